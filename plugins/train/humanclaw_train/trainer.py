"""A training run: its recipe and steps, and how it saves, resumes and reports."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Generic, Literal, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from humanclaw import HumanclawError
from humanclaw.body import HISTORY
from humanclaw_train import data, kinematics
from humanclaw_train.data import ChunkTensors
from humanclaw_train.flow import Objective

_SAVE_SECONDS: Final = 120
_REPORT_SECONDS: Final = 15


@dataclass(frozen=True)
class Recipe:
    """All settings of a run except its data. The run ends after `steps`, or after `minutes` if `steps` is 0."""

    size: str = "lite"
    batch: int = 64
    rate: float = 1e-3
    minutes: float = 40.0
    steps: int = 0
    seed: int = 0
    history_noise: float = 1.0
    jitter: float = 0.01
    """Noise on a condition, in units of its standard deviation."""
    tau: Literal["squared", "uniform"] = "squared"
    """Flow times of training: the square of a uniform number, or the number itself as in the paper."""
    terms: Literal["full", "plain"] = "full"
    """Terms of the loss (flow.LOSSES)."""
    init: str = ""
    """Recipe digest of the checkpoint that the run began from; empty for a run from scratch."""
    licences: tuple[str, ...] = ()
    """Licences of the data, for the checkpoint's header."""


Encode = Callable[[Tensor], Tensor]
"""Maps condition values (B, k) to (B, 1, hidden). Not compiled, so that one compilation serves all skills."""
M = TypeVar("M", bound=nn.Module)


class Trainer(Generic[M]):
    """One run: the trainable module, its optimiser, its running mean and its progress."""

    def __init__(self, module: M, chunks: ChunkTensors, recipe: Recipe) -> None:
        self.module = module
        self.chunks = chunks
        self.recipe = recipe
        # Checkpoints get the running mean, because single steps of the weights are noisy.
        self.mean = copy.deepcopy(module).eval().requires_grad_(False)
        self.parameters = [parameter for parameter in module.parameters() if parameter.requires_grad]
        self.optimiser = torch.optim.AdamW(
            self.parameters, lr=recipe.rate, betas=(0.9, 0.98), weight_decay=0.01, fused=True
        )
        self.jitter = recipe.jitter * chunks.params.std(0) if chunks.params.numel() else 0.0
        self.step = 0
        self.seconds = 0.0

    @property
    def progress(self) -> float:
        """Share of the run that is done, 0 to 1."""
        recipe = self.recipe
        return self.step / recipe.steps if recipe.steps else self.seconds / (60 * recipe.minutes)

    def batch(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Draw the current step's states (B, 20, 219) in metres, conditions (B, k), noise (B, 15, 219) and tau (B,).

        The draw depends on the seed and the step alone, so that a resumed run sees the same batches.
        """
        device = self.chunks.root.device
        generator = torch.Generator(device)
        # A hash of seed and step; torch takes 63 bits.
        generator.manual_seed(
            int(np.random.SeedSequence([self.recipe.seed, self.step]).generate_state(1, np.uint64)[0] >> 1)
        )
        size = self.recipe.batch
        chosen = torch.randint(len(self.chunks), (size,), generator=generator, device=device)
        clean = self.chunks.root[chosen]
        root, rotations = data.noisy_history(clean, self.chunks.rotations[chosen], generator, self.recipe.history_noise)
        states = kinematics.encode(root, rotations)
        values = data.commanded(self.chunks.measures, self.chunks.params[chosen], clean, root)
        values = values + self.jitter * torch.randn(values.shape, generator=generator, device=device)
        noise = torch.randn(states[:, HISTORY:].shape, generator=generator, device=device)
        tau = torch.rand(size, generator=generator, device=device)
        # Squared it is denser close to 0: from tau 0.1 on, the 15 noisy frames together reveal the outcome, so a model
        # learns to use its condition only below that.
        return states, values, noise, tau**2 if self.recipe.tau == "squared" else tau

    def advance(self, problem: Objective, encode: Encode) -> Tensor:
        """Do one optimisation step. Returns the loss before it."""
        states, values, noise, tau = self.batch()
        value = problem(states, encode(values), noise, tau)
        self._update(value)
        return value.detach()

    def _update(self, value: Tensor) -> None:
        for group in self.optimiser.param_groups:
            group["lr"] = self.recipe.rate * _schedule(self.step, self.progress)
        self.optimiser.zero_grad(set_to_none=True)
        value.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.parameters, 1.0)
        self.optimiser.step()
        self.step += 1
        # A mean over about a sixth of the steps so far, later over the last thousand: it forgets the first weights.
        share = max(1e-3, 1 / (1 + self.step / 5))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.mean.parameters()), list(self.module.parameters()), share)

    def save(self, path: Path) -> None:
        """Save the whole state. An interrupted save leaves the old file in place."""
        content = {
            "module": self.module.state_dict(),
            "mean": self.mean.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "seed": self.recipe.seed,
        }
        # Not write_atomically, which would hold the whole file in memory a second time.
        partial = path.with_suffix(".partial")
        torch.save(content, partial)
        partial.replace(path)

    def resume(self, path: Path) -> None:
        """Load a saved state, if there is one. Raises HumanclawError if its seed differs."""
        if not path.is_file():
            return
        content = torch.load(path, weights_only=True, map_location=self.chunks.root.device)
        if content["seed"] != self.recipe.seed:
            raise HumanclawError(f"{path} is of a run with seed {content['seed']}.", "Use that seed or another --out.")
        self.module.load_state_dict(content["module"])
        self.mean.load_state_dict(content["mean"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.step, self.seconds = content["step"], content["seconds"]


def _schedule(step: int, progress: float) -> float:
    """Return the learning rate's factor: warm-up over 200 steps or 1/20 of a run, then a cosine down to 0.01."""
    return min(1.0, max((step + 1) / 200, progress / 0.05)) * (
        0.01 + 0.99 * (0.5 + 0.5 * math.cos(math.pi * min(progress, 1.0)))
    )


def run(trainer: Trainer[M], problem: Objective, encode: Encode, out: Path, export: Callable[[], None]) -> None:
    """Train to the end of the recipe; resume, save and report on the way. export: writes the checkpoint."""
    out.mkdir(parents=True, exist_ok=True)
    trainer.resume(out / "state.pt")
    saved = reported = clock = time.monotonic()
    recipe, total, begun = trainer.recipe, 0.0, trainer.step
    until = f"to step {recipe.steps}" if recipe.steps else f"for {recipe.minutes:g} minutes"
    print(f"{len(trainer.chunks)} chunks on {trainer.chunks.root.device}, from step {begun} {until}", flush=True)
    first = begun
    while trainer.progress < 1:
        total += float(trainer.advance(problem, encode))
        now = time.monotonic()
        # The first step may compile, so the clock starts with the second.
        trainer.seconds += now - clock if trainer.step > begun + 1 else 0.0
        clock = now
        if now - reported > _REPORT_SECONDS:
            _report(trainer, total / (trainer.step - first), (trainer.step - first) / (now - reported))
            reported, total, first = now, 0.0, trainer.step
        if now - saved > _SAVE_SECONDS:
            trainer.save(out / "state.pt")
            export()
            saved = now
    trainer.save(out / "state.pt")
    export()


def _report(trainer: Trainer[M], loss: float, rate: float) -> None:
    done = max(trainer.progress, 1e-6)
    left = trainer.seconds / done - trainer.seconds
    print(
        f"step {trainer.step:7d}  {100 * done:5.1f} %  loss {loss:.4f}  {rate:.2f} steps/s  "
        f"{rate * trainer.recipe.batch:.0f} chunks/s  {left / 60:.1f} min left",
        flush=True,
    )
