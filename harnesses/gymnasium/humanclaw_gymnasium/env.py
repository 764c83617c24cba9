"""A body in a scene as a Gymnasium environment: an action is a skill call, an observation is what the eyes see next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from PIL import Image

from humanclaw.embodiment import Body, Engines
from humanclaw.errors import CallError
from humanclaw.geometry import distance_to_nearest
from humanclaw.interfaces import Call
from humanclaw.loop import check_call
from humanclaw.navigation import geodesics
from humanclaw.plugins import Plugins
from humanclaw.recorder import outcome
from humanclaw.scene import Scene
from humanclaw.tasks import free_episode
from humanclaw_gymnasium.actions import Action, Actions

Picture = NDArray[np.uint8]
ARRIVED: Final = 0.2
"""Metres between the body and the target at which it has been reached (NavSR of the benchmark)."""


class BodyEnv(gymnasium.Env[Picture, Action]):
    """Find something and, if the instruction says so, sit on it.

    Observation: (size, size, 3) uint8, the ego view. Action: see Actions; `env.unwrapped.actions.encode("walk", z_cm=40)` makes
    one. Terminated by a skill that ends the episode, such as stop; truncated after max_steps.
    Reward: metres by which the way to the nearest target became shorter, times shaping, and 1 for stopping in success. The way
    goes along the free floor, around walls and furniture.
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
        """scene: one reference, or several of which each reset picks one. size: edge of the observation in pixels.

        Raises HumanclawError if no skill can be called, ValueError for a render mode that there is not.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode must be rgb_array or None; got {render_mode!r}")
        self.scenes = (scene,) if isinstance(scene, str) else tuple(scene)
        self.instruction, self.max_steps, self.shaping, self.render_mode = instruction, max_steps, shaping, render_mode
        self._plugins = plugins or Plugins.discover()
        self._engines = Engines(profile=profile)
        self._body: Body | None = None
        self._measured: tuple[Scene, tuple[int, ...]] | None = None
        self.actions = Actions(self._plugins.skills)
        self.action_space = self.actions.space
        self.observation_space = Box(0, 255, (size, size, 3), np.uint8)

    @property
    def body(self) -> Body:
        """The body itself, for what the spaces leave out. Raises gymnasium.error.ResetNeeded before the first reset."""
        if self._body is None:
            raise gymnasium.error.ResetNeeded("the body is made by reset(); call it first.")
        return self._body

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Picture, dict[str, Any]]:
        """Begin an episode. options: scene and instruction for this episode alone."""
        super().reset(seed=seed)
        chosen = options or {}
        scene = chosen.get("scene") or str(self.np_random.choice(self.scenes))
        self._stand(scene, seed=int(self.np_random.integers(2**31)))
        instruction = chosen.get("instruction") or self.instruction
        self._spec = free_episode(instruction, self.body.scene, max_steps=self.max_steps)
        self._measure()
        self._steps, self._left, self._seated = 0, self._way_left(), frozenset[int]()
        return self._see(), self._info(None, False)

    def _stand(self, scene: str, seed: int) -> None:
        if self._body is None:
            self._body = Body(scene, seed=seed, plugins=self._plugins, engines=self._engines)
        else:
            same = self._body.scene.name == scene
            self._body.reset(self._body.scene if same else scene, seed=seed)

    def _measure(self) -> None:
        """Search the floor once for each scene and set of targets."""
        wanted = (self.body.scene, self._spec.target_ids)
        if self._measured != wanted and self._spec.target_ids:
            self._way = geodesics(*wanted, self.body.start.floor)
            self._measured = wanted

    def step(self, action: Action) -> tuple[Picture, float, bool, bool, dict[str, Any]]:
        """Carry out one call: about half a second. One that the skill refuses moves nothing; info says why."""
        body, call = self.body, self.actions.decode(action)
        self._steps += 1
        seated, left = self._seated, self._left
        error = self._attempt(call)
        self._left = self._way_left()
        terminated = not error and body.skills[call.skill].role == "stop"
        success = terminated and self._succeeded(seated)
        shorter = 0.0 if left is None or self._left is None else left - self._left
        reward = self.shaping * shorter + float(success)
        return self._see(), reward, terminated, self._steps >= self.max_steps, self._info(call, success, error)

    def _attempt(self, call: Call) -> str:
        """Carry a call out, and remember what the pelvis then rests on. Returns why it was refused, if it was."""
        try:
            deed = self.body.execute(check_call(call, self.body.skills))
        except CallError as fault:
            return str(fault)
        self._seated = frozenset(outcome(self.body.scene, self._spec.target_ids, deed)["pelvis_contacts"])
        return ""

    def _succeeded(self, seated: frozenset[int]) -> bool:
        """As the benchmark has it. seated: what the pelvis rested on before the stop."""
        distance = self._target_distance()
        near = distance is not None and distance <= ARRIVED
        return near and (not self._spec.interact or bool(seated & set(self._spec.target_ids)))

    def _way_left(self) -> float | None:
        """Metres along the floor to the nearest target; None if the instruction names none, or no way leads to it.

        0 for a body that has arrived: on a couch it is off the floor that leads there.
        """
        distance = self._target_distance()
        if distance is None or distance <= ARRIVED:
            return None if distance is None else 0.0
        left = self._way(self.body.state().body.root[-1])
        return left if np.isfinite(left) else None

    def _target_distance(self) -> float | None:
        """Metres from the nearest joint to the bounding box of the nearest target, straight; None if there is none."""
        if not self._spec.target_ids:
            return None
        return distance_to_nearest(
            self.body.state().body[-1:].joints(), map(self.body.scene.aabb, self._spec.target_ids)
        )

    def _info(self, call: Call | None, success: bool, error: str = "") -> dict[str, Any]:
        return {
            "instruction": self._spec.instruction,
            "scene": self.body.scene.name,
            "step": self._steps,
            "call": str(call or ""),
            "error": error,
            "way_left": self._left,
            "target_distance": self._target_distance(),
            "success": success,
        }

    def _see(self) -> Picture:
        self._picture = self.body.view().rgb
        size = self.observation_space.shape[0] if self.observation_space.shape else len(self._picture)
        if size == len(self._picture):
            return self._picture
        return np.asarray(Image.fromarray(self._picture).resize((size, size), Image.Resampling.BOX))

    def render(self) -> Picture | None:
        """The ego view in full size, if render_mode is rgb_array."""
        return self._picture if self.render_mode and self._body else None

    def close(self) -> None:
        if self._body:
            self._body.close()
            self._body = None
