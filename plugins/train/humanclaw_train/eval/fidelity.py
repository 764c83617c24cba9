"""Fidelity of the skills: achieved over commanded motion (paper, table 1).

* Generated: the motion model's output. Half of the rollouts begin after a chunk of another skill, the rest from
  standing. Then come three chunks in a row with parameters drawn uniformly from the middle nine tenths of the
  adapter's range.
* Simulated: the same in half-physics, on a flat floor, or on stairs or a seat that fit the command.
* Baseline: the median clip of each verb, whatever magnitude is commanded, like a text-to-motion model.
* Uncommanded: travel and turn on axes that the skill does not command, from standing and after walking.
"""

from __future__ import annotations

import json
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import CheckpointError, PluginError
from humanclaw.body import Array, wrap_angle
from humanclaw.motion import DiTGenerator, load_base
from humanclaw.skills import MEASURES, Measure, Regression, Skill, find, outcomes
from humanclaw_train.data.chunks import Chunks, of_skill
from humanclaw_train.eval.rollouts import Command, Rollouts, file_digest, others, roll, walker
from humanclaw_train.eval.simulated import Actor, roll_simulated
from humanclaw_train.eval.walks import Uncommanded, uncommanded, uncommanded_table
from humanclaw_train.markdown import cell, numbers, save, table

if TYPE_CHECKING:
    from humanclaw import Simulator

REPORT: Final = "fidelity.json"
"""File name of the report: beside the base, or beside the adapter of a skill of your own."""


@dataclass(frozen=True)
class Ratio:
    """Achieved over commanded motion of one skill."""

    mean: float
    std: float
    after_other: float
    """Mean over chunks that follow another skill; NaN if there are none."""
    error: float
    """Mean absolute error over all parameters; a centimetre counts as much as a degree."""
    chunks: int
    slope: float = np.nan
    """Of the line of achieved over commanded values of the primary parameter."""
    r2: float = np.nan
    """Share of the variance that the line explains."""
    constant: float = np.nan
    """The error of the best constant for each parameter, beside `error`."""


@dataclass(frozen=True)
class Row:
    """One skill's row. `generated` is NaN for a skill without parameters; None means not measured."""

    skill: str
    generated: Ratio
    simulated: Ratio | None = None
    baseline: Ratio | None = None
    adapter: str = ""
    """Digest of the adapter's file."""
    paper: tuple[float, float] | None = None
    """Mean and standard deviation of the ratio in the paper's table 1, on its data and body."""
    paper_baseline: tuple[float, float] | None = None
    """Mean and standard deviation for the paper's baseline, MoMask, which ignores the magnitude."""
    uncommanded: Uncommanded = field(default_factory=dict)
    """Travel and turn that the skill does not command."""


# -- notes of a skill's author -----------------------------------------------------------------------------------------
NOTES: Final = "card.toml"
"""File beside schema.json: `limits`, a list of sentences; `[paper]` with `ratio` and `baseline`, mean and deviation."""


@dataclass(frozen=True)
class Notes:
    """Content of a skill's card.toml; empty if there is no such file."""

    limits: tuple[str, ...] = ()
    paper: tuple[float, float] | None = None
    """Mean and standard deviation of achieved over commanded in the paper's table 1, on its data and body."""
    baseline: tuple[float, float] | None = None
    """Mean and standard deviation for the paper's baseline, MoMask, which ignores the magnitude."""

    @classmethod
    def read(cls, folder: Path) -> Notes:
        """Read the card.toml of a skill's folder. Raises PluginError if it is broken."""
        path = folder / NOTES
        if not path.is_file():
            return cls()
        try:
            content = tomllib.loads(path.read_text("utf-8"))
            paper = content.get("paper", {})
            return cls(tuple(content.get("limits", ())), _two(paper.get("ratio")), _two(paper.get("baseline")))
        except (OSError, ValueError, TypeError) as error:
            raise PluginError(
                f"{path} cannot be read: {error}.", f"See the {NOTES} of a shipped skill for the format."
            ) from error


def _two(values: list[float] | None) -> tuple[float, float] | None:
    if values is None:
        return None
    mean, deviation = values
    return mean, deviation


# -- measuring ---------------------------------------------------------------------------------------------------------
def achieved(command: Command, rollouts: Rollouts) -> Ratio:
    """Compare outcomes of rollouts with their commands, each parameter by its measure."""
    outcome = outcomes(command.parameters, rollouts.root, rollouts.rotations, command.measures)
    if not outcome.shape[1]:
        return Ratio(np.nan, np.nan, np.nan, np.nan, len(outcome))
    primary = command.primary
    difference = outcome - rollouts.commands
    angle = np.array([find(parameter, command.measures).unit == "rad" for parameter in command.parameters])
    # Angles in degrees, lengths in centimetres, so that both kinds of error have a similar size.
    difference[:, angle] = np.degrees(wrap_angle(difference[:, angle]))
    difference[:, ~angle] *= 100
    # Chunks of data, unlike commands, may have a displacement of exactly zero.
    wanted = np.where(rollouts.commands[:, primary] == 0, np.nan, rollouts.commands[:, primary])
    ratio = outcome[:, primary] / wanted
    error, constant = float(np.abs(difference).mean()), _constant(rollouts.commands, angle)
    fit = Regression.of(rollouts.commands[:, primary], outcome[:, primary])
    spread = float(np.nanstd(ratio))
    after = _mean(ratio[rollouts.after_other])
    return Ratio(_mean(ratio), spread, after, error, len(outcome), fit.slope, fit.r2, constant)


def _constant(commands: Array, angle: NDArray[np.bool_]) -> float:
    """Return the error of the best constant for each parameter, centimetres and degrees."""
    away = np.abs(commands - np.median(commands, 0)).mean(0)
    return float(np.where(angle, np.degrees(away), 100 * away).mean())


def _mean(values: Array) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else np.nan


def live(
    base: Path, declaration: Skill, rollouts: int = 24, measures: Mapping[str, Measure] = MEASURES
) -> Callable[[Path], str]:
    """Return a function that describes an adapter of a base in one line: achieved over commanded of a few rollouts."""
    generator = DiTGenerator(load_base(base))

    def look(adapter: Path) -> str:
        command = Command.declared(declaration, adapter, measures)
        ratio = achieved(command, roll(generator, command, (), rollouts, seed=1))
        return f"fidelity {_spread(ratio)}, mean error {cell(ratio.error)} (cm, degrees)"

    return look


def baseline(folders: Sequence[Path], command: Command, count: int = 600) -> Ratio | None:
    """Measure the median clip of the verb against commands drawn as in the rollouts. None without a clip.

    The clip is the chunk whose parameters are closest to the median magnitudes, a real chunk if there is one. A verb
    contains the side, so the clip is mirrored to the commanded side.
    """
    chunks = of_skill(folders, command.skill)
    if chunks is None or not chunks.params.shape[1]:
        return None
    magnitudes = np.abs(chunks.params.astype(float))
    # A parameter with one value would divide by 0.
    spread = np.maximum(magnitudes.std(0), 1e-6)
    far = np.abs((magnitudes - np.median(magnitudes, 0)) / spread).sum(1)
    clip = chunks[np.array([int(far.argmin())])]
    commands = command.draw(count, np.random.default_rng(0))
    # Magnitudes lose the sign, so put the clip on the commanded side by mirroring.
    side = np.sign(commands[:, command.primary]) * np.sign(clip.params[0, command.primary])
    both = Chunks.join([clip, clip.mirrored(command.measures)])[(side < 0).astype(int)]
    rollouts = Rollouts(both.root.astype(float), both.rotations.astype(float), commands, np.zeros(count, bool))
    return achieved(command, rollouts)


def milliseconds(generator: DiTGenerator, adapter: Path, values: Mapping[str, float]) -> float:
    """Return the least wall time of ten of one chunk of one body, after a first call that reads the adapter."""
    history = generator.start()
    generator.generate(history, adapter, values, (0,))
    taken = []
    for index in range(10):
        started = time.perf_counter()
        generator.generate(history, adapter, values, (index,))
        taken.append(1000 * (time.perf_counter() - started))
    return min(taken)


# -- the table ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class FidelityReport:
    """The table and the weights that it was measured on. `--save` writes it and model cards quote it."""

    base: str
    """Digest of the base."""
    solver: str
    rollouts: int
    seed: int
    milliseconds: float
    rows: tuple[Row, ...]

    def save(self, path: Path) -> None:
        """Write as JSON."""
        save(path, asdict(self))

    @classmethod
    def load(cls, path: Path) -> FidelityReport:
        """Read a file that `save` wrote. Raises CheckpointError for anything else."""
        try:
            content = json.loads(path.read_text("utf-8"))
            rows = tuple(Row(**row | {key: _ratio(row[key]) for key in _RATIOS}) for row in content["rows"])
            return cls(**content | {"rows": rows})
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise CheckpointError(
                f"{path} holds no fidelity report ({error}).", f"Measure with: humanclaw fidelity --save {path}"
            ) from error


def measured(
    generator: DiTGenerator,
    commands: Sequence[Command],
    before: Sequence[Command] = (),
    rollouts: int = 200,
    seed: int = 0,
    chunks: Sequence[Path] = (),
    simulator: Simulator | None = None,
    source: str = "generated",
) -> FidelityReport:
    """Measure one row per skill, in the order given. before: further skills that may come before one.

    chunks: folders for the baseline. simulator: for half-physics. source: of the history there
    (humanclaw.body.next_history). Raises CheckpointError for an adapter that does not fit the base.
    """
    known = [*commands, *before]
    besides = uncommanded(generator, commands, walker(known), seed=seed)
    actor, rows = Actor(generator, simulator, source) if simulator else None, []
    for command in commands:
        earlier, notes, played = others(command, known), Notes.read(command.adapter.parent), None
        if actor and command.names:
            played = achieved(command, roll_simulated(actor, command, earlier, rollouts, seed))
        rows.append(
            Row(
                command.skill,
                achieved(command, roll(generator, command, earlier, rollouts, seed)),
                played,
                baseline(chunks, command),
                file_digest(command.adapter),
                notes.paper,
                notes.baseline,
                besides[command.skill],
            )
        )
    first = commands[0]  # All adapters have the same size, so any of them gives the time.
    values = first.named(first.draw(1, np.random.default_rng(0))[0])
    time_of_one = milliseconds(generator, first.adapter, values)
    return FidelityReport(generator.digest, str(generator.profile.solver), rollouts, seed, time_of_one, tuple(rows))


_RATIOS: Final = ("generated", "simulated", "baseline")


def _ratio(content: Mapping[str, Any] | None) -> Ratio | None:
    return None if content is None else Ratio(**numbers(content))


def markdown(report: FidelityReport) -> str:
    """Return the report as Markdown tables, with the paper's results."""
    off_axis = uncommanded_table({row.skill: row.uncommanded for row in report.rows})
    solver = f"{report.solver}; {report.milliseconds:.1f} ms a chunk; base {report.base}"
    return f"{rows_table(report.rows)}\n\n{off_axis}\n\n{solver}"


def rows_table(rows: Sequence[Row]) -> str:
    """Return the rows as a Markdown table."""
    heads = (
        "skill", "generated", "after another", "slope", "R²", "error cm, deg", "of the best constant", "simulated",
        "error cm, deg", "median clip", "paper", "paper's baseline",
    )  # fmt: skip
    return table(heads, [
        (row.skill, _spread(row.generated), cell(row.generated.after_other, 3), cell(row.generated.slope, 2),
         cell(row.generated.r2, 2), cell(row.generated.error), cell(row.generated.constant),
         _spread(row.simulated), cell(row.simulated.error if row.simulated else np.nan), _spread(row.baseline),
         _pair(row.paper), _pair(row.paper_baseline))
        for row in rows
    ])  # fmt: skip


def _spread(ratio: Ratio | None) -> str:
    return _pair((ratio.mean, ratio.std)) if ratio and np.isfinite(ratio.mean) else "-"


def _pair(pair: Sequence[float] | None) -> str:
    return f"{pair[0]:.3f} ± {pair[1]:.3f}" if pair else "-"
