"""The shipped motion generator: a diffusion transformer, the adapters of skills, and corrections."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Self

import numpy as np

from humanclaw.body.pose import HISTORY, Motion, Pose2D, decode, encode
from humanclaw.motion.best_of_n import best_of_n
from humanclaw.motion.checkpoint import Base, load_base, shipped_base
from humanclaw.motion.flow import Solver, noise_of
from humanclaw.motion.profile import PROFILES, MotionProfile, motion_profile
from humanclaw.motion.runtime import NumpyRuntime, Runtime

RuntimeFactory = Callable[[Base, Solver], Runtime]


class DiTGenerator:
    """The base with one skill's adapter at a time. Adapters are read on first use and again when their file changes."""

    def __init__(
        self, base: Base, profile: MotionProfile = PROFILES["default"], runtime: RuntimeFactory = NumpyRuntime
    ) -> None:
        self.base, self.profile = base, profile
        self._runtime = runtime(base, profile.solver)

    @classmethod
    def load(cls, prior: Path | None = None, profile: str = "default", runtime: RuntimeFactory = NumpyRuntime) -> Self:
        """Read a base checkpoint; None for the one that comes with the package.

        profile: a name of PROFILES. runtime: makes what computes the model's output.

        Raises HumanclawError for an unknown profile, CheckpointError if the weights are missing.
        """
        return cls(load_base(prior or shipped_base()), motion_profile(profile), runtime)

    @property
    def digest(self) -> str:
        """Digest of the prior's weights."""
        return self.base.digest

    def start(self) -> Motion:
        """Return the five frames of standing that every episode begins from, at the origin facing +Z."""
        return Motion(self.base.start_root.astype(float), self.base.start_rotations.astype(float))

    def generate(
        self, history: Motion, adapter: Path | None, values: Mapping[str, float], key: Sequence[int]
    ) -> Motion:
        """Return 15 frames that continue 5, as MotionGenerator.generate.

        adapter: a skill's checkpoint, or None for the prior alone. key: non-negative integers.
        Raises CheckpointError for an adapter that cannot be used with this base or these values.
        """
        return self.generate_batch([history], adapter, [values], [key])[0]

    def generate_batch(
        self,
        histories: Sequence[Motion],
        adapter: Path | None,
        values: Sequence[Mapping[str, float]],
        keys: Sequence[Sequence[int]],
    ) -> list[Motion]:
        """Generate for many bodies and one skill; otherwise like generate()."""
        frames = [Pose2D.of_history(_checked(history)) for history in histories]
        local = [frame.to_local(history) for frame, history in zip(frames, histories, strict=True)]

        def draw(bodies: Sequence[int], attempt: int) -> list[Motion]:
            drawn = [(*keys[body], attempt) if attempt else keys[body] for body in bodies]
            return self._drawn([local[body] for body in bodies], adapter, [values[body] for body in bodies], drawn)

        futures = best_of_n(local, draw, self.profile.redraws)
        return [frame.to_world(future) for frame, future in zip(frames, futures, strict=True)]

    def _drawn(
        self,
        local: Sequence[Motion],
        adapter: Path | None,
        values: Sequence[Mapping[str, float]],
        keys: Sequence[Sequence[int]],
    ) -> list[Motion]:
        """Return futures in the frames of their histories."""
        clean = np.stack([encode(history) for history in local]).astype(np.float32)
        future = self._runtime.solve(self.base.normaliser.forward(clean), noise_of(keys), adapter, values)
        futures = [decode(state) for state in self.base.normaliser.inverse(future)]
        for correct in self.profile.future:
            futures = [correct(*pair, self.base.usual) for pair in zip(local, futures, strict=True)]
        return futures


def _checked(history: Motion) -> Motion:
    if len(history) != HISTORY:
        raise ValueError(f"a history needs {HISTORY} frames; got {len(history)}")
    return history
