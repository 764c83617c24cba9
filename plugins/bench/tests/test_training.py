"""Training tasks: endless, one a seed, in houses that no split and no hidden test has."""

import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from humanclaw import EpisodeSpec, Gym, HumanclawError, Plugins
from humanclaw.records import read_episodes, write_episodes
from humanclaw_bench.cli import bench
from humanclaw_bench.difficulty import overall
from humanclaw_bench.splits import DEV_HOUSES, HOUSES, secret_houses
from humanclaw_bench.training import MOST, require_training

ONE = {"houses": 1}


@pytest.mark.integration
def test_a_seed_gives_its_task_by_itself(plugins):
    first, second = (plugins.make("tasks", "train", ONE) for _ in range(2))
    drawn = [first(seed) for seed in range(8)]
    assert [second(seed) for seed in (7, 3)] == [drawn[7], drawn[3]]
    assert len({spec.id for spec in drawn}) == 8
    assert len({(spec.start.x, spec.start.z) for spec in drawn}) > 4


@pytest.mark.integration
def test_a_source_that_nobody_holds_frees_its_houses_at_once(plugins):
    source = plugins.make("tasks", "train", ONE)
    kept = weakref.ref(source._house(0))
    gc.disable()
    del source
    try:
        assert kept() is None
    finally:
        gc.enable()


@pytest.mark.integration
def test_difficulty_and_category_narrow_the_tasks(plugins):
    easy = plugins.make("tasks", "train", {**ONE, "difficulty": "easy", "category": "couch"})
    drawn = [easy(seed) for seed in range(5)]
    assert {overall(spec.difficulty) for spec in drawn} == {"easy"}
    assert {spec.target_category for spec in drawn} == {"couch"}


@pytest.mark.parametrize(
    "house",
    [
        *HOUSES[::20],
        *DEV_HOUSES[::20],
        *secret_houses(7)[::20],
        "humanclaw-houses:house:3",
        "house:3?",
        "house:3?assets=/a:b",
        f"{DEV_HOUSES[1]}?assets=x",
        f"{secret_houses(7)[0]}?assets=x",
    ],
)
def test_a_house_of_val_dev_or_a_hidden_test_is_refused(house, tmp_path, plugins):
    with pytest.raises(HumanclawError, match="cannot be tested in it"):
        require_training(house)
    write_episodes(tmp_path / "mine.jsonl", [EpisodeSpec(id="a", instruction="find a couch", scene=house)])
    with pytest.raises(HumanclawError, match="is a house of"):
        plugins.make("tasks", "file", {"file": str(tmp_path / "mine.jsonl")})


def test_training_houses_and_scenes_of_others_pass():
    for scene in ("house:train-0", f"house:train-{MOST - 1}", "house:train-500041", "hssd:102344022", "floor"):
        require_training(scene)
    assert f"house:train-{MOST}" == DEV_HOUSES[0]


WRONG = [{"hous": 1}, {"houses": 0}, {"houses": MOST + 1}, {"first": MOST - 1}, {"difficulty": "trivial"}]


@pytest.mark.parametrize("options", WRONG)
def test_a_wrong_option_is_named(plugins, options):
    with pytest.raises(HumanclawError, match=r"The options are houses, first, difficulty|Stay below"):
        plugins.make("tasks", "train", options)


def test_a_difficulty_is_refused_where_it_would_have_no_effect(plugins):
    with pytest.raises(HumanclawError, match="difficulty has no effect on tasks of 'sit'"):
        plugins.make("tasks", "sit", {"difficulty": "hard"})


@pytest.mark.integration
def test_training_tasks_are_written_to_a_file_that_a_gym_plays(tmp_path):
    made = CliRunner().invoke(bench, ["generate", "--train", "3", "--option", "houses=1", "--out", str(tmp_path)])
    assert made.exit_code == 0, made.output
    specs = read_episodes(tmp_path / "train.jsonl")
    assert {spec.scene for spec in specs} == {"house:train-0"}
    file = Plugins.discover().make("tasks", "file", {"file": str(tmp_path / "train.jsonl")})
    assert [file(seed) for seed in (0, 4)] == [specs[0], specs[1]]


def test_an_option_without_its_task_is_refused():
    for words in (["--task", "sit"], ["--secret", "5", "--train", "3"]):
        assert CliRunner().invoke(bench, ["generate", *words]).exit_code == 2


# -- capabilities ------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def gym(plugins):
    """gym(name): the gym of a source, in one house."""
    made = {}

    def get(name):
        if name not in made:
            made[name] = Gym(name, options=ONE, plugins=plugins)
        return made[name]

    yield get
    for env in made.values():
        env.close()


def _seen(gym):
    targets = list(gym.episode.spec.target_ids)
    return int(np.isin(gym.episode.body.view().ids, targets).sum())


def _called(gym, name, **arguments):
    return gym.call(name, {"thoughts": arguments.pop("thoughts", ""), **arguments})


@pytest.mark.integration
def test_to_approach_begins_ahead_and_a_stop_at_once_fails(gym):
    env = gym("approach")
    for seed in (0, 1):
        env.reset(seed)
        assert _seen(env) >= 100
        assert 0.2 < env.episode.target_distance() < 3.5
    turn = _called(env, "stop")
    assert turn.done
    assert not turn.solved
    assert turn.reward == 0


@pytest.mark.integration
def test_to_turn_begins_out_of_view(gym):
    env, blindly = gym("turn"), []
    for seed in range(10):
        env.reset(seed)
        assert _seen(env) < 100
        spec = env.episode.spec
        env.begin(spec.model_copy(update={"start": replace(spec.start, yaw=spec.start.yaw + np.pi)}))
        blindly.append(_seen(env) >= 100)
    assert sum(blindly) < 8


@pytest.mark.integration
def test_to_turn_is_solved_by_honest_words_alone(gym):
    env = gym("turn")
    for words in ("visible_state: A {} is ahead.", "visible_state: No {} is in view."):
        env.reset(0)
        noun = env.episode.spec.target_category
        for _ in range(9):
            if _seen(env) >= 500:
                break
            _called(env, "turn_in_place", yaw_deg=60)
        turn = _called(env, "stop", thoughts=words.format(noun))
        assert turn.solved == ("No" not in words)
        assert turn.reward == pytest.approx(2.0 if turn.solved else 0.0)


@pytest.mark.integration
def test_to_sit_begins_with_the_back_to_the_seat(gym):
    env = gym("sit")
    env.reset(1)
    assert _seen(env) < 100
    while env.episode.body.last is None or env.episode.body.last.feedback.proprioception is None:
        before = env.episode.target_distance()
        turn = _called(env, "step_back", z_cm=15)
        if turn.done or abs(before - env.episode.target_distance()) < 0.02:
            break
    _called(env, "sit_in_place", h_cm=48)
    _called(env, "sit_in_place", h_cm=44)
    assert _called(env, "stop").solved


@pytest.mark.integration
def test_to_touch_tells_no_category_and_is_solved_by_its_name(gym):
    env = gym("touch")
    env.reset(2)
    spec = env.episode.spec
    assert (spec.for_agent.target_category, spec.target_ids) == ("", ())
    while True:
        turn = _called(env, "walk", x_cm=0, z_cm=30, yaw_deg=0)
        touched = {env.episode.body.scene.by_id[c.object_id].category for c in env.episode.steps[-1].contacts} - {
            "floor"
        }
        if touched or turn.done:
            break
    noun = sorted(touched)[0]
    assert _called(env, "stop", thoughts=f"reasoning: A {noun} touches me.").solved
