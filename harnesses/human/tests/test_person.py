"""Tests of a person's calls and of the page's server."""

import gc
import json
import os
import queue
import threading
from pathlib import Path
from urllib.error import HTTPError
from urllib.parse import unquote, urlsplit
from urllib.request import Request, urlopen

import numpy as np
import pytest

from humanclaw import Call, CallError, EpisodeContext, EpisodeSpec, HumanclawError, Observation
from humanclaw.storage import jpeg
from humanclaw_human.commands import forms, keys, read
from humanclaw_human.person import Person, Settings
from humanclaw_human.window import PageServer, PageState


@pytest.fixture(scope="module")
def skills(plugins):
    return plugins.skills


PICTURE = np.zeros((8, 8, 3), np.uint8)
PICTURE[:, :4] = (255, 0, 0)


def sent(name, seen="", **params):
    """Return a call as the page sends it."""
    return json.dumps({"skill": name, "params": params, "seen": seen}).encode()


WALK = sent("walk", x_cm=0, z_cm=40, yaw_deg=0)
STOP = sent("stop")


def test_a_call_of_the_page_is_a_decision_with_what_the_person_sees(skills):
    decision = read(sent("turn_in_place", " a couch on the left ", yaw_deg=-45), skills)
    assert decision.calls == (Call("turn_in_place", {"yaw_deg": -45}),)
    assert decision.visible_state == "a couch on the left"


@pytest.mark.parametrize(
    ("call", "words"),
    [(b"", "A call has skill, params and seen"), (b"\xff", "A call has skill"), (sent("fly"), "no skill 'fly'"),
     (sent("turn_in_place", yaw_deg="far"), "yaw_deg"), (sent("turn_in_place", yaw_deg=900), "yaw_deg"),
     (sent("sit_in_place"), "h_cm")],
)  # fmt: skip
def test_what_is_no_call_is_explained(skills, call, words):
    with pytest.raises(CallError, match=words):
        read(call, skills)


@pytest.mark.integration
def test_the_view_is_served_to_this_machine_with_the_steps_words():
    window = PageServer()
    try:
        past, between = (("turn", "You turned."),), (b"first", b"second")
        window.show(PICTURE, PageState(3, 100, "Find a chair.", "You walked.", past, between))
        assert json.load(urlopen(window.address + "state")) == {
            "step": 3, "of": 100, "instruction": "Find a chair.", "feedback": "You walked.",
            "past": [["turn", "You turned."]], "between": 2,
        }  # fmt: skip
        assert [urlopen(window.address + f"between-{k}.jpg").read() for k in range(2)] == [b"first", b"second"]
        assert urlopen(window.address + "view.jpg?3").read() == jpeg(PICTURE), "what a model would be shown"
        assert b"<img" in urlopen(window.address).read()
        with pytest.raises(HTTPError, match="404"):
            urlopen(window.address + "etc/passwd")
    finally:
        window.close()


@pytest.fixture
def pressed():
    return []


@pytest.fixture
def window(pressed, skills):
    window = PageServer(0, pressed.append, lambda call: read(call, skills))
    yield window
    window.close()


def answered(request):
    try:
        return urlopen(request).status
    except HTTPError as error:
        return error.code


def press(window, call, place="call"):
    return answered(Request(window.address + place, call))


@pytest.mark.integration
def test_a_call_is_taken_while_one_is_waited_for(window, pressed):
    assert press(window, WALK) == 409, "nothing is shown yet"
    window.show(PICTURE, PageState(0, 9, "Find a chair."))
    assert press(window, sent("fly")) == 400
    assert press(window, WALK) == 204
    assert press(window, WALK) == 409, "the body moves"
    assert [decision.calls for decision in pressed] == [(Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}),)]


@pytest.mark.integration
def test_the_page_ends_with_the_result_and_then_the_replay(skills, window, tmp_path):
    person = begun(skills)
    person.show_result("stopped after 3 steps.", tmp_path)
    assert "result" not in json.load(urlopen(window.address + "state")), "another person's page goes on"
    window = person._window
    assert json.load(urlopen(window.address + "state"))["result"] == "stopped after 3 steps."
    assert answered(window.address + "replay") == 404, "it is still being made"
    (tmp_path / "report.html").write_text("a replay")
    assert urlopen(window.address + "replay").read() == b"a replay"


@pytest.mark.integration
@pytest.mark.parametrize("path", ["/", "/state", "/view.jpg", "/call", "/x/state", "/x/call", "//call", "/call/"])
def test_who_does_not_know_the_address_sees_and_presses_nothing(window, pressed, path):
    window.show(PICTURE, PageState(0, 9, "Find a chair."))
    there = f"http://{urlsplit(window.address).netloc}{path}"
    assert [answered(there), answered(Request(there, WALK))] == [403, 403]
    assert pressed == []


@pytest.mark.integration
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such modes")
def test_the_address_stands_in_a_file_of_this_user_alone(skills, capsys, monkeypatch):
    opened = queue.Queue()
    monkeypatch.setattr("webbrowser.open", opened.put)
    person = begun(skills, browser=True)
    link = Path(unquote(urlsplit(opened.get(timeout=5)).path))
    assert person._window.address in link.read_text()
    assert link.parent.stat().st_mode & 0o077 == 0
    output = capsys.readouterr().out
    assert str(link) in output
    assert person._window.address not in output
    del person
    gc.collect()
    assert not link.exists()


def test_the_page_offers_every_skill_with_what_a_model_is_told_of_it(skills):
    offered = {form["name"]: form for form in forms(skills)}
    assert set(offered) == set(skills)
    part = offered["sit_in_place"]["parameters"][0]
    declared = skills["sit_in_place"].schema["properties"]["h_cm"]
    assert (part["name"], part["minimum"], part["description"]) == ("h_cm", 20, declared["description"])
    assert read(sent("sit_in_place", h_cm=part["value"]), skills).calls, "a value to begin with"


@pytest.mark.integration
def test_who_leaves_by_the_page_interrupts_the_episode(skills):
    person = begun(skills)
    threading.Timer(0.2, lambda: press(person._window, b"", "leave")).start()
    with pytest.raises(KeyboardInterrupt):
        person.decide(Observation(0, "Stop.", PICTURE), ())


@pytest.mark.integration
def test_a_call_of_the_page_is_what_the_person_decides(skills):
    person = begun(skills)
    threading.Timer(0.2, lambda: press(person._window, STOP)).start()
    assert person.decide(Observation(0, "Stop.", PICTURE), ()).calls[0].skill == "stop"


@pytest.mark.integration
def test_the_next_person_can_have_the_port_of_the_one_who_is_gone(skills):
    person = begun(skills)
    address = person._window.address
    del person
    gc.collect()
    # With the same address, so that its page goes on.
    assert begun(skills, port=urlsplit(address).port)._window.address == address


@pytest.mark.integration
def test_a_taken_port_is_told_before_the_body_is_made(skills):
    port = urlsplit((first := begun(skills))._window.address).port
    with pytest.raises(HumanclawError, match=f"cannot listen on port {port} of 127.0.0.1"):
        Person(Settings(browser=False, port=port)).ready("Stop.")
    Person(Settings(browser=False)).ready("Stop.")
    assert first._window.visited is False


def begun(skills, **settings):
    person = Person(Settings(**{"browser": False} | settings))
    person.begin(EpisodeContext(EpisodeSpec(id="a", instruction="Stop.", scene="house:0"), skills, 0))
    return person


def test_every_key_stands_for_a_legal_call_that_moves_that_way(skills):
    calls = keys(skills)
    for key in calls.values():
        assert read(sent(key.skill, **key.params), skills).calls
    words = [calls[name].words for name in ("ArrowUp", "ArrowRight", "s")]
    assert words == ["forward 40 cm", "turn right 37°", "sit down"]
    assert (calls["ArrowUp"].skill, calls["ArrowUp"].params) == ("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0})
    assert calls["ArrowLeft"].params["yaw_deg"] == -calls["ArrowRight"].params["yaw_deg"] > 0
    assert [calls[name].skill for name in ("ArrowDown", "Shift+ArrowLeft", "s", "End")] == [
        "step_back", "side_step", "sit_in_place", "stop",
    ]  # fmt: skip


def test_an_option_of_a_model_is_no_option_of_a_person(plugins):
    with pytest.raises(HumanclawError, match="browser, port, views_between"):
        plugins.make("agents", "human", {"history": 10})
