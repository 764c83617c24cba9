"""Generated rollouts of a skill, from standing and after other skills, for the measures of the motion model."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import CheckpointError, Motion
from humanclaw.body import CHUNK, HISTORY, Array
from humanclaw.motion import read_header
from humanclaw.skills import MEASURES, Measure, Parameter, Skill
from humanclaw_train.data.chunks import canonical, stacked

if TYPE_CHECKING:
    from humanclaw import Plugins, Simulator
    from humanclaw.motion import DiTGenerator
    from humanclaw_train.mocap.clips import Clip

CHUNKS_IN_A_ROW: Final = 3
"""Calls of one command. The first sets out from standing, the others continue motion of the model's own."""
_LEAST: Final = 0.25
"""Smallest command, as a share of the largest. A ratio to almost zero has no meaning."""


@dataclass(frozen=True)
class Command:
    """The commands that one skill takes. names, low, high (k,): of the parameters, SI, in the adapter's order."""

    declaration: Skill
    adapter: Path
    names: tuple[str, ...]
    low: Array
    high: Array
    measures: Mapping[str, Measure] = field(default_factory=lambda: MEASURES, repr=False)

    @classmethod
    def of(cls, skill: str, adapter: Path, plugins: Plugins | None = None) -> Command:
        """Read the range that the adapter was trained on, without a twentieth at each end.

        The schema.json beside the adapter declares the skill, or else the installed skill does. Raises CheckpointError
        and PluginError if adapter and declaration do not match.
        """
        if plugins is None or (adapter.parent / "schema.json").is_file():
            declaration = Skill.from_folder(adapter.parent)
        else:
            declaration = plugins.skill(skill)
        return cls.declared(declaration, adapter, plugins.measures if plugins else MEASURES)

    @classmethod
    def declared(cls, declaration: Skill, adapter: Path, measures: Mapping[str, Measure] = MEASURES) -> Command:
        """Read the range of an adapter in any folder, for a given declaration."""
        config = read_header(adapter)["adapter"]
        declaration.order(config["params"])
        centre, scale = np.array(config["centre"], float), np.array(config["scale"], float)
        # scale is half of the range: a model is least accurate at the edge of its data.
        low, high = centre - 0.9 * scale, centre + 0.9 * scale
        return cls(declaration, adapter, tuple(config["params"]), low, high, measures)

    @property
    def skill(self) -> str:
        return self.declaration.name

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


@dataclass(frozen=True)
class Subject:
    """The weights that scenarios measure, and what they are measured with."""

    generator: DiTGenerator
    commands: Sequence[Command]
    rollouts: int = 200
    """Of each skill."""
    bodies: int = 20
    """For each pair of skills. Walks take fewer."""
    corners: int = 100
    """Calls at every corner of the range of walks."""
    seed: int = 0
    chunks: Sequence[Path] = ()
    """Folders of chunks to compare with."""
    clips: Sequence[Clip] = ()
    """Clips of people who walk."""
    plugins: Plugins | None = None
    """With the skills to play on a body; without them, none is played."""
    simulator: Simulator | None = None
    """Without it, nothing walks in half-physics."""

    @property
    def walks(self) -> Command | None:
        """The skill that walks."""
        return walker(self.commands)


def walker(commands: Sequence[Command]) -> Command | None:
    """Return the skill that walks: the first that commands both travel ahead and heading."""
    walking = {"hips.forward", "heading.left"}
    return next((command for command in commands if walking <= {part.measure for part in command.parameters}), None)


def installed(plugins: Plugins) -> dict[str, Path]:
    """Return the adapters of the installed skills, by skill."""
    skills = plugins.skills.values()
    return {skill.name: skill.adapter for skill in skills if skill.adapter is not None and skill.trained}


def adapters(roots: Sequence[Path]) -> dict[str, Path]:
    """Return the adapters in folders and below, by skill: their folder's name."""
    files = sorted(file for root in roots for file in root.glob("**/adapter.safetensors"))
    return {file.parent.name: file for file in files}


def wanted(known: Mapping[str, Path], skills: Sequence[str]) -> dict[str, Path]:
    """Return the adapters of the named skills, in that order, or of all. Raises CheckpointError if one is missing."""
    missing = [skill for skill in skills if skill not in known]
    if missing or not known:
        listed = ", ".join(known) or "none"
        raise CheckpointError(f"There is no adapter for {', '.join(missing) or 'any skill'}.", f"Known: {listed}.")
    return {skill: known[skill] for skill in skills or known}


def in_folders(folders: Sequence[Path]) -> dict[str, Path]:
    """Return the adapters in folders of skills, by skill. Raises CheckpointError for a folder without one."""
    paths = {folder.resolve().name: folder.resolve() / "adapter.safetensors" for folder in folders}
    for skill, path in paths.items():
        if not path.is_file():
            raise CheckpointError(
                f"{path} is missing.", f"Train it with: humanclaw train adapter --skill {path.parent} ({skill})"
            )
    return paths


def file_digest(path: Path) -> str:
    """Return the digest of a file's content."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def others(command: Command, commands: Sequence[Command]) -> list[Command]:
    """Return the skills that may come before one. Seats never come before stairs: the pelvis would rise by both."""
    seats = command.declaration.climbs
    different = (other for other in commands if other.skill != command.skill)
    return [other for other in different if not (seats and other.declaration.role == "sit")]


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
