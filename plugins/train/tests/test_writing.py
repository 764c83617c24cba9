"""Tests of checkpoints: the runtime reads back what training writes."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from safetensors.numpy import load_file
from tiny_motion import WALK

from humanclaw.motion import Card, ModelConfig, Normaliser, checkpoint
from humanclaw_train.data.tensors import ChunkTensors
from humanclaw_train.model.checkpoint import load_adapter, load_base, save_adapter, save_base
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import DiT
from humanclaw_train.train import adapter_config

START = torch.zeros(5, 3), torch.zeros(5, 24, 3)
NORMALISER = Normaliser(torch.zeros(219), torch.ones(219))


@pytest.fixture
def base(tmp_path):
    """Write a base as training does."""
    path = tmp_path / "base.safetensors"
    save_base(path, DiT(ModelConfig(32, 2, 4, prediction="clean")), NORMALISER, START, Card())
    return load_base(path)


def test_the_digest_names_the_numbers_and_not_the_notes(base, tmp_path):
    def save(name: str, card: Card, shift: float = 0.0) -> str:
        return save_base(tmp_path / name, base.model, base.normaliser, (START[0] + shift, START[1]), card)

    assert save("a", Card()) == save("b", Card({"note": "another"})) == base.digest
    assert save("c", Card(), shift=0.01) != base.digest


def test_an_adapter_comes_back_with_its_numbers_in_half_precision(base, tmp_path):
    path = tmp_path / "adapter.safetensors"
    adapter = Adapter(base.model, WALK)
    save_adapter(path, adapter, base.digest, Card())
    stored = load_file(path)
    for name, value in load_adapter(path, base, "walk").state_dict().items():
        assert stored[f"model.{name}"].dtype == np.float16
        assert np.array_equal(stored[f"model.{name}"], value.numpy())
        assert torch.equal(value, adapter.state_dict()[name].half().float())


def test_the_header_says_what_each_parameter_was_trained_to_command(base, tmp_path):
    """This finds a schema in which two parameters of one unit have changed places."""
    path, names, measures = tmp_path / "adapter.safetensors", ("x", "z"), ("hips.left", "hips.forward")
    poses = torch.zeros(4, 20, 3), torch.zeros(4, 20, 24, 3)
    params = torch.linspace(0.0, 0.4, 8).reshape(4, 2)
    config = adapter_config(ChunkTensors("veer", *poses, params, {}, names, measures))
    save_adapter(path, Adapter(base.model, config), base.digest, Card())
    assert load_adapter(path, base, "veer").config.measures == measures
    assert checkpoint.read_header(path)["adapter"]["measures"] == list(measures)


@pytest.mark.parametrize(
    ("width", "asked", "encoder"),
    [(1, "auto", "mlp"), (1, "fourier", "fourier"), (3, "auto", "fourier"), (3, "mlp", "mlp"), (0, "fourier", "token")],
)
def test_an_adapters_encoder_can_be_chosen(base, tmp_path, width, asked, encoder):
    poses, names = (torch.zeros(4, 20, 3), torch.zeros(4, 20, 24, 3)), tuple("xyz"[:width])
    params = torch.linspace(0.0, 0.4, 4 * width).reshape(4, width)
    config = adapter_config(ChunkTensors("veer", *poses, params, {}, names, names), asked)
    save_adapter(tmp_path / "a.safetensors", Adapter(base.model, config), base.digest, Card())
    assert load_adapter(tmp_path / "a.safetensors", base, "veer").config.encoder == encoder


def test_a_card_is_read_by_the_runtime_as_it_was_written(base, tmp_path):
    path, card = tmp_path / "base.safetensors", Card({"steps": 3}, {"chunks": 10}, ("CC0",))
    save_base(path, base.model, base.normaliser, START, card)
    assert checkpoint.load_base(path).card == card
