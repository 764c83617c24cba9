"""The programs behind slow evidence can at least be loaded: they run seldom, and what they import moves."""

import runpy
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

PROGRAMS = sorted((Path(__file__).parent / "evidence").glob("*.py"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_a_program_of_evidence_finds_what_it_imports(program: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(program.parent)  # As Python does with the folder of what it runs.
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


@pytest.mark.parametrize(
    ("work", "fixed", "fails"),
    [
        ((13.0, 2.0), (10.0, 2.0), ["a"]),
        ((26.0, 4.0), (20.0, 4.0), ["a"]),
        ((26.0, 4.9), (20.0, 4.9), []),
        ((30.0, 4.9), (20.0, 4.9), ["a"]),
        ((15.0, 2.5), (16.0, 2.0), []),
    ],
    ids=["slower", "on a machine half as fast", "within another make", "beyond it", "slower at its own kind alone"],
)
def test_a_figure_that_got_slower_by_a_fifth_fails(
    perf: dict[str, Any], work: tuple[float, float], fixed: tuple[float, float], fails: list[str]
) -> None:
    """On the standard's machine two figures take 10 and 2 ms, and so does their fixed work."""
    then, now = (
        {name: perf["Measured"](did / own, did, own) for name, did, own in zip("ab", works, fixeds, strict=True)}
        for works, fixeds in (((10.0, 2.0), (10.0, 2.0)), (work, fixed))
    )
    assert perf["failing"](now, then) == fails
