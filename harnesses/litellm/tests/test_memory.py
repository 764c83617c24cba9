"""The memory of a model: its own note and a sketch map; and how sure it is that the goal is reached."""

import re

import numpy as np
import pytest
from model_servers import OpenAIServer, call

from humanclaw import Call, Decision, HistoryEntry
from humanclaw.records import Displacement, Feedback, Proprioception
from humanclaw.skills import THOUGHTS

pytestmark = pytest.mark.integration

WAY = (
    ("walk", {"z_cm": 80}, "a hall, a lamp 3 m ahead"),
    ("walk", {"z_cm": 80}, ""),
    ("turn_in_place", {"yaw_deg": 45}, "a lamp 1.4 m ahead"),
    ("turn_in_place", {"yaw_deg": 45}, ""),
    ("walk", {"z_cm": 80}, "a door 2 m ahead"),
)
"""Calls with what the model says that it sees: 1.6 m ahead, a quarter turn to the left, 0.8 m ahead."""


@pytest.fixture
def lived(view):
    def make(notes=("", "", "", "", ""), felt=None):
        return [
            HistoryEntry(
                step,
                Decision((Call(name, params),), visible_state=saw, note_to_self=note),
                Feedback(Call(name, params), proprioception=felt),
                view(step).rgb,
            )
            for step, ((name, params, saw), note) in enumerate(zip(WAY, notes, strict=True))
        ]

    return make


@pytest.fixture
def asked(begin, view):
    """asked(history, **options): return the request of the step after a history, and the decision."""

    def ask(history=(), reply=None, **options):
        with OpenAIServer([reply or call("stop")]) as server:
            decision = begin(server, history=0, **options).decide(view(), history)
        return server.requests[0], decision

    return ask


def words(request):
    return " ".join(part.get("text", "") for part in request.messages[1]["content"])


def test_by_default_there_is_no_memory(asked, lived):
    request, _ = asked(lived(["the kitchen is empty", *[""] * 4]))
    assert "kitchen" not in words(request)
    assert "where you have been" not in words(request)
    assert "note_to_self" not in str(request.body)
    assert "expected_success" not in str(request.body)


@pytest.mark.parametrize("memory", ["notes", "map"])
def test_the_last_note_is_read_back_even_without_a_history(asked, lived, memory):
    request, _ = asked(lived(["the kitchen is empty", "the couch is left of the door", "", "", ""]), memory=memory)
    assert "your note to yourself: the couch is left of the door" in words(request)
    assert "kitchen" not in words(request)


def test_a_model_is_asked_for_its_note_and_the_record_holds_it(asked):
    note = {"note_to_self": "the hall has two doors"}
    request, decision = asked((), call("stop", **note), memory="notes", profile="paper")
    assert list(request.tools[0]["parameters"]["properties"])[5] == "note_to_self"
    assert "5. note_to_self: " in request.messages[0]["content"]
    assert decision.note_to_self == "the hall has two doors"
    _, brief = asked((), call("stop", **{THOUGHTS: "progress: none\nnote_to_self: two doors"}), memory="notes")
    assert (brief.progress, brief.note_to_self) == ("none", "two doors")


def test_the_map_shows_each_place_from_where_the_body_is_now(asked, lived):
    request, _ = asked(lived(), memory="map")
    assert re.findall(r"step (\d), (.*?): (.*)", words(request)) == [
        ("1", "0.8 m behind, 1.6 m left, looking 90 degrees right", "a hall, a lamp 3 m ahead"),
        ("5", "0.8 m behind, 0.0 m left, looking 0 degrees left", "a door 2 m ahead"),
    ], "step 3 stood in the cell of step 5"


def test_the_map_trusts_what_the_body_felt_more_than_what_was_called(asked, lived):
    stuck = Displacement(0.0, 0.0, 0.0, 0.0)
    request, _ = asked(lived(felt=Proprioception(0.9, 0.0, stuck, stuck)), memory="map")
    assert re.findall(r"step (\d), (.*?):", words(request)) == [
        ("5", "0.0 m ahead, 0.0 m left, looking 0 degrees left")
    ]


def test_the_map_keeps_the_latest_twelve_places(asked, view):
    walk = Call("walk", {"z_cm": 80})
    seen = Decision((walk,), visible_state="a hall")
    way = [HistoryEntry(step, seen, Feedback(walk), view(0).rgb) for step in range(30)]
    request, _ = asked(way, memory="map")
    steps = [int(step) for step in re.findall(r"step (\d+), ", words(request))]
    assert len(steps) == 12
    assert steps[-1] == 30
    assert np.all(np.diff(steps) >= 1)


@pytest.mark.parametrize(
    ("said", "share"), [(70, 0.7), ("70 %", 0.7), ("0", 0.0), ("likely", None), (0.7, None), (101, None)]
)
def test_a_model_tells_how_likely_the_goal_is_reached(asked, said, share):
    request, decision = asked((), call("stop", expected_success=said), expected_success=True, profile="paper")
    assert decision.expected_success == share
    assert request.tools[0]["parameters"]["properties"]["expected_success"] == {
        "type": "integer",
        "minimum": 0,
        "maximum": 100,
    }
