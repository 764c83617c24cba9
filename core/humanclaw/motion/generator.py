"""The motion generator: five frames and a skill's parameters in, fifteen frames out (paper, section 3.3).

The motion is kinematic. The simulator computes the body's actual motion.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np
from threadpoolctl import ThreadpoolController

from humanclaw.body.pose import HISTORY, Motion, Pose2D, decode, encode
from humanclaw.errors import CheckpointError, HumanclawError
from humanclaw.motion.checkpoint import Base, load_adapter, load_base, shipped_base
from humanclaw.motion.control import AdapterConfig, Controlled
from humanclaw.motion.dit import Array, Modulations
from humanclaw.motion.flow import PROFILES, Solver, noise_of, velocity
from humanclaw.motion.foot_locking import lock_feet
from humanclaw.motion.posture import settle
from humanclaw.motion.setting_out import set_out


class MotionGenerator(Protocol):
    """A motion prior with skill adapters (paper, section 3.3)."""

    def start(self) -> Motion:
        """Return the five frames of standing that every episode begins from, at the origin facing +Z."""

    def generate(self, history: Motion, adapter: Path, values: Mapping[str, float], key: Sequence[int]) -> Motion:
        """Return 15 frames that continue 5, in the frame of the history. The same key gives the same motion, bit for
        bit.

        values: each parameter that the adapter's header names, in SI, in any order.
        """

    @property
    def digest(self) -> str:
        """Digest of the prior's weights."""


@dataclass(frozen=True)
class _Branch:
    """A skill's adapter beside the base, and when its file was modified."""

    controlled: Controlled
    modified: int


class DiTGenerator:
    """The base with one skill's adapter at a time. Adapters are read on first use and again when their file changes.

    corrections: hold standing feet still (foot_locking), keep posture errors from adding up (posture), and redraw first
    steps on which both feet slide (setting_out). Without them the motion is the model's raw output.
    """

    def __init__(self, base: Base, solver: Solver, corrections: bool = True) -> None:
        self.base = base
        self.solver = solver
        self.corrections = corrections
        self._usual = base.usual
        self._times = np.array(solver.times, np.float32)
        self._branches: dict[Path, _Branch] = {}
        # Twenty tokens are too few for two threads: a second one gains nothing, and on a busy machine waiting for it
        # costs seconds. One thread also keeps the order of sums, and so the motion, whatever the number of cores.
        self._one_thread = partial(ThreadpoolController().limit, limits=1, user_api="blas")
        with self._one_thread():
            self._modulations = base.model.modulations(self._times)

    @classmethod
    def shipped(cls, profile: str = "default") -> DiTGenerator:
        """Return the base that comes with the package. Raises as load() does."""
        return cls.load(None, profile)

    @classmethod
    def load(cls, prior: Path | None = None, profile: str = "default") -> DiTGenerator:
        """Read a base checkpoint; None for the one that comes with the package.

        profile: `default` for few solver steps and all corrections, `paper` for the paper's 30 steps without
        corrections.

        Raises HumanclawError for an unknown profile, CheckpointError if the weights are missing.
        """
        if profile not in PROFILES:
            raise HumanclawError(f"There is no motion profile {profile!r}.", f"Choose from: {', '.join(PROFILES)}.")
        return cls(load_base(prior or shipped_base()), PROFILES[profile], corrections=profile != "paper")

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
        """Return 15 frames that continue 5, in the frame of the history. The same key gives the same motion, bit for
        bit.

        adapter: a skill's checkpoint, or None for the prior alone. values: each parameter that the adapter's header
        names, in SI, in any order. key: non-negative integers.
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

        futures = set_out(local, draw) if self.corrections else draw(range(len(local)), 0)
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
        with self._one_thread():
            future = self._sample(self.base.normaliser.forward(clean), adapter, values, noise_of(keys))
        futures = [decode(state) for state in self.base.normaliser.inverse(future)]
        if self.corrections:
            settled = [settle(*pair, self._usual) for pair in zip(local, futures, strict=True)]
            futures = [lock_feet(*pair) for pair in zip(local, settled, strict=True)]
        return futures

    def _sample(self, history: Array, path: Path | None, values: Sequence[Mapping[str, float]], noise: Array) -> Array:
        model = self.base.model
        controlled = self._branch(path).controlled if path is not None else None
        conditions = _conditions(controlled.config, values) if controlled else None

        def field(index: int, noisy: Array) -> Array:
            through = None
            if controlled is not None and conditions is not None:
                through = controlled.through(conditions, slice(index, index + 1))
            output = model(history, noisy, _at(self._modulations, index), through)
            return velocity(model.config.prediction, output, noisy, self.solver.times[index])

        future: Array = self.solver.solve(field, noise)
        return future

    def _branch(self, path: Path) -> _Branch:
        modified = path.stat().st_mtime_ns if path.exists() else -1
        known = self._branches.get(path)
        if known is None or known.modified != modified:
            known = _Branch(Controlled(self.base.model, load_adapter(path, self.base), self._times), modified)
            self._branches[path] = known
        return known


def _at(modulations: Modulations, index: int) -> Modulations:
    """Return the modulations of one solver time, to broadcast over a batch."""
    one = slice(index, index + 1)
    return Modulations(modulations.blocks[:, :, one], modulations.final[:, one])


def _conditions(adapter: AdapterConfig, values: Sequence[Mapping[str, float]]) -> Array:
    """Return (B, k) values in the order in which the adapter was trained."""
    params = adapter.params
    for row in values:
        if set(row) != set(params):
            raise CheckpointError(
                f"The adapter of {adapter.skill} takes {_listed(params)}; it got {_listed(row)}.",
                "Give one value for each parameter that its header names.",
            )
    rows = [[row[name] for name in params] for row in values]
    return np.array(rows, np.float32).reshape(len(values), len(params))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "no parameter"


def _checked(history: Motion) -> Motion:
    if len(history) != HISTORY:
        raise ValueError(f"a history needs {HISTORY} frames; got {len(history)}")
    return history
