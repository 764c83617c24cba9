"""What a file says of names and sizes is checked before anything is opened, made or written by it."""

import errno
import io
import json
import os
import re
import tracemalloc
import zipfile

import numpy as np
import pytest
from made import broken_off, record_episode
from PIL import Image

from humanclaw import EpisodeSpec, HumanclawError, RecordedEpisode, RecordError
from humanclaw.records import EpisodeRecord, EpisodeWriter, StepRecord, read_episodes
from humanclaw.storage import within

SPEC = EpisodeSpec(id="a", instruction="Find a couch.", scene="house:0")
RECORD = EpisodeRecord(spec=SPEC, start={"x": 0, "z": 0, "yaw": 0}, agent="a", scene_digest="d")


KINDS = ("generated", "simulated")


# -- names -------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["../b", "/etc/passwd", "a/../../b", "..", "a/../.."])
def test_a_name_cannot_lead_out_of_its_folder(tmp_path, name):
    with pytest.raises(ValueError, match="outside"):
        within(tmp_path / "home", name)


@pytest.mark.parametrize("name", ["b", "a/b", "a/../b", "."])
def test_a_name_inside_is_taken(tmp_path, name):
    assert within(tmp_path / "home", name).is_relative_to(tmp_path / "home")


@pytest.mark.parametrize("name", ["../a", "a/b", "a\\b", "..", "", ".hidden", "a\n", "a" * 101, "C:a", "é"])
def test_an_id_that_is_no_name_of_a_folder_is_none(name):
    with pytest.raises(ValueError, match="id"):
        EpisodeSpec(id=name, instruction="Find a couch.", scene="house:0")


def test_an_id_that_is_there_twice_is_named_by_its_lines(tmp_path):
    file = tmp_path / "split.jsonl"
    lines = [SPEC.model_copy(update={"id": name}).model_dump_json() for name in ("one", "two", "ONE")]
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(HumanclawError, match=r"split.jsonl:3 holds the id 'ONE' of line 1 again"):
        read_episodes(file)
    file.write_text("\n".join(lines[:2]))
    assert [spec.id for spec in read_episodes(file)] == ["one", "two"]


def test_a_key_that_is_there_twice_in_an_episode_is_named(tmp_path):
    line = SPEC.model_dump_json()
    (tmp_path / "split.jsonl").write_text(line.replace('"seed"', '"seed":7,"seed"', 1) + "\n")
    with pytest.raises(HumanclawError, match=r"split.jsonl:1 holds the key 'seed' twice"):
        read_episodes(tmp_path / "split.jsonl")


def test_a_split_that_is_no_text_is_told_by_its_line(tmp_path):
    (tmp_path / "split.jsonl").write_bytes(SPEC.model_dump_json().encode() + b"\n\xff\xfe\n")
    with pytest.raises(HumanclawError, match=r"split.jsonl:2 is not an episode: (.|\n)*target_category"):
        read_episodes(tmp_path / "split.jsonl")


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"id": "a b"}, "id: ' ' is not allowed in it."),
        ({"target_ids": ["couch"]}, "target_ids.0: expected a whole number; got 'couch'."),
        ({"start": [1, 2, 3]}, "start: expected a Pose2D, or an object of its fields; got [1, 2, 3]."),
    ],
)
def test_a_wrong_field_of_a_split_is_told_with_what_it_takes(tmp_path, changed, problem):
    (tmp_path / "split.jsonl").write_text(json.dumps(json.loads(SPEC.model_dump_json()) | changed))
    with pytest.raises(HumanclawError, match=re.escape(f"split.jsonl:1 is not an episode: {problem}")):
        read_episodes(tmp_path / "split.jsonl")


def test_a_line_in_single_quotes_is_told_of_the_double_ones(tmp_path):
    (tmp_path / "split.jsonl").write_text("{'id': 'a'}")
    with pytest.raises(HumanclawError, match=r"split.jsonl:1 .*JSON takes names and texts in double quotes"):
        read_episodes(tmp_path / "split.jsonl")


# -- sizes -------------------------------------------------------------------------------------------------------------
@pytest.fixture
def running(tmp_path):
    """The folder of an episode that has not ended."""
    record_episode(tmp_path / "couch-0")
    broken_off(tmp_path / "couch-0")
    return tmp_path / "couch-0"


def array(shape, data=b"", kind="<f8"):
    """A file of an array as its header describes it, whatever follows."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": kind, "fortran_order": False, "shape": shape})
    return stream.getvalue() + data


def zipped(members, how=zipfile.ZIP_DEFLATED):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", how) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


WHOLE = {
    f"{kind}_{name}.npy": array((5, *row), b"\0" * 8 * 5 * width)
    for kind in KINDS
    for name, row, width in (("root", (3,), 3), ("rotations", (24, 3), 72))
}
"""Five frames, which are read."""


NO_ARRAYS = (
    array((10**12, 3)), array((2**31, 2**31)), array((5, 3), b"\0" * 119), array((-1, 3)),
    array((5, 3), b"\0" * 120, "|O"),
    b"\x93NUMPY", b"words", b"",
)  # fmt: skip
"""Files of arrays that say they are larger than they are, or are none."""


def marked(data, place, value):
    """The same archive with another byte in both of the places where it tells of its first member."""
    changed = bytearray(data)
    changed[data.find(b"PK\x01\x02") + place + 2] = changed[data.find(b"PK\x03\x04") + place] = value
    return bytes(changed)


@pytest.mark.parametrize(
    "content",
    [
        array((10**13,)),
        b"PK\x03\x04" + b"\0" * 40,
        *(zipped({**WHOLE, "simulated_root.npy": array}) for array in NO_ARRAYS),
        zipped({**WHOLE, "object_x.npy": array((5, 7), b"\0" * 280)}),
        zipped({**WHOLE, "object_1.npy": array((4, 7), b"\0" * 224)}),
        zipped({**WHOLE, "object_1.npy": array((5, 2), b"\0" * 80)}),
        zipped({**WHOLE, "object_1.npy": array((5, 7), b"\0" * 140, "<U1")}),
        zipped({**WHOLE, "simulated_root.npy": array((5, 4), b"\0" * 160)}),
        zipped({**WHOLE, "simulated_root.npy": b"\x93NUMPY\x01\x00\x04\x00(((("}),
        marked(zipped(WHOLE), 6, 1),
        marked(zipped(WHOLE), 8, 99),
        marked(zipped(WHOLE, zipfile.ZIP_LZMA), 60, 255),
    ],
)
def test_motion_that_is_none_is_refused_whatever_reads_it(running, content):
    (running / "steps.jsonl").write_bytes(b"")
    (running / "motion.npz").write_bytes(zipped(WHOLE))
    assert RecordedEpisode(running).motion().root.shape == (5, 3)
    (running / "motion.npz").write_bytes(content)
    with pytest.raises(RecordError, match=r"motion\.npz cannot be read"):
        RecordedEpisode(running).objects()


def test_many_arrays_may_not_be_large_together(running, monkeypatch):
    monkeypatch.setattr("humanclaw.records.recorded_episode._LARGEST", 4 * 5 * 7 * 8)
    many = {f"object_{number}.npy": array((5, 7), b"\0" * 280) for number in range(4)}
    (running / "motion.npz").write_bytes(zipped(many))
    with pytest.raises(RecordError, match="larger than"):
        RecordedEpisode(running).objects()


def test_motion_of_far_more_frames_than_the_steps_last_is_refused(running):
    long = {"object_1.npy": array((101_000, 7), bytes(101_000 * 56))}
    (running / "motion.npz").write_bytes(zipped(long))
    with pytest.raises(RecordError, match="far more frames than its steps last"):
        RecordedEpisode(running).objects()


@pytest.mark.parametrize("content", [b"no picture", "PNG", "JPEG"])
def test_a_view_that_is_no_picture_or_too_large_is_refused(running, content):
    episode, stream = RecordedEpisode(running), io.BytesIO()
    assert episode.picture(episode.steps[0]).shape == (256, 256, 3)
    if isinstance(content, str):
        Image.new("L", (9000, 9000)).save(stream, content)
    (running / "frames" / "0000.jpg").write_bytes(stream.getvalue() or content)
    with pytest.raises(RecordError, match=r"cannot read .*0000\.jpg: (the picture has more|cannot identify)"):
        episode.picture(episode.steps[0])


# -- room --------------------------------------------------------------------------------------------------------------
@pytest.fixture
def full(monkeypatch):
    """full(): from now on nothing more gets onto the disk."""

    def refuse(*names, **folders):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    return lambda: [monkeypatch.setattr(write, refuse) for write in ("os.fsync", "os.replace")]


def step(number):
    return StepRecord(step=number, status="invalid", attempts=())


@pytest.fixture
def writer(tmp_path):
    writer = EpisodeWriter(tmp_path / "a", RECORD)
    writer.open()
    return writer


def test_a_full_disk_is_told_in_a_sentence_and_leaves_whole_lines(writer, full):
    writer.keep(step(0))
    writer.frame("0.jpg", b"x")
    full()
    writer.keep(step(1))  # It does not wait for the disk.
    for write in (lambda: writer.frame("0.jpg", b"x"), lambda: writer.end(RECORD)):
        with pytest.raises(RecordError, match=r"cannot write the record to .*: No space left on device\."):
            write()
    data = (writer.folder / "steps.jsonl").read_bytes()
    assert [json.loads(line)["step"] for line in data.splitlines()] == [0, 1]
    assert not list(writer.folder.rglob("*.partial"))
    assert RecordedEpisode(writer.folder).record.outcome == "running"


@pytest.mark.parametrize("order", ["C", "F"])
def test_motion_is_read_as_it_was_however_its_arrays_lie_in_memory(writer, order):
    root, turns = (np.asarray(np.arange(n).reshape(4, *row), float, order) for n, row in ((12, (3,)), (288, (24, 3))))
    writer.move({f"{kind}_root": root for kind in KINDS} | {f"{kind}_rotations": turns for kind in KINDS})
    writer.end(RECORD.model_copy(update={"outcome": "stopped"}))
    np.testing.assert_array_equal(RecordedEpisode(writer.folder).motion().root, root)
    np.testing.assert_array_equal(RecordedEpisode(writer.folder).motion().rotations, turns)


def test_an_object_rests_in_pieces_of_motion_that_do_not_name_it(tmp_path):
    body = {f"{kind}_root": np.zeros((2, 3)) for kind in KINDS}
    writer = EpisodeWriter(tmp_path, RECORD, {"object_4": np.zeros(7)})
    writer.open()
    writer.move(body, body | {"object_4": np.array([[1.0] * 7, [2.0] * 7])}, body)
    writer.end(RECORD)
    assert RecordedEpisode(tmp_path).objects()[4][:, 0].tolist() == [0, 0, 1, 2, 2, 2]


@pytest.mark.parametrize("room", [True, False][: 1 + os.path.exists("/dev/full")])
def test_a_long_motion_waits_in_a_file_if_there_is_room(tmp_path, monkeypatch, room):
    """Of 300 pieces of 48 kB memory holds 200, and 300 where the temporary file gets no byte."""
    if not room:
        monkeypatch.setattr("humanclaw.storage.overflow.TemporaryFile", lambda **_: io.FileIO("/dev/full", "w"))
    writer = EpisodeWriter(tmp_path, RECORD)
    writer.open()
    tracemalloc.start()
    for number in range(300):
        writer.move({"generated_root": np.full((2000, 3), float(number))})
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    writer.end(RECORD)
    assert held / 48e3 == pytest.approx(200 if room else 300, abs=5)
    with np.load(tmp_path / "motion.npz") as motion:
        assert (motion["generated_root"][::2000, 0] == np.arange(300)).all()
        assert motion["generated_root"].shape == (600_000, 3)


def test_steps_wait_for_no_disk_and_all_is_on_disk_at_the_end(writer, monkeypatch):
    real, settled = os.fsync, set()
    monkeypatch.setattr("os.fsync", lambda descriptor: (settled.add(os.fstat(descriptor).st_ino), real(descriptor)))
    files = [writer.folder / writer.frame(f"{k}.jpg", b"x") for k in range(20)]
    writer.keep(step(0))
    assert b'"step":0' in (writer.folder / "steps.jsonl").read_bytes(), "who is killed now keeps it"
    assert not settled
    writer.end(RECORD)
    files += [writer.folder / "frames", writer.folder / "steps.jsonl", writer.folder / "motion.npz"]
    assert settled >= {path.stat().st_ino for path in files}


@pytest.mark.parametrize("place", ['"x": NaN', '"z": Infinity', '"yaw": 1e999', '"x": 1e308', '"floor": -20000'])
def test_a_start_that_is_nowhere_is_told_by_its_line(tmp_path, place):
    (tmp_path / "s.jsonl").write_text(
        '{"id": "a", "instruction": "Find a couch.", "scene": "house:0", "start": {' + place + "}}"
    )
    with pytest.raises(HumanclawError, match=r"s\.jsonl:1 is not an episode"):
        read_episodes(tmp_path / "s.jsonl")


def test_a_seed_below_zero_is_none():
    with pytest.raises(ValueError, match="greater than or equal to 0"):
        EpisodeSpec(id="a", instruction="Find a couch.", scene="house:0", seed=-1)
