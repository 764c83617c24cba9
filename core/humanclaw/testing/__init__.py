"""Helpers and conformance suites for the tests of skills, plugins and harnesses."""

from typing import TYPE_CHECKING

from humanclaw.doors import door

if TYPE_CHECKING:
    from humanclaw.testing.contract import Report, check_skill, check_target, examine
    from humanclaw.testing.fakes import FakeGenerator, FakeModel, FakeRenderer, FakeWorld, fake_body, fake_scene
    from humanclaw.testing.sampling import corners, legal_calls
    from humanclaw.testing.scenes import SceneBuilder
    from humanclaw.testing.scripted import ScriptedAgent
    from humanclaw.testing.simulators import SimulatorConformance
    from humanclaw.testing.speed import reset_times, resident
    from humanclaw.testing.steps import check, contacts, touches

_HOMES = {
    "check": "steps",
    "contacts": "steps",
    "touches": "steps",
    "FakeGenerator": "fakes",
    "FakeModel": "fakes",
    "FakeRenderer": "fakes",
    "FakeWorld": "fakes",
    "Report": "contract",
    "SceneBuilder": "scenes",
    "ScriptedAgent": "scripted",
    "SimulatorConformance": "simulators",
    "check_skill": "contract",
    "check_target": "contract",
    "corners": "sampling",
    "examine": "contract",
    "fake_body": "fakes",
    "fake_scene": "fakes",
    "legal_calls": "sampling",
    "reset_times": "speed",
    "resident": "speed",
}
__all__ = [
    "FakeGenerator",
    "FakeModel",
    "FakeRenderer",
    "FakeWorld",
    "Report",
    "SceneBuilder",
    "ScriptedAgent",
    "SimulatorConformance",
    "check",
    "check_skill",
    "check_target",
    "contacts",
    "corners",
    "examine",
    "fake_body",
    "fake_scene",
    "legal_calls",
    "reset_times",
    "resident",
    "touches",
]
__getattr__ = lazy(__name__, _HOMES)
