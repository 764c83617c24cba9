"""A verifier that shortens long steps: `humanclaw run --plugin examples/hooks/verifiers.py --verifier careful`."""

from humanclaw import Call, EpisodeContext, Observation, Skill, Verdict, hookimpl
from humanclaw.plugins import Register, VerifierFactory
from humanclaw.records import Answer

SHORT = Answer("short", False, "a step is 40 cm at most")


class Careful:
    name = "careful"

    def begin(self, context: EpisodeContext) -> None:
        pass

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        if call.skill == "walk" and call.params["z_cm"] > 40:
            return Verdict(False, Call("walk", {**call.params, "z_cm": 40}), (SHORT,))
        return Verdict(True)


@hookimpl
def humanclaw_verifiers(register: Register[VerifierFactory]) -> None:
    register("careful", lambda options: Careful(), "shortens long steps")
