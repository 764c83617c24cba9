"""The pilot's labels are the simulator's, its eyes answer alike in numpy and torch, and it says what they see."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from humanclaw import Call, Decision, EpisodeContext, EpisodeSpec, HumanclawError, Observation, TaskError
from humanclaw.body import rest_pose
from humanclaw.records import acknowledges
from humanclaw.world import GAZES, SceneBuilder, WorldState, ego_camera
from humanclaw_pilot import agent as pilot, data
from humanclaw_pilot.command import command
from humanclaw_pilot.data import example, planted, played, written
from humanclaw_pilot.network import CELLS, CLASSES, SHAPES, SIZE, WEIGHTS, Eyes, Glance, halved, prepared

SPEC = EpisodeSpec(id="one", instruction="find a couch", scene="", target_category="couch")
PICTURE = np.zeros((512, 512, 3), np.uint8)


def glance(kind="floor", mine=0):
    """Return a glance at one kind of thing 2 m away. mine: rows of cells that show a couch, from the middle."""
    share = np.zeros((len(CLASSES), CELLS, CELLS), np.float32)
    share[CLASSES.index(kind)] = 1
    share[:, CELLS // 2 : CELLS // 2 + mine, 28:36] = np.eye(len(CLASSES))[CLASSES.index("couch")][:, None, None]
    return Glance(share, np.full((CELLS, CELLS), 2, np.float32))


def begun(plugins, seen, monkeypatch, **options):
    monkeypatch.setattr(Eyes, "__call__", lambda eyes, rgb: seen)
    agent = plugins.make("agents", "pilot", options)
    agent.begin(EpisodeContext(SPEC, plugins.skills, seed=0))
    return agent


def test_labels_are_what_the_simulator_knows(plugins):
    builder = SceneBuilder()
    builder.box("floor", (8, 0.1, 8), (0, -0.1, 0))
    builder.box("couch", (1, 0.8, 0.5), (0, 0, 1.5))
    renderer, scene, camera = plugins.make("renderers", "raster"), builder.scene(), ego_camera(rest_pose())
    renderer.load(scene)
    view = renderer.render(WorldState(rest_pose(), {}), camera)
    labelled = example(view, scene, camera, 0.0)
    middle = view.ids.reshape(CELLS, 8, CELLS, 8)[:, 4, :, 4]
    assert {*np.unique(labelled.kinds[middle == 2])} <= {CLASSES.index("couch"), CLASSES.index("floor")}
    assert (labelled.kinds == CLASSES.index("couch")).sum() > 100
    assert (labelled.kinds == CLASSES.index("floor")).sum() > 500
    # Where the labels say floor, a level floor under these eyes has the depth that they say.
    floor = pilot.imagined(view.rgb, glance(), labelled.kinds < 0, GAZES["body"], 3.5, 0.0).depth[4::8, 4::8]
    on_floor = labelled.kinds == CLASSES.index("floor")
    assert np.median(np.abs(floor / labelled.depth - 1)[on_floor]) < 0.01


@pytest.mark.integration
def test_views_come_from_training_houses_and_can_be_read_again(plugins, tmp_path):
    views = list(planted(plugins, 0, [rest_pose()], 2))
    written(tmp_path / "views.npz", views)
    with np.load(tmp_path / "views.npz") as read:
        assert read["picture"].shape == (2, SIZE, SIZE, 3)
        assert (read["kinds"][1] == views[1].kinds).all()
    with pytest.raises(HumanclawError, match="first"):
        next(planted(plugins, 500_000, [rest_pose()], 1))  # A house of dev.


@pytest.mark.integration
def test_an_agents_views_come_from_the_house_that_was_asked_for(plugins, monkeypatch):
    houses = []
    monkeypatch.setattr(data, "example", lambda view, scene, camera, floor: houses.append(scene.name))
    list(islice(played(plugins, "wanderer", {}, 7, (0, 100), 1), 2))
    assert houses == [plugins.scene("house:train-7").name] * 2


def test_a_seed_for_which_a_house_has_no_task_is_left_out(plugins, monkeypatch):
    def failing(error):
        def reset(gym, seed):
            raise error

        monkeypatch.setattr(data.Gym, "reset", reset)
        return list(played(plugins, "wanderer", {}, 7, (0, 1), 1))

    assert failing(TaskError("no house of 20 has a task for seed 0.")) == []
    with pytest.raises(HumanclawError, match="no simulator"):
        failing(HumanclawError("no simulator is installed."))


def test_weights_in_numbers_that_numpy_lacks_are_refused(tmp_path):
    torch = pytest.importorskip("torch")
    from safetensors.torch import save_file as save

    save({"answer.bias": torch.zeros(10, dtype=torch.bfloat16)}, tmp_path / "pilot.safetensors")
    with pytest.raises(HumanclawError, match="cannot read the pilot's weights"):
        Eyes.read(tmp_path / "pilot.safetensors")


def test_numpy_and_torch_agree_and_training_resumes(tmp_path, monkeypatch):
    torch = pytest.importorskip("torch")
    from humanclaw_pilot import training

    monkeypatch.setattr(training, "BATCH", 2)  # A step on 32 pictures takes seconds.
    rng = np.random.default_rng(0)
    kinds = rng.integers(2, size=(4, CELLS, CELLS)).astype(np.uint8)
    pictures = (255 * kinds[..., None]).repeat(4, 1).repeat(4, 2).repeat(3, 3).astype(np.uint8)
    data, out = (pictures, kinds, np.full(kinds.shape, 2, np.float16)), tmp_path / "eyes.safetensors"
    training.train(data, out, 4, 0, print, every=2)

    def interrupt(progress):
        raise KeyboardInterrupt

    again = tmp_path / "again.safetensors"
    with pytest.raises(KeyboardInterrupt):
        training.train(data, again, 4, 0, interrupt, every=2)
    training.train(data, again, 4, 0, print, every=2)
    assert again.read_bytes() == out.read_bytes()
    for others, seed in ((data, 1), ((pictures, 1 - kinds, data[2]), 0)):
        with pytest.raises(HumanclawError, match="is of a training with other views, steps or seed"):
            training.train(others, again, 4, seed, print)
    with pytest.raises(HumanclawError, match="there is no checkpoint"):
        training.train(data, tmp_path / "new.safetensors", 4, 0, print, start=tmp_path / "none.safetensors")

    model = training.TorchLayers().eval()
    model.load_state_dict(torch.load(training._beside(out))["model"])
    with torch.no_grad():
        outputs = model(torch.from_numpy(prepared(pictures[:1])))[0].numpy()
    seen = Eyes.read(out)(pictures[0].repeat(2, 0).repeat(2, 1))
    assert np.abs(np.exp(outputs[-1]) / seen.depth - 1).max() < 0.05  # Weights are kept in half precision.
    assert (halved(pictures[0].repeat(2, 0).repeat(2, 1)) == pictures[0]).all()


def test_the_eyes_undo_the_film_curve_of_pictures():
    """Tones that plugins/raster/tests/test_light.py derives by hand for surfaces of brightness 60, 120, 180, 240."""
    tones = np.zeros((1, SIZE, SIZE, 3), np.uint8)
    tones[0, 0, :5, 0] = 28, 93, 170, 233, 255
    assert prepared(tones)[0, 0, 0, :5] * 127.5 + 127.5 == pytest.approx([60, 120, 180, 240, 255], abs=1)


def test_the_shipped_weights_are_those_of_this_network_and_small():
    weights = load_file(WEIGHTS)
    assert {name: weights[f"{name}.weight"].shape for name in SHAPES} == {
        name: (after, before, side, side) for name, (before, after, side) in SHAPES.items()
    }
    assert sum(part.size for part in weights.values()) < 10e6
    assert WEIGHTS.stat().st_size < 10e6


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda weights: weights.pop("answer.bias"), "another network"),
        (lambda weights: weights.update({"answer.bias": np.full(10, np.nan, np.float16)}), "not finite"),
    ],
)
def test_weights_of_another_network_are_refused(damage, message, tmp_path):
    weights = load_file(WEIGHTS)
    save_file({**weights, "answer.bias": weights["answer.bias"] + 1}, tmp_path / "pilot.safetensors")
    assert Eyes.read(tmp_path / "pilot.safetensors").digest != Eyes.read().digest
    damage(weights)
    save_file(weights, tmp_path / "pilot.safetensors")
    for path in (tmp_path / "pilot.safetensors", tmp_path, tmp_path / "none"):
        with pytest.raises(HumanclawError, match=message if path.suffix else "cannot read the pilot's weights"):
            Eyes.read(path)


@pytest.mark.parametrize(("rows", "says"), [(0, False), (8, True)])
def test_it_names_the_target_where_its_eyes_show_it(rows, says, plugins, monkeypatch):
    decision = begun(plugins, glance(mine=rows), monkeypatch).decide(Observation(0, SPEC.instruction, PICTURE), ())
    assert acknowledges(decision.visible_state, "couch") is says
    (call,) = decision.calls
    assert plugins.skills[call.skill].check(call.params) == call.params


class Secret:
    """What only the simulator knows: whoever calls it or asks it for anything fails."""

    def __call__(self):
        raise AssertionError("was asked")

    def __getattr__(self, name):
        raise AssertionError(name)


def test_it_is_told_nothing_but_pictures_and_words(plugins, monkeypatch):
    agent = begun(plugins, glance(), monkeypatch)
    known = EpisodeContext(SPEC, plugins.skills, seed=0)
    agent.begin(replace(known, scene=Secret(), state=Secret(), view=Secret()))
    assert not agent.privileged
    assert agent.decide(Observation(0, SPEC.instruction, PICTURE), ()).calls
    assert agent._context.scene is agent._context.state is None


def test_what_it_cannot_do_is_said(plugins, monkeypatch):
    with pytest.raises(HumanclawError, match="certain"):
        plugins.make("agents", "pilot", {"certain": 2})
    agent = begun(plugins, glance(), monkeypatch)
    with pytest.raises(HumanclawError, match="knows chair"):
        agent.begin(EpisodeContext(SPEC.model_copy(update={"target_category": "lamp"}), plugins.skills, seed=0))


class Calls:
    """A planner that calls a skill of one role."""

    def __init__(self, skills, role):
        self._call = Call(next(name for name, skill in skills.items() if skill.role == role))

    def decide(self, observation, history):
        return Decision((self._call,))


@pytest.mark.parametrize(
    ("before", "unseen", "renewals"),
    [
        ("locomotion", 0, 0),
        ("locomotion", pilot.LATELY - 1, 0),
        ("locomotion", pilot.LATELY, pilot.AGAIN),
        ("sit", 9, 0),
    ],
)
def test_it_stops_only_where_it_sits_or_has_lately_seen_its_target(before, unseen, renewals, plugins, monkeypatch):
    agent, begun_anew = begun(plugins, glance(mine=8), monkeypatch), []
    agent._planner, agent._renew = Calls(plugins.skills, before), lambda: begun_anew.append(1)
    agent.decide(Observation(0, SPEC.instruction, PICTURE), ())
    monkeypatch.setattr(Eyes, "__call__", lambda eyes, rgb: glance())
    for step in range(1, unseen):
        agent.decide(Observation(step, SPEC.instruction, PICTURE), ())
    agent._planner = Calls(plugins.skills, "stop")
    monkeypatch.setattr(Eyes, "__call__", lambda eyes, rgb: glance(mine=0 if unseen else 8))
    assert agent.decide(Observation(unseen, SPEC.instruction, PICTURE), ()).calls
    assert len(begun_anew) == renewals


def test_each_new_search_believes_nearer_obstacles_alone(plugins, monkeypatch):
    ranges = []
    agent = begun(plugins, glance(), monkeypatch)
    monkeypatch.setattr(pilot, "imagined", lambda rgb, seen, mine, gaze, clear, deeper: ranges.append(clear))
    monkeypatch.setattr(agent, "_renew", lambda: None)
    for searches in (0, 2):
        agent._planner, agent._left = Calls(plugins.skills, "locomotion"), pilot.AGAIN - searches
        agent.decide(Observation(0, SPEC.instruction, PICTURE), ())
    assert ranges == pytest.approx([3.5, 3.5 * 0.49])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["data", "--houses", "seven", "--out", "views"], "expects FIRST:END, such as 0:150; it got 'seven'"),
        (["data", "--houses", "5:5", "--out", "views"], "expects FIRST:END"),
        (["measure", "."], "no views"),
    ],
)
def test_what_a_command_cannot_use_is_told_before_writing(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(HumanclawError, match=message):
        command.main(words, standalone_mode=False)
    assert list(tmp_path.iterdir()) == []
