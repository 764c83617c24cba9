"""Declarations for tests: those of the shipped skills, and of one that is nobody's."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from humanclaw.records import SkillInfo
from humanclaw.skills import Declaration

SKILLS = Path(__file__).parents[2] / "skills"
STROLL = {
    "type": "object",
    "x-role": "locomotion",
    "properties": {
        "veer_deg": {"type": "integer", "minimum": -20, "maximum": 20, "x-measure": "heading.left", "default": 0},
        "ahead_cm": {"type": "integer", "minimum": 10, "maximum": 50, "x-measure": "hips.forward"},
    },
    "required": ["ahead_cm"],
    "additionalProperties": False,
    "description": "Stroll ahead for half a second.",
}
"""The schema of a ninth skill, whose parameters have names of their own."""


def folder_of(skill: str) -> Path:
    """The folder of a shipped skill."""
    (found,) = SKILLS.glob(f"*/humanclaw_skill_*/{skill}")
    return found


def declaration(skill: str) -> Declaration:
    return Declaration.read(folder_of(skill))


def declare(folder: Path, schema: dict | None = None) -> None:
    """Lay a schema.json into a skill's folder: that of the shipped skill of this name, or another."""
    folder.mkdir(parents=True, exist_ok=True)
    if schema is None:
        shutil.copy(folder_of(folder.name) / "schema.json", folder)
    else:
        (folder / "schema.json").write_text(json.dumps(schema))


def info(skill: Declaration) -> SkillInfo:
    """What a record says of a skill."""
    return SkillInfo(role=skill.role, commands={one.key: one.measure for one in skill.parameters if one.measure})


INFOS = {path.parent.name: info(Declaration.read(path.parent)) for path in sorted(SKILLS.glob("*/*/*/schema.json"))}
"""What a record says of the shipped skills."""
