"""Helpers for the tests of skills, plugins and harnesses."""

from humanclaw.testing.contract import check_skill, corners
from humanclaw.testing.scripted import ScriptedAgent

__all__ = ["ScriptedAgent", "check_skill", "corners"]
