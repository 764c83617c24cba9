"""Solve the flow of the fifteen future frames (paper, section 3.3); the five history frames stay clean.

    x(tau) = (1 - (1 - sigma_min) tau) noise + tau clean        v = clean - (1 - sigma_min) noise

A model may answer with v or with the clean future; `velocity` turns either into v.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final, Literal

import numpy as np

from humanclaw.body.pose import FUTURE, STATE_SIZE
from humanclaw.motion.dit import Array, Prediction

SIGMA_MIN: Final = 1e-4
"""Noise that is left in clean motion (paper, section 3.3): a value above 0 keeps the velocity finite at the end."""
Method = Literal["euler", "midpoint"]

Field = Callable[[int, Any], Any]
"""The velocity at the i-th of a solver's times, given the noisy future."""


@dataclass(frozen=True)
class Solver:
    """A fixed-step integrator of dx/dtau = v from tau 0 to 1.

    power: the i-th of n steps begins at tau (i / n) ** power. Steps that are short at first let the model choose
    between outcomes, such as which foot goes first, before it commits to their average.
    """

    method: Method
    steps: int
    power: float = 1.0

    @property
    def edges(self) -> tuple[float, ...]:
        """The steps + 1 flow times at which steps begin and end."""
        return tuple((step / self.steps) ** self.power for step in range(self.steps + 1))

    @property
    def times(self) -> tuple[float, ...]:
        """The flow times at which the field is asked, in order."""
        edges = self.edges
        if self.method == "euler":
            return edges[:-1]
        return tuple(tau for start, end in pairwise(edges) for tau in (start, (start + end) / 2))

    def solve(self, field: Field, noise: Any) -> Any:
        """Carry (B, 15, 219) noise to tau 1. Arrays and tensors alike."""
        x = noise
        for step, (start, end) in enumerate(pairwise(self.edges)):
            width = end - start
            if self.method == "euler":
                x = x + width * field(step, x)
            else:
                middle = x + width / 2 * field(2 * step, x)
                x = x + width * field(2 * step + 1, middle)
        return x

    def __str__(self) -> str:
        grid = f", grid power {self.power:g}" if self.power != 1 else ""
        return f"{self.method}, {self.steps} steps{grid}"


def velocity(prediction: Prediction, output: Any, noisy: Any, tau: Any) -> Any:
    """Return the velocity that a model's output means. Arrays and tensors alike. tau: below 1, alone or (B, 1, 1)."""
    if prediction == "velocity":
        return output
    return (output - (1 - SIGMA_MIN) * noisy) / (1 - (1 - SIGMA_MIN) * tau)


def noise_of(keys: Sequence[Sequence[int]]) -> Array:
    """(B, 15, 219) standard normal numbers; each row depends on its own key of non-negative integers alone."""
    return np.stack(
        [np.random.default_rng(tuple(key)).standard_normal((FUTURE, STATE_SIZE), np.float32) for key in keys]
    )
