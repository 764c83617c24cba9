"""The programs behind slow evidence can at least be loaded: they run seldom, and what they import moves."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

PROGRAMS = sorted((Path(__file__).parent / "evidence").glob("*.py"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_a_program_of_evidence_finds_what_it_imports(program: Path) -> None:
    assert "main" in runpy.run_path(str(program), run_name="loaded")


def test_the_longer_measurement_of_a_figure_that_seems_slower_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    perf = runpy.run_path(str(Path(__file__).parent / "evidence" / "perf.py"), run_name="loaded")
    ratios = {5: (1.3, 1.0), 15: (1.4, 1.0)}
    figures = [SimpleNamespace(name=name, ratio=ratios.__getitem__) for name in ("slower", "new")]
    monkeypatch.setitem(perf["measured"].__globals__, "figures", lambda: figures)
    assert perf["measured"](5, {"slower": 1.0}) == {"slower": ratios[15], "new": ratios[5]}
