"""A reward that costs a tenth a step, and 1 for a call that was refused."""

from humanclaw import hookimpl
from humanclaw.plugins import Register, Reward
from humanclaw.records import Transition


def haste(transition: Transition) -> float:
    return -1.0 if transition.step.call is None else -0.1


@hookimpl
def humanclaw_rewards(register: Register[Reward]) -> None:
    register("haste", haste, "costs a tenth a step, and 1 for a call that was refused")
