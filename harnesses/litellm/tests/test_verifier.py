"""Tests of the verifier against a scripted model behind a real HTTP server."""

import json

import pytest
from model_servers import OpenAIServer, call, calls, no_choices, refusing, status, text

from humanclaw import Call
from humanclaw_litellm.settings import ModelError

pytestmark = pytest.mark.integration

WALK = Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0})


def verdict(*answers, **rest):
    """Return the arguments of a verdict: yes or no to each check in turn."""
    numbered = {f"check_{number}_answer": answer for number, answer in enumerate(answers, start=1)}
    seen = {f"check_{number}_evidence": "a wall" for number, _ in enumerate(answers, start=1)}
    return seen | numbered | rest


NO = json.dumps(verdict("no", skill="stop", parameters={}))


@pytest.fixture
def verify(begin, view, skills):
    """verify(reply, ...): return the verdict on a call, and the requests that were made for it."""

    def ask(*replies, about=WALK, **options):
        with OpenAIServer(replies) as server:
            verifier = begin(server, "verifiers", num_retries=1, **options)
            return verifier.verify(view(), about, skills[about.skill], "reach the couch"), server.requests

    return ask


@pytest.fixture
def yes(skills):
    return ["yes"] * len(skills["walk"].checks)


def test_a_call_that_passes_every_check_is_accepted(verify, yes, skills):
    ruling, requests = verify(call("verdict", **verdict(*yes)))
    assert (ruling.accepted, ruling.replacement, ruling.failed_open) == (True, None, "")
    assert [(answer.check, answer.passed) for answer in ruling.answers] == [(c.id, True) for c in skills["walk"].checks]
    assert ruling.usage.tokens_in == 1000
    assert len(requests) == 1


def test_a_failed_check_puts_another_call_in_its_place(verify, yes):
    other = {"skill": "turn_in_place", "parameters": {"yaw_deg": 30}}
    ruling, _ = verify(call("verdict", **verdict("no", *yes[1:], **other)))
    assert (ruling.accepted, ruling.replacement) == (False, Call("turn_in_place", {"yaw_deg": 30}))
    assert (ruling.answers[0].passed, ruling.answers[0].note) == (False, "a wall")


def test_the_model_sees_one_view_and_this_checklist(verify, yes, skills):
    _, (request,) = verify(call("verdict", **verdict(*yes)))
    assert len(request.images) == 1
    assert request.images[0].shape == (512, 512, 3)
    prompt = request.role("user")
    assert all(check.question in prompt for check in skills["walk"].checks)
    assert not any(check.question in request.text for check in skills["stop"].checks)
    assert "walk(x_cm=0, z_cm=40, yaw_deg=0)" in prompt
    assert "reach the couch" in prompt
    assert len(request.messages) == 2


def test_a_verifier_without_pictures_sends_none(verify, yes):
    """images=0 is for a model that takes none; its server would refuse the request."""
    ruling, (request,) = verify(call("verdict", **verdict(*yes)), images=0)
    assert (ruling.accepted, request.images) == (True, [])


def test_a_replacement_can_be_any_skill_of_the_pool(verify, yes, skills):
    _, (request,) = verify(call("verdict", **verdict(*yes)))
    properties = request.tools[0]["parameters"]["properties"]
    assert properties["skill"]["enum"] == list(skills)
    assert {"yaw_deg", "h_cm", "z_cm"} <= set(properties["parameters"]["properties"])
    assert list(properties)[-2:] == ["skill", "parameters"]


def test_a_skill_without_checks_passes_unasked(verify, skills):
    assert not skills["step_back"].checks
    ruling, requests = verify(about=Call("step_back", {"z_cm": 20}))
    assert ruling.accepted
    assert requests == []


@pytest.mark.parametrize(
    ("replies", "reason"),
    [
        ([status(500)] * 2, "gave no answer"),
        ([no_choices()] * 2, "held no choices"),
        ([text("Looks fine to me.")], "held no verdict"),
        ([calls(("verdict", '{"check_1_answer": "n'))], "held no verdict"),
        ([calls(("verdict", '{"check_1_answer": "no", "check_1_answer": "yes"}'))], "held no verdict"),
        ([text(json.dumps(verdict("no", skill="stop")), finish_reason="content_filter")], "held no verdict"),
        ([call("verdict", check_1_answer="maybe")], "no answer to path_clear"),
        ([call("verdict", **verdict("no"))], "no other call"),
        ([call("verdict", **verdict("no", skill="walk", parameters=dict(WALK.params)))], "no other call"),
    ],
)
def test_without_a_usable_verdict_the_call_passes(verify, replies, reason):
    ruling, _ = verify(*replies)
    assert ruling.accepted
    assert reason in ruling.failed_open


@pytest.mark.parametrize("marker", ["</think>", "◁/think▷", "[/THINK]"])
def test_a_draft_in_a_thought_is_no_verdict(verify, yes, marker):
    draft, final = json.dumps(verdict(*yes)), json.dumps(verdict("no", skill="stop", parameters={}))
    ruling, _ = verify(text(f"Perhaps {draft}? No.{marker}{final}"), mode="prompt")
    assert ruling.replacement == Call("stop")


@pytest.mark.parametrize(
    "reply",
    [
        text(f"```json\n{NO}\n```"),
        text(f"<think>The draft is {NO}</think><answer>{NO}</answer>"),
        text(f'<tool_call>{{"name": "verdict", "arguments": {NO}}}</tool_call>'),
        calls(("functions.verdict", NO)),
        calls(("verdict<|channel|>commentary", f"{NO}</s>")),
    ],
    ids=["fence", "answer mark", "call as text", "prefix", "end mark"],
)
def test_a_no_is_read_in_whatever_marks_it_stands(verify, reply):
    assert verify(reply)[0].replacement == Call("stop")


@pytest.mark.parametrize("mode", ["tools", "schema", "prompt"])
@pytest.mark.parametrize(
    "said",
    [
        f"A wall is close.\n{NO}",
        f"```json\n{NO}\n```\nA wall is close.",
        f"{NO}\n{NO}",
        f'<tool_call>{{"name": "verdict", "arguments": {NO}}}</tool_call> A wall is close.',
        f'{{"verdict": {NO}}}',
        NO.replace("a wall", "a\nwall").replace("\\n", "\n"),
    ],
    ids=["words before", "words behind", "twice", "call and words", "wrapped", "line break"],
)
def test_a_no_is_never_a_pass_whatever_stands_around_it(verify, said, mode):
    assert verify(text(said), mode=mode)[0].replacement == Call("stop")


@pytest.mark.parametrize("word", ["No, a chair is in the way", "**no**", "no - blocked", "'NO'", "_no_", False])
def test_the_first_word_answers_a_check(verify, yes, word):
    ruling, _ = verify(call("verdict", **verdict(word, *yes[1:], skill="stop")))
    assert ruling.replacement == Call("stop")
    assert [answer.passed for answer in ruling.answers] == [False, *([True] * len(yes[1:]))]


@pytest.mark.parametrize("word", ["Yes, nothing is in the way", "**yes**", "nothing", "not sure"])
def test_another_first_word_is_no_no(verify, yes, word):
    assert verify(call("verdict", **verdict(word, *yes[1:], skill="stop")))[0].accepted


def test_parameters_of_the_other_call_may_stand_beside_the_answers(verify):
    ruling, _ = verify(call("verdict", **verdict("no", skill="turn_in_place", yaw_deg=30, remark="left")))
    assert ruling.replacement == Call("turn_in_place", {"yaw_deg": 30})


def test_of_verdicts_that_differ_none_counts(verify, yes):
    several = [verdict(*yes), verdict("no", skill="stop")]
    for reply in (text("\n".join(map(json.dumps, several))), calls(*(("verdict", answers) for answers in several))):
        ruling, _ = verify(reply)
        assert (ruling.accepted, ruling.answers) == (True, ())
        assert "several" in ruling.failed_open


def test_a_wrong_key_is_not_passed_over(verify):
    with pytest.raises(ModelError, match="key"):
        verify(status(401))


def test_a_model_without_tools_verifies_in_words(begin, view, skills):
    answer = text(json.dumps(verdict("no", skill="stop", parameters={})))
    with OpenAIServer(refusing("tools", refusing("response_format", [answer]))) as server:
        ruling = begin(server, "verifiers").verify(view(), WALK, skills["walk"], "")
    assert ruling.replacement == Call("stop")
    assert "check_1_answer" in server.requests[-1].role("system")
