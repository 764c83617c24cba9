"""The agent makes legal calls, and comes to an end."""

from typing import Annotated

import numpy as np
import pytest
from pydantic import Field

from humanclaw import EpisodeContext, EpisodeSpec, Keyframes, Observation, PluginError, Plugins, skill
from humanclaw_example.agent import ExampleAgent

SPEC = EpisodeSpec(id="one", instruction="find a couch", scene="house:0")
AHEAD = Field(ge=0, le=80, json_schema_extra={"x-measure": "hips.forward"})


@skill(role="locomotion")
def amble(z_cm: Annotated[int, AHEAD]) -> Keyframes:
    """Go forward."""
    return Keyframes.cycle("head", "x", 5, 0.5)


@skill(role="stop")
def finish() -> Keyframes:
    """Declare the task complete."""
    return Keyframes.cycle("head", "x", 5, 0.5)


def look(step):
    return Observation(step, SPEC.instruction, np.zeros((512, 512, 3), np.uint8))


def test_it_goes_forward_until_it_stops():
    agent = ExampleAgent(steps=3, metres=0.4)
    agent.begin(EpisodeContext(SPEC, {"amble": amble, "finish": finish}, seed=0))
    calls = [agent.decide(look(step), ()).calls for step in range(4)]
    assert [call.skill for (call,) in calls] == ["amble", "amble", "amble", "finish"]
    assert amble.check(calls[0][0].params) == {"z_cm": 40}


def test_without_a_skill_that_stops_it_says_so():
    with pytest.raises(PluginError, match="stops"):
        ExampleAgent().begin(EpisodeContext(SPEC, {"amble": amble}, seed=0))


def test_it_is_found_once_it_is_installed():
    assert Plugins.discover().make("agents", "example", {}).name == "example"
