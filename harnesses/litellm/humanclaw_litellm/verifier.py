"""The skill-specific spatial response verifier (paper, section 3.2 and appendix A)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from humanclaw import (
    Call,
    CallError,
    Check,
    EpisodeContext,
    HumanclawError,
    Observation,
    ProviderClosedError,
    ProviderError,
    Skill,
    Verdict,
    verifier_content,
    verifier_prompt,
)
from humanclaw.records import Answer, Usage
from humanclaw.skills import Json, call_schema, plain_name, read_answer, read_objects, read_text
from humanclaw_litellm.asking import AnswerFormat, Asker
from humanclaw_litellm.client import Completion
from humanclaw_litellm.decision import usable
from humanclaw_litellm.failures import TooLongError
from humanclaw_litellm.settings import Mode, Settings

_VERDICT: Final = "verdict"
_WORD: Final = re.compile(r"[\W_]*(?:(yes|true)|no|false)(?![^\W_])", re.IGNORECASE)
"""The first word of an answer to a check, in whatever marks it stands."""


class ModelVerifier(Asker):
    """Asks a model the checklist of a skill. The model sees the current view and no history.

    The verifier fails open: without a verdict the call passes, and `failed_open` says why. A skill without checks
    passes without a request. LimitError, a limit of the episode, passes through.
    """

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.name = f"litellm:{settings.model}"
        self._skills: tuple[Skill, ...] = ()

    def begin(self, context: EpisodeContext) -> None:
        """Begin an episode. Raises ModelError if the model cannot be reached."""
        self._negotiator.client.begin(context.meter)
        self._skills, self._gaze = usable(context), context.gaze

    def verify(self, observation: Observation, call: Call, skill: Skill, goal: str) -> Verdict:
        """Ask the model about a call.

        Raises ModelError or ProviderClosedError if the provider rejects the model or the key.
        """
        if not self._skills:
            raise HumanclawError("a verifier must begin an episode before it verifies.", "Call begin first.")
        if not skill.checks:
            return Verdict(True)
        checks = _numbered(skill)
        form = _form(checks, self._skills)

        def messages(mode: Mode) -> list[Json]:
            system = verifier_prompt(self._skills, self._gaze, form.schema if mode in ("schema", "prompt") else None)
            content = verifier_content(observation, call, skill, goal, checks.items(), self._settings)
            return [{"role": "system", "content": system}, {"role": "user", "content": content}]

        try:
            reply = self._negotiator.ask(form, messages)
        except ProviderClosedError:
            raise
        except (ProviderError, TooLongError) as fault:
            return Verdict(True, failed_open=str(fault))
        verdict = _that_counts(_verdicts(reply.completion), checks)
        self._negotiator.report(reply, verdict is not None)
        return self._verdict(verdict, checks, call, reply.completion.usage)

    def _verdict(self, verdict: Json | None, checks: Mapping[str, Check], call: Call, usage: Usage) -> Verdict:
        if verdict is None:
            return Verdict(
                True, failed_open="the verifier's answer held no verdict, or several that differ", usage=usage
            )
        answers = tuple(filter(None, (_answer(key, check, verdict) for key, check in checks.items())))
        if all(answer.passed for answer in answers):
            left = [check.id for key, check in checks.items() if _passed(verdict, key) is None]
            return Verdict(True, None, answers, f"no answer to {', '.join(left)}" if left else "", usage)
        other = _replacement(verdict, self._skills)
        if other is None or other == call:
            return Verdict(True, None, answers, "checks failed, but no other call was named", usage)
        return Verdict(False, other, answers, usage=usage)


def _numbered(skill: Skill) -> dict[str, Check]:
    """Name the checks check_1, check_2, ...: every provider accepts these as names of properties."""
    return {f"check_{number}": check for number, check in enumerate(skill.checks, start=1)}


def _form(checks: Mapping[str, Check], skills: Sequence[Skill]) -> AnswerFormat:
    asked: Json = {}
    for key in checks:
        # Models write properties in order, so evidence comes before the answer that it supports.
        asked[f"{key}_evidence"] = {"type": "string"}
        asked[f"{key}_answer"] = {"type": "string", "enum": ["yes", "no"]}
    schema = {
        "type": "object",
        "properties": {**asked, **call_schema(skills)},
        "required": list(asked),
        "additionalProperties": False,
    }
    function = {
        "name": _VERDICT,
        "description": "Report the answers, and what to do instead if any is no.",
        "parameters": schema,
    }
    return AnswerFormat(({"type": "function", "function": function},), schema)


def _verdicts(completion: Completion) -> list[Json]:
    """Return the verdicts in tool calls or else in the text; none of one that is cut off or repeats a key."""
    if completion.cut_off or completion.withheld:
        return []
    try:
        if completion.calls:
            texts = [said for name, said in completion.calls if plain_name(name) == _VERDICT]
            verdicts = [item for said in texts for item in read_objects(said)]
        else:
            verdicts = _called(completion.text) or read_objects(completion.text)
    except CallError:
        return []
    opened = [item.get("arguments", item.get(_VERDICT)) for item in verdicts]  # A call with words behind it.
    verdicts = [inner if isinstance(inner, dict) else item for inner, item in zip(opened, verdicts, strict=True)]
    return [item for item in verdicts if any(key.endswith("_answer") for key in item)]


def _called(text: str) -> list[Json]:
    """Return the arguments of verdicts called in text, which a server without a tool parser passes on."""
    try:
        return [dict(call.params) for _, call in read_text(text) if call.skill == _VERDICT]
    except (CallError, ValueError):
        return []


def _that_counts(verdicts: Sequence[Json], checks: Mapping[str, Check]) -> Json | None:
    """Return the only verdict, or the last of several that all say no: a no never becomes a pass, whatever words stand
    around it. Of others, the one that the model means is unknown.
    """
    say_no = all(any(_passed(verdict, key) is False for key in checks) for verdict in verdicts)
    return verdicts[-1] if verdicts and (len(verdicts) == 1 or say_no) else None


def _answer(key: str, check: Check, verdict: Mapping[str, Any]) -> Answer | None:
    passed = _passed(verdict, key)
    return None if passed is None else Answer(check.id, passed, str(verdict.get(f"{key}_evidence", "")))


def _passed(verdict: Mapping[str, Any], key: str) -> bool | None:
    word = _WORD.match(str(verdict.get(f"{key}_answer", "")))
    return None if word is None else word[1] is not None


def _replacement(verdict: Mapping[str, Any], skills: Sequence[Skill]) -> Call | None:
    """Return the call to make instead, unchecked: the loop checks every call against its schema.

    Its parameters may stand beside the answers.
    """
    if not verdict.get("skill"):
        return None
    known = {name for skill in skills if skill.name == verdict["skill"] for name in skill.schema["properties"]}
    beside = {name: verdict[name] for name in known & verdict.keys()}
    try:
        return read_answer({"skill": verdict["skill"], "parameters": verdict.get("parameters"), **beside})[1]
    except CallError:
        return None
