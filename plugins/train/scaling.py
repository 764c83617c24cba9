"""Effect of width, training steps and real data on the prior: `python plugins/train/scaling.py CHUNKS`.

Priors of several widths, and priors trained on a share of the real clips, train for the same number of steps with the
recipe of the shipped prior. The table shows the mean error of their predictions over 15 frames and 24 joints of
held-out chunks, for several shares of the true motion in the input.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import torch
from torch import Tensor

from humanclaw.body import FUTURE, HISTORY
from humanclaw.motion import SIZES, ModelConfig, shipped_base
from humanclaw_train import data, flow, kinematics
from humanclaw_train.checkpoint import Normaliser, load_base
from humanclaw_train.dit import DiT
from humanclaw_train.flow import Loss, Weights, objective
from humanclaw_train.trainer import Problem, Recipe, Trainer

WIDTHS: Final = (96, 192, 288)
SHARES: Final = (0.25, 0.5)
TAUS: Final = (0.0, 0.25, 0.5)
"""Flow times: at 0 the model sees only the history, above it also a share of the true motion."""


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("chunks", type=Path, help="folder of `humanclaw data build`")
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    chunks, held_out = data.load([options.chunks], "base"), data.load([options.chunks / "held_out"], "base")
    normaliser, recipe = data.normaliser(chunks), Recipe(steps=options.steps, seed=options.seed)
    print("| prior | weights | real clips | steps |", " | ".join(f"tau {tau:g}, cm" for tau in TAUS), "|")
    print("| --- |", " --- |" * (3 + len(TAUS)))

    def show(name: str, model: DiT, share: float, steps: int, normaliser: Normaliser = normaliser) -> None:
        weights = sum(parameter.numel() for parameter in model.parameters())
        found = " | ".join(f"{error(model, normaliser, held_out, tau):.2f}" for tau in TAUS)
        print(f"| {name} | {weights / 1e6:.1f} M | {share:.0%} | {steps} | {found} |", flush=True)

    for width, share in [*((width, 1.0) for width in WIDTHS), *((192, share) for share in SHARES)]:
        shape = replace(SIZES["lite"], hidden=width)
        for steps, model in learned(shape, clips(chunks, options.chunks, share), normaliser, recipe):
            show(f"hidden {width}", model, share, steps)
    base = load_base(shipped_base())
    show("shipped", base.model, 1.0, 16000, base.normaliser)


def clips(chunks: data.ChunkTensors, folder: Path, share: float) -> data.ChunkTensors:
    """Keep a share of the real clips, spread evenly over their names, and all synthetic chunks."""
    with np.load(folder / "base.npz") as content:
        real, source = content["real"], content["source"]
    names = np.unique(source[real])
    kept = names[np.unique((np.arange(len(names)) * share).astype(int), return_index=True)[1]]
    chosen = torch.from_numpy(np.flatnonzero(~real | np.isin(source, kept)))
    return replace(chunks, root=chunks.root[chosen], rotations=chunks.rotations[chosen], params=chunks.params[chosen])


def learned(
    shape: ModelConfig, chunks: data.ChunkTensors, normaliser: Normaliser, recipe: Recipe
) -> list[tuple[int, DiT]]:
    """Train a prior. Returns the steps and its running mean, halfway and at the end."""
    torch.manual_seed(recipe.seed)
    model, found = DiT(shape), []
    trainer = Trainer(model, chunks, recipe)

    def forward(history: Tensor, noisy: Tensor, tau: Tensor, condition: Tensor) -> Tensor:
        output: Tensor = model(history, noisy, model.modulations(tau))
        return output

    bf16 = flow.has_bfloat16(chunks.root.device)
    problem = Problem(
        model, lambda values: values, objective(forward, Loss(normaliser, Weights()), shape.prediction, bf16)
    )
    for until in (recipe.steps // 2, recipe.steps):
        while trainer.step < until:
            trainer.advance(problem)
        mean = DiT(shape)
        mean.load_state_dict(trainer.mean.state_dict())
        found.append((until, mean))
    return found


@torch.inference_mode()
def error(model: DiT, normaliser: Normaliser, chunks: data.ChunkTensors, tau: float, seed: int = 0) -> float:
    """Return the mean distance of predicted joints from real ones, centimetres."""
    states = normaliser.forward(kinematics.encode(chunks.root, chunks.rotations))
    future, moment = states[:, HISTORY:], torch.full((len(states),), tau)
    noise = torch.randn(future.shape, generator=torch.Generator().manual_seed(seed))
    noisy = flow.noised(future, noise, moment)
    output = model(states[:, :HISTORY], noisy, model.modulations(moment))
    implied = normaliser.inverse(flow.clean(model.config.prediction, output, noisy, moment))
    rotations = implied[..., kinematics.ROTATIONS].reshape(len(states), FUTURE, -1, 3)
    predicted = kinematics.joints(implied[..., kinematics.ROOT], rotations)
    true = kinematics.joints(chunks.root[:, HISTORY:], chunks.rotations[:, HISTORY:])
    return 100 * float((predicted - true).norm(dim=-1).mean())


if __name__ == "__main__":
    main()
