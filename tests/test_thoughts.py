"""What a model only thinks is never executed."""

import time

import pytest

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
    "granite": "Here is my thought process: {} Here is my response:",
    "hunyuan": "<think>{}</think><answer>",
    "attribute": '<think type="deep">{}</think>',
    "escaped": "&lt;think&gt;{}&lt;/think&gt;",
    "invisible": "<\u200bthink>{}</think>",
    "begin of thought": "<|begin_of_thought|>{}<|end_of_thought|>",
    "medgemma": "<unused94>thought\n{}<unused95>",
}


@pytest.mark.parametrize("marked", MARKERS.values(), ids=MARKERS)
def test_a_call_in_a_thought_is_not_the_answer(marked):
    assert [call for _, call in read_text(marked.format(STOP) + STEP)] == [Call("step", {"z_cm": 40})]


@pytest.mark.parametrize("marked", MARKERS.values(), ids=MARKERS)
def test_a_thought_without_its_opening_marker_is_one(marked):
    closing = marked.partition("{}")[2]
    thoughts, answer = split_thoughts(f"I could {STOP} but no.{closing} I walk on.")
    assert STOP in thoughts
    assert answer == "I walk on."


@pytest.mark.parametrize("marked", MARKERS.values(), ids=MARKERS)
def test_an_open_thought_has_no_answer(marked):
    opening = marked.partition("{}")[0]
    assert split_thoughts(opening + STOP)[1] == ""


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        (STEP, STEP),
        (f"<think>a</think>{STOP}</think>{STEP}", STEP),
        (f"<think>a<think>b</think>{STOP}</think>{STEP}", STEP),
        (f"<think>a</think>{STEP}<think>{STOP}", ""),
        (f"<think>a <think>b</think> {STOP}", ""),
        (f"<think>\n<think>a</think>{STEP}", STEP),
        (f"<think>a</think>{STEP}<|im_end|>\n<|im_start|>user\nStep 2<|im_end|>{STOP}", STEP),
        (
            f"{STEP}<|im_end|><|im_start|>user\nYou arrived.<|im_end|><|im_start|>assistant\n<think>d</think>{STOP}",
            STEP,
        ),
        (f"I look.<end_of_turn><start_of_turn>model\n<think>d</think>{STOP}", "I look."),
        (f"{HARMONY.format('a')}{STEP}<|return|><|start|>user<|message|>b<|channel|>final<|message|>{STOP}", STEP),
        (f"<|im_start|>assistant\n{STEP}<|im_end|>", STEP),
        (f"<answer>{STEP}</answer>\n", STEP),
        (f"<answer>{STEP}</answer> No, I stay.", ""),
        (f"<answer>{STEP}</answer><answer>{STOP}</answer>", ""),
        ("", ""),
    ],
    ids=[
        "no thought",
        "closed twice",
        "nested",
        "thinks again",
        "nested and open",
        "opened twice",
        "made-up turn",
        "turn with a thought",
        "words and a turn",
        "harmony's turn",
        "own header",
        "marked answer",
        "taken back",
        "two answers",
        "nothing",
    ],
)
def test_the_answer_stands_behind_the_last_thought(text, answer):
    assert split_thoughts(text)[1] == answer


def test_a_marker_among_the_arguments_of_a_whole_object_is_text():
    text = '{"skill": "step", "parameters": {"z_cm": 40}, "reasoning": "I wrote </think> and <answer>"}'
    assert [call for _, call in read_text(text)] == [Call("step", {"z_cm": 40})]


@pytest.mark.parametrize("marker", ["</think>", "<answer>"])
def test_a_marker_in_a_broken_object_leaves_no_answer(marker):
    assert split_thoughts(f'{{"skill": "step", "reasoning": "I write {marker}{STOP}')[1] == ""


@pytest.mark.parametrize("mark", ["<｜User｜>", "<|observation|>", "<|turn>user", "<|eot|>", "<|im_user|>", "<eos>"])  # noqa: RUF001
def test_a_call_in_a_made_up_turn_is_none(mark):
    assert split_thoughts(f"I wait.{mark}ok {STOP}")[1] == "I wait."


@pytest.mark.parametrize(
    "piece", ["<think>", "</think>", "</think", "<|channel|>final", "Here is my ", "<", "a", "</s>"]
)
def test_thoughts_take_time_by_their_length(piece):
    """Four times the text takes about four times as long; a quadratic search would take 16 times."""

    def seconds(length):
        text = piece * (length // len(piece))
        began = time.process_time()
        for _ in range(3):
            split_thoughts(text)
        return time.process_time() - began

    short, long = (min(seconds(length) for _ in range(5)) for length in (50_000, 200_000))
    assert long < 10 * short
