"""Whatever comes in from outside is read or refused in words: no other exception, no illegal call.

`make fuzz` tries 12,500 examples of each; else `fuzzing` sets a few.
"""

import json
from contextlib import suppress

import fuzzing  # noqa: F401
import jsonschema
import numpy as np
from hypothesis import given, strategies as st

from humanclaw import CallError, Plugins
from humanclaw.skills import read_answer, read_call, read_objects, read_text

SKILLS = Plugins.discover().skills
ANY = st.text(st.characters(exclude_categories=()), max_size=60)
"""Half characters included, which UTF-8 cannot hold."""
NUMBERS = st.integers() | st.floats() | st.integers(-90, 90) | st.booleans()
VALUES = st.recursive(
    st.none() | NUMBERS | ANY,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
KEYS = st.sampled_from([*{key for s in SKILLS.values() for key in s.schema["properties"]}, "thoughts", "reasoning"])
PARAMS = st.dictionaries(KEYS | st.text(max_size=8), NUMBERS | VALUES, max_size=5)
NAMES = st.sampled_from(list(SKILLS)) | st.text(max_size=12)


def legal(call):
    """Hold a call to its skill; what passes fits the schema."""
    skill = SKILLS.get(call.skill)
    if skill:
        with suppress(CallError):
            jsonschema.validate(dict(skill.check(call.params)), skill.schema)


# -- what a model writes -----------------------------------------------------------------------------------------------
@given(NAMES, PARAMS | ANY)
def test_any_call_of_a_tool_is_legal_or_refused(name, arguments):
    texts = [arguments] if isinstance(arguments, str) else [arguments, json.dumps(arguments)]
    for given_ in texts:
        with suppress(CallError):
            legal(read_call(name, given_)[1])


@given(st.dictionaries(st.sampled_from(["skill", "name", "parameters", "arguments", "x"]), NAMES | PARAMS, max_size=4))
def test_any_object_is_a_legal_call_or_refused(answer):
    with suppress(CallError):
        legal(read_answer(answer)[1])


@given(st.lists(ANY | PARAMS.map(json.dumps) | st.sampled_from(["{", "```json", "<think>", '"skill":'])))
def test_any_text_is_read_or_refused(pieces):
    text = "".join(pieces)
    for prose in (True, False):
        with suppress(CallError):
            read_objects(text)
        with suppress(CallError):
            for _, call in read_text(text, prose):
                legal(call)


MARKS = [
    "<answer>",
    "</answer>",
    "</s>",
    "[INST]",
    "<|im_end|>",
    "<tool_call>",
    "```json\n",
    "in <think> tags ",
    '{"a": ',
    "it's ",
]
DRAFTS = ['{"skill": "stop", "parameters": {}}', '<tool_call>{"name": "stop", "arguments": {}}</tool_call>', "[stop()]"]


@given(st.lists(st.sampled_from([*MARKS, *DRAFTS])), st.lists(st.sampled_from([*MARKS, *DRAFTS, "</think>"])))
def test_a_call_in_a_thought_is_none_and_a_whole_call_is_always_one(thought, words):
    call = json.dumps({"skill": "say", "parameters": {"text": "".join(words)}})
    for prose in (True, False):
        for text in (call, f"<think>{''.join(thought)}</think>{call}"):
            assert [call.params["text"] for _, call in read_text(text, prose)] == ["".join(words)]
        with suppress(CallError):
            assert not read_text(f"<think>{''.join(thought)}", prose)


# -- what is seen ------------------------------------------------------------------------------------------------------
@given(st.lists(st.integers(0, 255), min_size=12, max_size=12))
def test_any_picture_is_encoded(values):
    from humanclaw.storage import jpeg

    assert jpeg(np.array(values, np.uint8).reshape(2, 2, 3)).startswith(b"\xff\xd8")
