"""What an instruction asks for: the thing it means among those it names, and whether to sit on it."""

from dataclasses import replace

import pytest
import rooms

from humanclaw import EpisodeSpec, SceneError
from humanclaw.records import ALIASES, category_of, instruction, targeted, wants_to_sit


@pytest.mark.parametrize(
    ("words", "category"),
    [
        ("find the tv behind the plant", "tv"),
        ("Find the TV behind the big potted plants.", "tv"),
        ("walk past the television to the bed", "bed"),
        ("go from the television to the couch", "couch"),
        ("walk past the door to the bed", "bed"),
        ("find the bed between the armchair and the television", "bed"),
        ("find the bed in front of the flat tv screen", "bed"),
        ("find a bed, not a couch", "bed"),
        ("stand next to the sofa", "couch"),
        ("find the tv above the couch", "tv"),
        ("leave the couch and go to the tv", "tv"),
        ("find the tv on the other side of the couch", "tv"),
        ("find the bed with a plant on it", "bed"),
        ("find the tv behind the big old dusty plant", "tv"),
        ("find the bed instead of the couch", "bed"),
        ("stand next to the bed facing the television", "bed"),
        ("skip the television, go to the bed", "bed"),
        ("find the tv on top of the commode", "tv"),
        ("go through the door beyond the potted plant to the tv", "tv"),
        ("do not go to the couch but to the bed", "bed"),
        ("find the tv. The potted plant is in front of it", "tv"),
        ("take a seat on the bed", "bed"),
        ("find the door", ""),
    ],
)
def test_a_thing_that_only_says_where_is_not_the_target(words, category):
    assert category_of(words) == category


@pytest.mark.parametrize("category", ALIASES)
def test_the_instruction_for_a_category_names_it(category):
    assert category_of(instruction(category)) == category


@pytest.mark.parametrize(
    ("words", "sits"),
    [
        ("go to the couch but do not sit on it", False),
        ("go to the couch; don't sit down", False),
        ("go to the couch and never take a seat", False),
        ("do not stop; sit on the couch", True),
        ("find the couch and sit on it, do not sit on the bed", True),
        ("find a couch and take a seat", True),
        ("find a couch", False),
        ("go to the couch, but you must not under any circumstances sit", False),
        ("refuse to sit on the couch", False),
        ("avoid taking a seat on the couch", False),
        ("go to the toilet seat", False),
        ("find a couch and be seated", True),
        ("do not forget to sit on the couch", True),
        ("do not hesitate to sit on the couch", True),
        ("do not touch the chair while you sit on the couch", True),
        ("do not sit until you reach the couch", True),
        ("go to the couch, there is no need to sit", False),
        ("you cannot sit on it", False),
        ("stand, rather than sit", False),
        ("go to the sitting room couch", False),
    ],
)
def test_who_is_told_not_to_sit_is_not_asked_to(words, sits):
    assert wants_to_sit(words) is sits


@pytest.mark.parametrize("asked", ["couch", "sofa", "", "Sofa"])
def test_targets_left_out_are_all_of_the_category(asked):
    spec = EpisodeSpec(id="mine", instruction="go to the sofa and sit on it", scene="test:rooms", target_category=asked)
    task = targeted(spec, rooms.two_rooms())
    assert (task.target_category, task.target_ids, task.interact) == ("couch", (20,), not asked)


@pytest.mark.parametrize(
    "fields",
    [
        {"instruction": "Stand up from the bed and watch the news."},
        {"instruction": "Take the screen, not the bed."},
        {"instruction": "Find a seat.", "target_category": "couch"},
        {"instruction": "The bed is too hard; find the news.", "target_ids": (21,)},
    ],
)
def test_words_that_may_mean_the_category_do_not_contradict_it(fields):
    spec = EpisodeSpec(**{"id": "mine", "scene": "test:rooms", "target_category": "tv"} | fields)
    assert targeted(spec, rooms.two_rooms()).target_category == spec.target_category


def test_a_category_may_have_blanks():
    scene = rooms.two_rooms()
    plant = replace(scene.objects[0], category="potted_plant")
    assert replace(scene, objects=(plant,)).of_category("potted plant") == (plant,)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"target_category": "piano"}, "episode 'mine' looks for a piano; test:rooms has none.*Choose from: .*couch"),
        ({"instruction": "find the tv", "target_ids": (20,)}, "names a tv; its target 20 is a couch.*target_category"),
        ({"target_category": "tv", "target_ids": (20,)}, "names a tv; its target 20 is a couch.*target_category"),
        ({"target_category": "tv", "interact": True}, "asks to sit on a tv.*Leave out interact"),
        (
            {"instruction": "sit on the bed", "target_category": "tv"},
            "asks for a bed in 'sit on the bed'; its target_category is 'tv'.*Mend one of them, or list .* target_ids",
        ),
        ({"target_ids": (99999,)}, "test:rooms has no object 99999, a target of episode 'mine'.*Leave out target_ids"),
    ],
)
def test_targets_that_the_scene_lacks_are_named(fields, message):
    spec = EpisodeSpec(**{"id": "mine", "instruction": "find it", "scene": "test:rooms"} | fields)
    with pytest.raises(SceneError, match=f"(?s){message}"):
        targeted(spec, rooms.two_rooms())
