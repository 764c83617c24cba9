"""Declarations for tests: those of the shipped skills, and an invented one."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from safetensors.numpy import load_file, save

from humanclaw.motion.checkpoint import HEADER, read_header
from humanclaw.records import SkillInfo
from humanclaw.skills import Skill

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
"""The schema of a ninth skill. No shipped skill has parameters of these names."""


def folder_of(skill: str) -> Path:
    """Return the folder of a shipped skill."""
    (folder,) = SKILLS.glob(f"*/humanclaw_skill_*/{skill}")
    return folder


def declaration(skill: str) -> Skill:
    return Skill.from_folder(folder_of(skill))


def declare(folder: Path, schema: dict | None = None) -> None:
    """Write schema.json into a skill's folder: by default that of the shipped skill of the same name."""
    folder.mkdir(parents=True, exist_ok=True)
    if schema is None:
        shutil.copy(folder_of(folder.name) / "schema.json", folder)
    else:
        (folder / "schema.json").write_text(json.dumps(schema))


def change_schema(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    content = json.loads((folder / "schema.json").read_text())
    change(content)
    (folder / "schema.json").write_text(json.dumps(content))


def change_adapter(
    folder: Path,
    header: Callable[[dict[str, Any]], object] = lambda header: None,
    weights: Callable[[dict[str, Any]], object] = lambda weights: None,
) -> None:
    """Write a skill's adapter with another header or other weights."""
    file = folder / "adapter.safetensors"
    head, tensors = read_header(file), load_file(file)
    header(head)
    weights(tensors)
    file.write_bytes(save(tensors, {HEADER: json.dumps(head)}))


def info(skill: Skill) -> SkillInfo:
    """Return what a record holds about a skill."""
    return SkillInfo(role=skill.role, commands={p.key: p.measure for p in skill.parameters if p.measure})


FOLDERS = [path.parent for path in sorted(SKILLS.glob("*/*/*/schema.json"))]
INFOS = {folder.name: info(Skill.from_folder(folder)) for folder in FOLDERS}
"""What a record holds about the shipped skills."""
