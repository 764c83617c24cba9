"""Tests of the body as an environment, in a real house."""

from __future__ import annotations

import importlib
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import humanclaw_gymnasium
from humanclaw import Call, Choice, HumanclawError, Keyframes, Plugins, skill
from humanclaw_gymnasium import Actions, BodyEnv


@pytest.fixture(scope="module")
def env():
    env = BodyEnv("house:0", "find a couch and sit on it", max_steps=3, size=64, render_mode="rgb_array")
    yield env
    env.close()


@skill()
def bow(depth: int) -> Keyframes:
    """Bow as deep as you like."""
    return Keyframes.cycle("spine1", axis="x", degrees=depth, seconds=1)


@skill()
def wave(left: bool = True) -> Keyframes:
    """Wave a hand."""
    return Keyframes.cycle("left_shoulder" if left else "right_shoulder", axis="z", degrees=40, seconds=0.5)


@pytest.fixture(scope="module")
def actions():
    """Of a walk, a wave, and a bow of any depth."""
    host = Plugins()
    for name in ("walk", "stop"):
        host.add(importlib.import_module(f"humanclaw_skill_{name}"), name)
    return Actions(host.skills | {"bow": bow, "wave": wave})


def test_its_actions_are_the_skills_that_were_chosen():
    env = BodyEnv(plugins=Plugins.discover(choice=Choice(skills=("walk", "stop"))))
    assert env.actions.skills == ("stop", "walk")


def test_it_passes_the_checker_of_gymnasium(env):
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        # With a spec, the checker would make the same environment again for its only render mode.
        warnings.filterwarnings("ignore", message=".*not having a spec")
        check_env(env)


def test_gymnasium_can_make_it():
    env = gymnasium.make("humanclaw_gymnasium:HumanCLAW-v0", scene="house:1", size=32)
    assert isinstance(env.unwrapped, BodyEnv)
    assert env.observation_space.shape == (32, 32, 3)
    assert humanclaw_gymnasium.__version__ == "0.1.0"
    env.close()


def test_the_reward_is_the_way_made_towards_the_target(env):
    _, start = env.reset(seed=1)
    picture, reward, terminated, truncated, info = env.step(env.actions.encode("walk", z_cm=60))
    assert picture.flags.writeable, "a learner may write to it"
    assert info["call"] == "walk(x_cm=0, z_cm=60, yaw_deg=0)"
    assert reward == pytest.approx(start["distance_to_goal"] - info["distance_to_goal"])
    assert 0.05 < abs(reward) < 0.9, "no farther than the legs go in half a second"
    assert info["distance_to_goal"] >= info["target_distance"] - 0.5, "a way is no shorter than the straight line"
    assert not terminated
    assert not truncated


@pytest.mark.integration
def test_it_plays_training_tasks_with_their_rewards():
    env = BodyEnv(tasks="approach", options={"houses": 1}, rewards={"contact": 0.5, "success": 1.0}, size=64)
    _, begun = env.reset(seed=3)
    assert begun["instruction"].startswith("walk up to the")
    assert begun["scene"] == "house:train-0"
    _, reward, _, _, info = env.step(env.actions.encode("stop"))
    assert (reward, info["rewards"]) == (0, {"contact": 0, "success": 0})
    env.close()


def test_stopping_far_from_the_target_is_no_success(env):
    _, start = env.reset(seed=1)
    assert start["target_distance"] > 0.3
    _, reward, terminated, _, info = env.step(env.actions.encode("stop"))
    assert terminated
    assert not info["success"]
    assert reward < 0.5


def test_an_episode_is_truncated_after_its_last_step(env):
    env.reset(seed=1)
    ends = [env.step(env.actions.encode("turn_in_place", yaw_deg=20))[3] for _ in range(3)]
    assert ends == [False, False, True]


def test_the_same_seed_and_actions_show_the_same(env):
    seen = []
    for seed in (5, 5, 6):
        env.reset(seed=seed)
        seen.append(env.step(env.actions.encode("walk", z_cm=60))[0])
    assert np.array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2])


def test_it_draws_the_full_view_and_observes_a_small_one(env):
    picture, _ = env.reset(seed=1)
    assert picture.shape == (64, 64, 3)
    assert env.render().shape == (512, 512, 3)
    assert picture.mean() == pytest.approx(env.render().mean(), abs=1)


def test_actions_and_calls_translate_into_one_another(actions):
    assert actions.skills == ("stop", "walk", "wave")
    assert actions.space.nvec.tolist() == [3, 61, 81, 61, 2]
    action = actions.encode("walk", z_cm=40, yaw_deg=-10)
    assert action.tolist() == [1, 30, 40, 20, 0]
    assert actions.decode(action) == Call("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": -10})
    assert actions.decode(actions.encode("wave", left=True)) == Call("wave", {"left": True})


def test_a_skill_whose_parameters_have_no_bounds_is_left_out_by_name(actions):
    assert actions.left_out == ("bow",)
    with pytest.raises(HumanclawError, match="no skill can be called"):
        Actions({"bow": bow})


@pytest.mark.parametrize("action", [[3, 0, 0, 0, 0], [1, 61, 0, 0, 0], [0, 0], [-1, 0, 0, 0, 0]])
def test_what_is_not_in_the_space_is_refused(actions, action):
    with pytest.raises(ValueError, match="integers below"):
        actions.decode(np.array(action))


@pytest.mark.parametrize(
    ("skill", "params", "fault"),
    [("wlak", {}, "no skill"), ("walk", {"speed": 1}, "no parameter 'speed'"), ("walk", {"z_cm": 81}, "0 to 80")],
)
def test_calls_that_no_action_stands_for_are_refused(actions, skill, params, fault):
    with pytest.raises(ValueError, match=fault):
        actions.encode(skill, **params)


def test_before_the_first_reset_there_is_no_body():
    env = BodyEnv()
    assert env.scenes == ("house:train-0",), "who names no house trains in none of val"
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(env.actions.encode("stop"))
    with pytest.raises(ValueError, match="rgb_array"):
        BodyEnv(render_mode="human")
