import numpy as np
import pytest
from tiny_motion import TINY, WALK, Drawn

from humanclaw.motion.control import Adapter, AdapterConfig, Controlled
from humanclaw.motion.dit import SIZES, DiT, ModelConfig, Weights


def _inputs() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    history, noisy = (random.standard_normal((2, frames, 219), np.float32) for frames in (5, 15))
    return history, noisy, np.array([0.2, 0.7], np.float32)


def _answer(base: DiT, adapter: Adapter | None, values: np.ndarray) -> np.ndarray:
    history, noisy, tau = _inputs()
    through = Controlled(base, adapter, tau).through(values) if adapter else None
    return base(history, noisy, base.modulations(tau), through)


@pytest.mark.parametrize("prediction", ["clean", "velocity"])
def test_an_untrained_adapter_leaves_every_bit_of_the_base(prediction):
    base = DiT(ModelConfig(32, 3, 4, prediction=prediction), Drawn(0.05, seed=1))
    untrained = Adapter(base, WALK, Drawn(0.0, seed=2))
    values = np.ones((2, 3), np.float32)
    assert np.array_equal(_answer(base, None, values), _answer(base, untrained, values))


def test_a_model_of_clean_futures_untrained_holds_the_last_pose():
    history, noisy, tau = _inputs()
    model = DiT(TINY, Drawn(0.0, seed=1))
    held = np.broadcast_to(history[:, -1:], (2, 15, 219))
    assert np.array_equal(model(history, noisy, model.modulations(tau)), held)


@pytest.mark.parametrize(("encoder", "params"), [("token", ("x",)), ("mlp", ()), ("conv", ("x",))])
def test_an_encoder_that_does_not_suit_its_parameters_is_refused(encoder, params):
    with pytest.raises(ValueError, match="encoder"):
        AdapterConfig("x", encoder, params, (0.0,) * len(params), (1.0,) * len(params))


def test_weights_of_another_shape_are_refused():
    drawn = Drawn(0.05, seed=1)
    DiT(TINY, drawn)
    tensors = {name.removeprefix("model."): tensor for name, tensor in drawn.tensors.items()}
    shapes = {"weight": (64, 64), "bias": 64}
    time = {f"time.mlp.{layer}.{part}": np.zeros(shapes[part]) for layer in (0, 2) for part in shapes}
    with pytest.raises(ValueError, match=r"enter.weight has shape \(32, 219\), not \(64, 219\)"):
        DiT(ModelConfig(64, 2, 4), Weights(tensors | time))
    weights = Weights({**tensors, "spare": np.zeros(1)})
    DiT(TINY, weights)
    with pytest.raises(ValueError, match="no part of the model takes spare"):
        weights.check_all_taken()


def test_the_papers_size_is_the_papers():
    drawn = Drawn(0.0, seed=1)
    DiT(SIZES["paper"], drawn)
    assert 36 < sum(tensor.size for tensor in drawn.tensors.values()) / 1e6 < 44
