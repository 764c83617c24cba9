"""A training run: its recipe and steps, and how it saves, resumes and reports."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Generic, Literal, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from humanclaw import HumanclawError
from humanclaw.body import HISTORY
from humanclaw_train.data import tensors
from humanclaw_train.data.rollout_training import OwnHistories
from humanclaw_train.data.tensors import ChunkTensors
from humanclaw_train.logs import Write, opened
from humanclaw_train.model import kinematics
from humanclaw_train.model.flow import Objective
from humanclaw_train.parallel import ALONE, Processes

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
    precision: Literal["float32", "bf16"] = "float32"
    """Of the model's layers. Weights, loss and optimiser are in single precision."""
    terms: Literal["full", "plain"] = "full"
    """Terms of the loss (flow.LOSSES)."""
    rollout: int = 1
    """Chunks in a row: over 1, histories are also those that the model leaves (own_histories)."""
    init: str = ""
    """Recipe digest of the checkpoint that the run began from; empty for a run from scratch."""
    licences: tuple[str, ...] = ()
    """Licences of the data, for the checkpoint's header."""


Batch = tuple[Tensor, Tensor, Tensor, Tensor]
"""States (B, 20, 219) in metres, conditions (B, k), noise (B, 15, 219) and flow times (B,)."""
M = TypeVar("M", bound=nn.Module)


class Problem(nn.Module, Generic[M]):
    """The loss of a batch as one module: what DistributedDataParallel wraps.

    encode: maps condition values (B, k) to (B, 1, hidden). Not compiled, so that one compilation serves all skills.
    """

    def __init__(self, module: M, encode: Callable[[Tensor], Tensor], objective: Objective) -> None:
        super().__init__()
        self.module, self.encode, self.objective = module, encode, objective

    def forward(self, states: Tensor, values: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
        """Return the loss of a Batch."""
        return self.objective(states, self.encode(values), noise, tau)


def seeded(device: torch.device, *key: int) -> torch.Generator:
    """Return random numbers that depend on the key alone."""
    # A hash of the key; torch takes 63 bits.
    state = np.random.SeedSequence(key).generate_state(1, np.uint64)[0]
    return torch.Generator(device).manual_seed(int(state >> 1))


def draw(
    chunks: ChunkTensors,
    chosen: Tensor,
    recipe: Recipe,
    generator: torch.Generator,
    jitter: Tensor | float = 0.0,
    own: OwnHistories | None = None,
) -> Batch:
    """Draw errors of histories, noise and flow times for chosen chunks (B,). jitter: of the conditions (k,), SI."""
    device = chunks.root.device
    clean = chunks.root[chosen]
    root, rotations = tensors.noisy_history(clean, chunks.rotations[chosen], generator, recipe.history_noise)
    if own is not None:
        root, rotations = own(chosen, root, rotations, generator)
    states = kinematics.encode(root, rotations)
    values = tensors.commanded(chunks.measures, chunks.params[chosen], clean, root)
    values = values + jitter * torch.randn(values.shape, generator=generator, device=device)
    noise = torch.randn(states[:, HISTORY:].shape, generator=generator, device=device)
    tau = torch.rand(len(chosen), generator=generator, device=device)
    # Squared it is denser close to 0: from tau 0.1 on, the 15 noisy frames together reveal the outcome, so a model
    # learns to use its condition only below that.
    return states, values, noise, tau**2 if recipe.tau == "squared" else tau


class Trainer(Generic[M]):
    """One run: the trainable module, its optimiser, its running mean and its progress."""

    def __init__(self, module: M, chunks: ChunkTensors, recipe: Recipe, processes: Processes = ALONE) -> None:
        self.module = module
        self.chunks = chunks
        self.recipe = recipe
        self.processes = processes
        # Checkpoints get the running mean, because single steps of the weights are noisy.
        self.mean = copy.deepcopy(module).eval().requires_grad_(False)
        self.parameters = [parameter for parameter in module.parameters() if parameter.requires_grad]
        self.optimiser = torch.optim.AdamW(
            self.parameters, lr=recipe.rate, betas=(0.9, 0.98), weight_decay=0.01, fused=True
        )
        self.jitter = recipe.jitter * chunks.params.std(0) if chunks.params.numel() else 0.0
        self.own: OwnHistories | None = None
        self.step = 0
        self.seconds = 0.0

    @property
    def progress(self) -> float:
        """Share of the run that is done, 0 to 1."""
        recipe = self.recipe
        return self.step / recipe.steps if recipe.steps else self.seconds / (60 * recipe.minutes)

    def batch(self) -> Batch:
        """Draw the current step's batch.

        It depends on the seed and the step alone, so that a resumed run sees the same batches, and so do several
        processes together.
        """
        generator = seeded(self.chunks.root.device, self.recipe.seed, self.step)
        chosen = torch.randint(
            len(self.chunks), (self.recipe.batch,), generator=generator, device=self.chunks.root.device
        )
        return draw(self.chunks, chosen, self.recipe, generator, self.jitter, self.own)

    def advance(self, problem: nn.Module) -> Tensor:
        """Do one optimisation step. Returns the loss before it, of this process's share of the batch."""
        value: Tensor = problem(*map(self.processes.share, self.batch()))
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


@dataclass
class _Meter:
    """Counts losses and time of a run, and reports their means every quarter of a minute."""

    trainer: Trainer[Any]
    write: Write
    total: float = 0.0
    steps: int = 0
    begun: bool = False

    def __post_init__(self) -> None:
        self.clock = self.reported = time.monotonic()

    def count(self, loss: float) -> None:
        """Count a step, and report if it is time to."""
        trainer, now = self.trainer, time.monotonic()
        # The first step may compile, so the clock starts with the second.
        trainer.seconds += now - self.clock if self.begun else 0.0
        if not trainer.recipe.steps:
            trainer.seconds = trainer.processes.agreed(trainer.seconds, trainer.chunks.root.device)
        self.clock, self.begun = now, True
        self.total, self.steps = self.total + loss, self.steps + 1
        if now - self.reported > _REPORT_SECONDS:
            self.report()

    def report(self) -> None:
        """Print and log what was counted since the last report, if anything was."""
        if not self.steps:
            return
        now = time.monotonic()
        loss, rate = self.total / self.steps, self.steps / max(now - self.reported, 1e-9)
        self.total, self.steps, self.reported = 0.0, 0, now
        if self.trainer.processes.first:
            _report(self.trainer, loss, rate)
            learning = self.trainer.optimiser.param_groups[0]["lr"]
            self.write(self.trainer.step, {"loss": loss, "learning rate": learning, "steps/s": rate})


def run(
    trainer: Trainer[M],
    problem: nn.Module,
    out: Path,
    export: Callable[[], None],
    validate: Callable[[], float] | None = None,
    logs: Sequence[str] = (),
) -> None:
    """Train to the end of the recipe; resume, save, validate and report on the way.

    export: writes the checkpoint. validate: returns the loss on held-out clips. logs: names of LOGS.
    """
    out.mkdir(parents=True, exist_ok=True)
    trainer.resume(out / "state.pt")
    problem, first = trainer.processes.together(problem, trainer.batch()), trainer.processes.first
    saved = time.monotonic()
    if first:
        _begin(trainer, "validated on held-out clips" if validate else "no held-out clips")
    with opened(logs if first else (), out, asdict(trainer.recipe), trainer.step) as write:

        def save() -> None:
            trainer.save(out / "state.pt")
            export()
            if validate is not None:
                loss = validate()
                print(f"step {trainer.step:7d}  validation loss {loss:.4f}", flush=True)
                write(trainer.step, {"validation loss": loss})

        meter = _Meter(trainer, write)
        while trainer.progress < 1:
            meter.count(float(trainer.advance(problem)))
            if first and time.monotonic() - saved > _SAVE_SECONDS:
                save()
                saved = time.monotonic()
        meter.report()
        if first:
            save()


def _begin(trainer: Trainer[M], validation: str) -> None:
    recipe, many = trainer.recipe, trainer.processes.count
    until = f"to step {recipe.steps}" if recipe.steps else f"for {recipe.minutes:g} minutes"
    where = f"{recipe.precision}{f', {many} processes' if many > 1 else ''} on {trainer.chunks.root.device}"
    print(f"{len(trainer.chunks)} chunks, {validation}, {where}, from step {trainer.step} {until}", flush=True)


def _report(trainer: Trainer[M], loss: float, rate: float) -> None:
    done = max(trainer.progress, 1e-6)
    left = trainer.seconds / done - trainer.seconds
    print(
        f"step {trainer.step:7d}  {100 * done:5.1f} %  loss {loss:.4f}  {rate:.2f} steps/s  "
        f"{rate * trainer.recipe.batch:.0f} chunks/s  {left / 60:.1f} min left",
        flush=True,
    )
