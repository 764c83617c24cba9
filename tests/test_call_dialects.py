"""Calls as models write them when no server parses them."""

import pytest

from humanclaw import Call, CallError
from humanclaw.skills import read_call, read_objects, read_text

STOP = '{"skill": "stop", "parameters": {}}'

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
    "mistral's id": '[TOOL_CALLS] [{"name": "step", "arguments": {"z_cm": 40}, "id": "abcdEFG12"}]',
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
    "gpt-oss, recipient first": "<|start|>assistant to=functions.step<|channel|>commentary json<|message|>"
    '{"z_cm": 40}<|call|>',
    "mistral, with an id": '[TOOL_CALLS]step[CALL_ID]a1b2c3d4e[ARGS]{"z_cm": 40}</s>',
    "lfm2": "<|tool_call_start|>[step(z_cm=40)]<|tool_call_end|>",
    "lfm2, words behind": "<|tool_call_start|>[step(z_cm=40)]<|tool_call_end|>I go on.",
    "gemma 4": "<|channel>thought\nWell.<channel|><|tool_call>call:step{z_cm:40}<tool_call|>",
    "gemma 4, with a string": '<|tool_call>call:step{reasoning:<|"|>a: {b}, "c"<|"|>,z_cm:40}<tool_call|>',
    "deepseek 3.2": 'I go.\n\n<｜DSML｜function_calls>\n<｜DSML｜invoke name="step">\n'  # noqa: RUF001
    '<｜DSML｜parameter name="z_cm" string="false">40</｜DSML｜parameter>\n'  # noqa: RUF001
    "</｜DSML｜invoke>\n</｜DSML｜function_calls>",  # noqa: RUF001
    "gemini's prefix": '{"name": "default_api.step", "arguments": {"z_cm": 40}}',
    "null": '{"name": "step", "arguments": {"x_cm": null, "z_cm": 40}}',
    "line break in a string": '{"name": "step", "arguments": {"thoughts": "I\ngo", "z_cm": 40}}',
    "seed": "<seed:tool_call><function=step><parameter=z_cm>40</parameter></function></seed:tool_call>",
    "claude": '{"type": "tool_use", "id": "a", "name": "step", "input": {"z_cm": 40}}',
    "openai's list": '{"tool_calls": [{"function": {"name": "step", "arguments": "{\\"z_cm\\": 40}"}}]}',
    "llama's end": '{"name": "step", "parameters": {"z_cm": 40}}<|eom_id|>',
    "answer": '<answer>{"skill": "step", "parameters": {"z_cm": 40}}</answer>\n',
    "action": '<action>{"skill": "step", "parameters": {"z_cm": 40}}</action>',
    "box": '<|begin_of_box|>{"skill": "step", "parameters": {"z_cm": 40}}<|end_of_box|>',
    "latex": '\\boxed{{"skill": "step", "parameters": {"z_cm": 40}}}',
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
        ('<|tool_call>call:step{z_cm:40,thoughts:<|"|>I go<tool_call|>', "no call"),
        ("<|tool_call_start|>[step(z_cm=40)]<|tool_call_end|>I go. {", "no call"),
        ('<tool_call>{"name": "step", "arguments": {"z_cm": 40}}</tool_call> but no.', "no call"),
        ('I could {"name": "step", "arguments": {"z_cm": 40}}', "no call"),
        ('I will not send <answer>{"name": "step", "arguments": {"z_cm": 40}}</answer>', "no call"),
        ('I would say: Here is my response: {"name": "step", "arguments": {"z_cm": 40}}', "no call"),
        ('{"name": "step", "arguments": {"z_cm": 40}}<|end|> No, wrong.', "no call"),
        ("<function=step>", "no call"),
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


def test_every_outermost_object_is_read():
    assert read_objects('Well. {"a": 1} - no, {x} {"a": {"b": 2}}') == [{"a": 1}, {"a": {"b": 2}}]
    for text in ('{"a": 1, "a": 2}', " " * 100_001):
        with pytest.raises(CallError):
            read_objects(text)


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


@pytest.mark.parametrize("prose", [False, True], ids=["with tools", "without tools"])
@pytest.mark.parametrize(
    "mark", ["<answer>{}</answer>", "</think>{}", "<think>{}", "</s>{}", "<tool_call>{}</tool_call>"]
)
@pytest.mark.parametrize(
    "text",
    [
        "<tool_call>\n<function=say>\n<parameter=text>\nI wrote {}\n</parameter>\n</function>\n</tool_call>",
        "<tool_call>say\n<arg_key>text</arg_key>\n<arg_value>I wrote {}</arg_value>\n</tool_call>",
        "[say(text='I wrote {}')]",
        '<|tool_call>call:say{{text:<|"|>I wrote {}<|"|>}}<tool_call|>',
        '<tool_call>{{"name": "say", "arguments": {{"text": "I wrote {0!r}"}}}}</tool_call>',
    ],
    ids=["qwen coder", "glm", "python", "gemma", "hermes"],
)
def test_what_a_whole_call_holds_is_text(text, mark, prose):
    other = "<function=stop></function>" if "{0!r}" in text else '{"skill": "stop", "parameters": {}}'
    ((_, call),) = read_text(f"<think>Well.</think>{text.format(mark.format(other))}<|im_end|>", prose)
    assert call.skill == "say"
    assert other in call.params["text"]


@pytest.mark.parametrize(
    "cut",
    [
        "<tool_call><function=walk><parameter=z_cm>40</parameter><parameter=reasoning>not ",
        "[walk(z_cm=40, reasoning='not ",
        '<|tool_call>call:walk{z_cm:40,reasoning:<|"|>not ',
        '{"skill": "walk", "reasoning": "not ',
    ],
)
def test_a_call_in_a_call_that_is_cut_off_is_refused(cut):
    for text in (f"{cut}{STOP}", f"{cut}<answer>{STOP}</answer>", f"I go on. {cut}<tool_call>{STOP}</tool_call>"):
        for prose in (False, True):
            with pytest.raises(CallError):
                read_text(text, prose)


def test_marks_that_a_server_leaves_on_a_tool_call_are_taken_off():
    for name in (
        *("step", "functions.step", "functions.step:0", "default_api.step", "default_api:step"),
        *("step<|channel|>commentary", "step <|constrain|>json"),
    ):
        assert read_call(name, '{"z_cm": 40}</tool_call></s>')[1] == Call("step", {"z_cm": 40})
    with pytest.raises(CallError, match="words follow"):
        read_call("step", '{"z_cm": 40} or 30')


def test_arguments_may_be_null_and_hold_line_breaks():
    said, call = read_call("step", '{"thoughts": "I\ngo", "x_cm": null, "z_cm": 40, "note_to_self": null}')
    assert (said.reasoning, said.note_to_self, call) == ("I go", "", Call("step", {"z_cm": 40}))


def test_a_parameter_between_tags_is_a_number_only_if_it_reads_as_one():
    ((_, call),) = read_text("<function=say><parameter=text>40 cm</parameter><parameter=times>2</parameter></function>")
    assert call == Call("say", {"text": "40 cm", "times": 2})
