"""Recipes: registered through the hook, judged on windows whose travel is known."""

import numpy as np
import pytest
from hosting import host_of, plugin

from humanclaw.plugins import Plugins
from humanclaw.skills import Recipe, WindowTravel


def _windows(**given) -> WindowTravel:
    zero, no = np.zeros(1), np.ones(1, bool)
    numbers = {"across": zero, "up": zero, "forward": zero, "yaw": zero, "feet": zero}
    return WindowTravel(**numbers | {key: np.array([value]) for key, value in given.items()}, neutral=no, level=no)


STROLL = Recipe("stroll", windows=lambda w: w.forward > 0.2)


def test_a_plugin_registers_the_recipe_of_its_skill():
    host = host_of("stroller", recipes=[STROLL])
    (found,) = host.registered("recipes")
    assert (found.name, found.owner) == ("stroll", "stroller")
    assert found.value.windows(_windows(forward=0.3)).tolist() == [True]


def test_of_two_recipes_for_one_skill_the_first_stays_and_both_owners_are_named():
    host = host_of("one", recipes=[STROLL])
    host.add(plugin(recipes=[STROLL]), "two")
    assert [one.owner for one in host.registered("recipes")] == ["one"]
    assert "'stroll' of plugin 'two' is already registered by 'one'" in host.infos[-1].duplicates[0]


def test_every_trained_skill_that_is_shipped_has_a_recipe_that_draws_each_of_its_parameters():
    host = Plugins.discover()
    recipes = {one.name: one.value for one in host.registered("recipes")}
    skills = {name: skill for name, skill in host.skills.items() if skill.adapter is not None}
    assert set(recipes) == set(skills)
    for name, skill in skills.items():
        assert set(recipes[name].commands) == {one.name for one in skill.parameters}
        for one in skill.parameters:
            draw = recipes[name].commands[one.name]
            assert draw.low <= one.low
            assert draw.high >= one.high


@pytest.mark.parametrize(
    ("given", "idle"),
    [({}, True), ({"forward": 0.06}, False), ({"yaw": 0.2}, False), ({"feet": 0.1}, False), ({"up": -0.04}, False)],
)
def test_who_neither_travels_nor_turns_nor_moves_the_feet_is_idle(given, idle):
    assert _windows(**given).idle.tolist() == [idle]
    assert _windows(across=0.3, forward=0.4).flat == pytest.approx([0.5])
