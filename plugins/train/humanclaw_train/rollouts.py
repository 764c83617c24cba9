"""Generated rollouts of a skill, from standing and after other skills: what the measures of the motion model look
at."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import CheckpointError, Motion
from humanclaw.measures import MEASURES, Declaration, Measure, Parameter
from humanclaw.motion import DiTGenerator, read_header
from humanclaw.pose import CHUNK, HISTORY, Array
from humanclaw_train.chunks import canonical, stacked

Installed = Callable[[], Mapping[str, Path]]
"""Gives the adapters of the skills that are installed, by skill."""
Measures = Callable[[], Mapping[str, Measure]]
"""Gives the measures that are installed, by name."""
CHUNKS_IN_A_ROW: Final = 3
_LEAST: Final = 0.25
"""Commands smaller than this share of the largest are not asked for: a ratio to nothing says nothing."""


@dataclass(frozen=True)
class Command:
    """What one skill can be asked: the range of each parameter, SI. names (k,), low (k,), high (k,): as in the
    adapter's header."""

    declaration: Declaration
    adapter: Path
    names: tuple[str, ...]
    low: Array
    high: Array
    measures: Mapping[str, Measure] = field(default_factory=lambda: MEASURES, repr=False)

    @classmethod
    def of(cls, skill: str, adapter: Path, measures: Mapping[str, Measure] = MEASURES) -> Command:
        """Return the range that the adapter was trained on, less a twentieth at either end.

        Raises CheckpointError and PluginError for an adapter and a schema.json that do not fit.
        """
        return cls.declared(Declaration.read(declared(skill, adapter)), adapter, measures)

    @classmethod
    def declared(cls, declaration: Declaration, adapter: Path, measures: Mapping[str, Measure] = MEASURES) -> Command:
        """Do the same for a skill whose declaration is at hand, wherever its adapter lies."""
        config = read_header(adapter)["adapter"]
        declaration.order(config["params"])
        centre, scale = np.array(config["centre"], float), np.array(config["scale"], float)
        low, high = centre - 0.9 * scale, centre + 0.9 * scale
        return cls(declaration, adapter, tuple(config["params"]), low, high, measures)

    @property
    def skill(self) -> str:
        return self.declaration.skill

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """(k,) in the order of the values."""
        return self.declaration.order(self.names)

    @property
    def primary(self) -> int:
        """Which of the values the ratio of achieved over commanded is told of."""
        return self.parameters.index(self.declaration.primary) if self.declaration.primary else 0

    def named(self, values: Array) -> dict[str, float]:
        """One command (k,) by name, as the generator takes it."""
        return dict(zip(self.names, values.tolist(), strict=True))

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """(count, k) commands; the parameter that the ratio is of is never close to zero."""
        values = random.uniform(self.low, self.high, (count, len(self.low)))
        if len(self.low):
            primary = self.primary
            column, largest = values[:, primary], max(abs(self.low[primary]), abs(self.high[primary]))
            small = np.abs(column) < _LEAST * largest
            values[small, primary] = np.where(column[small] < 0, -1, 1) * _LEAST * largest
        return values


def adapters(
    roots: Sequence[Path] | None, wanted: Sequence[str] = (), installed: Installed | None = None
) -> dict[str, Path]:
    """Return the adapters below some folders by skill, or of them the wanted ones in that order. Raises
    CheckpointError.

    roots: None for those of the installed skills, or, where nothing tells which are installed, of the repository.
    """
    found = dict(installed()) if roots is None and installed else _below(roots or [Path("skills")])
    missing = [skill for skill in wanted if skill not in found]
    if missing or not found:
        known = ", ".join(found) or "none"
        raise CheckpointError(f"There is no adapter for {', '.join(missing) or 'any skill'}.", f"There are: {known}.")
    return {skill: found[skill] for skill in wanted or found}


def _below(roots: Sequence[Path]) -> dict[str, Path]:
    files = sorted(file for root in roots for file in root.glob("**/adapter.safetensors"))
    return {file.parent.name: file for file in files}


def own(folders: Sequence[Path]) -> dict[str, Path]:
    """Find the adapters of skill folders by skill. Raises CheckpointError for a folder without one."""
    paths = {folder.resolve().name: folder.resolve() / "adapter.safetensors" for folder in folders}
    for skill, path in paths.items():
        if not path.is_file():
            raise CheckpointError(
                f"{path} is missing.", f"Train it with: humanclaw train adapter --skill {path.parent} ({skill})"
            )
    return paths


def declared(skill: str, adapter: Path) -> Path:
    """Return the folder that declares a skill: that of its adapter, or for one just trained that of the skill in the
    repository."""
    if (adapter.parent / "schema.json").is_file():
        return adapter.parent
    return next((file.parent for file in sorted(Path("skills").glob(f"**/{skill}/schema.json"))), adapter.parent)


def file_digest(path: Path) -> str:
    """Names the content of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def others(command: Command, commands: Sequence[Command]) -> list[Command]:
    """Return the skills that may come before one. Who steps onto a stair out of a seat rises by both; that ratio would
    be of the two."""
    seats = command.declaration.climbs
    return [one for one in commands if one.skill != command.skill and not (seats and one.declaration.role == "sit")]


@dataclass(frozen=True)
class Rollouts:
    """What became of one skill's commands (N, k): root (N, 20, 3) and rotations (N, 20, 24, 3), each chunk in its
    canonical frame.

    after_other (N,): whether the chunk before was another skill's. whole: the motions that the chunks were cut from.
    """

    root: Array
    rotations: Array
    commands: Array
    after_other: NDArray[np.bool_]
    whole: tuple[Motion, ...] = ()


def roll(generator: DiTGenerator, command: Command, before: Sequence[Command], rollouts: int, seed: int) -> Rollouts:
    """Run one skill `rollouts` times for three chunks in a row; every second time after one chunk of another skill."""
    random = np.random.default_rng(seed)
    motions = [generator.start() for _ in range(rollouts)]
    strange = np.zeros(rollouts, bool)
    if before:
        strange[1::2] = True
        for index, other in enumerate(before):
            chosen = np.flatnonzero(strange)[index :: len(before)]
            extend(generator, other, motions, chosen, other.draw(len(chosen), random), (seed, 0))
    chunks: list[Motion] = []
    commands = []
    for turn in range(CHUNKS_IN_A_ROW):
        values = command.draw(rollouts, random)
        extend(generator, command, motions, np.arange(rollouts), values, (seed, turn + 1))
        chunks += [motion[-CHUNK:] for motion in motions]
        commands.append(values)
    local = canonical(*stacked(chunks))
    after = np.concatenate([strange, *[np.zeros(rollouts, bool)] * (CHUNKS_IN_A_ROW - 1)])
    return Rollouts(*local, np.concatenate(commands), after, tuple(motions))


def extend(
    generator: DiTGenerator,
    command: Command,
    motions: list[Motion],
    chosen: NDArray[np.int_],
    values: Array,
    key: tuple[int, ...],
) -> None:
    """Let the chosen bodies go on, in place, by one chunk of a skill with their values (len(chosen), k)."""
    if len(chosen):
        histories = [motions[index][-HISTORY:] for index in chosen]
        keys = [(*key, int(index)) for index in chosen]
        futures = generator.generate_batch(histories, command.adapter, [command.named(row) for row in values], keys)
        for index, future in zip(chosen, futures, strict=True):
            motions[index] = motions[index].then(future)
