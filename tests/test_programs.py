"""The programs behind slow evidence can at least be loaded: they run seldom, and what they import moves."""

import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

PROGRAMS = sorted((Path(__file__).parent / "evidence").glob("*.py"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_a_program_of_evidence_finds_what_it_imports(program: Path) -> None:
    assert "main" in runpy.run_path(str(program), run_name="loaded")


@pytest.fixture
def perf() -> dict[str, Any]:
    return runpy.run_path(str(Path(__file__).parent / "evidence" / "perf.py"), run_name="loaded")


def test_the_longer_measurement_of_a_figure_that_seems_slower_counts(
    perf: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = {5: perf["Measured"](1.3, 13.0, 10.0), 15: perf["Measured"](1.4, 14.0, 10.0)}
    figures = [SimpleNamespace(name=name, measure=measured.__getitem__) for name in ("slower", "new")]
    monkeypatch.setitem(perf["measured"].__globals__, "figures", lambda: figures)
    then = {"slower": perf["Measured"](1.0, 10.0, 10.0)}
    assert perf["measured"](5, then) == {"slower": measured[15], "new": measured[5]}


@pytest.mark.parametrize(("fixed", "alike"), [((20.0, 4.0), True), ((20.0, 4.9), False), ((8.0, 2.0), False)])
def test_a_machine_is_like_another_if_all_its_fixed_work_is_as_much_faster(
    perf: dict[str, Any], fixed: tuple[float, float], alike: bool
) -> None:
    """On the standard's machine the two take 10 and 2 ms."""
    then, now = (
        {name: perf["Measured"](1.0, time, time) for name, time in zip("ab", times, strict=True)}
        for times in ((10.0, 2.0), fixed)
    )
    assert perf["alike"](now, then) == alike
