"""Words from the eyes: the oracle tells what its view shows, and nothing that only the map knows."""

import re

import numpy as np
import pytest

from humanclaw import Body, Call, Decision, Episode
from humanclaw.records import SEEN_PIXELS, acknowledges, free_episode
from humanclaw_scripted.depth_mapping import Sight
from humanclaw_scripted.faulty import FaultyAgent
from humanclaw_scripted.narration import Seen, narrated
from humanclaw_scripted.options import FaultyOptions
from humanclaw_scripted.oracle import OracleAgent

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def played(plugins):
    """What an oracle said in a house whose couch is out of view at the start: (words, view) of each step."""
    with Body("house:0", plugins=plugins) as body:
        spec = free_episode("find a couch and sit on it", body.scene, max_steps=60)
        with Episode(body, spec, OracleAgent("eyes")) as episode:
            steps = []
            while not episode.done:
                view = body.view()
                steps.append((episode.ask().decision, view))
        assert episode.success
        return steps, spec, body.scene


def test_it_claims_the_target_exactly_where_its_view_shows_it(played):
    steps, spec, _ = played
    shown = [int(np.isin(view.ids, spec.target_ids).sum()) >= SEEN_PIXELS for _, view in steps]
    assert [acknowledges(said.visible_state, "couch") for said, _ in steps] == shown
    assert True in shown
    assert False in shown


def test_its_words_name_no_room_and_no_length_that_it_cannot_see(played):
    steps, _, scene = played
    rooms = {room.name.replace("_", " ") for room in scene.rooms} | {room.kind for room in scene.rooms}
    for said, view in steps:
        words = " ".join((said.visible_state, said.progress, said.mid_level_goal, said.reasoning)).lower()
        assert not [room for room in rooms if re.search(rf"\b{room}\b", words)]
        farthest = float(view.depth[np.isfinite(view.depth)].max()) * 1.5
        assert all(float(metres) <= farthest for metres in re.findall(r"([\d.]+) m\b", words))


def test_the_words_are_a_function_of_view_call_and_earlier_words(plugins):
    """The same view and call give the same words, whatever lies behind the walls: narrated() is given nothing else."""
    points = np.array([[0.3, 0.5, 2.0], [0.4, 0.6, 2.0], [0.0, 0.5, 3.0]])
    seen = Seen.of(Sight(points, np.array([True, True, False]), 400))
    call = Call("walk", {"x_cm": -10, "z_cm": 40, "yaw_deg": 0})
    said = narrated(
        Decision((call,), visible_state="I am in the kitchen.", progress="7.2 m left."),
        seen,
        "couch",
        plugins.skills,
        (),
    )
    assert said.visible_state == "A couch is in view, ahead, about 2.0 m away. 3.0 m of floor ahead are free."
    assert said.reasoning == "I go 10 cm to the right and go 40 cm ahead: the couch is ahead."
    assert (said.progress, said.mid_level_goal) == ("I begin. Approach.", "Get to the couch that I have seen.")
    unseen = narrated(Decision((call,)), Seen(None, np.inf), "couch", plugins.skills, ())
    assert unseen.visible_state == "No couch is in view. The floor ahead is free."
    assert unseen.reasoning.endswith("I look for the couch.")


def test_a_fault_that_goes_by_the_map_does_not_say_so(plugins):
    """The fault turns to where the toilet is, behind walls. Its words are those of somebody who looks for one."""
    agent = FaultyAgent(FaultyOptions(fault="blind_approach", words="eyes"))
    with (
        Body("house:0", plugins=plugins) as body,
        Episode(body, free_episode("find a toilet", body.scene), agent) as episode,
    ):
        said = episode.ask().decision
    assert not acknowledges(said.visible_state, "toilet")
    assert said.reasoning == "I turn 75 degrees to the left: I look for the toilet."
