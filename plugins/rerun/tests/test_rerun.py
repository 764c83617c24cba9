"""Tests of Rerun recordings, read back with Rerun's own reader and compared with the records."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from made import record_episode
from rooms import two_rooms

pytest.importorskip("rerun", reason="Rerun is not installed: pip install humanclaw-rerun")
chunks = pytest.importorskip("rerun.chunk")

from humanclaw import (  # noqa: E402
    Plugins,
    RecordedEpisode,
    RecordError,
    SceneError,
    cli,
)
from humanclaw.body import FPS, HISTORY, skin  # noqa: E402
from humanclaw_rerun.log import bones, house_of, write_recording  # noqa: E402


class Recording:
    """The content of an .rrd file: times in seconds and values, by entity and component."""

    def __init__(self, path: Path) -> None:
        self.reader = chunks.RrdReader(path)
        self.batches = [(chunk.entity_path, chunk.to_record_batch()) for chunk in self.reader.stream()]

    def entities(self) -> set[str]:
        return {path for path, _ in self.batches}

    def read(self, path: str, component: str) -> tuple[np.ndarray, list]:
        """Return times (NaN for static values) and the values logged at them, in order of time."""
        times, values = [], []
        for entity, batch in self.batches:
            if entity == path and component in batch.schema.names:
                rows = batch.column(component).to_pylist()
                timed = "time" in batch.schema.names
                ticks = batch.column("time").cast("int64").to_numpy() / 1e9 if timed else np.full(len(rows), np.nan)
                times += list(ticks)
                values += rows
        order = np.argsort(times, kind="stable")
        return np.array(times)[order], [values[k] for k in order]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedEpisode:
    folder = tmp_path_factory.mktemp("record") / "couch-0"
    record_episode(folder)
    return RecordedEpisode(folder)


@pytest.fixture(scope="module")
def recording(recorded: RecordedEpisode) -> Recording:
    out = recorded.folder / "couch.rrd"
    write_recording(recorded, two_rooms(), out)
    return Recording(out)


def assert_bodies(recording, recorded):
    """Assert that the recording shows each third pose as a skin, and each generated pose as bones."""
    simulated, generated = recorded.motion(), recorded.motion("generated")
    times, strips = recording.read("/world/body/generated", "LineStrips3D:strips")
    assert times == pytest.approx(np.arange(len(generated)) / FPS, abs=1e-8)
    assert np.array(strips) == pytest.approx(bones(generated), abs=1e-4)
    times, poses = recording.read("/world/body/simulated", "Mesh3D:vertex_positions")
    kept = range(0, len(simulated), 3)
    assert times == pytest.approx(np.array(kept) / FPS, abs=1e-8)
    for k in (0, -1):
        posed, _ = skin().posed(simulated.root[kept[k]], simulated.rotations[kept[k]])
        assert np.array(poses[k]) == pytest.approx(posed, abs=1e-4)


def test_every_frame_of_the_body_is_where_the_record_says(recorded, recording):
    assert_bodies(recording, recorded)


def test_a_bone_runs_from_a_joint_to_its_child(recorded):
    joints, ends = recorded.motion().joints(), bones(recorded.motion())
    assert ends.shape == (len(joints), 23, 2, 3)
    assert ends[:, 0, 0] == pytest.approx(joints[:, 0])
    assert {tuple(end) for end in ends[0, :, 1].round(6)} == {tuple(joint) for joint in joints[0, 1:].round(6)}


def test_the_distance_of_each_step_is_at_the_end_of_the_step(recorded, recording):
    times, values = recording.read("/distance", "Scalars:scalars")
    ends = HISTORY + np.cumsum([step.motion_frames for step in recorded.steps])
    assert times == pytest.approx(ends / FPS, abs=1e-8)
    assert [value for (value,) in values] == pytest.approx([step.target_distance for step in recorded.steps])


def test_every_call_is_told_as_it_begins_with_the_words_before_it(recorded, recording):
    times, lines = recording.read("/calls", "TextLog:text")
    moments = dict.fromkeys(times.round(6))
    assert len(moments) == len(recorded.steps)
    text = [line for (line,) in lines]
    for step in recorded.steps:
        assert str(step.call) in text
        assert step.decision.reasoning in text
    (level,) = [
        level
        for (level,), (line,) in zip(recording.read("/calls", "TextLog:level")[1], lines, strict=True)
        if "too far" in line
    ]
    assert level == "WARN"


def test_the_eyes_hold_the_pictures_of_the_record_where_the_head_was(recorded, recording):
    _, pictures = recording.read("/world/eyes", "EncodedImage:blob")
    kept = [(recorded.folder / step.frame_file).read_bytes() for step in recorded.steps]
    assert [bytes(blob) for (blob,) in pictures] == kept
    _, places = recording.read("/world/eyes", "Transform3D:translation")
    _, axes = recording.read("/world/eyes", "Transform3D:mat3x3")
    before = recorded.motion().joints()[HISTORY - 1]
    assert np.linalg.norm(np.array(places[0][0]) - before[15]) < 0.25
    # The columns are right, up and backwards. At yaw 0 a body looks along +Z, so its right is -X.
    right, up, back = np.array(axes[0][0]).reshape(3, 3)
    facing = np.array([np.sin(recorded.record.start.yaw), 0, np.cos(recorded.record.start.yaw)])
    assert -back @ facing > 0.7
    assert up[1] > 0.7
    assert right == pytest.approx(np.cross(up, back), abs=1e-6)


def test_the_house_stands_where_the_scene_says_and_has_no_ceiling(recording):
    scene = two_rooms()
    for obj in scene.objects:
        path = f"/world/house/{obj.category}_{obj.id}"
        assert (path in recording.entities()) == (obj.category != "ceiling")
        _, placed = recording.read(path, "Transform3D:translation")
        _, meshes = recording.read(path, "Mesh3D:vertex_positions")
        assert placed[0][0] == pytest.approx(obj.position)
        assert np.array(meshes[0]) == pytest.approx(scene.assets[obj.asset].mesh.vertices, abs=1e-6)


def test_a_recording_brings_its_own_layout(recording):
    assert [store.application_id for store in recording.reader.blueprints()] == ["humanclaw"]


def test_a_house_that_is_not_the_records_is_left_out_and_said_so(recorded, tmp_path):
    plugins = Plugins.discover()
    plugins.scene = lambda reference: two_rooms()
    assert house_of(recorded.record, plugins)[0] is not None
    other = recorded.record.model_copy(update={"scene_digest": "other"})
    scene, note = house_of(other, plugins)
    assert scene is None
    assert "differs" in note

    def missing(reference: str) -> None:
        raise SceneError("there is no such scene.")

    plugins.scene = missing
    assert "no such scene" in house_of(recorded.record, plugins)[1]
    write_recording(recorded, None, tmp_path / "bare.rrd", note)
    bare = Recording(tmp_path / "bare.rrd")
    assert "differs" in bare.read("/note", "TextDocument:text")[1][0][0]
    assert not [path for path in bare.entities() if path.startswith("/world/house")]


def test_a_file_that_cannot_be_written_is_said_in_a_sentence(recorded, tmp_path):
    with pytest.raises(RecordError, match="cannot write"):
        write_recording(recorded, None, tmp_path / "missing" / "a.rrd")


def invoke(*args):
    return CliRunner().invoke(cli.build(Plugins.discover), [str(arg) for arg in args])


def test_the_command_writes_an_episode_and_of_a_run_each(recorded, tmp_path):
    result = invoke("rerun", recorded.folder, "--out", tmp_path / "one.rrd")
    assert result.output.splitlines()[-1] == str(tmp_path / "one.rrd")
    for name in ("a", "b"):
        record_episode(tmp_path / "run" / name, name=name)
    refused = invoke("rerun", tmp_path / "run", "--out", tmp_path / "both.rrd")
    assert refused.exit_code == 2
    assert "holds 2 episodes" in refused.output
    assert invoke("rerun", tmp_path / "run").exit_code == 0
    for name in ("a", "b"):
        assert_bodies(Recording(tmp_path / "run" / name / "episode.rrd"), recorded)


@pytest.mark.integration
def test_rerun_is_not_loaded_until_a_recording_is_written():
    probe = "import sys, humanclaw_rerun, humanclaw_rerun.command\nprint(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    assert "rerun" not in loaded
