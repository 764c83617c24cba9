"""Recipes: beside the schema of each trained skill, judged on windows whose travel is known."""

import runpy

import numpy as np
import pytest

from humanclaw.skills import WindowTravel


def _windows(**given) -> WindowTravel:
    zero, no = np.zeros(1), np.ones(1, bool)
    numbers = {"across": zero, "up": zero, "forward": zero, "yaw": zero, "feet": zero}
    return WindowTravel(**numbers | {key: np.array([value]) for key, value in given.items()}, neutral=no, level=no)


def test_every_shipped_skill_that_is_trained_draws_all_its_parameters(plugins):
    skills = [skill for skill in plugins.skills.values() if skill.adapter is not None]
    assert len(skills) == 8
    for skill in skills:
        recipe = runpy.run_path(str(skill.source / "recipe.py"))["RECIPE"]
        assert recipe.name == skill.name
        assert set(recipe.commands) == {parameter.name for parameter in skill.parameters}
        for parameter in skill.parameters:
            draw = recipe.commands[parameter.name]
            assert draw.low <= parameter.low
            assert draw.high >= parameter.high


@pytest.mark.parametrize(
    ("given", "idle"),
    [({}, True), ({"forward": 0.06}, False), ({"yaw": 0.2}, False), ({"feet": 0.1}, False), ({"up": -0.04}, False)],
)
def test_who_neither_travels_nor_turns_nor_moves_the_feet_is_idle(given, idle):
    assert _windows(**given).idle.tolist() == [idle]
    assert _windows(across=0.3, forward=0.4).flat == pytest.approx([0.5])
