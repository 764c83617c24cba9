"""The splits have the properties of the paper's episodes, and every episode is solvable."""

import itertools
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from rooms import two_rooms

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw.records import Difficulty, route_difficulty, write_episodes
from humanclaw.world import DistanceField, MultiFloorMap, goals_at
from humanclaw_bench.cli import bench
from humanclaw_bench.difficulty import TIERS, overall, tiers
from humanclaw_bench.difficulty_cli import COLOURS, histogram, typical
from humanclaw_bench.splits import (
    BETWEEN,
    DEV_HOUSES,
    EPISODES,
    HOUSES,
    MINI,
    SPLITS,
    VAL,
    Quota,
    candidates,
    choose,
    load_split,
    named,
    secret_houses,
    spaced,
)


@pytest.fixture(scope="module")
def pool():
    return list(candidates(two_rooms(), 0, starts=6))


# -- difficulty --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("distance", "turns", "rooms", "obstacles", "expected"),
    [
        (3.5, 1, 1, 2.5, "easy"),
        (3.51, 1, 1, 2.5, "easy"),  # one medium of three rounds down
        (3.51, 2, 1, 2.5, "medium"),
        (8.0, 3, 2, 5.0, "medium"),
        (8.1, 3, 2, 5.0, "medium"),
        (8.1, 3, 3, 5.0, "hard"),
        (20.0, 9, 9, 9.0, "hard"),
        (20.0, 0, 1, 0.0, "medium"),  # hard, easy and easy: two thirds round to one
    ],
)
def test_the_overall_tier_is_the_rounded_mean_of_the_papers_three(distance, turns, rooms, obstacles, expected):
    assert overall(Difficulty(distance=distance, turns=turns, rooms=rooms, obstacles=obstacles)) == expected


def test_thresholds_are_the_papers():
    edge = Difficulty(distance=3.5, turns=1, rooms=1, obstacles=5.0)
    assert tiers(edge) == {"distance": "easy", "choice": "easy", "obstacle": "medium"}


def test_a_way_through_a_door_has_two_rooms_and_turns():
    scene = two_rooms()
    storeys = MultiFloorMap.of(scene)
    ways = DistanceField.of(storeys, goals_at(storeys, scene, 20))
    start = np.array([1.0, 0.0, 1.0])
    way = ways.path(start)
    assert np.allclose(way[0], start, atol=0.05)
    difficulty = route_difficulty(scene, way, float(ways.at(start)))
    # To the doorway at (4, 4.5) and on to the front of the couch, whose middle is at (7.5, 2.5): 4.6 m and more than 3
    # m.
    assert 7.0 < difficulty.distance < 9.0
    assert difficulty.rooms == 2
    assert difficulty.turns >= 1


def test_obstacles_are_what_stands_within_a_metre():
    scene = two_rooms()
    middle = np.array(
        [[6.0, 0.0, 4.5]]
    )  # 1.5 m from the wall at z = 6, 1.55 m from the couch's end, 1.95 m from the doorway
    assert route_difficulty(scene, np.repeat(middle, 2, 0), 0.0).obstacles == 0.0
    corner = np.array([[7.5, 0.0, 5.5]])  # two walls within a metre
    assert route_difficulty(scene, np.repeat(corner, 2, 0), 0.0).obstacles == 2.0


# -- candidates and choosing -------------------------------------------------------------------------------------------
def test_every_candidate_can_be_walked(pool):
    scene = two_rooms()
    storeys = MultiFloorMap.of(scene)
    assert {spec.target_category for spec in pool} == {"couch", "bed", "tv"}
    for spec in pool:
        goals = np.concatenate([goals_at(storeys, scene, key) for key in spec.target_ids])
        start = np.array([[spec.start.x, spec.start.floor, spec.start.z]])
        assert spec.difficulty.distance == pytest.approx(DistanceField.of(storeys, start).at(goals).min(), rel=0.01)
        assert spec.difficulty.distance >= 1.0
        assert spec.interact == (spec.target_category in ("couch", "bed"))
        assert ("sit" in spec.instruction) == spec.interact


def test_the_same_seed_draws_the_same_candidates(pool):
    assert list(candidates(two_rooms(), 0, starts=6)) == pool
    assert list(candidates(two_rooms(), 1, starts=6)) != pool


def test_choosing_meets_its_quota_and_is_repeatable(pool):
    quota = Quota({"couch": 6, "bed": 4, "tv": 2}, (12, 12), dict.fromkeys(("couch", "bed", "tv"), (1, 9)))
    chosen = choose(pool, quota)
    assert [sum(spec.target_category == name for spec in chosen) for name in quota.categories] == [6, 4, 2]
    assert choose(pool, quota) == chosen


def test_a_quota_that_cannot_be_met_is_an_error(pool):
    with pytest.raises(HumanclawError, match="no 999 episodes"):
        choose(pool, Quota({"couch": 999}, (0, 999), {"couch": (0, 999)}))


def test_starts_of_one_house_and_category_are_a_metre_apart(pool):
    kept = spaced(pool)
    assert set(kept) < set(pool)
    for spec, other in itertools.combinations(kept, 2):
        if spec.target_category == other.target_category:
            assert np.hypot(spec.start.x - other.start.x, spec.start.z - other.start.z) >= 1.0
    for left_out in set(pool) - set(kept):
        near = [np.hypot(left_out.start.x - spec.start.x, left_out.start.z - spec.start.z) for spec in kept
                if spec.target_category == left_out.target_category]  # fmt: skip
        assert min(near) < 1.0


def test_starts_in_two_houses_or_for_two_categories_may_be_the_same(pool):
    couch = next(spec for spec in pool if spec.target_category == "couch")
    elsewhere = couch.model_copy(update={"scene": "house:9"})
    other = couch.model_copy(update={"target_category": "bed"})
    assert spaced([couch, elsewhere, other, couch]) == (couch, elsewhere, other)


def test_the_quota_of_val_gives_each_house_alike_of_each_category():
    assert VAL.both["chair"] == VAL.both["couch"] == VAL.both["bed"] == VAL.both["potted_plant"] == (4, 7)
    for name, count in VAL.categories.items():
        low, high = VAL.both[name]
        assert low * len(HOUSES) <= count <= high * len(HOUSES)
    assert {name: MINI.categories[name] + BETWEEN.categories[name] for name in EPISODES} == {
        "chair": 76, "couch": 76, "bed": 71, "potted_plant": 67, "tv": 61, "toilet": 49,
    }  # fmt: skip


def test_a_secret_leads_to_houses_that_nobody_else_has():
    houses = secret_houses(5)
    assert houses == secret_houses(5)
    assert len(set(houses)) == 41
    assert not set(houses) & ({*HOUSES} | {*secret_houses(6)})
    assert list(candidates(two_rooms(), 0, starts=2, seed=(5, 2))) != list(candidates(two_rooms(), 0, starts=2))


def test_a_split_reads_back_as_it_was_written(pool, tmp_path):
    specs = named(pool)
    assert len({spec.id for spec in specs}) == len(specs)
    write_episodes(tmp_path / "mine.jsonl", specs)
    assert load_split(str(tmp_path / "mine.jsonl")) == specs


def test_a_split_that_is_not_there_or_not_one_is_refused(tmp_path):
    with pytest.raises(HumanclawError, match="there is no split missing"):
        load_split("missing")
    with pytest.raises(HumanclawError, match=r"Did you mean smoke\?"):
        load_split("smok")
    with pytest.raises(HumanclawError, match=r"there is no file nothere\.jsonl"):
        load_split("nothere.jsonl")
    for field, words in {
        '"id": "a b/c"': "' ' and '/' are not allowed",
        '"start": {"y": 1}': "A start has x, z",
    }.items():
        (tmp_path / "bad.jsonl").write_text(f'{{"instruction": "x", "scene": "floor", "id": "a", {field}}}\n')
        with pytest.raises(HumanclawError, match=words):
            load_split(str(tmp_path / "bad.jsonl"))
    (tmp_path / "bad.jsonl").write_text('{"id": 1}\n')
    with pytest.raises(HumanclawError, match=r"bad\.jsonl:1 is not an episode"):
        load_split(str(tmp_path / "bad.jsonl"))
    (tmp_path / "empty.jsonl").write_text("\n")
    with pytest.raises(HumanclawError, match="holds no episode"):
        load_split(str(tmp_path / "empty.jsonl"))


# -- what comes with the package ---------------------------------------------------------------------------------------
def test_the_validation_split_is_the_papers_in_numbers():
    specs = load_split("val")
    houses = [sum(spec.scene == scene for spec in specs) for scene in {spec.scene for spec in specs}]
    assert (len(specs), len({spec.id for spec in specs}), len(houses)) == (1218, 1218, 41)
    assert min(houses) >= 28
    assert max(houses) <= 30
    assert {name: sum(spec.target_category == name for spec in specs) for name in EPISODES} == EPISODES
    assert sum(spec.interact for spec in specs) == 597


def test_distances_and_tiers_are_spread_as_in_the_paper():
    known = [spec.difficulty for spec in load_split("val")]
    share = lambda test: np.mean([test(difficulty) for difficulty in known])  # noqa: E731
    metres = [difficulty.distance for difficulty in known]
    assert [share(lambda d, t=t: tiers(d)["distance"] == t) for t in ("easy", "medium", "hard")] == pytest.approx(
        [0.40, 0.34, 0.25], abs=0.05
    )
    assert [share(lambda d, t=t: overall(d) == t) for t in ("easy", "medium", "hard")] == pytest.approx(
        [0.23, 0.46, 0.31], abs=0.03
    )
    assert np.median(metres) == pytest.approx(4.4, abs=0.2)
    assert np.quantile(metres, 0.9) < 12.8


def test_the_readme_tells_the_figures_of_the_split_that_is_shipped():
    readme = " ".join((Path(__file__).parents[1] / "README.md").read_text("utf-8").split())
    val = load_split("val")
    ways = np.array([spec.difficulty.distance for spec in val])
    tiers = [overall(spec.difficulty) for spec in val]
    share = ", ".join(f"{100 * tiers.count(tier) / len(val):.1f}" for tier in ("easy", "medium", "hard"))
    thirds = np.histogram(ways, [0, 3.5 + 1e-9, 8 + 1e-9, 99])[0] / len(val)
    couches = Counter(spec.scene for spec in val if spec.target_category == "couch").values()
    for words in (
        f"| easy, medium, hard | {share} % |",
        "| distance of the three tiers | " + ", ".join(f"{100 * third:.0f}" for third in thirds) + " % |",
        f"| {np.median(ways):.1f} m; {np.quantile(ways, 0.9):.1f} m |",
        f"over 20 m ({ways.max():.1f} m the longest)",
    ):
        assert words in readme
    assert (ways > 20).sum() == 7  # "Seven paths"
    counts = Counter(couches)
    assert (min(counts), max(counts), counts[4], counts[7]) == (4, 7, 12, 17)


def test_the_small_splits_are_part_of_the_large_one():
    val, large, mini, smoke = ({spec.id for spec in load_split(name)} for name in SPLITS if name != "dev")
    assert (len(large), len(mini), len(smoke)) == (400, 100, 5)
    assert smoke < mini < large < val
    assert len({spec.scene for spec in load_split("mini")}) == 41


def test_the_development_split_shares_no_house_with_the_others():
    dev, val = load_split("dev"), load_split("val")
    assert (len(dev), len({spec.scene for spec in dev})) == (100, 41)
    assert {spec.scene for spec in dev} == set(DEV_HOUSES)
    assert not {spec.scene for spec in dev} & {spec.scene for spec in val}
    assert Counter(spec.target_category for spec in dev) == Counter(spec.target_category for spec in load_split("mini"))


def test_the_splits_are_of_the_houses_that_are_installed(house):
    made: EpisodeSpec = next(spec for spec in load_split("val") if spec.scene == house.name)
    assert made.scene_digest == house.digest


@pytest.mark.integration
@pytest.mark.parametrize(
    ("split", "number", "least"), [("val", 0, 28), ("val", 3, 28), ("dev", 41, 1)],
    ids=["one storey", "two storeys", "development"],
)  # fmt: skip
def test_making_the_splits_again_draws_the_episodes_that_are_shipped(plugins, split, number, least):
    scene = plugins.scene((*HOUSES, *DEV_HOUSES)[number])
    ours = [spec for spec in load_split(split) if spec.scene == scene.name]
    assert len(ours) >= least
    unnamed = [spec.model_copy(update={"id": spec.target_category, "seed": 0}) for spec in ours]
    assert set(unnamed) <= set(candidates(scene, number))


def test_a_seed_beside_a_secret_is_refused(tmp_path):
    done = CliRunner().invoke(bench, ["generate", "--secret", "5", "--seed", "1", "--out", str(tmp_path)])
    assert (done.exit_code, "leave it out" in done.output, list(tmp_path.iterdir())) == (2, True, [])


def test_a_worked_example_is_of_its_tier_in_every_dimension():
    for tier in TIERS:
        assert set(tiers(typical(load_split("val"), tier).difficulty).values()) == {tier}


def test_a_bar_up_to_a_threshold_has_the_colour_of_the_tier_below_it():
    # Two bars of half a metre: up to 3.5 m it is easy, from there on medium.
    bars = histogram("distance", [3.5, 3.4, 3.6]).crop((20, 80, 380, 360))
    colours = {"#{:02x}{:02x}{:02x}".format(*colour) for _, colour in bars.getcolors()}
    assert colours == {COLOURS["easy"], COLOURS["medium"], "#ffffff"}


def test_rooms_without_obstacles_have_one_bar():
    bars = histogram("obstacle", [0.0, 0.0]).crop((20, 80, 380, 360))
    assert COLOURS["easy"] in {"#{:02x}{:02x}{:02x}".format(*colour) for _, colour in bars.getcolors()}


def test_the_difficulty_of_a_split_is_printed():
    done = CliRunner().invoke(bench, ["difficulty", "--split", "smoke"])
    assert "overall" in done.output
    assert "obstacle" in done.output


@pytest.mark.integration
def test_histograms_and_a_route_of_each_tier_are_one_picture(tmp_path):
    done = CliRunner().invoke(bench, ["difficulty", "--split", "mini", "--out", str(tmp_path / "figure.png")])
    assert done.exit_code == 0, done.output
    with Image.open(tmp_path / "figure.png") as picture:
        assert picture.size == (1200, 830)


@pytest.mark.parametrize(("lost", "field"), [({"start": None}, "start"), ({"target_ids": ()}, "target_ids")])
def test_a_route_without_its_ends_is_told_so(tmp_path, lost, field):
    easy = typical(load_split("val"), "easy")
    write_episodes(tmp_path / "own.jsonl", [easy.model_copy(update=lost)])
    words = ["difficulty", "--split", str(tmp_path / "own.jsonl"), "--out", str(tmp_path / "figure.png")]
    done = CliRunner().invoke(bench, words)
    assert isinstance(done.exception, HumanclawError)
    assert f"has no {field}" in str(done.exception)


def test_a_split_without_difficulties_is_told_so():
    done = CliRunner().invoke(bench, ["difficulty", "--split", "self"])
    assert isinstance(done.exception, HumanclawError)
    assert "no episode of split 'self' has a difficulty" in str(done.exception)
