"""The page of public doors is true: it lists the names that are there, and nobody outside the core goes by another
way."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest

import humanclaw

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "doors.md").read_text("utf-8")
DOORS = set(re.findall(r"^\* `(humanclaw[a-z_.]*)`:", PAGE, re.MULTILINE))


def _imported(path: Path) -> set[str]:
    """The modules of the core that a file imports names from."""
    tree = ast.parse(path.read_text("utf-8"))
    plain = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    named = {
        _module(node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }
    return {name for name in plain | named if name.split(".")[0] == "humanclaw"}


def _module(package: str, name: str) -> str:
    """What `from package import name` reaches for: a module of the core of that name, unless a door offers the name."""
    if package in DOORS and name in getattr(importlib.import_module(package), "__all__", ()):
        return package
    inner = ROOT / "core" / Path(*package.split("."), name)
    return f"{package}.{name}" if inner.is_dir() or inner.with_suffix(".py").is_file() else package


def _ways() -> list[tuple[str, str]]:
    """(file, module) of every import of the core by what is not the core; tests beside a plugin may look deeper."""
    files = [path for part in ("plugins", "skills", "harnesses", "examples") for path in (ROOT / part).rglob("*.py")]
    inside = [path.relative_to(ROOT) for path in files]
    return [
        (path.as_posix(), name)
        for path in inside
        if "tests" not in path.parts and not any(part.startswith(".") for part in path.parts)
        for name in _imported(ROOT / path)
    ]


def test_the_page_lists_every_name_of_the_first_door_and_no_other():
    listed = re.findall(r"`(\w+)`", PAGE.split("## Names of")[1])
    assert sorted(listed[1:]) == sorted(humanclaw.__all__)


def test_every_name_of_the_first_door_is_there():
    assert [name for name in humanclaw.__all__ if not hasattr(humanclaw, name)] == []
    assert set(humanclaw.__all__) <= set(dir(humanclaw))


def test_there_are_at_most_ten_doors():
    assert len(DOORS) <= 10


def test_a_name_that_no_door_has_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"module 'humanclaw\.world' has no attribute 'Nothing'"):
        humanclaw.world.Nothing  # noqa: B018


def test_every_door_on_the_page_opens():
    for door in DOORS:
        module = importlib.import_module(door)
        assert all(hasattr(module, name) for name in getattr(module, "__all__", ())), door


def test_plugins_skills_harnesses_and_examples_go_by_the_doors_alone():
    ways = _ways()
    assert len(ways) > 300
    assert [way for way in ways if way[1] not in DOORS] == []


def test_no_name_of_a_door_is_also_a_module_behind_it():
    """Whichever is imported first would win, and a function be a module for whoever comes later."""
    for door in DOORS:
        module = importlib.import_module(door)
        behind = {path.stem for folder in getattr(module, "__path__", ()) for path in Path(folder).iterdir()}
        assert behind & set(getattr(module, "__all__", ())) == set(), door
