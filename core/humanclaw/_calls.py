"""Holding what an agent asks for to the skills' schemas, before anything is executed."""

from __future__ import annotations

from collections.abc import Mapping

from humanclaw._decisions import Call, Decision
from humanclaw._words import did_you_mean
from humanclaw.contract import Skill
from humanclaw.errors import CallError


def check(decision: Decision, skills: Mapping[str, Skill]) -> Call:
    """Take the one legal call of a decision, defaults filled in. Raises CallError, written for the model."""
    if len(decision.calls) != 1:
        count = "no call" if not decision.calls else f"{len(decision.calls)} calls"
        raise CallError(f"Nothing was executed: the answer held {count}; make exactly one skill call a step.")
    return check_call(decision.calls[0], skills)


def check_call(call: Call, skills: Mapping[str, Skill]) -> Call:
    """Fill the defaults of a call in. Raises CallError, written for the model."""
    if call.skill not in skills:
        told = f"Nothing was executed: there is no skill {call.skill[:64]!r}."
        known = f"The skills are {', '.join(skills)}."
        raise CallError(" ".join(filter(None, (told, did_you_mean(call.skill, skills), known))))
    skill = skills[call.skill]
    if not skill.trained:
        raise CallError(
            f"Nothing was executed: {call.skill} is not available, its adapter is not trained. Use another skill."
        )
    return Call(call.skill, skill.check(call.params))
