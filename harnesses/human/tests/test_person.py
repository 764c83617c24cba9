"""Tests of a person's lines and of the page's server."""

import gc
import io
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
from humanclaw_human.commands import forms, in_words, keys, manual, parse
from humanclaw_human.person import Person, Settings
from humanclaw_human.window import LEAVE, PageServer, PageState


@pytest.fixture(scope="module")
def skills(plugins):
    return plugins.skills


PICTURE = np.zeros((8, 8, 3), np.uint8)
PICTURE[:, :4] = (255, 0, 0)


@pytest.mark.parametrize(
    ("line", "skill", "params"),
    [
        ("walk 10 60 5", "walk", {"x_cm": 10, "z_cm": 60, "yaw_deg": 5}),
        ("turn -45", "turn_in_place", {"yaw_deg": -45}),
        ("back 20", "step_back", {"z_cm": 20}),
        ("SIT 50", "sit_in_place", {"h_cm": 50}),
        ("climb 17, 28", "climb_upstairs", {"h_cm": 17, "d_cm": 28}),
        ("stop", "stop", {}),
    ],
)
def test_a_line_is_a_skill_and_its_numbers(skills, line, skill, params):
    call = parse(line, skills).call
    assert call.skill == skill
    assert dict(call.params) == params


def test_what_follows_a_hash_is_what_the_person_sees(skills):
    assert parse("turn 30 # a couch on the left", skills).seen == "a couch on the left"


@pytest.mark.parametrize(
    ("line", "words"),
    [("", "Type a skill"), ("fly 3", "no skill 'fly'"), ("walk far", "whole number"), ("turn 1 2 3", "takes 1"),
     ("turn 900", "yaw_deg"), ("st", "step_back or stop"), ("sit", "h_cm")],
)  # fmt: skip
def test_a_line_that_is_no_call_is_explained(skills, line, words):
    with pytest.raises(CallError, match=words):
        parse(line, skills)


def test_the_manual_names_every_skill_and_its_bounds(skills):
    assert all(name in manual(skills) for name in skills)
    assert "h_cm 20 to 80" in manual(skills)


@pytest.mark.integration
def test_a_person_is_asked_again_until_the_line_is_a_call(skills, capsys):
    lines = iter(["help", "jump", "walk 0 30 # a chair"])
    person = Person(Settings(browser=False), lambda prompt: next(lines))
    spec = EpisodeSpec(id="a", instruction="Find a chair.", scene="house:0")
    person.begin(EpisodeContext(spec, skills, 0))
    decision = person.decide(Observation(0, "Find a chair.", PICTURE, "Executed stop()."), ())
    told = capsys.readouterr().out
    assert decision.calls[0].skill == "walk"
    assert decision.visible_state == "a chair"
    assert "no skill 'jump'" in told
    assert "Executed stop()." in told


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
    window = PageServer(0, pressed.append, lambda line: parse(line, skills))
    yield window
    window.close()


def answered(request):
    try:
        return urlopen(request).status
    except HTTPError as error:
        return error.code


def press(window, line):
    return answered(Request(window.address + "call", line.encode()))


@pytest.mark.integration
def test_a_call_is_taken_while_one_is_waited_for(window, pressed):
    assert press(window, "walk 0 40 0") == 409, "nothing is shown yet"
    window.show(PICTURE, PageState(0, 9, "Find a chair."))
    assert press(window, "fly 3") == 400
    assert press(window, "walk 0 40 0 # a chair") == 204
    assert press(window, "walk 0 40 0") == 409, "the body moves"
    window.show(PICTURE, PageState(1, 9, "Find a chair."))
    window.settle()
    assert press(window, "walk 0 40 0") == 409, "a line was typed"
    assert pressed == ["walk 0 40 0 # a chair"]


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
    assert [answered(there), answered(Request(there, b"walk 0 40 0"))] == [403, 403]
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
    told = capsys.readouterr().out
    assert str(link) in told
    assert person._window.address not in told
    del person
    gc.collect()
    assert not link.exists()


def test_the_page_offers_every_skill_with_what_a_model_is_told_of_it(skills):
    offered = {form["name"]: form for form in forms(skills)}
    assert set(offered) == set(skills)
    part = offered["sit_in_place"]["parameters"][0]
    declared = skills["sit_in_place"].schema["properties"]["h_cm"]
    assert (part["name"], part["minimum"], part["description"]) == ("h_cm", 20, declared["description"])
    assert parse(f"sit_in_place {part['value']}", skills).call.skill == "sit_in_place", "a value to begin with"


@pytest.fixture
def no_terminal(monkeypatch):
    with open(os.devnull) as nothing:
        monkeypatch.setattr("sys.stdin", nothing)
        yield


@pytest.mark.integration
@pytest.mark.usefixtures("no_terminal")
def test_who_leaves_by_the_page_interrupts_the_episode(skills):
    person = begun(skills)
    threading.Timer(0.2, lambda: press(person._window, LEAVE)).start()
    with pytest.raises(KeyboardInterrupt):
        person.decide(Observation(0, "Stop.", PICTURE), ())


@pytest.mark.integration
@pytest.mark.usefixtures("no_terminal")
def test_without_a_terminal_the_page_alone_is_asked(skills):
    person = begun(skills)
    threading.Timer(0.2, lambda: press(person._window, "stop")).start()
    assert person.decide(Observation(0, "Stop.", PICTURE), ()).calls[0].skill == "stop"


@pytest.mark.integration
def test_the_next_person_can_have_the_port_of_the_one_who_is_gone(skills):
    person = begun(skills)
    address = person._window.address
    del person
    gc.collect()
    # With the same address, so that its page goes on.
    assert begun(skills, port=urlsplit(address).port)._window.address == address


def begun(skills, **settings):
    person = Person(Settings(**{"browser": False} | settings))
    person.begin(EpisodeContext(EpisodeSpec(id="a", instruction="Stop.", scene="house:0"), skills, 0))
    return person


def test_every_key_stands_for_a_legal_call_that_moves_that_way(skills):
    calls = {key: parse(line, skills).call for key, line in keys(skills).items()}
    words = in_words(keys(skills), skills)
    assert (words["ArrowUp"], words["ArrowRight"], words["s"]) == ("forward 40 cm", "turn right 37°", "sit down")
    assert calls["ArrowUp"] == Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0})
    assert calls["ArrowLeft"].params["yaw_deg"] == -calls["ArrowRight"].params["yaw_deg"] > 0
    assert [calls[key].skill for key in ("ArrowDown", "Shift+ArrowLeft", "s", "End")] == [
        "step_back", "side_step", "sit_in_place", "stop",
    ]  # fmt: skip


@pytest.mark.integration
def test_a_key_and_a_line_of_the_terminal_are_answers_alike(skills, monkeypatch, capsys):
    read, write = os.pipe()
    monkeypatch.setattr("sys.stdin", os.fdopen(read))
    person = begun(skills)
    window = person._window
    threading.Timer(0.2, lambda: press(window, keys(skills)["ArrowUp"])).start()
    assert person.decide(Observation(0, "Stop.", PICTURE), ()).calls[0].skill == "walk"
    os.write(write, b"stop\n")
    assert person.decide(Observation(1, "Stop.", PICTURE), ()).calls[0].skill == "stop"
    os.close(write)


@pytest.mark.integration
def test_the_end_of_the_input_interrupts_the_episode(skills, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    person = begun(skills)
    with pytest.raises(KeyboardInterrupt):
        person.decide(Observation(0, "Stop.", PICTURE), ())


def test_an_option_of_a_model_is_no_option_of_a_person(plugins):
    with pytest.raises(HumanclawError, match="browser, port, views_between"):
        plugins.make("agents", "human", {"history": 10})
