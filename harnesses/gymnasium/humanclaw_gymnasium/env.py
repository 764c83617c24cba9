"""A body in a scene as a Gymnasium environment: actions are skill calls, observations are ego views."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from PIL import Image

from humanclaw import Backends, Body, Call, Decision, Episode, Plugins, Scene
from humanclaw.records import REACHED, free_episode
from humanclaw.world import DistanceFn, geodesics
from humanclaw_gymnasium.actions import Action, Actions

Picture = NDArray[np.uint8]


class BodyEnv(gymnasium.Env[Picture, Action]):
    """Find an object and, if the instruction says so, sit on it.

    Observation: (size, size, 3) uint8, the ego view. Action: see Actions; `env.unwrapped.actions.encode("walk",
    z_cm=40)` makes one. Terminated by a skill that ends the episode, such as stop; truncated after max_steps.
    Reward: decrease of the path length to the nearest target, metres, times shaping, plus 1 for a successful stop. The
    path runs along the free floor, around walls and furniture.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 - as in gymnasium.Env

    def __init__(
        self,
        scene: str | Sequence[str] = "house:0",
        instruction: str = "find a couch and sit on it",
        *,
        max_steps: int = 100,
        size: int = 512,
        shaping: float = 1.0,
        profile: str = "default",
        render_mode: str | None = None,
        plugins: Plugins | None = None,
    ) -> None:
        """scene: one reference, or several, of which each reset picks one. size: edge of the observation, pixels.

        Raises HumanclawError if no skill can be called, ValueError for an unknown render mode.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode must be rgb_array or None; got {render_mode!r}")
        self.scenes = (scene,) if isinstance(scene, str) else tuple(scene)
        self.instruction, self.max_steps, self.shaping, self.render_mode = instruction, max_steps, shaping, render_mode
        self._plugins = plugins or Plugins.discover()
        self._backends = Backends(profile=profile)
        self._body: Body | None = None
        self._episode: Episode | None = None
        self._measured: tuple[tuple[Scene, tuple[int, ...]], DistanceFn] | None = None
        self.actions = Actions(self._plugins.skills)
        self.action_space = self.actions.space
        self.observation_space = Box(0, 255, (size, size, 3), np.uint8)

    @property
    def episode(self) -> Episode:
        """The current episode. Raises gymnasium.error.ResetNeeded before the first reset."""
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("an episode is begun by reset(); call it first.")
        return self._episode

    @property
    def body(self) -> Body:
        """The body. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self.episode.body

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Picture, dict[str, Any]]:
        """Begin an episode. options: scene and instruction for this episode alone."""
        super().reset(seed=seed)
        chosen = options or {}
        scene = chosen.get("scene") or str(self.np_random.choice(self.scenes))
        seed = int(self.np_random.integers(2**31))
        if self._episode:
            self._episode.close()
        if self._body is None:
            self._body = Body(scene, seed=seed, plugins=self._plugins, backends=self._backends)
        elif self._body.scene.name != scene:
            self._body.reset(scene, seed=seed)
        instruction = chosen.get("instruction") or self.instruction
        spec = free_episode(instruction, self._body.scene, seed=seed, max_steps=self.max_steps)
        # One attempt: a learner must see that its call was refused, instead of being asked again.
        self._episode = Episode(self._body, spec, "gymnasium", distance=self._distances, attempts=1)
        self._left = self._distance_to_goal()
        return self._see(), self._info()

    def _distances(self, scene: Scene, targets: Sequence[int], floor: float) -> DistanceFn:
        """Search the floor once for each scene and set of targets."""
        wanted = (scene, tuple(targets))
        if self._measured is None or self._measured[0] != wanted:
            self._measured = wanted, geodesics(scene, targets, floor)
        return self._measured[1]

    def step(self, action: Action) -> tuple[Picture, float, bool, bool, dict[str, Any]]:
        """Execute one call, about half a second. A refused call moves nothing; info['error'] says why."""
        episode, call = self.episode, self.actions.decode(action)
        episode.submit(Decision((call,)))
        before, self._left = self._left, self._distance_to_goal()
        shorter = 0.0 if before is None or self._left is None else before - self._left
        stopped = episode.outcome == "stopped"
        reward = self.shaping * shorter + float(episode.success)
        return self._see(), reward, stopped, episode.done and not stopped, self._info(call)

    def _distance_to_goal(self) -> float | None:
        """Return metres along the floor to the nearest target; None without a reachable target.

        0 for a body within reach: on a couch it is off the floor, from where no path starts.
        """
        straight = self.episode.target_distance()
        return 0.0 if straight is not None and straight <= REACHED else self.episode.distance_to_goal()

    def _info(self, call: Call | None = None) -> dict[str, Any]:
        episode = self.episode
        return {
            "instruction": episode.spec.instruction,
            "scene": episode.body.scene.name,
            "step": len(episode.steps),
            "call": str(call or ""),
            "error": episode.observe().feedback.refusal,
            "distance_to_goal": self._left,
            "target_distance": episode.target_distance(),
            "success": episode.success,
        }

    def _see(self) -> Picture:
        self._picture = self.episode.observe().rgb.copy()  # A copy, because a learner may write to it.
        size = self.observation_space.shape[0] if self.observation_space.shape else len(self._picture)
        if size == len(self._picture):
            return self._picture
        return np.asarray(Image.fromarray(self._picture).resize((size, size), Image.Resampling.BOX))

    def render(self) -> Picture | None:
        """Return the ego view in full size, if render_mode is rgb_array."""
        return self._picture if self.render_mode and self._body else None

    def close(self) -> None:
        if self._episode:
            self._episode.close()
            self._episode = None
        if self._body:
            self._body.close()
            self._body = None
