"""Tests of naturalness (likeness, transitions, a long life, sequences) on models that stand still."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from declared import declaration, declare, folder_of
from tiny_motion import write_adapter

from humanclaw import Motion
from humanclaw.body import FUTURE, HISTORY, STANDING_HEIGHT, rest_pose
from humanclaw.motion import AdapterConfig, DiTGenerator, MotionProfile, Solver, load_base
from humanclaw_train.data.chunks import Chunks, canonical, stacked
from humanclaw_train.eval import scenarios, walks
from humanclaw_train.eval.likeness import PRIOR, free_running, held_out, likeness, naturalness, prior, skills
from humanclaw_train.eval.measures import Features, frechet
from humanclaw_train.eval.rollouts import Command, Subject, adapters
from humanclaw_train.eval.scenarios import (
    SEQUENCES,
    first_steps,
    real_peak,
    sequences,
    slid,
    transitions,
)
from humanclaw_train.eval.walks import corners, drift, gaits, uncommanded

SKILLS = ("walk", "side_step", "step_back", "turn_in_place")


@pytest.fixture(scope="module")
def still(tmp_path_factory, still_base):
    """Return a folder with a base that holds the last pose, and adapters of four skills that change nothing."""
    folder = tmp_path_factory.mktemp("still")
    base = still_base(folder / "base.safetensors")
    for skill in SKILLS:
        names = tuple(parameter.name for parameter in declaration(skill).parameters)
        width = len(names)
        config = AdapterConfig(skill, "mlp", names, (0.0,) * width, (0.2,) * width)
        write_adapter(folder / skill / "adapter.safetensors", base, config, scale=0.0)
        declare(folder / skill)
    return folder


@pytest.fixture(scope="module")
def generator(still):
    return DiTGenerator(load_base(still / "base.safetensors"), MotionProfile(Solver("euler", 1)))


@pytest.fixture(scope="module")
def commands(still):
    paths = adapters([still])
    return [Command.of(skill, paths[skill]) for skill in SKILLS]


def _wobbling(count: int, size: float, source: str, seed: int = 0) -> Chunks:
    """Return chunks of a body that stands still in its history and then drifts at random."""
    random = np.random.default_rng(seed)
    rest = rest_pose(20)
    drift = random.normal(0, size, (count, 1, 3)) * np.clip(np.arange(20) - 4, 0, None)[:, None] / 15
    return Chunks.of(
        declaration("walk").parameters, rest.root + drift, np.repeat(rest.rotations[None], count, 0), source, real=True
    )


@pytest.mark.integration
def test_a_model_that_stands_still_is_unlike_moving_people(generator, commands):
    data = Chunks.join([_wobbling(80, 0.1, "one", 1), _wobbling(80, 0.1, "two", 2)])
    features = Features.of(data.root.astype(float), data.rotations.astype(float))
    made, floor = likeness(generator, commands[0], data[:80], data[80:], features, seed=0)
    assert made > 3 * floor
    assert free_running(generator, commands[0], data, features, seed=0) > 3 * floor


def _rocking(start: Motion, count: int, random: np.random.Generator) -> Motion:
    """Continue a motion by so many times half a second, in each of which the body rocks ahead and back by 10 cm."""
    ahead = 0.1 * np.sin(2 * np.pi * np.arange(1, count * FUTURE + 1) / FUTURE)
    root = start.root[-1] + ahead[:, None] * [0.0, 0.0, 1.0] + random.normal(0, 1e-3, (len(ahead), 3))
    return start.then(Motion(root, np.repeat(start.rotations[-1:], len(root), 0)))


def test_windows_of_the_model_begin_at_any_frame(commands):
    """A model that rocks once a call, always in step, is as like people who rock as they are like one another."""
    random, rest = np.random.default_rng(0), rest_pose(HISTORY)
    clips = [_rocking(rest, 6, random) for _ in range(200)]
    windows = [clip[at : at + HISTORY + FUTURE] for clip, at in zip(clips, random.integers(5, 60, 200), strict=True)]
    root, rotations = canonical(*stacked(windows))
    data = Chunks.of(declaration("walk").parameters, root, rotations, "people", real=True)
    model = SimpleNamespace(
        start=lambda: rest, generate_batch=lambda starts, *_: [_rocking(start, 1, random)[HISTORY:] for start in starts]
    )
    features = Features.of(root, rotations)
    halves = frechet(features(root[::2], rotations[::2]), features(root[1::2], rotations[1::2]))
    assert free_running(model, commands[0], data, features, seed=0) < 2 * halves


def test_chunks_of_clips_that_nothing_learnt_from_are_kept_apart(tmp_path):
    _wobbling(50, 0.1, "learnt").save(tmp_path / "walk.npz")
    assert held_out([tmp_path], "walk") is None
    _wobbling(40, 0.1, "never seen").save(tmp_path / "held_out" / "walk.npz")
    held, rest = held_out([tmp_path], "walk")
    assert (set(held.source), set(rest.source)) == ({"never seen"}, {"learnt"})


def test_the_prior_alone_is_held_against_clips_it_never_saw(generator, tmp_path):
    data = _wobbling(80, 0.1, "learnt", 1)
    features = Features.of(data.root.astype(float), data.rotations.astype(float))
    data.save(tmp_path / "base.npz")
    assert prior(generator, [tmp_path], features, seed=0) == []
    _wobbling(80, 0.1, "never seen", 2).save(tmp_path / "held_out" / "base.npz")
    made, true = prior(generator, [tmp_path], features, seed=0)
    assert (made["skill"], made["motion"], true["motion"]) == (PRIOR, "generated", "held-out")
    assert made["Frechet"] > 3 * true["Frechet"]  # The model stands still; the people do not.


def test_a_skill_that_held_out_clips_lack_has_no_distance_to_them(generator, commands, tmp_path):
    for name in ("base", "walk"):
        _wobbling(80, 0.1, "one", 1).save(tmp_path / f"{name}.npz")
    subject = Subject(generator, commands[:1], rollouts=4, chunks=[tmp_path])
    rows = skills(subject)
    assert [row["motion"] for row in rows] == ["generated", "real"]
    assert np.isnan([row["Frechet"] for row in rows]).all()
    _wobbling(40, 0.1, "never seen").save(tmp_path / "held_out" / "walk.npz")
    assert np.isfinite([row["Frechet"] for row in skills(subject)]).all()


def test_first_steps_and_drift_of_a_standing_body_are_zero(generator, commands, monkeypatch):
    monkeypatch.setattr(scenarios, "_FIRST_BODIES", 3)
    subject = Subject(generator, commands, bodies=2)
    (row, *_) = first_steps(subject)
    assert (row["skill"], row["bodies"], row["over 2 cm"]) == ("walk", 3, 0)
    assert row["most"] == pytest.approx(0, abs=1e-3)
    assert subject.walks is commands[0]
    (row,) = drift(subject, calls=2)
    assert list(row.values()) == pytest.approx([0] * 4, abs=1e-3)


@pytest.mark.integration
def test_a_standing_body_keeps_its_hips_and_has_no_gait(plugins, generator, commands, monkeypatch):
    monkeypatch.setattr(walks, "_BODIES", 1)
    simulator = plugins.make("simulators", "mujoco", profile="default")
    subject = Subject(generator, commands, bodies=1, corners=1, simulator=simulator)
    rows = corners(subject)
    assert [rows[1][key] for key in ("x_cm", "z_cm", "yaw_deg")] == [-30, 0, 30]
    assert len(rows) == 8
    assert min(row["lowest hips cm"] for row in rows) == pytest.approx(100 * STANDING_HEIGHT, abs=1.0)
    assert gaits(subject) == []


def test_first_steps_are_asked_for_straight_ahead_too_and_by_little(generator, commands, monkeypatch):
    """Models call these most, and scatter in the other parameters would hide their errors."""
    asked = []
    batch = generator.generate_batch
    monkeypatch.setattr(
        generator,
        "generate_batch",
        lambda bodies, adapter, values, keys: asked.extend(values) or batch(bodies, adapter, values, keys),
    )
    monkeypatch.setattr(scenarios, "_FIRST_BODIES", 40)
    first_steps(Subject(generator, commands[:1]))
    straight = [row["x"] == row["yaw"] == 0 for row in asked]
    assert straight == [True, False] * 20
    assert all(0 <= row["z"] <= 0.16 for row in asked[::3])  # Of 80 cm.
    assert max(row["z"] for row in asked) > 0.7


def test_a_body_that_slides_over_two_centimetres_glides():
    row = slid(np.arange(100.0) / 25)  # 0 to 3.96 cm.
    assert list(row.values()) == pytest.approx([3.762, 3.9204, 3.96, 49, 100])


def test_what_a_skill_commands_is_not_counted_as_uncommanded(generator, commands):
    drifts = uncommanded(generator, commands, commands[0], bodies=2)
    assert set(drifts["walk"]) == set()
    assert set(drifts["step_back"]) == {"hips.left", "heading.left"}
    assert drifts["turn_in_place"]["hips.forward"] == pytest.approx((0, 0), abs=1e-3)


@pytest.mark.parametrize("stairs", [False, True])
def test_a_body_that_stands_still_skates_sinks_and_jerks_by_nothing(stairs):
    """On stairs the floor is not at zero: neither skate nor depth is known."""
    rest = rest_pose(20)
    row = naturalness("walk", "generated", rest.root[None], rest.rotations[None], stairs)
    unknown = np.nan if stairs else 0
    assert list(row.values())[3:8] == pytest.approx([unknown, 0, unknown, 0, 0], abs=1e-6, nan_ok=True)


def test_a_body_that_holds_its_pose_does_not_pop(generator, commands):
    rows = transitions(Subject(generator, commands, bodies=2))
    assert [row["worst m/s2"] for row in rows] == pytest.approx([0] * 4, abs=0.5)


def _command(skill: str) -> Command:
    return Command.of(skill, folder_of(skill) / "adapter.safetensors")


def test_the_peak_of_real_motion_is_that_of_its_sharpest_frame(tmp_path):
    chunks = _wobbling(1, 0.0, "clip")
    chunks.root[0, 10:, 2] += 0.01
    chunks.save(tmp_path / "walk.npz")
    assert real_peak([tmp_path], [_command("walk"), _command("sit_in_place")]) == pytest.approx(9, rel=1e-3)
    assert np.isnan(real_peak([tmp_path], [_command("sit_in_place")]))


def test_a_standing_body_has_no_jerk_in_any_sequence(generator, commands, monkeypatch):
    monkeypatch.setattr(scenarios, "_SEQUENCE_BODIES", 1)
    rows = sequences(Subject(generator, commands))
    assert [row["sequence"] for row in rows] == list(SEQUENCES)
    assert max(row["jerk m/s3"] for row in rows) < 0.2


def test_the_command_line_prints_a_table_a_scenario(humanclaw, still, capsys, tmp_path, monkeypatch):
    few = {"skills": skills, "transitions": transitions}  # All of them take minutes.
    monkeypatch.setattr(scenarios, "SCENARIOS", few)
    _wobbling(40, 0.1, "one").save(tmp_path / "walk.npz")
    _wobbling(60, 0.1, "two").save(tmp_path / "base.npz")
    words = ["--adapters", still, "--base", still / "base.safetensors", "--rollouts", "2", "--steps", "1"]
    arguments = ["naturalness", *words, "--bodies", "2", "--chunks", tmp_path]
    assert humanclaw(*arguments) == 0
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    for title in few:
        assert f"\n{title}\n" in f"\n{printed}"
    assert humanclaw(*arguments, "--json") == 0
    tables = json.loads(capsys.readouterr().out)
    assert list(tables) == list(few)
    assert {row["motion"] for row in tables["skills"]} == {"generated", "real"}
    assert humanclaw("naturalness", "--adapters", tmp_path) == 2
