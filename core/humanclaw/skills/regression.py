"""How well achieved values follow commanded ones, beside the best constant. Needs numpy alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from humanclaw.body.pose import Array


@dataclass(frozen=True)
class Regression:
    """One parameter's achieved values over its commanded ones.

    The mean ratio alone says little: a constant 115 cm has a ratio near 1 for heights of 95 to 135 cm.
    """

    slope: float
    """Of the least-squares line of achieved over commanded values: 1 is ideal, 0 ignores the command."""
    r2: float
    """Share of the achieved values' variance that the line explains."""
    error: float
    """Mean absolute difference of achieved and commanded values, in their unit."""
    constant: float
    """The same for the best constant: the median of the commands, whatever is commanded."""

    @classmethod
    def of(cls, commanded: Array, achieved: Array) -> Self:
        """Compare values (N,). slope and r2 are NaN where all commands are equal."""
        error = float(np.abs(achieved - commanded).mean())
        constant = float(np.abs(commanded - np.median(commanded)).mean())
        spread = float(np.var(commanded))
        shared = float(np.mean((commanded - commanded.mean()) * (achieved - achieved.mean())))
        if spread < 1e-12:
            return cls(np.nan, np.nan, error, constant)
        return cls(shared / spread, shared**2 / (spread * max(float(np.var(achieved)), 1e-12)), error, constant)

    @property
    def follows(self) -> bool:
        """Whether the values follow the command better than the best constant does."""
        return self.error < self.constant
