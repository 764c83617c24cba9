"""A small learner: it walks up to what is in front of it and stops within 0.2 m. docs/gym.md trains it.

`python examples/stopper.py DATA weights.npz` clones the calls of a dataset of `humanclaw bench rollouts`. It is a
softmax over nine calls, linear in a small picture, in how much it changed since the last one, and in the step's number.
`--plugin examples/stopper.py --agent stopper` plays it; without `--option weights=FILE` it guesses.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.optimize import minimize
from scipy.special import log_softmax

from humanclaw import Agent, Call, Decision, EpisodeContext, HistoryEntry, Observation, hookimpl
from humanclaw.plugins import AgentFactory, Register

Array = NDArray[np.float64]
SIZE, STEPS = 12, 15
CALLS = [Call("walk", {"x_cm": 0, "z_cm": z, "yaw_deg": yaw}) for z in (20, 55) for yaw in (-20, 0, 20)]
CALLS += [Call("turn_in_place", {"yaw_deg": -45}), Call("turn_in_place", {"yaw_deg": 45}), Call("stop")]


def features(picture: Image.Image, before: Array | None, step: int) -> tuple[Array, Array]:
    """Return the input of the policy, and the small picture to compare the next one with."""
    small = np.asarray(picture.convert("RGB").resize((SIZE, SIZE), Image.Resampling.BOX), float) / 255 - 0.5
    change = np.zeros((SIZE, SIZE)) if before is None else np.abs(small - before).mean(-1)
    bands = change.reshape(3, SIZE // 3, SIZE).mean((1, 2))
    return np.concatenate([small.ravel(), 10 * bands, [float(before is None), step / STEPS, 1.0]]), small


def nearest(name: str, params: Mapping[str, float]) -> int:
    """Return the index of the call that is most like another one."""
    values = [(call.skill, call.params.get("z_cm", 0) / 35, call.params.get("yaw_deg", 0) / 20) for call in CALLS]
    z, yaw = params.get("z_cm", 0) / 35, params.get("yaw_deg", 0) / 20
    costs = [9 * (skill != name) + abs(ahead - z) + abs(turn - yaw) for skill, ahead, turn in values]
    return int(np.argmin(costs))


def examples(data: Path) -> Iterator[tuple[Array, int]]:
    """Yield input and index of the call for each row of a dataset."""
    for file in sorted(data.glob("train/*.jsonl")):
        before = None
        for row in map(json.loads, file.open(encoding="utf-8")):
            seen, before = features(Image.open(data / row["images"][0]), before, row["step"])
            called = row["messages"][-1]["tool_calls"][0]["function"]
            yield seen, nearest(called["name"], json.loads(called["arguments"]))


def fit(inputs: Array, called: NDArray[np.int64], decay: float = 0.01) -> Array:
    """Return (features, calls) weights: multinomial logistic regression."""
    wanted, shape = np.eye(len(CALLS))[called], (inputs.shape[1], len(CALLS))

    def loss(flat: Array) -> tuple[float, Array]:
        weights = flat.reshape(shape)
        logs = log_softmax(inputs @ weights, axis=1)
        slope = inputs.T @ (np.exp(logs) - wanted) / len(inputs) + 2 * decay * weights
        return float(-(wanted * logs).sum() / len(inputs) + decay * (flat**2).sum()), slope.ravel()

    solution = minimize(loss, np.zeros(shape[0] * shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 300})
    return np.asarray(solution.x.reshape(shape))


class Stopper:
    """Plays the policy: the most likely call; a random one before it has learned."""

    name, privileged = "stopper", False

    def __init__(self, weights: str = "") -> None:
        self.settings: Mapping[str, Any] = {"weights": weights}
        self._weights = np.load(weights)["weights"] if weights else None

    def begin(self, context: EpisodeContext) -> None:
        self._before: Array | None = None
        self._rng = np.random.default_rng(context.seed)

    def decide(self, observation: Observation, history: Sequence[HistoryEntry]) -> Decision:
        seen, self._before = features(Image.fromarray(observation.rgb), self._before, observation.step)
        guess = self._weights is None
        call = CALLS[int(self._rng.integers(len(CALLS)) if guess else np.argmax(seen @ self._weights))]
        return Decision((call,))


@hookimpl
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    register("stopper", _made, "walks up to what is in front of it and stops")


def _made(options: Mapping[str, Any]) -> Agent:
    return Stopper(options.get("weights", ""))


if __name__ == "__main__":
    pairs = list(examples(Path(sys.argv[1])))
    weights = fit(np.array([seen for seen, _ in pairs]), np.array([index for _, index in pairs]))
    np.savez(sys.argv[2], weights=weights)
    print(f"{len(pairs)} steps learned; weights: {sys.argv[2]}")
