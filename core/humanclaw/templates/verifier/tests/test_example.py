"""The verifier lets a call pass, or puts a legal one in its place."""

from typing import Annotated

import numpy as np
from pydantic import Field

from humanclaw import Call, EpisodeContext, EpisodeSpec, Keyframes, Observation, Plugins, skill
from humanclaw_example.verifier import ExampleVerifier

SPEC = EpisodeSpec(id="one", instruction="find a couch", scene="house:0")
LEFT = Field(ge=-90, le=90, json_schema_extra={"x-measure": "heading.left"})


@skill(role="locomotion")
def rotate(yaw_deg: Annotated[int, LEFT]) -> Keyframes:
    """Turn on the spot."""
    return Keyframes.cycle("head", "y", 5, 0.5)


@skill(role="stop")
def finish() -> Keyframes:
    """Declare the task complete."""
    return Keyframes.cycle("head", "x", 5, 0.5)


def verdict(step, call, called):
    verifier = ExampleVerifier(least=3)
    verifier.begin(EpisodeContext(SPEC, {"rotate": rotate, "finish": finish}, seed=0))
    return verifier.verify(Observation(step, "", np.zeros((512, 512, 3), np.uint8)), call, called, "")


def test_who_stops_too_early_turns_instead():
    replacement = verdict(2, Call("finish"), finish).replacement
    assert rotate.check(replacement.params) == {"yaw_deg": 30}


def test_whoever_stops_later_or_moves_may_do_so():
    assert verdict(3, Call("finish"), finish).accepted
    assert verdict(0, Call("rotate", {"yaw_deg": 5}), rotate).accepted


def test_it_is_found_once_it_is_installed():
    assert Plugins.discover().make("verifiers", "example", {}).name == "example"
