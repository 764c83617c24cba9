"""Wheels are complete, and the demo runs from them. Those that need PyPI: pytest -m evidence tests/test_wheels.py"""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import wheels


@pytest.fixture(scope="session")
def built(tmp_path_factory) -> list[Path]:
    return wheels.build(tmp_path_factory.mktemp("wheels"))


def _install(folder: Path, built: list[Path], *wanted: str) -> Path:
    """Install our wheels, and the rest from the index, into a new environment; return its folder of commands."""
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    commands = folder / ("Scripts" if os.name == "nt" else "bin")
    given = ["--quiet", "--no-cache-dir", "--only-binary=:all:", "--find-links", str(built[0].parent)]
    subprocess.run([str(commands / "python"), "-m", "pip", "install", *given, *wanted], check=True)
    return commands


def _humanclaw(commands: Path, *args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([str(commands / "humanclaw"), *args], cwd=commands.parent, capture_output=True, text=True)


@pytest.mark.integration
def test_every_wheel_holds_its_licence_its_types_and_its_weights(built):
    assert len(built) == len(wheels.distributions())
    for wheel in built:
        names = zipfile.ZipFile(wheel).namelist()
        assert any(name.endswith("/licenses/LICENSE") for name in names), wheel.name
        assert any(name.endswith("/py.typed") for name in names), wheel.name
        skills = {name.rpartition("/")[0] for name in names if name.endswith("/schema.json")}
        skills = {skill for skill in skills if "/templates/" not in skill}
        assert all(f"{skill}/adapter.safetensors" in names for skill in skills), wheel.name
    assert "humanclaw/motion/weights/base.safetensors" in zipfile.ZipFile(built[0]).namelist()


@pytest.mark.evidence
def test_two_builds_of_every_wheel_are_byte_identical(built, tmp_path, monkeypatch):
    checkout = tmp_path / "elsewhere"
    shutil.copytree(wheels.ROOT, checkout, ignore=shutil.ignore_patterns(".venv*", ".git", "runs", "dist", ".data"))
    for path in checkout.rglob("*"):
        os.utime(path, (1_000_000_000, 1_000_000_000))
    monkeypatch.setattr(wheels, "ROOT", checkout)
    again = wheels.build(tmp_path / "wheels")
    assert [path.name for path in again] == [path.name for path in built]
    assert [
        path.name for path, other in zip(built, again, strict=True) if path.read_bytes() != other.read_bytes()
    ] == []


@pytest.mark.evidence
def test_a_skill_alone_brings_the_core_and_says_what_else_it_needs(built, tmp_path):
    commands = _install(tmp_path / "skill", built, "humanclaw-skill-climb")
    done = _humanclaw(commands, "run")
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "error: scene 'house', simulator 'mujoco', renderer 'raster' and agent 'oracle' are not installed.",
        "Run `pip install --find-links dist humanclaw-houses humanclaw-mujoco humanclaw-raster humanclaw-scripted`.",
    ]


@pytest.mark.evidence
@pytest.mark.parametrize("extra", ["demo", "all"])
def test_the_demo_runs_from_wheels_and_without_torch(built, tmp_path, extra):
    commands = _install(tmp_path / extra, built, f"humanclaw[{extra}]")
    done = _humanclaw(commands, "run", "--max-steps", "3", "--film", "gif", "--out", "r")
    assert done.returncode == 0, done.stderr
    assert (commands.parent / "r" / "report.html").is_file()
    assert subprocess.run([str(commands / "python"), "-c", "import torch"], capture_output=True).returncode != 0
