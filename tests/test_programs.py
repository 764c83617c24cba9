"""The programs behind slow evidence can at least be loaded: they run seldom, and what they import moves."""

import runpy
from pathlib import Path

import pytest

PROGRAMS = sorted((Path(__file__).parent / "evidence").glob("*.py"))


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_a_program_of_evidence_finds_what_it_imports(program: Path) -> None:
    assert "main" in runpy.run_path(str(program), run_name="loaded")
