"""Tests of providers over HTTP, through litellm: requests to them, and their replies in their own words (replies.toml).

No provider needs anything of its last answer back: each step is a conversation of its own.
"""

import json
import time
from pathlib import Path

import pytest
from model_servers import delayed, dropped, truncated
from model_servers.table import a_call, markdown, providers, rows

from humanclaw import (
    Call,
    CallError,
    Decision,
    HistoryEntry,
    LimitError,
    ProviderError,
)
from humanclaw.records import Feedback
from humanclaw.testing import check
from humanclaw_litellm.settings import ModelError

pytestmark = pytest.mark.integration
DOCS = Path(__file__).parents[3] / "docs" / "results" / "harnesses.md"
WALK = Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0})


@pytest.fixture
def play(begin, view):
    """play(row, replies, ...): take a decision in each step; return the decisions and the requests.

    past: number of steps before. options: of the agent.
    """

    def run(row, replies, steps=1, past=0, **options):
        walked = [Decision((WALK,))] * past
        with row.server(replies) as server:
            agent = begin(server, model=row.model, **{"num_retries": 1, **row.options, **options})
            for step in range(past, past + steps):
                walked.append(agent.decide(view(step), [remembered(*pair) for pair in enumerate(walked)]))
        return walked[past:], server.requests

    def remembered(step, decision):
        return HistoryEntry(step, decision, Feedback(executed=WALK), view(step).rgb)

    return run


# -- replies -----------------------------------------------------------------------------------------------------------
def executed(row, play, skills):
    (decision,), _ = play(row, [row.reply])
    assert check(decision, skills) == WALK
    assert row.thoughts in json.loads(decision.raw)["thoughts"]
    usage = decision.usage
    counted = (usage.tokens_in, usage.tokens_out, usage.tokens_reasoning)
    assert (counted[: len(row.tokens)], usage.estimated) == (row.tokens, False)


def told(row, play, skills):
    (refused, after), requests = play(row, [row.reply, a_call(row.provider).reply], steps=2)
    with pytest.raises(CallError):
        check(refused, skills)
    assert row.says in requests[1].text
    assert check(after, skills) == WALK


def asked_otherwise(row, play, skills):
    good = a_call(row.provider).reply
    decisions, requests = play(row, [row.reply, good, good], steps=2, temperature=0.0)
    assert [check(decision, skills) for decision in decisions] == [WALK, WALK]
    first, *later = [request.raw.get(row.without) for request in requests]
    assert len(later) == 2  # The provider is not asked a second time whether it takes it.
    assert first not in later


def shortened(row, play, skills):
    (decision,), (whole, short) = play(row, [row.reply, a_call(row.provider).reply], past=8)
    assert check(decision, skills) == WALK
    assert len(short.text) < len(whole.text)
    with pytest.raises(LimitError, match="context"):
        play(row, [row.reply] * 20)


def retried(row, play, skills):
    began = time.monotonic()
    good = a_call(row.provider).reply
    (decision,), _ = play(row, [row.reply, good])
    assert check(decision, skills) == WALK
    assert time.monotonic() - began >= row.wait
    with pytest.raises(ProviderError, match=row.says):
        play(row, [row.reply, row.reply, good])  # One retry was asked for, and no client below makes another.


def mended_by_the_user(row, play, skills):
    with pytest.raises(ModelError, match=row.says) as fault:
        play(row, [row.reply] * 8)
    assert fault.value.remedy


@pytest.mark.parametrize("row", rows(), ids=str)
def test_each_reply_becomes_what_the_table_says(row, play, skills):
    globals()[row.then.replace(" ", "_")](row, play, skills)


@pytest.mark.parametrize("row", [row for row in rows() if row.when == "thoughts alone"], ids=str)
def test_thoughts_alone_change_the_way_of_asking(row, play):
    (silent, after), _ = play(row, [row.reply, a_call(row.provider).reply], steps=2)
    first, second = json.loads(silent.raw), json.loads(after.raw)
    assert "parameters" in first["thoughts"]
    assert first["mode"].startswith("tools")
    assert second["mode"] == "schema"
    assert silent.usage.tokens_out > 0


def test_the_docs_show_this_list():
    assert markdown() in DOCS.read_text()


# -- requests ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", providers())
def test_two_steps_are_asked_for_as_the_provider_takes_them(name, play, skills):
    row = a_call(name)
    _, requests = play(row, [row.reply] * 2, steps=2)
    for request in requests:
        assert {message["role"] for message in request.messages} == {"system", "user"}
        assert [part["type"] for part in request.messages[1]["content"]][-2:] == ["text", "image_url"]
        assert request.images[0].shape == (512, 512, 3)
        assert "Find the couch and sit on it." in request.role("system")
        assert json.loads(providers()[name]["sent"]).items() <= request.raw.items()
        assert request.tool_names == list(skills)
    second = json.dumps(requests[1].raw)
    assert "Step 2 of 100" in second
    assert not any(kept in second for kept in (row.thoughts or "?!", "signature", "Signature", "encrypted", "call_id"))


@pytest.mark.parametrize("name", providers())
def test_every_parameter_keeps_its_type_and_bounds(name, play, skills):
    _, (request,) = play(a_call(name), [a_call(name).reply])
    for tool in request.tools:
        for parameter, part in skills[tool["name"]].schema["properties"].items():
            sent = tool["parameters"]["properties"][parameter]
            bounds = (sent["type"].lower(), sent["minimum"], sent["maximum"])
            assert bounds == ("integer", part["minimum"], part["maximum"])
    # litellm turns alternatives into {} for Gemini.
    assert not {"oneOf", "anyOf", "allOf", "$ref"} & set(json.dumps(request.raw).replace('"', " ").split())


# -- connections -------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", providers())
def test_a_lost_connection_or_a_broken_body_is_asked_for_again(name, play, skills):
    row = a_call(name)
    for fault in (dropped(), truncated(row.reply)):
        (decision,), _ = play(row, [fault, row.reply])
        assert check(decision, skills) == WALK
        with pytest.raises(ProviderError):
            play(row, [fault, fault, row.reply])


@pytest.mark.parametrize("name", providers())
def test_a_late_answer_is_a_provider_error(name, play):
    row = a_call(name)
    with pytest.raises(ProviderError, match=r"(?i)time|no answer within"):
        play(row, [delayed(20, row.reply)] * 2, timeout=0.3)
