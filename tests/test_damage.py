"""Damage to a record: whatever is cut, flipped or swapped is found, by file and line, or has changed nothing."""

import hashlib
import json
import re

import numpy as np
import pytest
from made import record_episode

from humanclaw.errors import RecordError
from humanclaw.records import EpisodeRecord, RecordedEpisode, StepRecord, Usage, write_record
from humanclaw.world import Contact


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a whole record."""
    folder = tmp_path_factory.mktemp("whole") / "couch-0"
    record_episode(folder)
    return folder


@pytest.fixture
def folder(tmp_path):
    record_episode(tmp_path / "couch-0")
    return tmp_path / "couch-0"


def flipped(data, rng):
    """One bit is another."""
    place = int(rng.integers(len(data)))
    return data[:place] + bytes([data[place] ^ (1 << int(rng.integers(8)))]) + data[place + 1 :]


def cut(data, rng):
    """The end is missing, or a piece from the middle."""
    first, last = sorted(rng.integers(len(data), size=2))
    return data[:first] + data[last + 1 :] if rng.random() < 0.5 else data[:first]


def swapped(data, rng):
    """Two lines have changed places, or one is there twice."""
    lines = data.splitlines(keepends=True)
    a, b = rng.integers(len(lines), size=2)
    if rng.random() < 0.5:
        return b"".join([*lines[:a], lines[b], *lines[a:]])
    lines[a], lines[b] = lines[b], lines[a]
    return b"".join(lines)


def test_a_thousand_flips_cuts_and_swaps_are_each_found_or_harmless(whole):
    before, rng = RecordedEpisode(whole).digest, np.random.default_rng(18)
    files = [path for path in sorted(whole.rglob("*")) if path.is_file()]
    weight = [0.3 if path.suffix.startswith(".json") else 0.4 / (len(files) - 2) for path in files]
    count = 0
    for _ in range(1000):
        path = files[int(rng.choice(len(files), p=weight))]
        data = path.read_bytes()
        path.write_bytes((flipped, cut, swapped)[int(rng.integers(3))](data, rng))
        try:
            assert RecordedEpisode(whole).digest == before, f"{path} is damaged, and nobody noticed"
        except RecordError as error:
            count += str(whole) in str(error)
        path.write_bytes(data)
    assert count > 800  # Most of what is harmless swaps a line with itself.


@pytest.mark.parametrize("name", ["steps.jsonl", "motion.npz", "frames/0000.jpg"])
def test_a_file_that_is_gone_is_named(folder, name):
    (folder / name).unlink()
    with pytest.raises(RecordError, match=f"cannot read .*{name}"):
        RecordedEpisode(folder)


def test_a_record_that_was_mended_by_hand_is_refused(folder):
    path = folder / "episode.json"
    path.write_text(path.read_text().replace('"outcome": "stopped"', '"outcome": "out_of_steps"'))
    with pytest.raises(RecordError, match=r"episode\.json has been changed"):
        RecordedEpisode(folder)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (
            lambda lines: [*lines[:2], lines[2][:-9] + b"\n", *lines[3:]],
            r"steps\.jsonl:3 holds a line that is not a step",
        ),
        (lambda lines: [lines[0], *lines[2:]], r"steps\.jsonl:2 holds step 2: lines are missing"),
        (lambda lines: [lines[0], *lines], r"steps\.jsonl:2 holds step 0"),
    ],
)
def test_of_an_episode_under_way_damaged_lines_are_named(folder, damage, words):
    """It has no digests yet: a crash left it there."""
    _leave_open(folder)
    path = folder / "steps.jsonl"
    path.write_bytes(b"".join(damage(path.read_bytes().splitlines(keepends=True))))
    with pytest.raises(RecordError, match=words):
        RecordedEpisode(folder)


@pytest.mark.parametrize("value", ["NaN", "Infinity", "-Infinity"])
def test_a_step_that_holds_no_finite_number_is_named(folder, value):
    _leave_open(folder)
    path = folder / "steps.jsonl"
    path.write_text(re.sub(r'"yaw_end":[^,}]+', f'"yaw_end":{value}', path.read_text(), count=1))
    with pytest.raises(RecordError, match=rf"steps\.jsonl:1 holds {value}, which is not a finite number"):
        RecordedEpisode(folder)


def test_words_may_say_what_is_no_number(folder):
    _leave_open(folder)
    path = folder / "steps.jsonl"
    path.write_text(re.sub(r'"reasoning":"[^"]*"', '"reasoning":"NaN, -Infinity"', path.read_text()))
    assert RecordedEpisode(folder).steps[0].decision.reasoning == "NaN, -Infinity"


def test_motion_that_holds_no_finite_number_is_named(folder):
    _leave_open(folder)
    with np.load(folder / "motion.npz") as data:
        arrays = dict(data)
    arrays["simulated_root"][3, 1] = np.nan
    np.savez(folder / "motion.npz", **arrays)
    with pytest.raises(RecordError, match=r"motion\.npz cannot be read: it holds values that are not finite"):
        RecordedEpisode(folder).motion()


def _leave_open(folder):
    """Make of a closed record one without digests, as a crash leaves it."""
    record = EpisodeRecord.model_validate_json((folder / "episode.json").read_bytes())
    write_record(folder, record.model_copy(update={"outcome": "running", "files": {}}))


def test_a_record_cut_in_half_is_named_with_the_line_where_it_ends(folder):
    path = folder / "episode.json"
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(RecordError, match=r"episode\.json:\d+ is no record"):
        RecordedEpisode(folder)


def test_a_record_of_another_version_says_which_format_it_has(folder):
    path = folder / "episode.json"
    path.write_bytes(re.sub(rb'"format": ?\d+', b'"format": 4', path.read_bytes()))
    with pytest.raises(RecordError, match="another version of humanclaw wrote it, in format 4; this one reads 5"):
        RecordedEpisode(folder)


@pytest.mark.parametrize("name", ["../../secret", "/etc/hostname"])
def test_a_record_names_no_file_outside_its_folder(folder, name):
    record = EpisodeRecord.model_validate_json((folder / "episode.json").read_bytes())
    write_record(folder, record.model_copy(update={"files": {name: "0" * 64}}))
    with pytest.raises(RecordError, match="leads out of the folder"):
        RecordedEpisode(folder)
    lines = [json.loads(line) for line in (folder / "steps.jsonl").read_text().split("\n")[:-1]]
    lines[0]["frame_file"] = name
    (folder / "steps.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    write_record(folder, record.model_copy(update={"files": {}}))
    with pytest.raises(RecordError, match="not a step"):
        _ = RecordedEpisode(folder).digest


@pytest.mark.parametrize("key", ["agent", "verifier"])
def test_a_record_of_somebody_else_cannot_command_a_terminal(folder, key):
    """Tables print who played: such a name wrote to the clipboard of whoever looked at them."""
    record = EpisodeRecord.model_validate_json((folder / "episode.json").read_bytes())
    write_record(folder, record.model_copy(update={key: "oracle\x1b]52;c;aGk=\x07"}))
    with pytest.raises(RecordError, match=r"episode\.json.*no record"):
        RecordedEpisode(folder)


def test_a_record_of_an_earlier_version_with_a_field_less_is_whole(folder):
    path = folder / "episode.json"
    content = json.loads(path.read_bytes())
    del content["seal"], content["limit"]
    said = json.dumps(content, sort_keys=True).encode()
    path.write_text(json.dumps({**content, "seal": hashlib.sha256(said).hexdigest()}, indent=1))
    assert RecordedEpisode(folder).record.limit == ""
    path.write_text(path.read_text().replace('"steps": ', '"steps": 1'))
    with pytest.raises(RecordError, match="changed since it was written"):
        RecordedEpisode(folder)


def test_a_number_that_is_none_is_read_back_on_a_readable_line():
    touch = Contact((0,), "head", "head", 7, False, float("nan"), float("-inf"))
    step = StepRecord(step=0, status="invalid", attempts=(), contacts=(touch,), target_distance=float("nan"))
    assert StepRecord.model_validate_json(step.model_dump_json()).model_dump_json() == step.model_dump_json()


@pytest.mark.parametrize("cost", [float("nan"), float("inf"), -0.01])
def test_nothing_costs_less_than_nothing_or_what_is_no_number(cost):
    with pytest.raises(ValueError, match="not below 0"):
        Usage(10, 5, cost)
    with pytest.raises(ValueError, match="not below 0"):
        Usage(-10, 5)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("motion_frames", -15, "greater than or equal to 0"),
        ("motion_frames", 10**30, "less than or equal to"),
        ("motion_frames", 9000, "frames, and its steps last"),
        ("rise_frames", 10**400, "less than or equal to"),
        ("fall", -5.0, "greater than or equal to 0"),
        ("fall", 1e308, "less than or equal to"),
        ("joint", "tail", "expected a joint of the body; got 'tail'"),
    ],
)
def test_a_sealed_step_that_no_body_could_make_is_refused(folder, field, value, message):
    path = folder / "steps.jsonl"
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    (lines[2] if field in lines[2] else lines[2]["contacts"][0])[field] = value
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    record = EpisodeRecord.model_validate_json((folder / "episode.json").read_bytes())
    digests = record.files | {"steps.jsonl": hashlib.sha256(path.read_bytes()).hexdigest()}
    write_record(folder, record.model_copy(update={"files": digests}))
    with pytest.raises(RecordError, match=message):
        RecordedEpisode(folder).motion()
