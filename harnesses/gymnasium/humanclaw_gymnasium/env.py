"""A body in a scene as a Gymnasium environment: actions are skill calls, observations are ego views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from PIL import Image

from humanclaw import Backends, Body, Call, Decision, Episode, EpisodeSpec, Gym, HumanclawError, Plugins
from humanclaw.records import REACHED, free_episode
from humanclaw_gymnasium.actions import Action, Actions

Picture = NDArray[np.uint8]


class BodyEnv(gymnasium.Env[Picture, Action]):
    """Find an object and, if the instruction says so, sit on it; or play training tasks.

    Observation: (size, size, 3) uint8, the ego view. Action: see Actions; `env.unwrapped.actions.encode("walk",
    z_cm=40)` makes one. Terminated by a skill that ends the episode, such as stop; truncated after max_steps.
    Reward: decrease of the path length to the nearest target, metres, times shaping, plus 1 for a successful stop; or
    the rewards of the tasks.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 - as in gymnasium.Env

    def __init__(
        self,
        scene: str | Sequence[str] = "house:train-0",
        instruction: str = "find a couch and sit on it",
        *,
        tasks: str = "",
        options: Mapping[str, Any] | None = None,
        rewards: Mapping[str, float] | None = None,
        max_steps: int = 100,
        size: int = 512,
        shaping: float = 1.0,
        profile: str = "default",
        render_mode: str | None = None,
        plugins: Plugins | None = None,
    ) -> None:
        """Begin without a body.

        Args:
            scene: one reference, or several, of which each reset picks one.
            tasks, options, rewards: as of humanclaw.Gym; then scene, instruction and max_steps have no effect.
            size: edge of the observation, pixels.

        Raises HumanclawError if no skill can be called, ValueError for an unknown render mode.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode must be rgb_array or None; got {render_mode!r}")
        self.scenes = (scene,) if isinstance(scene, str) else tuple(scene)
        self.instruction, self.max_steps, self.render_mode = instruction, max_steps, render_mode
        host = plugins or Plugins.discover()
        self._tasks, weights = tasks, {"progress": shaping, "success": 1.0}
        self._gym = Gym(
            tasks or _Given(), rewards if tasks or rewards else weights, options=options, agent="gymnasium",
            plugins=host, backends=Backends(profile=profile),
        )  # fmt: skip
        self._begun = False
        self.actions = Actions(host.skills)
        self.action_space = self.actions.space
        self.observation_space = Box(0, 255, (size, size, 3), np.uint8)

    @property
    def episode(self) -> Episode:
        """The current episode. Raises gymnasium.error.ResetNeeded before the first reset."""
        if not self._begun:
            raise gymnasium.error.ResetNeeded("an episode is begun by reset(); call it first.")
        return self._gym.episode

    @property
    def body(self) -> Body:
        """The body. Raises gymnasium.error.ResetNeeded before the first reset."""
        return self.episode.body

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Picture, dict[str, Any]]:
        """Begin an episode. options: scene and instruction for this episode alone."""
        super().reset(seed=seed)
        self._turn = self._gym.reset(self._drawn()) if self._tasks else self._gym.begin(self._free(options or {}))
        self._begun = True
        return self._see(), self._info()

    def _drawn(self) -> int:
        return int(self.np_random.integers(2**31))

    def _free(self, chosen: Mapping[str, Any]) -> EpisodeSpec:
        scene = self._gym.scene(chosen.get("scene") or str(self.np_random.choice(self.scenes)))
        instruction = chosen.get("instruction") or self.instruction
        return free_episode(instruction, scene, seed=self._drawn(), max_steps=self.max_steps)

    def step(self, action: Action) -> tuple[Picture, float, bool, bool, dict[str, Any]]:
        """Execute one call, about half a second. A refused call moves nothing; info['error'] says why."""
        episode, call = self.episode, self.actions.decode(action)
        self._turn = self._gym.submit(Decision((call,)))
        stopped = episode.outcome == "stopped"
        return self._see(), self._turn.reward, stopped, episode.done and not stopped, self._info(call)

    def _info(self, call: Call | None = None) -> dict[str, Any]:
        episode, straight = self.episode, self.episode.target_distance()
        # 0 for a body within reach: on a couch it is off the floor, from where no path starts.
        within = straight is not None and straight <= REACHED
        return {
            "instruction": episode.spec.instruction,
            "scene": episode.body.scene.name,
            "step": len(episode.steps),
            "call": str(call or ""),
            "error": self._turn.observation.feedback.refusal,
            "distance_to_goal": 0.0 if within else episode.distance_to_goal(),
            "target_distance": straight,
            "success": episode.success,
            "rewards": dict(self._turn.rewards),
        }

    def _see(self) -> Picture:
        self._picture = self._turn.observation.rgb.copy()  # A copy, because a learner may write to it.
        size = self.observation_space.shape[0] if self.observation_space.shape else len(self._picture)
        if size == len(self._picture):
            return self._picture
        return np.array(Image.fromarray(self._picture).resize((size, size), Image.Resampling.BOX))

    def render(self) -> Picture | None:
        """Return the ego view in full size, if render_mode is rgb_array."""
        return self._picture if self.render_mode and self._begun else None

    def close(self) -> None:
        self._gym.close()
        self._begun = False


class _Given:
    """The episodes that BodyEnv makes itself."""

    goal = "success"
    rewards: Mapping[str, float] = {"success": 1.0}

    def __call__(self, seed: int) -> EpisodeSpec:
        raise HumanclawError("this environment makes its own episodes.", "Name tasks to play.")
