"""Tests of training on a few artificial chunks: gliding bodies, commanded by the distance that they cover."""

import hashlib
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from gliding import gliding, save_chunks

from humanclaw import HumanclawError
from humanclaw.body import Motion, Pose2D, rest_pose
from humanclaw.motion import DiTGenerator, ModelConfig, MotionProfile, Solver, load_adapter, load_base, read_header
from humanclaw_train import train
from humanclaw_train.data import tensors
from humanclaw_train.data.tensors import commanded, noisy_history
from humanclaw_train.eval import fidelity
from humanclaw_train.model import kinematics
from humanclaw_train.model.flow import Loss, Weights
from humanclaw_train.train import Recipe, draw, main, seeded

COUNT = 64


@pytest.fixture(scope="module")
def chunks(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("chunks")
    save_chunks(folder / "stop.npz", np.zeros(COUNT), np.zeros((COUNT, 0)))
    # A prior must have seen that bodies move; here the history shows how fast.
    save_chunks(folder / "base.npz", np.linspace(-0.5, 0.5, COUNT), np.zeros((COUNT, 0)), moving=True)
    return folder


@pytest.fixture(scope="module")
def backwards(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("backwards")
    distance = np.linspace(0.05, 0.45, COUNT)
    save_chunks(folder / "step_back.npz", -distance, distance[:, None])
    return folder


@pytest.fixture(scope="module", autouse=True)
def _small():
    """A model that trains in seconds, on one thread, and is looked at in one rollout."""
    threads = torch.get_num_threads()
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(train.SIZES, "lite", ModelConfig(64, 1, 4, prediction="clean"))
        patch.setattr(fidelity, "live", partial(fidelity.live, rollouts=1))
        yield
    torch.set_num_threads(threads)


def _base(chunks: Path, out: Path, *more: str) -> Path:
    assert main(["base", "--data", str(chunks), "--out", str(out), "--batch", "16", "--device", "cpu", *more]) == 0
    return out / "base.safetensors"


@pytest.fixture(scope="module")
def base_file(chunks, tmp_path_factory) -> Path:
    return _base(chunks, tmp_path_factory.mktemp("base"), "--steps", "2", "--licence", "CC0")


def _step_back(backwards: Path, base_file: Path, out: Path) -> list[str]:
    """The command line that trains step_back, without its options."""
    return ["adapter", "step_back", "--data", str(backwards), "--base", str(base_file), "--out", str(out)]


def _adapter(backwards: Path, base_file: Path, out: Path, *more: str) -> Path:
    arguments = _step_back(backwards, base_file, out)
    assert main([*arguments, "--device", "cpu", "--batch", "16", *more]) == 0
    return out / "adapter.safetensors"


@pytest.mark.integration
def test_an_adapter_learns_to_cover_the_commanded_distance(chunks, backwards, tmp_path):
    fast = ("--rate", "3e-3", "--history-noise", "0")
    base = _base(chunks, tmp_path, "--steps", "400", *fast)
    path = _adapter(backwards, base, tmp_path / "step_back", "--steps", "200", *fast)
    generator = DiTGenerator(load_base(base), MotionProfile(Solver("midpoint", 2)))
    start = generator.start()
    for distance in (0.15, 0.35):
        future = generator.generate(start, path, {"z": distance}, (0,))
        assert start.root[-1, 2] - future.root[-1, 2] == pytest.approx(distance, abs=0.05)


def test_the_start_of_an_episode_is_standing_taken_from_the_data(base_file):
    start = load_base(base_file)
    np.testing.assert_allclose(start.start_root, rest_pose(5).root, atol=1e-6)


def test_a_checkpoint_says_what_it_was_trained_on(backwards, base_file, tmp_path):
    base = load_base(base_file)
    assert base.card.licences == ("CC0",)
    assert base.card.data["chunks"] == 2 * COUNT
    assert base.card.data["real"] == 2 * COUNT // 4
    assert base.card.data["sources"] == {"a studio": 2 * COUNT}
    assert base.card.recipe["done_steps"] == 2
    adapter = load_adapter(_adapter(backwards, base_file, tmp_path, "--steps", "1"), base, "step_back")
    assert adapter.config.encoder == "mlp"
    assert adapter.config.params == ("z",)
    assert adapter.config.centre[0] == pytest.approx(0.25, abs=0.01)


def _tree(*folders: Path) -> dict[Path, str]:
    files = [
        file for folder in folders for file in folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts
    ]
    return {file: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def test_training_an_adapter_changes_no_file_but_those_of_its_own_run(backwards, base_file, tmp_path):
    repository = Path(__file__).parents[3]
    watched = (repository / "core", repository / "skills", backwards, base_file.parent)
    before = _tree(*watched)
    copy = tmp_path / "skill" / "adapter.safetensors"
    adapter = _adapter(backwards, base_file, tmp_path / "run", "--steps", "2", "--export", str(copy))
    assert _tree(*watched) == before
    assert copy.read_bytes() == adapter.read_bytes()
    assert {file.parent for file in _tree(tmp_path)} == {tmp_path / "run", copy.parent}


def test_the_papers_training_is_two_switches_and_the_header_tells(backwards, base_file, tmp_path, capsys):
    ours = _adapter(backwards, base_file, tmp_path / "ours", "--steps", "3")
    paper = _adapter(backwards, base_file, tmp_path / "paper", "--steps", "3", "--tau", "uniform", "--loss", "plain")
    assert paper.read_bytes() != ours.read_bytes()
    recipes = [read_header(path)["card"]["recipe"] for path in (ours, paper)]
    assert [(recipe["tau"], recipe["terms"]) for recipe in recipes] == [("squared", "full"), ("uniform", "plain")]
    assert recipes[1]["loss"]["joints"] == 0.0 < recipes[0]["loss"]["joints"]
    assert capsys.readouterr().out.splitlines()[0].endswith("on cpu, from step 0 to step 3")


def test_a_checkpoint_begun_from_another_names_the_licences_of_both(backwards, base_file, tmp_path):
    first = _adapter(backwards, base_file, tmp_path / "first", "--steps", "1", "--licence", "CMU: free")
    second = _adapter(
        backwards, base_file, tmp_path / "second", "--steps", "1", "--init", str(first), "--licence", "Own: MIT"
    )
    assert read_header(second)["card"]["licences"] == ["Own: MIT", "CMU: free"]


def test_uniform_flow_times_are_the_roots_of_the_squared_ones(base_file, backwards):
    chunks = tensors.load([backwards], "step_back")
    chosen = torch.zeros(4000, dtype=torch.long)
    taus = [draw(chunks, chosen, Recipe(tau=tau), seeded(torch.device("cpu"), 0))[3] for tau in ("uniform", "squared")]
    assert float(taus[0].mean()) == pytest.approx(0.5, abs=0.02)
    assert torch.equal(taus[0] ** 2, taus[1])


def test_another_seed_learns_other_weights(backwards, base_file, tmp_path):
    first = _adapter(backwards, base_file, tmp_path / "first", "--steps", "2").read_bytes()
    assert _adapter(backwards, base_file, tmp_path / "second", "--steps", "2", "--seed", "1").read_bytes() != first


def test_missing_chunks_are_an_error_with_a_remedy(base_file, tmp_path, capsys):
    arguments = ["adapter", "walk", "--data", str(tmp_path), "--base", str(base_file), "--out", str(tmp_path)]
    assert main(arguments) == 2
    assert "no walk.npz" in (said := capsys.readouterr().err)
    assert "humanclaw data chunks --skill FOLDER_OF/walk --clips DIR" in said


WITHOUT_A_HOST = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in ("pydantic", "pluggy", "click", "scipy", "jinja2", "rich", "jsonschema", "threadpoolctl"):
            raise ImportError(name)

sys.meta_path.insert(0, Missing())
import humanclaw_train.train
"""


@pytest.mark.integration
def test_training_imports_where_there_is_no_plugin_host():
    subprocess.run([sys.executable, "-c", WITHOUT_A_HOST], check=True)


# -- histories ---------------------------------------------------------------------------------------------------------
def _spoilt(strength: float = 1.0) -> tuple[np.ndarray, ...]:
    clean = tuple(torch.from_numpy(part).float() for part in gliding(np.linspace(0.05, 0.45, COUNT)))
    off = noisy_history(*clean, torch.Generator().manual_seed(0), strength)
    return tuple(part.numpy().astype(float) for part in (*clean, *off))


def test_a_spoilt_history_stays_in_its_canonical_frame():
    *_, root, rotations = _spoilt()
    for pair in zip(root, rotations, strict=True):
        frame = Pose2D.of_history(Motion(pair[0][:5], pair[1][:5]))
        assert (frame.x, frame.z, frame.floor) == pytest.approx((0, 0, 0), abs=1e-5)
        assert frame.yaw == pytest.approx(0, abs=0.02)


def test_a_spoilt_chunk_ends_as_the_clean_one_without_a_jump():
    clean_root, clean_rotations, root, rotations = _spoilt()
    np.testing.assert_allclose(root[:, -1], clean_root[:, -1], atol=2e-3)
    np.testing.assert_allclose(rotations[:, -1], clean_rotations[:, -1], atol=5e-3)
    offset = rotations - clean_rotations
    assert np.abs(offset[:, :5]).max() > 0.1
    jump = np.abs(np.diff(offset, axis=1))
    assert jump[:, 4:].max() < 0.1


def test_only_moving_bodies_get_larger_errors():
    """Larger errors of standing feet would hide which foot moves first."""

    def most(moving, strength):
        clean = tuple(torch.from_numpy(part).float() for part in gliding(np.full(COUNT, 0.5), moving))
        off = noisy_history(*clean, torch.Generator().manual_seed(0), strength)
        return float((off[1] - clean[1]).abs().max())

    assert most(False, 2.5) == most(False, 1.0)
    assert most(True, 2.5) == pytest.approx(2.5 * most(True, 1.0), rel=0.05)


def test_no_strength_leaves_chunks_as_they_are():
    clean_root, clean_rotations, root, rotations = _spoilt(0.0)
    np.testing.assert_allclose(root, clean_root, atol=1e-5)
    np.testing.assert_array_equal(rotations, clean_rotations)


def test_a_rise_is_measured_from_where_the_spoilt_pelvis_is():
    clean, spoilt_root = torch.zeros(1, 20, 3), torch.zeros(1, 20, 3)
    clean[:, 4, 1], spoilt_root[:, 4, 1] = 0.95, 0.93

    def asked(measures: list[str], *params: float) -> list[float]:
        return commanded(measures, torch.tensor([params]), clean, spoilt_root)[0].tolist()

    assert asked(["hips.rise", "hips.forward"], 0.15, 0.3) == pytest.approx([0.17, 0.3])
    assert asked(["hips.forward", "hips.drop"], 0.3, 0.15) == pytest.approx([0.3, 0.13])
    assert asked(["hips.left", "hips.forward", "heading.left"], 0.1, 0.3, 0.2) == pytest.approx([0.1, 0.3, 0.2])


# -- the loss ----------------------------------------------------------------------------------------------------------
def _loss_of(shift, **weights: float) -> float:
    root, rotations = (torch.from_numpy(part).float() for part in gliding(np.array([0.3])))
    states = kinematics.encode(root, rotations)
    normaliser = tensors.normaliser(tensors.ChunkTensors("x", root, rotations, torch.zeros(1, 0), {}))
    future = states[:, 5:].clone()
    shift(future)
    normal = normaliser.forward(future)
    return float(Loss(normaliser, Weights(**weights))(normal, normaliser.forward(states[:, 5:]), normal, states))


def test_the_loss_of_the_truth_is_nothing():
    assert _loss_of(lambda future: None) == pytest.approx(0, abs=1e-4)


def test_only_a_wrong_end_is_a_wrong_outcome():
    def price(frame: int) -> float:
        def shift(future):
            future[:, frame, 2] += 0.02

        return _loss_of(shift, outcome=0.2) - _loss_of(shift, outcome=0.0)

    assert price(7) == pytest.approx(0, abs=1e-5)
    assert price(14) == pytest.approx(0.2 * 1.5 / 6, rel=0.01)  # 2 cm in one of six numbers: |2| - 1/2


def test_chunks_with_a_number_that_is_not_finite_are_refused(tmp_path):
    save_chunks(tmp_path / "base.npz", np.array([0.1, np.nan]), np.zeros((2, 0)))
    with pytest.raises(HumanclawError, match="not finite"):
        tensors.load([tmp_path], "base")


def test_unknown_data_is_refused_before_anything_is_trained(tmp_path):
    with pytest.raises(HumanclawError, match="no chunks"):
        tensors.load_all([tmp_path])


def test_what_two_folders_both_hold_of_real_clips_is_learnt_from_once(tmp_path):
    for seed, metres in enumerate((0.1, 0.2)):
        (tmp_path / str(seed)).mkdir()
        distance = np.linspace(0.05, 0.45, COUNT)
        distance[np.arange(COUNT) % 4 != 0] += metres  # Every fourth is real; the rest has another seed.
        save_chunks(tmp_path / str(seed) / "step_back.npz", -distance, distance[:, None], moving=True)
    loaded = tensors.load([tmp_path / "0", tmp_path / "1"], "step_back")
    assert loaded.statistics["real"] == 16
    assert len(loaded) == loaded.statistics["chunks"] == 16 + 48 + 48


def test_a_sliding_foot_costs_more_than_a_sliding_hand():
    def turn(joint):
        def shift(future):
            future[:, 7, 3 + 3 * joint] += 0.1

        return shift

    ankle, wrist = 7, 20
    assert _loss_of(turn(ankle)) > _loss_of(turn(wrist))


def test_a_licence_that_says_nothing_is_refused(capsys):
    with pytest.raises(SystemExit):
        main(["base", "--out", "nowhere", "--licence", " "])
    assert "the licence is empty" in capsys.readouterr().err


@pytest.mark.parametrize(("names", "measures"), [(["z"], ["hips.forward"]), (["ahead"], ["hips.back"])])
def test_chunks_with_other_commands_are_not_mixed(backwards, tmp_path, names, measures):
    with np.load(backwards / "step_back.npz") as arrays:
        np.savez(tmp_path / "step_back.npz", **{**arrays, "names": names, "measures": measures})
    message = rf"commands {names[0]} \({measures[0]}\); .* commands z \(hips.back\)"
    with pytest.raises(HumanclawError, match=message):
        tensors.load([backwards, tmp_path], "step_back")


def test_training_tells_the_fidelity_of_an_installed_skill(backwards, base_file, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)  # Outside the repository.
    words = [*_step_back(backwards, base_file, tmp_path / "run"), "--device", "cpu", "--batch", "16", "--steps", "1"]
    assert main(words) == 0
    assert "step       1  fidelity " in capsys.readouterr().out
