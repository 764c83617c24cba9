"""A record that contradicts its own motion is found without a simulator."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from humanclaw import Plugins, RecordedEpisode, RecordError, run_episode
from humanclaw.cli import build
from humanclaw.records import Decision, close_record, free_episode
from humanclaw.skills import Call
from humanclaw_bench.motion_check import contradicted


class Walker:
    name, privileged = "walker", False

    def begin(self, context: object) -> None: ...

    def decide(self, observation: object, history: object) -> Decision:
        return Decision((Call("walk", {"z_cm": 30}),))


@pytest.fixture(scope="module")
def honest(body, house, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("run") / "free-0"
    run_episode(body, free_episode("find a couch", house, max_steps=3), Walker(), folder=folder)
    return folder


@pytest.fixture
def bent(honest, tmp_path) -> Callable[..., list[str]]:
    """bent(steps=..., motion=...): contradictions of a copy in which steps or arrays were changed and sealed anew."""

    def change(steps: Callable = lambda step: {}, motion: Callable = lambda arrays: None) -> list[str]:
        found, folder = RecordedEpisode(honest), tmp_path / "free-0"
        (folder / "frames").mkdir(parents=True)
        for frame in (honest / "frames").iterdir():
            (folder / "frames" / frame.name).write_bytes(frame.read_bytes())
        with np.load(honest / "motion.npz") as kept:
            arrays = dict(kept)
        motion(arrays)
        stream = io.BytesIO()
        np.savez_compressed(stream, **arrays)
        (folder / "motion.npz").write_bytes(stream.getvalue())
        lines = [step.model_copy(update=steps(step)).model_dump_json() + "\n" for step in found.steps]
        (folder / "steps.jsonl").write_text("".join(lines))
        close_record(folder, found.record)
        return list(contradicted(RecordedEpisode(folder)))

    return change


def test_an_honest_record_agrees_with_its_motion(bent):
    assert bent() == []


def test_a_body_that_was_put_elsewhere_between_two_steps_is_found(bent):
    def put(arrays):
        arrays["simulated_root"][-15:, 2] += 3.0

    assert "its body jumps by 3.0" in bent(motion=put)[0]


def test_a_step_that_tells_another_place_than_its_motion_is_found(bent):
    def arrived(step):
        x, y, z = step.end
        return {"end": (x + 2.0, y, z)} if step.step == 2 else {}

    assert bent(arrived) == ["step 2 ends 2.00 m from where its motion does"]


def test_a_step_that_tells_an_arrival_of_which_the_motion_knows_nothing_is_found(bent):
    (told,) = bent(lambda step: {"target_distance": 0.1} if step.step == 2 else {})
    assert told.startswith("step 2 tells 0.10 m to the target, its motion ")


def test_a_seat_that_the_body_never_reached_is_found(bent):
    told = bent(lambda step: {"pelvis_contacts": tuple(step.targets)} if step.step == 2 else {})
    assert told[0].startswith("step 2 has the pelvis on target ")


def test_a_record_that_ended_and_hides_its_motion_is_found(bent, tmp_path):
    bent()
    folder = tmp_path / "free-0"
    record = RecordedEpisode(folder).record
    (folder / "motion.npz").unlink()
    close_record(folder, record)
    assert list(contradicted(RecordedEpisode(folder))) == ["it ended, and its motion is missing"]


def test_a_step_of_another_length_than_its_motion_is_found(bent):
    (told,) = bent(lambda step: {"motion_frames": 0} if step.step == 1 else {})
    assert told == "its steps last 30 frames, its motion another time"


def test_verify_names_an_episode_whose_motion_ends_before_its_steps_do(bent, tmp_path):
    with pytest.raises(RecordError, match="it holds 50 frames, and its steps last 60"):
        bent(lambda step: {"motion_frames": 30} if step.step == 1 else {})
    done = CliRunner().invoke(build(Plugins.discover), ["bench", "verify", str(tmp_path)])
    assert (done.exit_code, "it holds 50 frames, and its steps last 60" in done.output) == (1, True)
    assert "1 damaged, or not of this run" in done.output


def test_verify_names_the_episode(bent, tmp_path):
    bent(lambda step: {"target_distance": 0.1} if step.step == 2 else {})
    done = CliRunner().invoke(build(Plugins.discover), ["bench", "verify", str(tmp_path)])
    assert done.exit_code == 1
    assert "free-0: step 2 tells 0.10 m to the target" in done.output
