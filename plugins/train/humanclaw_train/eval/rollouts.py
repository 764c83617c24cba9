"""Generated rollouts of a skill, from standing and after other skills, for the measures of the motion model."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import CheckpointError, Motion
from humanclaw.body import CHUNK, HISTORY, Array
from humanclaw.motion import read_header
from humanclaw.skills import MEASURES, Declaration, Measure, Parameter
from humanclaw_train.data.chunks import canonical, stacked

if TYPE_CHECKING:
    from humanclaw.motion import DiTGenerator

Installed = Callable[[], Mapping[str, Path]]
"""Returns the adapters of the installed skills, by skill."""
Measures = Callable[[], Mapping[str, Measure]]
"""Returns the known measures, by name."""
_NONE: Final[Mapping[str, Path]] = MappingProxyType({})
CHUNKS_IN_A_ROW: Final = 3
_LEAST: Final = 0.25
"""Smallest command, as a share of the largest. A ratio to almost zero has no meaning."""


@dataclass(frozen=True)
class Command:
    """The commands that one skill takes. names, low, high (k,): of the parameters, SI, in the adapter's order."""

    declaration: Declaration
    adapter: Path
    names: tuple[str, ...]
    low: Array
    high: Array
    measures: Mapping[str, Measure] = field(default_factory=lambda: MEASURES, repr=False)

    @classmethod
    def of(
        cls,
        skill: str,
        adapter: Path,
        measures: Mapping[str, Measure] = MEASURES,
        installed: Mapping[str, Path] = _NONE,
    ) -> Command:
        """Read the range that the adapter was trained on, without a twentieth at each end.

        installed: adapters of the installed skills, which declare an adapter in a folder without schema.json.

        Raises CheckpointError and PluginError if adapter and schema.json do not match.
        """
        return cls.declared(Declaration.read(declared(skill, adapter, installed)), adapter, measures)

    @classmethod
    def declared(cls, declaration: Declaration, adapter: Path, measures: Mapping[str, Measure] = MEASURES) -> Command:
        """Read the range of an adapter in any folder, for a given declaration."""
        config = read_header(adapter)["adapter"]
        declaration.order(config["params"])
        centre, scale = np.array(config["centre"], float), np.array(config["scale"], float)
        # scale is half of the range: a model is least accurate at the edge of its data.
        low, high = centre - 0.9 * scale, centre + 0.9 * scale
        return cls(declaration, adapter, tuple(config["params"]), low, high, measures)

    @property
    def skill(self) -> str:
        return self.declaration.skill

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """(k,) Parameters in the order of the values."""
        return self.declaration.order(self.names)

    @property
    def primary(self) -> int:
        """Index of the value whose ratio of achieved over commanded is reported."""
        return self.parameters.index(self.declaration.primary) if self.declaration.primary else 0

    def named(self, values: Array) -> dict[str, float]:
        """Return one command (k,) by name, as the generator takes it."""
        return dict(zip(self.names, values.tolist(), strict=True))

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """Draw commands (count, k). The primary parameter is never close to zero."""
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
    """Return adapters by skill: all, or the wanted ones in that order. Raises CheckpointError if one is missing.

    roots: folders to search. None for the installed skills or, without `installed`, for the repository's.
    """
    found = dict(installed()) if roots is None and installed else _below(roots or [Path("skills")])
    missing = [skill for skill in wanted if skill not in found]
    if missing or not found:
        known = ", ".join(found) or "none"
        raise CheckpointError(f"There is no adapter for {', '.join(missing) or 'any skill'}.", f"Known: {known}.")
    return {skill: found[skill] for skill in wanted or found}


def _below(roots: Sequence[Path]) -> dict[str, Path]:
    files = sorted(file for root in roots for file in root.glob("**/adapter.safetensors"))
    return {file.parent.name: file for file in files}


def own(folders: Sequence[Path]) -> dict[str, Path]:
    """Return the adapters in folders of skills, by skill. Raises CheckpointError for a folder without one."""
    paths = {folder.resolve().name: folder.resolve() / "adapter.safetensors" for folder in folders}
    for skill, path in paths.items():
        if not path.is_file():
            raise CheckpointError(
                f"{path} is missing.", f"Train it with: humanclaw train adapter --skill {path.parent} ({skill})"
            )
    return paths


def declared(skill: str, adapter: Path, installed: Mapping[str, Path] = _NONE) -> Path:
    """Return the folder that declares a skill: its adapter's, the installed skill's, or else the repository's."""
    files = [adapter, installed.get(skill, adapter), *sorted(Path("skills").glob(f"**/{skill}/schema.json"))]
    return next((file.parent for file in files if (file.parent / "schema.json").is_file()), adapter.parent)


def file_digest(path: Path) -> str:
    """Return the digest of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def others(command: Command, commands: Sequence[Command]) -> list[Command]:
    """Return the skills that may come before one. Seats never come before stairs: the pelvis would rise by both."""
    seats = command.declaration.climbs
    return [one for one in commands if one.skill != command.skill and not (seats and one.declaration.role == "sit")]


@dataclass(frozen=True)
class Rollouts:
    """Results of one skill's commands (N, k): canonical root (N, 20, 3) and rotations (N, 20, 24, 3).

    after_other (N,): whether the chunk before was another skill's.
    """

    root: Array
    rotations: Array
    commands: Array
    after_other: NDArray[np.bool_]


def roll(generator: DiTGenerator, command: Command, before: Sequence[Command], rollouts: int, seed: int) -> Rollouts:
    """Run one skill `rollouts` times for three chunks in a row, every second time after a chunk of another skill."""
    random = np.random.default_rng(seed)
    motions = [generator.start() for _ in range(rollouts)]
    strange = np.zeros(rollouts, bool)
    if before:
        # The others in turn, so that each precedes equally many rollouts and runs as one batch.
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
    return Rollouts(*local, np.concatenate(commands), after)


def extend(
    generator: DiTGenerator,
    command: Command,
    motions: list[Motion],
    chosen: NDArray[np.int_],
    values: Array,
    key: tuple[int, ...],
) -> None:
    """Continue the chosen bodies, in place, by one chunk of a skill with values (len(chosen), k).

    key: start of the noise key. Callers use different numbers, so that no two measures share noise.
    """
    if len(chosen):
        # A key for each body, so that its noise does not depend on the size of the batch.
        histories = [motions[index][-HISTORY:] for index in chosen]
        keys = [(*key, int(index)) for index in chosen]
        futures = generator.generate_batch(histories, command.adapter, [command.named(row) for row in values], keys)
        for index, future in zip(chosen, futures, strict=True):
            motions[index] = motions[index].then(future)
