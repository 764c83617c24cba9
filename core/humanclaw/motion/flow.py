"""Solve the flow of the fifteen future frames (paper, section 3.3); the five history frames stay clean.

    x(tau) = (1 - (1 - sigma_min) tau) noise + tau clean        v = clean - (1 - sigma_min) noise

A model may answer with v or with the clean future; `velocity` turns either into v.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from humanclaw.motion.dit import Array, Prediction
from humanclaw.pose import FUTURE, STATE_SIZE

SIGMA_MIN: Final = 1e-4
Method = Literal["euler", "midpoint"]

Field = Callable[[int, Any], Any]
"""The velocity at the i-th of a solver's times, given the noisy future."""


@dataclass(frozen=True)
class Solver:
    """A fixed-step integrator of dx/dtau = v from tau 0 to 1."""

    method: Method
    steps: int

    @property
    def times(self) -> tuple[float, ...]:
        """The flow times at which the field is asked, in order."""
        starts = [step / self.steps for step in range(self.steps)]
        if self.method == "euler":
            return tuple(starts)
        return tuple(tau for start in starts for tau in (start, start + 0.5 / self.steps))

    def solve(self, field: Field, noise: Any) -> Any:
        """Carry (B, 15, 219) noise to tau 1. Arrays and tensors alike."""
        x, width = noise, 1 / self.steps
        for step in range(self.steps):
            if self.method == "euler":
                x = x + width * field(step, x)
            else:
                middle = x + width / 2 * field(2 * step, x)
                x = x + width * field(2 * step + 1, middle)
        return x


PROFILES: Final = {"default": Solver("euler", 4), "paper": Solver("midpoint", 30)}


def velocity(prediction: Prediction, output: Array, noisy: Array, tau: float) -> Array:
    """The velocity that a model's output means. tau: below 1."""
    if prediction == "velocity":
        return output
    # In single precision: numpy's stubs promote by a Python float, numpy does not.
    return (output - (1 - SIGMA_MIN) * noisy) / (1 - (1 - SIGMA_MIN) * tau)  # type: ignore[return-value]


def noise_of(keys: Sequence[Sequence[int]]) -> Array:
    """(B, 15, 219) standard normal numbers; each row depends on its own key of non-negative integers alone."""
    return np.stack(
        [np.random.default_rng(tuple(key)).standard_normal((FUTURE, STATE_SIZE), np.float32) for key in keys]
    )
