import json

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file
from tiny_motion import write_base

from humanclaw.errors import CheckpointError
from humanclaw.motion.checkpoint import Card, load_adapter, load_base, read_header


def test_a_base_comes_back_with_its_numbers_in_half_precision(base_file, base):
    stored = load_file(base_file)["model.enter.weight"]
    assert stored.dtype == np.float16
    assert base.model.enter.weight.dtype == np.float32
    assert np.array_equal(base.model.enter.weight.T, stored)
    assert base.card == Card({"steps": 3}, {"chunks": 10}, ("CC0",))


def test_the_header_says_what_a_checkpoint_is_without_its_weights(base, walk_file):
    header = read_header(walk_file)
    assert header["kind"] == "adapter"
    assert header["base"] == base.digest
    assert header["adapter"]["params"] == ["x", "z", "yaw"]
    assert header["card"]["licences"] == ["CC0"]
    assert header["card"]["recipe_digest"] == Card({"steps": 3}).recipe_digest


def test_an_adapter_comes_back_and_does_the_same(base, walk_file):
    adapter = load_adapter(walk_file, base, "walk")
    values = np.array([[0.1, 0.4, 0.0]], np.float32)
    stored = load_file(walk_file)
    assert np.array_equal(adapter.weights[1].weight.T, stored["model.weights.1.weight"])
    assert adapter.condition(values).shape == (1, 1, 32)


def test_a_missing_checkpoint_is_named_with_what_makes_it(base, tmp_path):
    with pytest.raises(CheckpointError, match=r"no checkpoint at .*humanclaw train base"):
        load_base(tmp_path / "base.safetensors")
    with pytest.raises(CheckpointError, match="humanclaw train adapter walk"):
        load_adapter(tmp_path / "adapter.safetensors", base, "walk")


def headed(text):
    return lambda path: save_file({"x": np.zeros(3, np.float16)}, path, {"humanclaw": text})


def without_a_weight(path):
    tensors, header = load_file(path), read_header(path)
    tensors.popitem()
    save_file(tensors, path, {"humanclaw": json.dumps({**header})})


def with_a_weight(value, kind=np.float16):
    def spoil(path):
        tensors = {name: tensor.astype(kind) for name, tensor in load_file(path).items()}
        tensors[min(tensors)].flat[-1] = value
        save_file(tensors, path, {"humanclaw": json.dumps(read_header(path))})

    return spoil


SPOILT = {
    "empty": (lambda path: path.write_bytes(b""), "cannot be read"),
    "text": (lambda path: path.write_bytes(b"not a checkpoint at all"), "cannot be read"),
    "pickle": (lambda path: path.write_bytes(b"\x80\x04K\x01."), "cannot be read"),
    "truncated": (lambda path: path.write_bytes(path.read_bytes()[:-100]), "cannot be read"),
    "somebody else's": (lambda path: save_file({"weight": np.zeros(3)}, path), "not a checkpoint of HumanCLAW"),
    "deep": (headed("[" * 100_000), "cannot be read as a checkpoint"),
    "list": (headed("[]"), "cannot be read as a checkpoint"),
    "cut": (headed("{"), "cannot be read as a checkpoint"),
    "number": (headed("7"), "cannot be read as a checkpoint"),
    "nothing": (headed("null"), "cannot be read as a checkpoint"),
    "no kind": (headed('{"format": 1}'), "weights where|cannot be read"),
    "another format": (headed('{"format": 99}'), "format 99"),
    "without a weight": (without_a_weight, "cannot be read"),
    "not a number": (with_a_weight(np.nan), "holds NaN, infinity or no floats in .*Train"),
    "infinite": (with_a_weight(-np.inf, np.float32), "holds NaN, infinity or no floats in .*Train"),
    "integers": (with_a_weight(1, np.int32), "holds NaN, infinity or no floats in .*Train"),
}


@pytest.mark.parametrize("how", SPOILT)
def test_a_file_that_is_no_whole_checkpoint_is_refused(base, base_file, walk_file, tmp_path, how):
    spoil, message = SPOILT[how]
    for whole, load in ((base_file, load_base), (walk_file, lambda path: load_adapter(path, base, "walk"))):
        path = tmp_path / whole.name
        path.write_bytes(whole.read_bytes())
        spoil(path)
        with pytest.raises(CheckpointError, match=message):
            load(path)


def test_a_base_is_no_adapter_nor_the_other_way_round(base, base_file, walk_file):
    with pytest.raises(CheckpointError, match="'base' weights where 'adapter'"):
        load_adapter(base_file, base)
    with pytest.raises(CheckpointError, match="'adapter' weights where 'base'"):
        load_base(walk_file)


def test_an_adapter_of_another_base_says_what_mends_it(base, walk_file, tmp_path):
    other = write_base(tmp_path / "base.safetensors", digest="another")
    with pytest.raises(CheckpointError) as refused:
        load_adapter(walk_file, other)
    assert base.digest in refused.value.message
    assert other.digest in refused.value.message
    assert refused.value.remedy == "Train it again with: humanclaw train adapter walk"


def test_another_skills_adapter_is_refused(base, walk_file):
    with pytest.raises(CheckpointError, match="adapter of walk, not of stop"):
        load_adapter(walk_file, base, "stop")
