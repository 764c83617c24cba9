"""A pytest plugin: one test for each named check of a skill.

    pytest --humanclaw-skill=skills/hop --humanclaw-skill=mine.py

or, in pyproject.toml, [tool.pytest.ini_options] with humanclaw_skills = ["skills/hop"]. A check that does
not apply to a skill passes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from humanclaw.testing import Report


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add --humanclaw-skill and the setting humanclaw_skills."""
    about = "Test a skill of HumanCLAW: name, folder or Python file. Repeatable."
    group = parser.getgroup("humanclaw")
    group.addoption("--humanclaw-skill", action="append", default=[], metavar="TARGET", help=about)
    group.addoption("--humanclaw-engine", action="append", default=[], metavar="NAME", help="Simulator to play it on.")
    parser.addini("humanclaw_skills", "Skills of HumanCLAW to test: names, folders, files.", "linelist", [])


def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """Add the checks of the configured skills."""
    targets = [*config.getini("humanclaw_skills"), *config.getoption("--humanclaw-skill")]
    for target in dict.fromkeys(targets):
        items += SkillChecks.from_parent(session, name=target).collect()


class SkillChecks(pytest.Collector):
    """The checks of one target. The target is played once, when the first check runs."""

    _reports: list[Report] | None = None

    def collect(self) -> list[pytest.Item]:
        from humanclaw.skills.checks import CHECKS

        return [NamedCheck.from_parent(self, name=check) for check in CHECKS]

    @property
    def reports(self) -> list[Report]:
        """The reports."""
        if self._reports is None:
            from humanclaw.plugins.host import Plugins
            from humanclaw.testing import check_target

            engines = self.config.getoption("--humanclaw-engine") or None
            self._reports = check_target(self.name, Plugins.discover(), engines=engines)
        return self._reports


class NamedCheck(pytest.Item):
    """One check of one target."""

    def runtest(self) -> None:
        lines = list(self._lines())
        if lines:
            raise AssertionError("\n".join(lines))

    def _lines(self) -> Iterator[str]:
        assert isinstance(self.parent, SkillChecks)
        for report in self.parent.reports:
            for fault in report.faults:
                if fault.check == self.name:
                    yield f"{report.skill}: {fault}"

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> str:
        """Print the problem and its remedy, without a traceback."""
        return str(excinfo.value)

    def reportinfo(self) -> tuple[str, None, str]:
        """Name the target and the check."""
        target = self.parent.name if self.parent else ""
        return target, None, f"{target}: {self.name}"
