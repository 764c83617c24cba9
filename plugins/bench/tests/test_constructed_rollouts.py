"""Root causes of constructed rollouts and their near misses, checked by an independent copy of the paper's rules."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import groupby
from math import dist, hypot
from pathlib import Path
from typing import Any

import pytest
from constructed import CLAIMS, LABELS, SUCCESS, Built, anything, construct

from humanclaw import Decision, RecordedEpisode
from humanclaw.records import Attempt
from humanclaw_bench.attribution import CAUSES, attribute

EACH, MISSES, RANDOM = 25, 15, 200


def label_of(recorded: RecordedEpisode) -> str:
    cause = attribute(recorded)
    return cause.label if cause else SUCCESS


# -- the rules of appendix B once more, over the written lines ---------------------------------------------------------
LOCOMOTION = {"walk", "side_step", "step_back", "climb_upstairs", "walk_downstairs"}


def second_opinion(folder: Path) -> str:
    """The label of an episode folder, from its two files alone."""
    episode = json.loads((folder / "episode.json").read_text())
    steps = [json.loads(line) for line in (folder / "steps.jsonl").read_text().splitlines()]
    task, targets = episode["spec"], set(episode["spec"]["target_ids"])
    shown = [sum(step["target_pixels"].values()) >= 100 for step in steps]
    said = [step["attempts"][-1]["decision"]["visible_state"] in CLAIMS[task["target_category"]] for step in steps]
    stopped = steps[-1]["status"] == "stopped"
    gaps = [step["target_distance"] for step in steps if step["target_distance"] is not None]
    reached = stopped and bool(gaps) and gaps[-1] <= 0.2
    done = [step for step in steps if step["status"] == "executed"]
    sits = [step for step in done if step["call"]["skill"] in ("sit", "sit_in_place")]
    seated = stopped and bool(sits) and bool(targets.intersection(steps[-1]["pelvis_contacts"]))
    if seated if task["interact"] else reached:
        return SUCCESS
    if not any(a and b for a, b in zip(shown, said, strict=True)):
        return "find: " + find_rule(episode, steps, any(shown))
    if not reached:
        return "nav: " + nav_rule(task, steps, shown, said[-1], stopped, min(gaps, default=9.9) <= 0.2)
    return "interact: " + interact_rule(steps, sits, targets)


def find_rule(episode: dict[str, Any], steps: Sequence[dict[str, Any]], shown: bool) -> str:
    way = ways(episode, steps)
    if shown:
        return "target in view but not seen"
    if min(way) < 1.5:
        return "near but not in view"
    if way[0] > 20:
        return "too far"
    if jammed(steps):
        return "unaware jammed"
    if confined(steps):
        return "ineffective actions"
    if min(way) / way[0] < 0.5 and way[-1] / way[0] > 0.6:
        return "midpoint give up"
    return "ineffective exploration"


def nav_rule(
    task: dict[str, Any],
    steps: Sequence[dict[str, Any]],
    shown: list[bool],
    said_last: bool,
    stopped: bool,
    arrived: bool,
) -> str:
    if arrived and not stopped:
        return "unaware arrived/touch"
    if stopped and not arrived:
        return "stop while far"
    if 10 * shown.index(True) >= 7 * task["max_steps"]:
        return "find too late"
    if shown[-1]:
        return "unaware jammed" if jammed(steps) else "ineffective actions"
    return "target hallucination" if said_last else "lost target"


def interact_rule(steps: Sequence[dict[str, Any]], sits: Sequence[dict[str, Any]], targets: set[int]) -> str:
    if not sits:
        return "stop but never sit"
    if any(targets.intersection(sit["pelvis_contacts"]) for sit in sits):
        return "stand after sit"
    held = any(step["pelvis_contacts"] for step in steps)
    brushed = any(contact["joint"] == "pelvis" for step in steps for contact in step["contacts"])
    thighs = any(contact["joint"] in ("left_hip", "right_hip") for sit in sits for contact in sit["contacts"])
    return "sit wrong" if held or brushed or thighs else "sit on air"


def ways(episode: dict[str, Any], steps: Sequence[dict[str, Any]]) -> list[float]:
    """Way left at the start and after each step: as measured, else straight over the floor."""

    def straight(x: float, z: float) -> float:
        boxes = [(low, high) for low, high in episode["targets"].values()]
        return min(hypot(max(a[0] - x, x - b[0], 0), max(a[2] - z, z - b[2], 0)) for a, b in boxes)

    if episode["geodesic"] is not None:
        return [episode["geodesic"], *(step["geodesic"] for step in steps)]
    places = [(episode["start"]["x"], episode["start"]["z"]), *((step["end"][0], step["end"][2]) for step in steps)]
    return [straight(x, z) for x, z in places]


def jammed(steps: Sequence[dict[str, Any]]) -> bool:
    """Eight locomotion commands in a row of less than 0.1 m each."""
    run = 0
    for step in steps:
        held = step["call"] and step["call"]["skill"] in LOCOMOTION and dist(step["start"], step["end"]) < 0.1
        run = run + 1 if held else 0
        if run == 8:
            return True
    return False


def confined(steps: Sequence[dict[str, Any]]) -> bool:
    """25 movement or turning commands in a row within a box of 2 m."""
    for acting, group in groupby(
        steps, lambda s: bool(s["call"]) and s["call"]["skill"] in LOCOMOTION | {"turn_in_place"}
    ):
        run = list(group)
        for first in range(len(run) - 24) if acting else ():
            places = [place for step in run[first : first + 25] for place in (step["start"], step["end"])]
            if all(max(p[axis] for p in places) - min(p[axis] for p in places) <= 2 for axis in (0, 2)):
                return True
    return False


# -- rollouts with a known label ---------------------------------------------------------------------------------------
def test_the_constructed_labels_are_those_of_the_classifier() -> None:
    assert [cause.label for cause in CAUSES] == list(LABELS)


@pytest.mark.parametrize("label", LABELS)
def test_every_rollout_built_to_have_a_root_cause_gets_it_from_both_computations(tmp_path: Path, label: str) -> None:
    rollouts = [construct(label, case) for case in range(EACH)]
    for case, built in enumerate(rollouts):
        recorded = built.write(tmp_path, f"{case}")
        assert built.label == label
        assert label_of(recorded) == label, f"case {case}"
        assert second_opinion(recorded.folder) == label, f"case {case}"
    assert_they_differ(
        rollouts, ("category", "max_steps", "targets", "interact")[: 3 if label.startswith("interact") else 4]
    )


def assert_they_differ(rollouts: Sequence[Built], free: Sequence[str]) -> None:
    """In length, and in each of these fields, none of which the rule names."""
    assert len({len(built.steps) for built in rollouts}) > 5
    assert all(len({str(built.episode[name]) for built in rollouts}) > 1 for name in free)


@pytest.mark.parametrize("label", LABELS)
def test_the_same_rollout_with_the_deciding_fact_undone_gets_the_label_that_is_then_due(
    tmp_path: Path, label: str
) -> None:
    for case in range(MISSES):
        built = construct(label, case, miss=True)
        recorded = built.write(tmp_path, f"{case}")
        assert built.label != label
        assert label_of(recorded) == built.label, f"case {case}"
        assert second_opinion(recorded.folder) == built.label, f"case {case}"


def test_a_target_in_view_that_is_acknowledged_once_is_no_failure_to_find(tmp_path: Path) -> None:
    for case in range(5):
        built = construct("find: target in view but not seen", case)
        said = (Attempt(Decision(visible_state=CLAIMS[built.episode["category"]][case % 4])),)
        seen = next(k for k, step in enumerate(built.steps) if sum(step.target_pixels.values()) >= 100)
        built.steps[seen] = built.steps[seen].model_copy(update={"attempts": said})
        assert label_of(built.write(tmp_path, f"{case}")).startswith("nav: ")


# -- rollouts with an unknown one --------------------------------------------------------------------------------------
def test_both_computations_agree_on_random_rollouts_of_many_labels(tmp_path: Path) -> None:
    labels = set()
    for case in range(RANDOM):
        recorded = anything(case).write(tmp_path, f"{case}")
        label = label_of(recorded)
        labels.add(label)
        assert label == second_opinion(recorded.folder), f"case {case}"
    assert SUCCESS in labels
    assert len(labels) > 12


@pytest.mark.parametrize("label", LABELS)
def test_a_record_gets_the_same_label_again_and_after_it_was_read_again(tmp_path: Path, label: str) -> None:
    recorded, twin = (construct(label, EACH).write(tmp_path, name) for name in ("one", "two"))
    labels = {label_of(one) for one in (recorded, recorded, RecordedEpisode(recorded.folder), twin)}
    assert labels == {label}
    assert [one.model_dump() for one in twin.steps] == [one.model_dump() for one in recorded.steps]
