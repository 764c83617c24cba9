"""Tests of faulty agents on a body that executes calls exactly: each fault shows, and a repair removes it."""

from __future__ import annotations

import subprocess
import sys
import weakref

import numpy as np
import pytest
from rooms import asset, block, scene_object, two_rooms
from walker import PICTURE, SKILLS, Walker, play

from humanclaw import Call, EpisodeContext, EpisodeSpec, HumanclawError, Observation
from humanclaw.plugins import read_options
from humanclaw.records import Difficulty, acknowledges
from humanclaw.world import distance_to_box
from humanclaw_scripted.faults import FAULTS
from humanclaw_scripted.faulty import FaultyAgent, OracleVerifier
from humanclaw_scripted.options import FaultyOptions, VerifierOptions

COUCH = 20


def spec(sit: bool, seed: int = 0) -> EpisodeSpec:
    return EpisodeSpec(
        id="test", instruction="Find a couch.", scene=two_rooms().name, target_category="couch", target_ids=(COUCH,),
        interact=sit, max_steps=60, seed=seed,
    )  # fmt: skip


def live(sit: bool = True, seed: int = 0, **given: object) -> tuple[Walker, list]:
    walker = Walker(two_rooms(), (COUCH,), seed)
    return walker, play(FaultyAgent(FaultyOptions.of(given)), walker, spec(sit, seed))


def reach(walker: Walker) -> float:
    return float(distance_to_box(walker.state().body.joints()[-1], *walker.scene.aabb(COUCH)).min())


def test_without_a_fault_it_is_the_oracle():
    walker, log = live()
    assert walker.sat
    assert log[-1][1].skill == "stop"


def test_who_cannot_judge_distances_stops_far_away():
    walker, log = live(sit=False, fault="distance")
    assert log[-1][1].skill == "stop"
    assert 0.2 < reach(walker) < 3.2


def test_who_does_not_notice_the_arrival_never_stops():
    walker, log = live(sit=False, fault="arrival")
    assert len(log) == 60
    assert reach(walker) < 0.4


def test_who_does_not_notice_a_jam_never_arrives():
    walker, log = live(sit=False, fault="jam", seed=2)
    aside = [decision for decision, call in log if call.skill == "side_step"]
    assert len(aside) >= 5
    assert all(acknowledges(decision.visible_state, "couch") for decision in aside)
    assert len(log) == 60
    assert reach(walker) > 1.0


def test_the_blind_never_say_that_they_see_the_target_and_search_on():
    walker, log = live(fault="blindness")
    assert not any(acknowledges(decision.visible_state, "couch") for decision, _ in log)
    assert skills(log)[-8:] == ["turn_in_place"] * 8
    assert reach(walker) > 1.0


def test_who_imagines_the_target_says_that_it_is_there():
    _, log = live(sit=False, fault="imagination")
    assert acknowledges(log[-1][0].visible_state, "couch")
    assert log[-1][1].skill != "stop"


@pytest.mark.parametrize(("fault", "sits"), [("sitting", 0), ("seat", 1)])
def test_who_cannot_sit_comes_to_the_seat_and_does_not_sit_on_it(fault, sits):
    walker, log = live(fault=fault)
    assert log[-1][1].skill == "stop"
    assert sum(call.skill == "sit_in_place" for _, call in log) == sits
    assert reach(walker) < 0.6


def test_who_rises_has_sat_and_stands_at_the_end():
    walker, log = live(fault="rising")
    assert "sit_in_place" in [call.skill for _, call in log]
    assert not walker.sat


def skills(log: list) -> list[str]:
    return [call.skill for _, call in log]


def test_who_fidgets_never_leaves_the_spot():
    walker, log = live(sit=False, fault="fidgeting")
    assert set(skills(log)) == {"turn_in_place"}
    assert np.ptp(np.array(walker.track), axis=0).max() < 0.3


def test_who_dawdles_sets_out_when_sixteen_steps_are_left():
    _, log = live(sit=False, fault="lateness")
    assert set(skills(log[:44])) == {"turn_in_place"}
    assert "walk" in skills(log[44:])


def test_who_loses_heart_stops_where_it_started():
    """A folding screen hides the couch until the body is past it."""
    screen = asset("screen", "screen", block(0.05, 1.8, 3.2))
    walker = Walker(two_rooms(0.9, (screen, scene_object(30, screen, 6.0, 2.6))), (COUCH,))
    log = play(FaultyAgent(FaultyOptions.of({"fault": "give_up"})), walker, spec(False))
    track = np.array(walker.track)
    assert log[-1][1].skill == "stop"
    assert np.linalg.norm(track - track[0], axis=1).max() > 3.0
    assert np.linalg.norm(track[-1] - track[0]) < 0.6


def test_who_wanders_turns_back_again_and_again():
    """The turning point is at 3.2 m or one step further, so 60 steps are enough to come back twice."""
    walker, log = live(sit=False, fault="aimless_search")
    away = np.linalg.norm(np.array(walker.track) - walker.track[0], axis=1)
    returns = np.flatnonzero((away[1:] < 0.5) & (away[:-1] >= 0.5))
    assert len(log) == 60
    assert 2.0 < away.max() < 3.9
    assert len(returns) >= 2


def test_who_backs_up_steps_back_and_never_walks():
    _, log = live(sit=False, fault="backing")
    assert set(skills(log)) <= {"turn_in_place", "step_back", "stop"}
    assert "step_back" in skills(log)


def test_who_gropes_walks_against_the_wall_until_it_has_seen():
    walker, log = live(sit=False, fault="blind_approach")
    assert skills(log)[-8:] == ["walk"] * 8
    assert np.ptp(np.array(walker.track[-100:]), axis=0).max() < 0.1


def test_who_is_confused_sits_on_the_bed_and_stops_at_the_couch():
    """The bed's seat is 50 cm high, the couch's 42 cm. Hips go 10 cm over the seat, but at most to 54 cm."""
    walker, log = live(fault="confusion")
    (sat,) = [call for _, call in log if call.skill == "sit_in_place"]
    assert sat.params["h_cm"] == 54
    assert log[-1][1].skill == "stop"
    assert reach(walker) <= 0.2


@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_putting_the_capability_back_makes_it_the_oracle_again(fault):
    walker, log = live(fault=fault, repair=FAULTS[fault].capability)
    assert walker.sat
    assert log[-1][1].skill == "stop"


@pytest.mark.integration
def test_the_table_of_faults_loads_no_agent():
    """Every command loads the table."""
    script = "import sys; from humanclaw import Plugins; Plugins.discover().registered('faults'); print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert "humanclaw_scripted.faults" in loaded
    assert not {"humanclaw_scripted.oracle", "humanclaw.navigation", "scipy"} & set(loaded)


def test_a_fault_shows_only_in_episodes_that_fit_it():
    near, far = (
        spec(True).model_copy(update={"difficulty": Difficulty(distance=d, turns=0, rooms=3, obstacles=0)})
        for d in (3, 9)
    )
    assert not FAULTS["aimless_search"].fits(near)
    assert FAULTS["aimless_search"].fits(far)
    assert not FAULTS["seat"].fits(spec(False))


def test_a_verifier_that_knows_better_lets_nobody_stop_out_of_reach():
    walker = Walker(two_rooms(), (COUCH,), 0)
    verifier = OracleVerifier(VerifierOptions())
    verifier.begin(EpisodeContext(spec(False), SKILLS, 0, walker.scene, walker.state))
    view = Observation(0, "Find a couch.", PICTURE)
    verdict = verifier.verify(view, Call("stop"), SKILLS["stop"], "")
    assert not verdict.accepted
    assert verdict.replacement.skill != "stop"
    assert verifier.verify(view, Call("walk", {"z_cm": 30}), SKILLS["walk"], "").accepted


def test_a_verifier_that_knows_better_keeps_no_view():
    walker = Walker(two_rooms(), (COUCH,), 0)
    verifier = OracleVerifier(VerifierOptions())
    verifier.begin(EpisodeContext(spec(False), SKILLS, 0, walker.scene, walker.state))
    view = Observation(0, "Find a couch.", PICTURE.copy())
    verifier.verify(view, Call("walk", {"z_cm": 30}), SKILLS["walk"], "")
    seen = weakref.ref(view.rgb)
    del view
    assert seen() is None


@pytest.mark.parametrize("wrong", [{"fault": "hunger"}, {"repair": "abc"}, {"miss": 2}, {"memory": 3}])
def test_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(HumanclawError, match=r"options are|Choose from|repair is one of"):
        FaultyOptions.of(wrong)


@pytest.mark.parametrize("miss", ["abc", 7, -0.1])
def test_a_verifier_that_overlooks_no_probability_is_refused(miss, plugins):
    with pytest.raises(HumanclawError, match="--option miss"):
        plugins.make("verifiers", "oracle", {"miss": miss})


def test_a_verifier_records_its_own_option_and_no_other(plugins):
    verifier = plugins.make("verifiers", "oracle", {"miss": 0.25, "fault": "jam"})
    assert verifier.settings == {"miss": 0.25}


@pytest.mark.parametrize("key", ["miss", "verifier_miss"])
def test_the_verifier_takes_its_option_by_either_name(key):
    assert read_options(VerifierOptions, {key: "0.5"}).miss == 0.5
    with pytest.raises(HumanclawError, match=key):
        read_options(VerifierOptions, {key: 7})
