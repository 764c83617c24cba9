"""Whatever comes in from outside is read or refused in words: no other exception, no illegal call.

HUMANCLAW_FUZZ=N tries N examples of each (`make fuzz`); without it there are a few.
"""

import functools
import json
import os
from contextlib import suppress

import jsonschema
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from made import record_episode
from rooms import two_rooms
from tiny_motion import write_base

from humanclaw import CallError, CheckpointError, HumanclawError, Plugins, RecordedEpisode, RecordError, SceneError
from humanclaw.motion.checkpoint import load_base
from humanclaw.records import read_episodes
from humanclaw.skills import json_objects, read_answer, read_call, read_text
from humanclaw.world import pack_scene, unpack_scene

fuzz = settings(
    max_examples=int(os.environ.get("HUMANCLAW_FUZZ", "8")),
    deadline=None,
    derandomize="HUMANCLAW_FUZZ" not in os.environ,
    suppress_health_check=list(HealthCheck),
    database=None,
)
SKILLS = Plugins.discover().skills
ANY = st.text(st.characters(exclude_categories=()), max_size=60)
"""Half characters included, which UTF-8 cannot hold."""
NUMBERS = st.integers() | st.floats() | st.integers(-90, 90) | st.booleans()
VALUES = st.recursive(
    st.none() | NUMBERS | ANY,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
KEYS = st.sampled_from([*{key for one in SKILLS.values() for key in one.schema["properties"]}, "thoughts", "reasoning"])
PARAMS = st.dictionaries(KEYS | st.text(max_size=8), NUMBERS | VALUES, max_size=5)
NAMES = st.sampled_from(list(SKILLS)) | st.text(max_size=12)


def legal(call):
    """Hold a call to its skill; what passes fits the schema."""
    skill = SKILLS.get(call.skill)
    if skill:
        with suppress(CallError):
            jsonschema.validate(dict(skill.check(call.params)), skill.schema)


# -- what a model writes -----------------------------------------------------------------------------------------------
@fuzz
@given(NAMES, PARAMS | ANY)
def test_any_call_of_a_tool_is_legal_or_refused(name, arguments):
    texts = [arguments] if isinstance(arguments, str) else [arguments, json.dumps(arguments)]
    for given_ in texts:
        with suppress(CallError):
            legal(read_call(name, given_)[1])


@fuzz
@given(st.dictionaries(st.sampled_from(["skill", "name", "parameters", "arguments", "x"]), NAMES | PARAMS, max_size=4))
def test_any_object_is_a_legal_call_or_refused(answer):
    with suppress(CallError):
        legal(read_answer(answer)[1])


@fuzz
@given(st.lists(ANY | PARAMS.map(json.dumps) | st.sampled_from(["{", "```json", "<think>", '"skill":'])))
def test_any_text_is_read_or_refused(pieces):
    text = "".join(pieces)
    list(json_objects(text))
    for prose in (True, False):
        with suppress(CallError):
            for _, call in read_text(text, prose):
                legal(call)


# -- what lies on the disk ---------------------------------------------------------------------------------------------
def damages():
    """Changes of bytes: (place, what is put there, how many go)."""
    one = st.tuples(st.integers(0, 2**20), st.binary(max_size=6), st.integers(0, 40))
    return st.lists(one, min_size=1, max_size=3)


def damaged(data, changes):
    for place, new, gone in changes:
        first = place % (len(data) + 1)
        data = data[:first] + new + data[first + gone :]
    return data


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@functools.cache
def record(home):
    record_episode(home / "couch-0")
    path = home / "couch-0" / "episode.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "seal": "", "files": {}}))
    return {name: (home / "couch-0" / name).read_bytes() for name in ("episode.json", "steps.jsonl", "motion.npz")}


@fuzz
@given(name=st.sampled_from(["episode.json", "steps.jsonl", "motion.npz"]), changes=damages())
def test_any_damage_to_a_record_without_a_seal_is_read_or_refused(home, name, changes):
    whole = record(home)
    for other, data in whole.items():
        (home / "couch-0" / other).write_bytes(damaged(data, changes) if other == name else data)
    with suppress(RecordError):
        found = RecordedEpisode(home / "couch-0")
        found.motion()
        found.objects()


@fuzz
@given(changes=damages())
def test_any_damage_to_a_packed_scene_is_found(changes):
    data = packed()
    changed = damaged(data, changes)
    with suppress(SceneError):
        assert unpack_scene(changed).digest == two_rooms().digest


@functools.cache
def packed():
    return pack_scene(two_rooms())


@fuzz
@given(changes=damages(), text=st.binary(max_size=60))
def test_any_file_of_episodes_is_read_or_refused(home, changes, text):
    line = b'{"id": "a", "instruction": "Find a couch.", "scene": "house:0", "start": {"x": 1, "z": 2, "yaw": 0}}\n'
    for content in (damaged(line, changes), text):
        (home / "split.jsonl").write_bytes(content)
        with suppress(HumanclawError):
            read_episodes(home / "split.jsonl")


@fuzz
@given(changes=damages())
def test_any_damage_to_a_checkpoint_is_read_or_refused(home, changes):
    path = home / "tiny.safetensors"
    (home / "damaged.safetensors").write_bytes(damaged(checkpoint(path), changes))
    with suppress(CheckpointError):
        load_base(home / "damaged.safetensors")


@functools.cache
def checkpoint(path):
    write_base(path)
    return path.read_bytes()


# -- what is seen ------------------------------------------------------------------------------------------------------
@fuzz
@given(st.lists(st.integers(0, 255), min_size=12, max_size=12))
def test_any_picture_is_encoded(values):
    from humanclaw.storage import jpeg

    assert jpeg(np.array(values, np.uint8).reshape(2, 2, 3)).startswith(b"\xff\xd8")
