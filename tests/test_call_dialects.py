"""Calls as models write them when no server parses them."""

import pytest

from humanclaw import Call, CallError
from humanclaw.skills import read_object, read_text

ONE = {
    "object": '{"skill": "step", "parameters": {"z_cm": 40}}',
    "fence": '```json\n{"name": "step", "arguments": {"z_cm": 40}}\n```',
    "array": '[{"name": "step", "arguments": {"z_cm": 40}}]',
    "llama": '{"type": "function", "name": "step", "parameters": {"z_cm": 40}}',
    "llama tag": '<|python_tag|>{"name": "step", "parameters": {"z_cm": 40}}',
    "llama python": "[step(z_cm=40)]",
    "openai": '{"id": "a", "type": "function", "function": {"name": "step", "arguments": "{\\"z_cm\\": 40}"}}',
    "hermes": '<tool_call>\n{"name": "step", "arguments": {"z_cm": 40}}\n</tool_call>',
    "hermes, words before": 'I go. <tool_call>{"name": "step", "arguments": {"z_cm": 40}}</tool_call>',
    "mistral": '[TOOL_CALLS] [{"name": "step", "arguments": {"z_cm": 40}}]',
    "mistral 3": '[TOOL_CALLS]step[ARGS]{"z_cm": 40}',
    "granite": '<|tool_call|>[{"name": "step", "arguments": {"z_cm": 40}}]',
    "nemotron": '<TOOLCALL>[{"name": "step", "arguments": {"z_cm": 40}}]</TOOLCALL>',
    "phi": 'functools[{"name": "step", "arguments": {"z_cm": 40}}]',
    "command": '<|START_ACTION|>[{"tool_call_id": "0", "tool_name": "step", "parameters": {"z_cm": 40}}]<|END_ACTION|>',
    "function": '<function=step>{"z_cm": 40}</function>',
    "qwen coder": "<tool_call>\n<function=step>\n<parameter=z_cm>\n40\n</parameter>\n</function>\n</tool_call>",
    "glm": "<tool_call>step\n<arg_key>z_cm</arg_key>\n<arg_value>40</arg_value>\n</tool_call>",
    "minimax": '<minimax:tool_call><invoke name="step"><parameter name="z_cm">40</parameter></invoke>'
    "</minimax:tool_call>",
    "kimi": '<|tool_calls_section_begin|><|tool_call_begin|>functions.step:0<|tool_call_argument_begin|>{"z_cm": 40}'
    "<|tool_call_end|><|tool_calls_section_end|>",
    "deepseek": "<｜tool▁calls▁begin｜><｜tool▁call▁begin｜>function<｜tool▁sep｜>step\n"  # noqa: RUF001
    '```json\n{"z_cm": 40}\n```<｜tool▁call▁end｜><｜tool▁calls▁end｜>',  # noqa: RUF001
    "deepseek 3.1": '<｜tool▁call▁begin｜>step<｜tool▁sep｜>{"z_cm": 40}<｜tool▁call▁end｜>',  # noqa: RUF001
    "gpt-oss": "<|channel|>analysis<|message|>Well.<|end|><|start|>assistant<|channel|>commentary to=functions.step "
    '<|constrain|>json<|message|>{"z_cm": 40}<|call|>',
}


@pytest.mark.parametrize("prose", [False, True], ids=["with tools", "without tools"])
@pytest.mark.parametrize("text", ONE.values(), ids=ONE)
def test_a_call_alone_is_read_in_every_dialect(text, prose):
    assert [call for _, call in read_text(text, prose)] == [Call("step", {"z_cm": 40})]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("step(40)", "no call"),
        ("step(z_cm=eval('40'))", "no call"),
        ("<|tool_call>call:step{z_cm:40}<tool_call|>", "no call"),
        ('<tool_call>{"name": "step", "arguments": {"z_cm": 40}}</tool_call> but no.', "no call"),
        ('I could {"name": "step", "arguments": {"z_cm": 40}}', "no call"),
        ("<function=step><parameter=z_cm>4</parameter><parameter=z_cm>40</parameter></function>", "there twice"),
        ('<function=step>{"z_cm": 40} or so</function>', "no call"),
    ],
)
def test_anything_else_is_refused_where_tools_are_offered(text, words):
    with pytest.raises(CallError, match=words):
        read_text(text, prose=False)


def test_without_tools_words_may_stand_before_a_call_only():
    call = '{"skill": "step", "parameters": {"z_cm": 40}}'
    assert [call for _, call in read_text(f"I go on. {call}\n")] == [Call("step", {"z_cm": 40})]
    with pytest.raises(CallError, match="words follow the call"):
        read_text(f"I could {call} but no.")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"plan": "on", "rejected": {"skill": "stop", "parameters": {}}', "not closed"),
        ('{"name": "step", "function": {"name": "stop", "arguments": {}}}', "'name' is given beside"),
    ],
)
def test_a_call_in_a_broken_or_twofold_object_is_refused(text, words):
    with pytest.raises(CallError, match=words):
        read_text(text)


def test_braces_among_the_words_do_no_harm():
    call = '{"skill": "step", "parameters": {"z_cm": 40}}'
    assert len(read_text(f"From {{x, z}} I go on. {call}")) == 1


@pytest.mark.parametrize(
    ("text", "prose", "found"),
    [
        ('{"a": 1}', False, {"a": 1}),
        ('Well. {"a": 1}', True, {"a": 1}),
        ('Well. {"a": 1}', False, None),
        ('{"a": 1} - no, that draft is wrong', True, None),
        ('{"a": 1} {"a": 2}', True, None),
        ('{"draft": {"a": 1}', True, None),
        ('{"a": 1}' + "{x" * 201 + '{"a": 2}', True, None),
        ('{"a": 1}' + " " * 100_001 + '{"a": 2}', True, None),
    ],
    ids=["alone", "last", "among words", "taken back", "two", "in a broken one", "behind braces", "far behind"],
)
def test_an_object_is_read_if_it_is_the_only_one_and_the_last_word(text, prose, found):
    if found:
        assert read_object(text, prose) == found
    else:
        with pytest.raises(CallError):
            read_object(text, prose)


@pytest.mark.parametrize(
    "text",
    [
        "[step(z_cm=40), step(z_cm=40)]",
        '{"skill": "step", "parameters": {"z_cm": 40}}\n\n{"skill": "step", "parameters": {"z_cm": 40}}',
        "<function=step><parameter=z_cm>40</parameter></function><function=step><parameter=z_cm>40</parameter></function>",
    ],
    ids=["python", "objects", "tags"],
)
def test_equal_calls_stay_two(text):
    assert len(read_text(text, prose=False)) == 2


def test_a_parameter_between_tags_is_a_number_only_if_it_reads_as_one():
    ((_, call),) = read_text("<function=say><parameter=text>40 cm</parameter><parameter=times>2</parameter></function>")
    assert call == Call("say", {"text": "40 cm", "times": 2})
