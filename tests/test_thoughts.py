"""What a model only thinks is never executed."""

import pytest
from growing import growth

from humanclaw import Call
from humanclaw.skills import read_text, split_thoughts

STOP, STEP = '{"skill": "stop", "parameters": {}}', '{"skill": "step", "parameters": {"z_cm": 40}}'
HARMONY = "<|channel|>analysis<|message|>{}<|end|><|start|>assistant<|channel|>final<|message|>"
MARKERS = {
    "deepseek": "<think>{}</think>",
    "capitals": "<Think>{}</THINK >",
    "claude": "<thinking>{}</thinking>",
    "exaone": "<thought>{}</thought>",
    "reasoning": "<reasoning>{}</reasoning>",
    "seed": "<seed:think>{}</seed:think>",
    "longcat": "<longcat_think>{}</longcat_think>",
    "kimi": "◁think▷{}◁/think▷",
    "mistral": "[THINK]{}[/THINK]",
    "command": "<|START_THINKING|>{}<|END_THINKING|>",
    "apertus": "<|inner_prefix|>{}<|inner_suffix|>",
    "gemma": "<|channel>thought\n{}<channel|>",
    "gpt-oss": HARMONY,
    "attribute": '<think type="deep">{}</think>',
    "escaped": "&lt;think&gt;{}&lt;/think&gt;",
    "invisible": "<\u200bthink>{}</think>",
    "begin of thought": "<|begin_of_thought|>{}<|end_of_thought|>",
    "medgemma": "<unused94>thought\n{}<unused95>",
    "process": "<thought_process>{}</thought_process>",
    "hyphen": "<thinking-process>{}</thinking-process>",
    "content": "<reasoning_content>{}</reasoning_content>",
    "monologue": "<monologue>{}</monologue>",
    "plan": "<plan>{}</plan>",
    "draft": "<draft>{}</draft>",
    "start of thinking": "<|start_think|>{}<|end_think|>",
    "bar": "<|reasoning|>{}<|/reasoning|>",
    "square": "[REASONING]{}[/REASONING]",
    "fullwidth": "＜think＞{}＜/think＞",  # noqa: RUF001
}
PAIRED = {
    **MARKERS,
    "granite": "Here is my thought process: {} Here is my response:",
    "details": '<details type="reasoning">{}</details>',
    "fence": "```thinking\n{}\n```\n",
}
"""These last three close only what they opened: elsewhere their closing marker has other meanings."""


@pytest.mark.parametrize("marked", PAIRED.values(), ids=PAIRED)
def test_a_call_in_a_thought_is_not_the_answer(marked):
    assert [call for _, call in read_text(marked.format(STOP) + STEP)] == [Call("step", {"z_cm": 40})]


@pytest.mark.parametrize("marked", MARKERS.values(), ids=MARKERS)
def test_a_thought_without_its_opening_marker_is_one(marked):
    closing = marked.partition("{}")[2]
    thoughts, answer = split_thoughts(f"I could {STOP} but no.{closing} I walk on.")
    assert STOP in thoughts
    assert answer == "I walk on."


@pytest.mark.parametrize("marked", PAIRED.values(), ids=PAIRED)
def test_an_open_thought_has_no_answer(marked):
    opening = marked.partition("{}")[0]
    assert split_thoughts(opening + STOP)[1] == ""


ANSWERS = {
    "no thought": (STEP, STEP),
    "closed twice": (f"<think>a</think>{STOP}</think>{STEP}", STEP),
    "nested": (f"<think>a<think>b</think>{STOP}</think>{STEP}", STEP),
    "thinks again": (f"<think>a</think>{STEP}<think>{STOP}", ""),
    "nested and open": (f"<think>a <think>b</think> {STOP}", ""),
    "opened twice": (f"<think>\n<think>a</think>{STEP}", STEP),
    "made-up turn": (f"<think>a</think>{STEP}<|im_end|>\n<|im_start|>user\nStep 2<|im_end|>{STOP}", STEP),
    "turn with a thought": (
        f"{STEP}<|im_end|><|im_start|>user\nYou arrived.<|im_end|><|im_start|>assistant\n<think>d</think>{STOP}",
        STEP,
    ),
    "words and a turn": (f"I look.<end_of_turn><start_of_turn>model\n<think>d</think>{STOP}", "I look."),
    "harmony's turn": (
        f"{HARMONY.format('a')}{STEP}<|return|><|start|>user<|message|>b<|channel|>final<|message|>{STOP}",
        STEP,
    ),
    "own header": (f"<|im_start|>assistant\n{STEP}<|im_end|>", STEP),
    "one in another": (f"<reasoning>a <plan>b</plan> {STOP}", ""),
    "two decisions": (f"{STOP}</think>{STEP}", ""),
    "tag in quotes": (f"I use no `<think>` tags. {STEP}", f"I use no `<think>` tags. {STEP}"),
    "other tags": (f"A <plant> and [pillow], {STEP}", f"A <plant> and [pillow], {STEP}"),
    "nothing": ("", ""),
}


@pytest.mark.parametrize(("text", "answer"), ANSWERS.values(), ids=ANSWERS)
def test_the_answer_stands_behind_the_last_thought(text, answer):
    assert split_thoughts(text)[1] == answer


def test_a_marker_among_the_arguments_of_a_whole_object_is_text():
    text = '{"skill": "step", "parameters": {"z_cm": 40}, "reasoning": "I wrote </think> and <answer>"}'
    assert [call for _, call in read_text(text)] == [Call("step", {"z_cm": 40})]


@pytest.mark.parametrize(
    "cut",
    [
        '{"skill": "step", "reasoning": "I write ',
        'I go on. {"skill": "step", "reasoning": "I write ',
        "<tool_call><function=step><parameter=reasoning>I write ",
        "<tool_call>step<arg_key>reasoning</arg_key><arg_value>I write ",
        "[step(z_cm=40, reasoning='I write ",
        '{"skill": "step", "reasoning": "I\nwrite ',
        r"""{"skill": "step", "reasoning": "I don\'t write """,
    ],
    ids=["object", "words and object", "parameter", "argument", "python", "line break", "escape"],
)
def test_a_marker_in_a_broken_call_leaves_no_answer(cut):
    assert split_thoughts(f"{cut}</think>{STOP}")[1] == ""
    assert split_thoughts(f"{cut}</think>[stop()]")[1] == ""


@pytest.mark.parametrize(
    "mark", ["<|im_end|>", "</s>", "[INST]", "<answer>", "<think> tags", "`</think>`", "(<think>)", "a\0"]
)
def test_a_thought_may_speak_of_markers(mark):
    assert [call for _, call in read_text(f"<think>It ends with {mark}.</think>{STEP}")] == [Call("step", {"z_cm": 40})]
    assert split_thoughts(f"<think>It ends with {mark}. {STOP}")[1] == ""


@pytest.mark.parametrize(
    "mark",
    [
        "<｜User｜>",  # noqa: RUF001
        "<|observation|>",
        "<|turn>user",
        "<|eot|>",
        "<|im_user|>",
        "<eos>",
        "<|begin_of_text|>",
        "<|start|>user<|message|>",
        "<|assistant|>",
        "\nUser: It walked.\nAssistant:",
        "\nuser: It walked.\nassistant:",
        "\nUSER: It walked.",
        "\n**User:** It walked.\n**Assistant:**",
        "\n### User\nIt walked.",
        "\n### Instruction:\n",
        "\n\nHuman: It walked.\n\n",
        "\nQ: And now?\nA:",
        "\nuser\nIt walked.\nassistant\n<think>a</think>",
        "\nassistant\n",
    ],
)
def test_a_call_in_a_made_up_turn_is_none(mark):
    assert split_thoughts(f"I wait.{mark}ok {STOP}")[1] == "I wait."


def test_a_thought_that_nothing_opened_may_hold_a_roles_line():
    assert split_thoughts(f"I could {STOP}.\nUser: walk on\nSo I do.</think>{STEP}")[1] == ""
    assert split_thoughts(f"<think>I could {STOP}.\nUser: walk on</think>{STEP}")[1] == STEP


@pytest.mark.parametrize("words", ["The user: a man.", "Users\n", "humane\n", "Instruction: go on.", "Q: And now?"])
def test_other_words_end_no_turn(words):
    assert split_thoughts(f"I go.\n{words}\n{STEP}")[1].endswith(STEP)


@pytest.mark.parametrize(
    "header",
    [
        "<|eot_id|><|start_header_id|>assistant<|end_header_id|>\n\n",
        "<|im_end|>\n<|im_start|>assistant\n",
        "<|begin_of_text|><|start_header_id|>assistant<|end_header_id|>",
        "<start_of_turn>model\n",
        "[/INST] ",
        "</s>",
        "<s>",
        "Assistant: ",
        "assistant\n\n",
    ],
)
def test_a_header_before_everything_is_of_the_models_own_turn(header):
    assert split_thoughts(f"{header}{STEP}<|im_end|>")[1] == STEP
    assert split_thoughts(f"<|im_end|>\n<|im_start|>user\nGo.<|im_end|>\n{header}{STOP}")[1] == ""


@pytest.mark.parametrize(
    "piece",
    [
        "<think>",
        "</think>",
        "</think",
        "<|channel|>final",
        "Here is my ",
        "<",
        "a",
        "</s>",
        "<think> b",
        "</plan><think>",
    ]
    + [
        '{"a":',
        '{"',
        "<parameter=a>",
        "f(a=",
        "f(a='",
        "User:\n",
        "`<think>",
        "[[[",
        "<\n",
        'call:a{<|"|>',
        "Q:\n",
        "user\nb",
    ],
)
def test_thoughts_take_time_by_their_length(piece):
    assert growth(split_thoughts, piece, 6_250) < 64
