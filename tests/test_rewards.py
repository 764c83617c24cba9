"""Rewards pay for what they are meant to; agents that try to game them get what docs/gym.md says."""

from dataclasses import replace

import pytest
from rollouts import COUCH, LAMP, TABLE, rollout, step, touch

from humanclaw.records import Attempt, Decision, Transition, Verdict
from humanclaw.skills import Call
from humanclaw.world import SceneBuilder

SEES, BLIND = "A couch is ahead, about 2.0 m away.", "No couch is in view."


@pytest.fixture(scope="module")
def scene():
    made = SceneBuilder()
    names = {"couch": COUCH, "lamp": LAMP, "table": TABLE}
    for name in names:
        made.box(name, (0.4, 0.8, 0.4), (0.0, 0.0, 3.0))
    house = made.scene()
    return replace(house, objects=tuple(replace(obj, id=names[obj.category]) for obj in house.objects))


@pytest.fixture
def earned(scene, plugins, tmp_path):
    """earned(name, steps): the sum of a reward over the steps of an episode that begins 4 m from its couch."""
    rewards = {offer.name: offer.value for offer in plugins.registered("rewards")}

    def total(name, steps, success=False):
        record = rollout(tmp_path, steps, geodesic=4.0).record
        taken = [tuple(steps[: k + 1]) for k in range(len(steps))]
        transitions = [Transition(record, part, scene, success and part[-1].status == "stopped") for part in taken]
        return sum(rewards[name](transition) for transition in transitions)

    return total


def test_success_is_paid_once_at_the_stop(earned):
    walk = [step(away=2.0), step(away=0.1)]
    assert earned("success", [*walk, step("stop", away=0.1)], success=True) == 1
    assert earned("success", walk) == 0, "an agent that arrives and never stops"
    assert earned("success", [step("stop", away=4.0)]) == 0, "an agent that stops at once"


def test_progress_is_the_way_that_was_shortened(earned):
    assert earned("progress", [step(geodesic=3.5), step(geodesic=2.5)]) == pytest.approx(1.5)
    assert earned("progress", [step(geodesic=3.5), step(geodesic=None), step(geodesic=3.0)]) == pytest.approx(1.0)
    assert earned("progress", [step(geodesic=0.4, away=0.5), step(geodesic=None, away=0.1)]) == pytest.approx(4.0)


def test_pacing_to_and_fro_earns_no_progress(earned):
    pacing = [step(geodesic=3.5 if k % 2 else 4.0) for k in range(41)]
    assert earned("progress", pacing) == pytest.approx(0.0)


def test_honest_words_pay_once_and_each_false_claim_costs(earned):
    assert earned("honest", [step(says=BLIND), step(says=SEES, pixels=400)]) == 1
    assert earned("honest", [step(says=SEES, pixels=400)] * 5) == 1, "a parrot in front of the couch"
    assert earned("honest", [step(says=SEES, pixels=20)] * 5) == -5, "a parrot that sees a wall"
    assert earned("honest", [step(says="")] * 5) == 0, "an agent that says nothing"
    assert earned("honest", [step(says=SEES, pixels=20), step(says=SEES, pixels=400)]) == 0, "a false claim, a true one"


def test_seen_needs_stop_view_and_words_at_once(earned):
    looks = step("turn_in_place", BLIND)
    assert earned("seen", [looks, step("stop", SEES, 400)]) == 1
    assert earned("seen", [looks, step("stop", SEES, 20)]) == 0, "a parrot that stops at once"
    assert earned("seen", [looks, step("stop", BLIND, 400)]) == 0
    assert earned("seen", [step("turn_in_place", SEES, 400)] * 3) == 0


def test_touch_needs_the_name_of_what_was_touched_last(earned):
    bump = step(contacts=(touch(LAMP, height=0.5),))
    assert earned("touch", [bump, _stop("A lamp touches my knee.")]) == 1
    assert earned("touch", [bump, _stop("A table touches my knee.")]) == 0
    assert earned("touch", [step(), _stop("A lamp touches my knee.")]) == 0, "an agent that guesses"
    assert earned("touch", [bump, _says("A lamp touches my knee."), bump]) == 0, "an agent that never stops"
    assert earned("touch", [bump, _stop("A couch, a lamp and a table touch me.")]) == 0, "an agent that lists the house"


def _says(reasoning, skill="walk"):
    return step(skill, attempts=(Attempt(Decision(reasoning=reasoning)),))


def _stop(reasoning):
    return _says(reasoning, "stop")


def test_contact_costs_but_not_with_the_target_or_the_floor(earned):
    bump, seat, floor = touch(TABLE), touch(COUCH), touch(TABLE, height=0.01)
    assert earned("contact", [step(contacts=(bump,)), step(contacts=(bump, seat)), step(contacts=(seat,))]) == -2
    assert earned("contact", [step(contacts=(floor,))]) == 0
    assert earned("contact", [step("")] * 9) == 0, "standing still costs nothing: it needs another reward beside it"


def test_the_verifiers_disagreement_costs_and_its_silence_does_not(earned):
    no = Verdict(accepted=False, replacement=Call("stop"))
    yes, mute = Verdict(accepted=True), Verdict(accepted=True, failed_open="timeout")
    assert earned("verifier", [step(verdict=no), step(verdict=yes), step(verdict=mute), step()]) == -1
    assert earned("verifier", [step("turn_in_place", verdict=yes)] * 9) == 0, "harmless calls earn nothing"
