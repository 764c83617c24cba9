"""The skills without which nobody can solve the episodes of a run."""

from __future__ import annotations

from collections.abc import Iterable

from humanclaw import EpisodeSpec, PluginError, Plugins, Skill
from humanclaw.skills import suited
from humanclaw_bench.two.partners import HAND, speaking


def require_skills(specs: Iterable[EpisodeSpec], plugins: Plugins) -> None:
    """Raise PluginError, before anything is played or paid for, if an episode needs a skill that is missing."""
    skills = plugins.skills.values()
    able = {
        "say": speaking(skills), "reach": suited(skills, *HAND, role="gesture"),
        "grasp": suited(skills, role="grasp"), "release": suited(skills, role="release"),
        "answer": any(map(_answers, skills)),
    }  # fmt: skip
    lacking = [(spec, names) for spec in specs if (names := [name for name in _needed(spec) if not able[name]])]
    if not lacking:
        return
    missing = [name for name in able if any(name in names for _, names in lacking)]
    if not {item.name for item in plugins.registered("skills")}.issuperset(missing):
        helpful = dict.fromkeys(name for spec, _ in lacking for name in _helpful(spec))
        try:
            plugins.require(*(("skills", name) for name in dict.fromkeys((*missing, *helpful))))
        except PluginError as error:
            raise PluginError(f"these episodes cannot be solved: {error.message}", error.remedy) from None
    raise PluginError(f"whoever plays these episodes needs {', '.join(missing)}.", "Name that in --skills, too.")


def _answers(skill: Skill) -> bool:
    """Return whether a skill ends an episode with words."""
    parts = skill.schema.get("properties", {}).values()
    return skill.role == "stop" and any(part.get("type") == "string" for part in parts)


def _needed(spec: EpisodeSpec) -> tuple[str, ...]:
    """Return the skills without which an episode cannot be solved, also those that its partner plays."""
    if spec.partner is not None:
        return ("say", "reach", "grasp", "release") if spec.partner.task == "give" else ()
    if spec.goal is None or spec.success:  # A function may find success in anything.
        return ()
    asked = {"grasp": spec.goal.things, "release": spec.goal.on is not None, "answer": spec.goal.answer}
    return tuple(name for name, needed in asked.items() if needed)


def _helpful(spec: EpisodeSpec) -> tuple[str, ...]:
    """Return the skills that a task can do without, but that its results were measured with."""
    if spec.partner is not None:
        return ()
    return ("reach", "gaze") if spec.goal and spec.goal.asks else ("reach", "pull", "gaze", "crouch")
