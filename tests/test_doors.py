"""The page of public doors is true: it lists the names that are there, and nobody outside the core goes by another
way."""

from __future__ import annotations

import importlib
import pkgutil
import re
import tomllib
from pathlib import Path

import pytest

import humanclaw

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "doors.md").read_text("utf-8")
DOORS = set(re.findall(r"^\* `(humanclaw[a-z_.]*)`:", PAGE, re.MULTILINE))


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


def test_the_import_rules_forbid_packages_all_that_is_no_door():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
    (rule,) = (contract for contract in contracts if contract["name"].endswith("import the public doors alone"))
    modules = {f"humanclaw.{module.name}" for module in pkgutil.iter_modules(humanclaw.__path__)}
    assert modules - DOORS - {"humanclaw.__main__"} == set(rule["forbidden_modules"]) - {"humanclaw.*.*"}


def test_examples_go_by_the_doors_alone():
    text = "\n".join(path.read_text("utf-8") for path in (ROOT / "examples").rglob("*.py"))
    imported = set(re.findall(r"^ *(?:from|import) (humanclaw\b[\w.]*)", text, re.MULTILINE))
    assert len(imported) > 4
    assert imported <= DOORS


def test_no_name_of_a_door_is_also_a_module_behind_it():
    """Whichever is imported first would win, and a function be a module for whoever comes later."""
    for door in DOORS:
        module = importlib.import_module(door)
        behind = {path.stem for folder in getattr(module, "__path__", ()) for path in Path(folder).iterdir()}
        assert behind & set(getattr(module, "__all__", ())) == set(), door
