"""Tests of how a run computes, validates, logs and resumes, on a few artificial chunks."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import cut_short
from gliding import save_chunks

from humanclaw import HumanclawError
from humanclaw.motion import read_header
from humanclaw_train import train
from humanclaw_train.data import tensors
from humanclaw_train.train import Processes, Recipe, validation

SUPPORT = Path(__file__).parents[3] / "tests" / "support"
SIX = ["--steps", "6", "--batch", "8", "--size", "tiny", "--device", "cpu"]


@pytest.fixture(scope="module")
def chunks(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("chunks")
    distance = np.linspace(-0.5, 0.5, 64)
    save_chunks(folder / "base.npz", distance, np.zeros((64, 0)), moving=True)
    save_chunks(folder / "held_out" / "base.npz", distance[::5] * 0.9, np.zeros((13, 0)), moving=True)
    return folder


def _base(chunks: Path, out: Path, *more: str) -> Path:
    assert train.main(["base", "--data", str(chunks), "--out", str(out), *SIX, *more]) == 0
    return out / "base.safetensors"


def _torchrun(program: list[str]) -> None:
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", *program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("mode", [(), ("--precision", "bf16"), ("--precision", "float32"), ("--tau", "uniform")])
def test_three_steps_and_three_more_are_six_steps_bit_for_bit(chunks, tmp_path, mode):
    whole = _base(chunks, tmp_path / "whole", *mode)
    arguments = ["base", "--data", str(chunks), "--out", str(tmp_path / "cut"), *SIX, *mode]
    assert cut_short.main(3, arguments) == 0
    assert torch.load(tmp_path / "cut" / "state.pt")["step"] == 3
    assert _base(chunks, tmp_path / "cut", *mode).read_bytes() == whole.read_bytes()


# -- what goes wrong ---------------------------------------------------------------------------------------------------
def test_a_loss_that_is_no_number_stops_a_run_and_spares_its_files(chunks, tmp_path, capsys, monkeypatch):
    arguments = ["base", "--data", str(chunks), "--out", str(tmp_path), *SIX]
    assert cut_short.main(3, arguments) == 0
    kept = {path: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr(train, "_SAVE_SECONDS", 0)
    assert train.main([*arguments, "--rate", "1e30"]) == 2
    message = capsys.readouterr().err
    assert "diverged at step 4" in message
    assert "Lower --rate (now 1e+30)" in message
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == kept
    assert train.main(arguments) == 0


def test_a_loss_that_explodes_stops_a_run_and_spares_its_files(chunks, tmp_path, capsys):
    """From 9 at a rate of .001 the loss grows more than tenfold at one of .3, and stays finite."""
    arguments = ["base", "--data", str(chunks), "--out", str(tmp_path), *SIX]
    assert cut_short.main(3, arguments) == 0
    kept = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert train.main([*arguments, "--steps", "30", "--rate", "0.3"]) == 2
    message = capsys.readouterr().err
    assert "diverged at step 30: expected a loss near the" in message
    assert f"start again from the last save, which {tmp_path} keeps" in message
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == kept
    assert train.main(arguments) == 0


def test_a_run_without_a_save_names_none(chunks, tmp_path, capsys):
    assert train.main(["base", "--data", str(chunks), "--out", str(tmp_path), *SIX, "--rate", "1e30"]) == 2
    message = capsys.readouterr().err
    assert "Training diverged" in message
    assert "last save" not in message


def test_a_flipped_bit_of_a_state_is_noticed(chunks, tmp_path, capsys):
    _base(chunks, tmp_path)
    state = tmp_path / "state.pt"
    content = bytearray(state.read_bytes())
    weights = next(iter(torch.load(state)["module"].values())).numpy().tobytes()
    content[content.index(weights)] ^= 1
    state.write_bytes(content)
    assert train.main(["base", "--data", str(chunks), "--out", str(tmp_path), *SIX]) == 2
    assert "is incomplete, damaged or has other content" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "before", "now"),
    [("--batch", 8, 16), ("--loss", "full", "plain"), ("--seed", 0, 1), ("--size", "tiny", "lite")],
)
def test_a_run_goes_on_with_its_own_settings_alone(chunks, tmp_path, capsys, option, before, now):
    _base(chunks, tmp_path)
    assert train.main(["base", "--data", str(chunks), "--out", str(tmp_path), *SIX, option, str(now)]) == 2
    message = capsys.readouterr().err
    assert f"is of a run with {option} {before}; this run has {option} {now}." in message
    assert "another --out" in message


@pytest.mark.parametrize("array", ["root", "rotations"])
def test_a_run_goes_on_with_its_own_chunks_alone(chunks, tmp_path, capsys, array):
    _base(chunks, tmp_path / "run")
    with np.load(chunks / "base.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "base.npz", **arrays | {array: arrays[array] * np.float32(0.5)})
    assert train.main(["base", "--data", str(tmp_path), "--out", str(tmp_path / "run"), *SIX]) == 2
    assert "--data base, 64 chunks, digest" in capsys.readouterr().err


def test_a_run_goes_on_for_more_steps_at_another_rate(chunks, tmp_path):
    _base(chunks, tmp_path)
    _base(chunks, tmp_path, "--steps", "8", "--rate", "1e-4")
    assert torch.load(tmp_path / "state.pt")["step"] == 8


def test_a_run_with_fewer_steps_than_are_done_is_refused(chunks, tmp_path, capsys):
    _base(chunks, tmp_path)
    few = ["base", "--data", str(chunks), "--out", str(tmp_path), *SIX, "--steps", "2"]
    assert train.main(few) == 2
    assert "Expected --steps of 6 or more" in capsys.readouterr().err
    (tmp_path / "state.pt").unlink()
    (tmp_path / "state.pt").mkdir()
    assert train.main(few) == 2
    assert "Expected the state of a run" in capsys.readouterr().err


def test_a_state_whose_weights_are_no_numbers_is_refused(chunks, tmp_path, capsys):
    _base(chunks, tmp_path)
    content = torch.load(tmp_path / "state.pt")
    next(iter(content["module"].values())).fill_(torch.nan)
    torch.save(content, tmp_path / "state.pt")
    assert train.main(["base", "--data", str(chunks), "--out", str(tmp_path), *SIX]) == 2
    assert "Expected the state of a run" in capsys.readouterr().err


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99, 1.0])
def test_an_incomplete_state_is_refused_with_the_remedy(chunks, tmp_path, capsys, share):
    _base(chunks, tmp_path)
    state = tmp_path / "state.pt"
    content = torch.load(state)
    del content["optimiser"]
    torch.save(content, state)
    state.write_bytes(state.read_bytes()[: int(share * state.stat().st_size)])
    assert train.main(["base", "--data", str(chunks), "--out", str(tmp_path), *SIX]) == 2
    assert f"Expected the state of a run in {state}" in capsys.readouterr().err


@pytest.mark.parametrize("words", [("--steps", "-3"), ("--minutes", "0"), ("--batch", "0"), ("--rate", "nan")])
def test_settings_with_which_a_run_cannot_end_are_refused(chunks, tmp_path, capsys, words):
    arguments = ["base", "--data", str(chunks), "--out", str(tmp_path / "run"), "--device", "cpu"]
    assert train.main([*arguments, *words]) == 2
    assert f"for {words[0]}; got" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


# -- several processes -------------------------------------------------------------------------------------------------
PARTING = """
import pathlib, sys
from humanclaw_train import train
assert train.main(sys.argv[1:]) == 0
names = [path.read_text() for path in pathlib.Path("/proc/self/task").glob("*/comm")]
assert not [name for name in names if "gloo" in name], names  # One that is left may abort the process as Python ends.
"""


@pytest.mark.integration
def test_two_processes_train_and_resume_as_one_does(chunks, tmp_path):
    def arguments(name: str) -> list[str]:
        more = ["--precision", "float32", "--batch", "8", "--export", str(tmp_path / f"{name}.safetensors")]
        return ["base", "--data", str(chunks), "--out", str(tmp_path / name), *SIX, *more]

    _torchrun([str(SUPPORT / "cut_short.py"), "3", *arguments("cut")])
    assert torch.load(tmp_path / "cut" / "state.pt")["step"] == 3
    program = tmp_path / "parting.py"
    program.write_text(PARTING)
    _torchrun([str(program), *arguments("cut")])
    _torchrun(["-m", "humanclaw_train.train", *arguments("whole")])
    assert (tmp_path / "cut.safetensors").read_bytes() == (tmp_path / "whole.safetensors").read_bytes()

    alone = _base(chunks, tmp_path / "alone", "--precision", "float32", "--batch", "8").parent / "state.pt"
    single, double = (torch.load(path)["module"] for path in (alone, tmp_path / "whole" / "state.pt"))
    assert all(torch.allclose(single[name], double[name], atol=1e-5) for name in single)


def test_a_batch_that_cannot_be_shared_evenly_is_refused():
    assert Processes(1, 2).share(torch.arange(6)).tolist() == [1, 3, 5]
    with pytest.raises(HumanclawError, match="multiple of 4"):
        Processes(0, 4).share(torch.arange(6))


def test_the_precision_of_a_run_is_chosen_and_told(chunks, tmp_path, capsys):
    half, single = (_base(chunks, tmp_path / precision, "--precision", precision) for precision in ("bf16", "float32"))
    assert read_header(half)["card"]["recipe"]["precision"] == "bf16"
    assert half.read_bytes() != single.read_bytes()
    assert "bf16 on cpu" in capsys.readouterr().out


def test_the_loss_on_held_out_clips_is_printed_alone(chunks, tmp_path, capsys):
    with_validation = _base(chunks, tmp_path / "one")
    first, *lines = capsys.readouterr().out.splitlines()
    assert "validated on held-out clips" in first
    assert lines[-1].startswith("step       6  validation loss ")
    bare = tmp_path / "bare"
    save_chunks(bare / "base.npz", np.linspace(-0.5, 0.5, 64), np.zeros((64, 0)), moving=True)
    assert _base(bare, tmp_path / "two").read_bytes() == with_validation.read_bytes()
    assert "validation" not in capsys.readouterr().out


def test_every_held_out_chunk_counts_once_in_the_validation_loss(tmp_path):
    distance = np.arange(13.0)
    save_chunks(tmp_path / "base.npz", distance, np.zeros((13, 0)))
    chunks = tensors.load([tmp_path], "base")
    covered = validation(lambda states, *_: states[:, -1, 2].mean(), chunks, Recipe(batch=8, history_noise=0.0))
    assert covered == pytest.approx(6.0, abs=1e-4)  # The mean of 0 to 12, in batches of 8 and 5.


@pytest.mark.integration
def test_tensorboard_gets_the_losses_of_a_run(chunks, tmp_path):
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    _base(chunks, tmp_path, "--logger", "tensorboard")
    events = EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    assert {"loss", "validation loss", "learning rate", "steps/s"} <= set(events.Tags()["scalars"])
    assert [event.step for event in events.Scalars("validation loss")] == [6]


@pytest.mark.integration
def test_wandb_gets_the_losses_of_a_run_and_of_its_resumption(chunks, tmp_path, monkeypatch):
    pytest.importorskip("wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    arguments = ["base", "--data", str(chunks), "--out", str(tmp_path), *SIX, "--logger", "wandb"]
    assert cut_short.main(3, arguments) == 0
    known = (tmp_path / "wandb-run").read_text()
    assert train.main(arguments) == 0
    assert (tmp_path / "wandb-run").read_text() == known
    written = sorted((tmp_path / "wandb").glob(f"offline-run-*-{known}/*.wandb"))
    assert written
    assert b"validation loss" in b"".join(path.read_bytes() for path in written)


def test_a_log_without_its_package_is_refused_with_its_install_line(chunks, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    arguments = ["base", "--data", str(chunks), "--out", str(tmp_path / "run"), *SIX]
    for name in train.LOGS:
        assert train.main([*arguments, "--logger", name]) == 2
        assert f"pip install {name}" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
