"""For the tests of skills, plugins and harnesses: checks, fakes, and a conformance suite of simulators."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.checks.bounded import OverdueError as OverdueError, bounded as bounded
    from humanclaw.checks.fakes import (
        FakeGenerator as FakeGenerator,
        FakeRenderer as FakeRenderer,
        FakeWorld as FakeWorld,
        ScriptedAgent as ScriptedAgent,
        fake_body as fake_body,
        fake_scene as fake_scene,
    )
    from humanclaw.checks.sampling import corners as corners, legal_calls as legal_calls
    from humanclaw.checks.skills import Report as Report, check_skill as check_skill, examine as examine
    from humanclaw.checks.targets import check_target as check_target
    from humanclaw.episodes.step import contacts as contacts, touches as touches
    from humanclaw.records.decisions import check as check
    from humanclaw.testing.simulators import SimulatorConformance as SimulatorConformance
    from humanclaw.testing.speed import reset_times as reset_times, resident as resident

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
