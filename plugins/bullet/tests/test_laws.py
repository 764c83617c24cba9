"""The laws that `humanclaw physics` measures, on few samples: the same code, within the same bounds."""

import pytest
from click.testing import CliRunner

from humanclaw_bullet.command import physics
from humanclaw_bullet.laws import LAWS, Finding, Lab, table


@pytest.mark.parametrize("law", sorted(LAWS))
def test_the_law_holds(law):
    lab = Lab.of("default", samples=2, chunks=60)
    found = list(LAWS[law](lab, lambda: None))
    assert found
    assert [finding for finding in found if not finding.holds] == []


@pytest.mark.parametrize("profile", ["paper", "reference"])
def test_the_paper_s_constants_keep_bodies_whole_too(profile):
    lab = Lab.of(profile, chunks=30)
    for law in ("free-space", "ledge", "wild"):
        assert [finding for finding in LAWS[law](lab, lambda: None) if not finding.holds] == []


def test_a_finding_outside_its_bounds_does_not_hold_and_the_table_says_so():
    wrong = Finding("falling", "acceleration", 12.0, "m/s2", 9.6, 10.0)
    assert not wrong.holds
    assert table([wrong]).splitlines()[-1] == "| falling | acceleration | 12 m/s2 | ≥ 9.6, ≤ 10 | **no** |"


def test_the_command_prints_the_table_and_nothing_else():
    done = CliRunner().invoke(physics, ["free-space"])
    assert done.exit_code == 0
    assert done.stdout.startswith("| law | measure | found | bound | holds |")
    assert len(done.stdout.splitlines()) == 5
