"""Uncommanded travel: displacement and turn of a call on axes that its skill does not command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from humanclaw.body import FUTURE, HISTORY
from humanclaw.motion import DiTGenerator
from humanclaw.skills import MEASURES
from humanclaw_train.data.chunks import canonical, stacked
from humanclaw_train.eval.rollouts import Command, extend
from humanclaw_train.eval.walks import straight_walks
from humanclaw_train.markdown import table

Uncommanded = Mapping[str, tuple[float, float]]
"""Measure to its mean over bodies, SI: from standing, and after walking. Commanded measures are left out.

A skill that commands `hips.back` also commands `hips.forward`.
"""
_FREE: Final = ("hips.left", "hips.forward", "heading.left")


def uncommanded(
    generator: DiTGenerator, commands: Sequence[Command], walks: Command | None, bodies: int = 30, seed: int = 0
) -> dict[str, Uncommanded]:
    """Measure each skill's uncommanded travel, from standing and after walking at 1 m/s.

    walks: the skill that walks; without one, all bodies begin from standing.
    """
    standing = [generator.start() for _ in range(bodies)]
    before = (standing, straight_walks(generator, walks, 1.0, bodies, 2, seed) if walks else standing)
    travel: dict[str, Uncommanded] = {}
    for command in commands:
        # hips.back is hips.forward with the other sign, so it commands the same axis.
        commanded = {parameter.measure.replace("back", "forward") for parameter in command.parameters}
        values = command.draw(bodies, np.random.default_rng(seed))
        rows = []
        for motions in map(list, before):
            extend(generator, command, motions, np.arange(bodies), values, (seed, 17))
            last = [motion[-HISTORY - FUTURE :] for motion in motions]
            local = canonical(*stacked(last))
            rows.append({name: float(MEASURES[name](*local).mean()) for name in _FREE if name not in commanded})
        travel[command.skill] = {name: (rows[0][name], rows[1][name]) for name in rows[0]}
    return travel


def uncommanded_table(travel: Mapping[str, Uncommanded]) -> str:
    """Format travel from standing and after walking: cm to the left and ahead, degrees to the left; a dash if
    commanded."""

    def cell(row: Uncommanded, name: str) -> str:
        scale = 180 / np.pi if name.startswith("heading") else 100.0
        return " / ".join(f"{scale * value:+.1f}" for value in row[name]) if name in row else "-"

    rows = [(skill, *(cell(row, name) for name in _FREE)) for skill, row in travel.items()]
    return table(("uncommanded, from standing / after walking", "left cm", "ahead cm", "turn degrees"), rows)
