"""Score the same records by the former and the present definitions of the metrics, to show what each change did.

python tests/evidence/definitions.py runs/seeing runs/oracle

The former definitions exist only here. Some of them need the half second after a stop, which is no longer played. The
motion model generates it without physics: it shows how far a body coasts, but not which obstacles it would hit.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from humanclaw import HumanclawError, Motion, Plugins
from humanclaw.body import HISTORY, Pose2D, root_jerk
from humanclaw.motion import DiTGenerator
from humanclaw.records import ALIASES, REACHED, RecordedEpisode, in_view
from humanclaw.world import distance_to_nearest
from humanclaw_bench.scores import Scores, disturbed, generated_trajectory, score

NEW_ALIASES = {"sectional", "screen", "commode"}
NEGATION = re.compile(
    r"\b(?:no|not|none|never|neither|nor|nothing|nowhere|without|cannot|cant|absent|missing|invisible|unseen)\b"
    r"|n['\u2019]t\b|\bout of (?:view|sight)\b"
)

Row = tuple[RecordedEpisode, Scores, Motion | None]
"""An episode, its scores, and the body's motion in the half second after its stop."""


def coasted(recorded: RecordedEpisode, generator: DiTGenerator, stop: Path) -> Motion | None:
    """Return the half second after a stop; None if the episode did not end with one."""
    if recorded.record.outcome != "stopped":
        return None
    return generator.generate(recorded.motion()[-HISTORY:], stop, {}, (recorded.record.spec.seed,))


def nav_after_coasting(row: Row) -> bool | None:
    recorded, scores, after = row
    if after is None or not recorded.steps:
        return scores.nav
    boxes = [tuple(map(np.array, box)) for box in recorded.steps[-1].targets.values()]
    return distance_to_nearest(after[-1:].joints(), boxes) <= REACHED


def nav_where_targets_were(row: Row) -> bool | None:
    recorded, scores, _ = row
    if recorded.record.outcome != "stopped":
        return scores.nav
    boxes = [tuple(map(np.array, box)) for box in recorded.record.targets.values()]
    return distance_to_nearest(recorded.motion()[-1:].joints(), boxes) <= REACHED


def found_by_sentence(row: Row) -> bool | None:
    recorded, scores, _ = row
    if scores.find is None:
        return None
    names = (*(set(ALIASES.get(scores.category, (scores.category,))) - NEW_ALIASES), "target")
    named = re.compile(rf"\b(?:{'|'.join(map(re.escape, names))})(?:e?s)?\b")
    told = (step.decision.visible_state.lower().replace("_", " ") for step in recorded.steps if in_view(step))
    sentences = (one for text in told for one in re.split(r"[.!?](?=\s|$)|[;\n]", text))
    return any(named.search(one) and not NEGATION.search(one) for one in sentences)


def collisions_with_the_stop(row: Row) -> float:
    """Count the stop as a half second without a new contact."""
    _, scores, after = row
    return scores.collisions["any"] * scores.chunks / (scores.chunks + (after is not None)) if scores.chunks else np.nan


def path_since_touched(row: Row) -> float:
    recorded, _, _ = row
    moved = recorded.objects()
    since = disturbed(recorded, moved)
    pieces = [moved[key][max(first - 1, 0) :, :3] for key, first in since.items() if key in moved]
    return float(sum(np.linalg.norm(np.diff(piece, axis=0), axis=1).sum() for piece in pieces))


def jerk_with_the_stop(row: Row) -> float:
    recorded, _, after = row
    made, real = generated_trajectory(recorded), recorded.motion()
    if after is None:
        return root_jerk(made)
    joined = (Pose2D.of(motion, floor=float(motion.root[-1, 1])) for motion in (made, real))
    return root_jerk(made.then(next(joined).to_world(next(joined).to_local(after))))


CHANGES: Sequence[tuple[str, str, Callable[[Row], float | bool | None], Callable[[Scores], float | bool | None]]] = (
    ("a stop ends the episode where the body is", "NavSR %", nav_after_coasting, lambda s: s.nav),
    ("targets are where they now are", "NavSR %", nav_where_targets_were, lambda s: s.nav),
    ("a negation is bound to its clause, a search is none", "FindSR %", found_by_sentence, lambda s: s.find),
    ("a stop is no motion step", "Coll. %", collisions_with_the_stop, lambda s: s.collisions["any"]),
    ("paths from the first frame that moves", "dDtb, m an episode", path_since_touched, lambda s: s.disturbed_path),
    ("jerk without the stop", "jerk, m/s3", jerk_with_the_stop, lambda s: s.jerk),
)


def table(name: str, rows: Sequence[Row]) -> list[str]:
    """Return one line a change: both means, and the number of episodes whose value changed."""
    lines = []
    for change, metric, before, now in CHANGES:
        pairs = [(before(row), now(row[1])) for row in rows]
        known = np.array([pair for pair in pairs if None not in pair], float)
        known = known[np.isfinite(known).all(axis=1)]
        old, new = known.mean(axis=0) * (100 if "%" in metric else 1)
        other = int((np.abs(known[:, 0] - known[:, 1]) > 1e-6).sum())
        lines.append(f"| {name} | {change} | {metric} | {old:.3g} | {new:.3g} | {other} of {len(known)} |")
    return lines


def main(folders: Sequence[str]) -> int:
    """Print the table of some runs' folders."""
    plugins = Plugins.discover()
    generator, stop = plugins.make("motion_generators", "dit"), plugins.skill("stop").adapter
    print("| agent | change | metric | before | now | episodes that read otherwise |\n|" + " --- |" * 6)
    for folder in folders:
        rows = []
        for file in sorted(Path(folder).glob("*/episode.json")):
            try:
                recorded = RecordedEpisode(file.parent)
                rows.append((recorded, score(recorded), coasted(recorded, generator, stop)))
            except HumanclawError as error:
                print(f"left out: {error}", file=sys.stderr)
        print("\n".join(table(Path(folder).name, rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
