"""How faithfully the skills do what they are told: achieved over commanded, on generated motion (paper, table 1).

    python -m humanclaw.training.fidelity --skills walk sit_in_place --rollouts 200 --data CHUNKS

A rollout starts from standing; every other one first does one chunk of another skill. Then it runs the skill for several chunks
in a row, each with parameters of its own, drawn uniformly from the middle nine tenths of the adapter's range.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw.body import JOINT_INDEX, TOE_SOLE
from humanclaw.errors import HumanclawError
from humanclaw.motion.checkpoint import load_base, read_header
from humanclaw.motion.flow import PROFILES, Solver
from humanclaw.motion.generator import DiTGenerator, shipped_base
from humanclaw.pose import (
    FPS,
    FUTURE,
    HISTORY,
    Motion,
    forward_kinematics,
    matrix_from_vector,
    rest_pose,
    support_height,
    wrap_angle,
)
from humanclaw.training.chunks import PARAMETERS, Chunks, canonical, outcomes

Array = NDArray[np.float64]

CHUNKS_IN_A_ROW: Final = 3
_LEAST: Final = 0.25
"""Commands smaller than this share of the largest are not asked for: a ratio to nothing says nothing."""
_PRIMARY: Final = {"walk": 1, "climb_upstairs": 0, "walk_downstairs": 0}
"""Which parameter the ratio is of, where it is not the only one: the forward distance, and the height of the step."""
_STAIRS: Final = ("climb_upstairs", "walk_downstairs")
_TOUCH: Final = 0.02
"""A sole lower than this counts as being on the ground, metres."""


@dataclass(frozen=True)
class Row:
    """One skill's line of the table."""

    skill: str
    ratio: float
    ratio_std: float
    """Of achieved over commanded, over all chunks."""
    ratio_after_other: float
    """The same where the chunk before was another skill's."""
    error: float
    """Mean absolute error over all parameters, centimetres and degrees alike."""
    skate: float
    """Mean horizontal speed of a toe that is on the ground, centimetres a second."""
    penetration: float
    """Mean depth of the lowest sole below the history's floor, centimetres; for stairs it says nothing."""
    pop: float
    """Median over chunks of the fastest joint acceleration where history and future meet, metres a second squared."""
    inside: float
    """The same, within the future."""
    jerk: float
    """Root-rigid jerk of the rollouts, metres a second cubed (paper, table 2)."""


# -- measures ----------------------------------------------------------------------------------------------------------
def skate(joints: Array) -> float:
    """(..., T, 24, 3) joint positions above a floor at 0 to the mean speed of toes on the ground, centimetres a second."""
    toes = joints[..., [JOINT_INDEX["left_foot"], JOINT_INDEX["right_foot"]], :]
    low = toes[..., 1] - TOE_SOLE < _TOUCH
    both = low[..., 1:, :] & low[..., :-1, :]
    speed = 100 * FPS * np.linalg.norm(np.diff(toes, axis=-3)[..., [0, 2]], axis=-1)
    return float(speed[both].mean()) if both.any() else float("nan")


def penetration(joints: Array) -> float:
    """(..., T, 24, 3) joint positions above a floor at 0 to the mean depth of the lowest sole, centimetres."""
    return float(100 * np.clip(-support_height(joints), 0, None).mean())


def acceleration(joints: Array) -> tuple[float, float]:
    """(N, 20, 24, 3): peak joint acceleration where history and future meet, and within the future; medians, m/s^2."""
    size = np.linalg.norm(np.diff(joints, n=2, axis=1), axis=-1).max(-1) * FPS**2
    seam = size[:, HISTORY - 2 : HISTORY].max(1)
    return float(np.median(seam)), float(np.median(size[:, HISTORY:].max(1)))


def root_jerk(motion: Motion, stride: int = 8) -> float:
    """Mean norm of the third difference of 22 joints carried rigidly by the root, m/s^3, at a stride of 8 frames (0.27 s)."""
    rest = rest_pose().joints()[0, :22] - rest_pose().root[0]
    carried = motion.root[:, None] + np.einsum("tij,nj->tni", matrix_from_vector(motion.rotations[:, 0]), rest)
    smooth = (carried[:-2] + carried[1:-1] + carried[2:]) / 3
    a, b, c, d = (smooth[start : len(smooth) - 3 * stride + start] for start in (0, stride, 2 * stride, 3 * stride))
    return float(np.linalg.norm(d - 3 * c + 3 * b - a, axis=-1).mean() / (stride / FPS) ** 3)


# -- rollouts ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Command:
    """What one skill can be asked: the range of each parameter, SI."""

    skill: str
    adapter: Path
    low: Array
    high: Array

    @classmethod
    def of(cls, skill: str, adapter: Path) -> Command:
        """The range that the adapter was trained on, less a twentieth at either end."""
        config = read_header(adapter)["adapter"]
        centre, scale = np.array(config["centre"], float), np.array(config["scale"], float)
        return cls(skill, adapter, centre - 0.9 * scale, centre + 0.9 * scale)

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """(count, k) commands; the parameter that the ratio is of is never close to zero."""
        values = random.uniform(self.low, self.high, (count, len(self.low)))
        if len(self.low):
            primary = _PRIMARY.get(self.skill, 0)
            column, largest = values[:, primary], max(abs(self.low[primary]), abs(self.high[primary]))
            small = np.abs(column) < _LEAST * largest
            values[small, primary] = np.where(column[small] < 0, -1, 1) * _LEAST * largest
        return values


@dataclass(frozen=True)
class Rollouts:
    """What was generated for one skill. chunks: (N, 20, 24, 3)-shaped content in canonical frames, with commands (N, k)."""

    root: Array
    rotations: Array
    commands: Array
    after_other: NDArray[np.bool_]
    whole: tuple[Motion, ...]


def roll(generator: DiTGenerator, command: Command, others: Sequence[Command], rollouts: int, seed: int) -> Rollouts:
    """Run one skill `rollouts` times for three chunks in a row; every second time after one chunk of another skill."""
    random = np.random.default_rng(seed)
    motions = [generator.start() for _ in range(rollouts)]
    strange = np.zeros(rollouts, bool)
    if others:
        strange[1::2] = True
        for index, other in enumerate(others):
            chosen = np.flatnonzero(strange)[index :: len(others)]
            _extend(generator, other, motions, chosen, random, (seed, 0))
    roots, rotations, commands = [], [], []
    for turn in range(CHUNKS_IN_A_ROW):
        values = _extend(generator, command, motions, np.arange(rollouts), random, (seed, turn + 1))
        roots.append(np.stack([motion.root[-HISTORY - FUTURE :] for motion in motions]))
        rotations.append(np.stack([motion.rotations[-HISTORY - FUTURE :] for motion in motions]))
        commands.append(values)
    local = canonical(np.concatenate(roots), np.concatenate(rotations))
    after = np.concatenate([strange, *[np.zeros(rollouts, bool)] * (CHUNKS_IN_A_ROW - 1)])
    return Rollouts(*local, np.concatenate(commands), after, tuple(motions))


def _extend(
    generator: DiTGenerator,
    command: Command,
    motions: list[Motion],
    chosen: NDArray[np.int_],
    random: np.random.Generator,
    key: tuple[int, int],
) -> Array:
    values = command.draw(len(chosen), random)
    if len(chosen):
        histories = [motions[index][-HISTORY:] for index in chosen]
        keys = [(*key, int(index)) for index in chosen]
        futures = generator.generate_batch(histories, command.adapter, values.tolist(), keys)
        for index, future in zip(chosen, futures, strict=True):
            motions[index] = motions[index].then(future)
    return values


# -- the table ---------------------------------------------------------------------------------------------------------
def fidelity(generator: DiTGenerator, adapters: Mapping[str, Path], rollouts: int = 200, seed: int = 0) -> list[Row]:
    """One row a skill, in the order given. Raises CheckpointError for an adapter that does not fit the base."""
    commands = [Command.of(skill, path) for skill, path in adapters.items()]

    def others(command: Command) -> list[Command]:
        # Who steps onto a stair out of a seat rises by both, and the ratio would be that of the two together.
        unfit = {command.skill, "sit_in_place"} if command.skill in _STAIRS else {command.skill}
        return [other for other in commands if other.skill not in unfit]

    return [_row(command.skill, roll(generator, command, others(command), rollouts, seed)) for command in commands]


def reference(skill: str, chunks: Chunks, most: int = 1000) -> Row:
    """The same measures on the data itself, whose ratio is 1 by construction; jerk over single chunks is not defined."""
    some = chunks[np.random.default_rng(0).permutation(len(chunks))[:most]]
    root, rotations = some.root.astype(float), some.rotations.astype(float)
    none = np.zeros(len(some), bool)
    return _row(skill, Rollouts(root, rotations, some.params.astype(float), none, ()))


def _row(skill: str, rollouts: Rollouts) -> Row:
    joints, _ = forward_kinematics(rollouts.root, rollouts.rotations)
    future = joints[:, HISTORY - 1 :]
    ratio, error = _achieved(skill, rollouts)
    after = ratio[rollouts.after_other]
    pop, inside = acceleration(joints)
    jerks = [root_jerk(motion) for motion in rollouts.whole]
    return Row(
        skill, _mean(ratio), float(np.nanstd(ratio)) if np.isfinite(ratio).any() else float("nan"), _mean(after), error,
        skate(future), penetration(future), pop, inside, _mean(np.array(jerks)),
    )  # fmt: skip


def _achieved(skill: str, rollouts: Rollouts) -> tuple[Array, float]:
    achieved = outcomes(skill, rollouts.root, rollouts.rotations)
    if not achieved.shape[1]:
        return np.full(len(achieved), np.nan), float("nan")
    primary = _PRIMARY.get(skill, 0)
    difference = achieved - rollouts.commands
    angle = np.array([name == "yaw" for name in PARAMETERS[skill]])
    difference[:, angle] = np.degrees(wrap_angle(difference[:, angle]))
    difference[:, ~angle] *= 100
    # Data, unlike commands, may hold a displacement of exactly nothing.
    wanted = np.where(rollouts.commands[:, primary] == 0, np.nan, rollouts.commands[:, primary])
    return achieved[:, primary] / wanted, float(np.abs(difference).mean())


def _mean(values: Array) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def milliseconds(generator: DiTGenerator, adapter: Path, values: Sequence[float], times: int = 10) -> float:
    """Median wall time of one generated chunk, one body at a time, after a first call that reads the adapter."""
    history = generator.start()
    generator.generate(history, adapter, values, (0,))
    taken = []
    for index in range(times):
        started = time.perf_counter()
        generator.generate(history, adapter, values, (index,))
        taken.append(1000 * (time.perf_counter() - started))
    return float(np.median(taken))


def markdown(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    heads = (
        "skill",
        "ratio",
        "after another",
        "error cm, deg",
        "skate cm/s",
        "sunk cm",
        "seam m/s2",
        "inside m/s2",
        "jerk m/s3",
    )
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for row in rows:
        cells = (
            row.skill, f"{row.ratio:.3f} ± {row.ratio_std:.3f}", f"{row.ratio_after_other:.3f}", f"{row.error:.1f}",
            f"{row.skate:.1f}", f"{row.penetration:.2f}", f"{row.pop:.1f}", f"{row.inside:.1f}", f"{row.jerk:.1f}",
        )  # fmt: skip
        lines.append("| " + " | ".join(cell.replace("nan ± nan", "-").replace("nan", "-") for cell in cells) + " |")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    options = _parser().parse_args(arguments)
    try:
        base = load_base(options.base or shipped_base())
        solver = Solver(options.method, options.steps) if options.steps else PROFILES[options.profile]
        generator = DiTGenerator(base, solver)
        adapters = {path.parent.name: path for path in _adapters(options.adapters)}
        wanted = {skill: adapters[skill] for skill in options.skills or adapters}
        rows = fidelity(generator, wanted, options.rollouts, options.seed)
        for folder in options.data:
            known = [skill for skill in wanted if (folder / f"{skill}.npz").is_file()]
            rows += [reference(skill, Chunks.load(folder / f"{skill}.npz")) for skill in known]
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyError as error:
        print(f"error: no adapter for {error}; there are {', '.join(adapters) or 'none'}", file=sys.stderr)
        return 2
    print(markdown(rows))
    first, path = next(iter(wanted.items()))
    values = Command.of(first, path).draw(1, np.random.default_rng(0))[0].tolist()
    print(
        f"\n{solver.method}, {solver.steps} steps; {milliseconds(generator, path, values):.1f} ms a chunk; base {base.digest}"
    )
    return 0


def _adapters(roots: Sequence[Path]) -> list[Path]:
    return sorted(path for root in roots for path in root.glob("**/adapter.safetensors"))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="humanclaw.training.fidelity", description=__doc__.splitlines()[0] if __doc__ else ""
    )
    parser.add_argument("--skills", nargs="*", default=[], help="which skills (default: all that have an adapter)")
    parser.add_argument(
        "--adapters", type=Path, nargs="*", default=[Path("skills")], help="folders that are searched for adapters"
    )
    parser.add_argument("--base", type=Path, help="base checkpoint (default: the shipped one)")
    parser.add_argument("--data", type=Path, nargs="*", default=[], help="folders of chunks, measured for comparison")
    parser.add_argument("--rollouts", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--profile", choices=list(PROFILES), default="default")
    parser.add_argument("--method", choices=("euler", "midpoint"), default="midpoint")
    parser.add_argument("--steps", type=int, default=0, help="solver steps, in place of the profile's")
    return parser


if __name__ == "__main__":
    sys.exit(main())
