"""Train the prior or one skill's adapter (paper, section 3.3).

    python -m humanclaw_train.train base --data CHUNKS --out DIR
    python -m humanclaw_train.train adapter NAME --data CHUNKS --base base.safetensors --out DIR
    python -m humanclaw_train.train adapter --skill FOLDER

With --skill, the skill has the folder's name, its chunks come from the default folder of `humanclaw data chunks`, and
the finished adapter is copied into the folder. If the skill's schema.json is found, every save also prints the fidelity
of the adapter.

A run saves its whole state every two minutes, and computes its loss on held-out chunks (DIR/held_out) if there are any.
Started again with the same --out, it resumes from there. Every random number depends on the seed and the step alone, so
an interrupted run ends with the same weights as an uninterrupted one (with --steps; with --minutes the schedule follows
the clock).

    torchrun --nproc-per-node 4 --no-python humanclaw train base --size paper --data CHUNKS --out DIR

runs four processes, each on a GPU of its own; together they compute the batches that one process would compute.
"""

from __future__ import annotations

import argparse
import copy
import hashlib
import importlib
import importlib.util
import math
import os
import pickle
import statistics
import sys
import time
import zipfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numpy as np
import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from humanclaw import HumanclawError
from humanclaw.body import HISTORY
from humanclaw.motion import (
    PROFILES,
    SIZES,
    AdapterConfig,
    Card,
    Encoder,
    read_header,
    shipped_base,
    velocity,
)
from humanclaw.skills import Skill
from humanclaw.storage import write_atomically
from humanclaw_train.data import tensors
from humanclaw_train.data.chunks import CHUNKS
from humanclaw_train.data.rollout_training import OwnHistories, predecessors
from humanclaw_train.data.tensors import ChunkTensors
from humanclaw_train.model import kinematics
from humanclaw_train.model.checkpoint import Base, load_adapter, load_base, moved, save_adapter, save_base
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import DiT
from humanclaw_train.model.flow import LOSSES, Loss, clean, noised, target

_SAVE_SECONDS: Final = 120
"""An interruption costs at most so much work; a save of the largest size takes about a second."""
_REPORT_SECONDS: Final = 15
"""Between two lines of progress: often enough to see that it goes on, and a terminal holds an hour of them."""
_WORSE: Final = 10
"""A run whose loss is so many times the least before has diverged. Noise moves the median below by a third."""
_RECENT: Final = 20
"""Number of the steps whose median is the loss of a save: one bad batch is no divergence."""
_STATE: Final = ("settings", "module", "mean", "optimiser", "step", "seconds", "least")
"""What a saved state holds."""
_UNREADABLE: Final = (
    OSError, EOFError, RuntimeError, KeyError, TypeError, ValueError, pickle.UnpicklingError, zipfile.BadZipFile,
)  # fmt: skip
"""What reading a file raises that is no such state."""
_MOST_VALIDATED: Final = 1024
"""Most chunks of a validation, spread evenly over all: a second of time for the shipped size."""


# -- the settings of a run ---------------------------------------------------------------------------------------------
def _option(flag: str, default: Any, explanation: str, **more: Any) -> Any:
    """Return a field that is an option of the command line. more: arguments of argparse."""
    given = list(default) if isinstance(default, tuple) else default  # argparse appends to lists alone.
    shown = "" if isinstance(default, tuple) else " (default: %(default)s)"
    argument = {"type": type(default), "default": given, "help": explanation + shown, **more}
    return field(default=default, metadata={"flag": flag, "argument": argument})


def _licence(text: str) -> str:
    if not text.strip():  # For example from a shell variable that is not set.
        raise argparse.ArgumentTypeError("the licence is empty; write SOURCE: LICENCE")
    return text


@dataclass(frozen=True)
class Recipe:
    """All settings of a run except its data. The run ends after `steps`, or after `minutes` if `steps` is 0."""

    size: str = _option("--size", "lite", "size of the base", choices=tuple(SIZES))
    minutes: float = _option("--minutes", 40.0, "training time")
    steps: int = _option("--steps", 0, "end after this many steps instead of --minutes")
    batch: int = _option("--batch", 64, "chunks per step, of all processes together")
    rate: float = _option("--rate", 1e-3, "learning rate")
    seed: int = _option("--seed", 0, "seed of all random numbers")
    history_noise: float = _option("--history-noise", 1.0, "strength of the errors added to histories")
    tau: str = _option("--tau", "squared", "flow times; the paper does not say", choices=("squared", "uniform"))
    terms: str = _option(
        "--loss", "full", "plain: the paper's, without terms for joints and feet", choices=tuple(LOSSES)
    )
    precision: str = _option(
        "--precision",
        "auto",
        "of the layers; auto takes bf16 where the device is fast at it",
        choices=("auto", "float32", "bf16"),
    )
    jitter: float = _option("--jitter", 0.01, "noise on conditions, in standard deviations")
    encoder: str = _option(
        "--encoder",
        "auto",
        "of an adapter's parameters; auto takes fourier for three or more, such as walk's, and mlp for fewer",
        choices=("auto", "mlp", "fourier"),
    )
    rollout: int = _option("--rollout", 1, "chunks in a row, the earlier ones generated")
    licences: tuple[str, ...] = _option(
        "--licence", (), "licence of a data source that its folder does not tell; repeatable",
        action="append", type=_licence, metavar="SOURCE: LICENCE",
    )  # fmt: skip
    init: str = ""
    """Recipe digest of the checkpoint that the run began from; empty for a run from scratch."""

    def __post_init__(self) -> None:
        for name in ("minutes", "batch", "rate", "rollout", "steps", "history_noise", "jitter"):
            value, may_be_zero = getattr(self, name), name in ("steps", "history_noise", "jitter")
            # Otherwise a run has no end, or no batch.
            if not (value > 0 or (may_be_zero and value == 0)):
                wanted, flag = "0 or a positive number" if may_be_zero else "a positive number", _OPTIONS[name]["flag"]
                raise HumanclawError(f"Expected {wanted} for {flag}; got {value}.", "Give another one.")

    def on(self, device: torch.device) -> Recipe:
        """Return the recipe with the precision that `auto` means on a device."""
        fast = "bf16" if _has_bfloat16(device) else "float32"
        return replace(self, precision=fast) if self.precision == "auto" else self


_OPTIONS: Final = {option.name: option.metadata for option in fields(Recipe) if option.metadata}


def _has_bfloat16(device: torch.device) -> bool:
    """Return whether bfloat16 is fast: processors without AVX-512 emulate it 13 times slower than float32 (on AVX2)."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    return device.type != "cpu" or torch.backends.cpu.get_cpu_capability() == "AVX512"


# -- the model and its loss --------------------------------------------------------------------------------------------
M = TypeVar("M", bound=nn.Module)


def _frozen(module: M) -> M:
    return copy.deepcopy(module).eval().requires_grad_(False)


class Model(nn.Module):
    """The base, and on it a skill's adapter. The adapter is trained if there is one, and else the base."""

    def __init__(self, base: Base, adapter: Adapter | None = None) -> None:
        super().__init__()
        self.base, self.dit, self.adapter = base, base.model, adapter
        self.prediction, self.normaliser = base.model.config.prediction, base.normaliser

    @property
    def trained(self) -> DiT | Adapter:
        """The module whose weights change."""
        return self.dit if self.adapter is None else self.adapter

    def frozen(self) -> Model:
        """Return a model with a frozen copy of what is trained."""
        if self.adapter is None:
            return Model(replace(self.base, model=_frozen(self.dit)))
        return Model(self.base, _frozen(self.adapter))

    def encode(self, values: Tensor) -> Tensor:
        """Encode conditions (B, k), SI, as (B, 1, hidden). A base has none."""
        return values if self.adapter is None else self.adapter.condition(values)

    def forward(self, history: Tensor, noisy: Tensor, tau: Tensor, condition: Tensor) -> Tensor:
        """Return the output (B, 15, 219) for normalised frames (B, 5, 219) and (B, 15, 219) at flow times tau (B,)."""
        residual = None
        if self.adapter is not None:
            residual = self.adapter.residual(condition, self.adapter.modulations(self.dit, tau))
        output: Tensor = self.dit(history, noisy, self.dit.modulations(tau), residual)
        return output

    def generate(self, history: Tensor, values: Tensor, noise: Tensor) -> Tensor:
        """Return the futures (B, 15, 219) of states (B, 5, 219) in metres and radians, by the default solver."""
        normal, condition, solver = self.normaliser.forward(history), self.encode(values), PROFILES["default"].solver

        def field(index: int, noisy: Tensor) -> Tensor:
            tau = torch.full((len(noisy),), solver.times[index], device=noisy.device)
            answer: Tensor = velocity(self.prediction, self(normal, noisy, tau, condition), noisy, tau[:, None, None])
            return answer

        future: Tensor = self.normaliser.inverse(solver.solve(field, noise))
        return future


class Objective(nn.Module):
    """The loss of a batch as one module: what DistributedDataParallel wraps. fast: compile it."""

    def __init__(self, model: Model, recipe: Recipe, fast: bool = False) -> None:
        super().__init__()
        self.model, self.bf16 = model, recipe.precision == "bf16"
        self.loss = Loss(model.normaliser, LOSSES[recipe.terms])
        self._compute = torch.compile(self._value) if fast else self._value

    def forward(self, states: Tensor, values: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
        """Return the loss of a Batch."""
        # The encoder is not compiled, so that one compilation serves all skills.
        return self._compute(states, self.model.encode(values), noise, tau)

    def _value(self, states: Tensor, condition: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
        normal = self.model.normaliser.forward(states)  # (B, 20, 219)
        future = normal[:, HISTORY:]  # (B, 15, 219)
        noisy = noised(future, noise, tau)
        with torch.autocast(states.device.type, torch.bfloat16, enabled=self.bf16):
            output = self.model(normal[:, :HISTORY], noisy, tau, condition)
        output = output.float()  # The loss in single precision: its metric terms are small differences.
        prediction = self.model.prediction
        wanted = future if prediction == "clean" else target(future, noise)
        return self.loss(output, wanted, clean(prediction, output, noisy, tau), states)


# -- batches -----------------------------------------------------------------------------------------------------------
Batch = tuple[Tensor, Tensor, Tensor, Tensor]
"""States (B, 20, 219) in metres, conditions (B, k), noise (B, 15, 219) and flow times (B,)."""


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
    true = chunks.root[chosen]
    root, rotations = tensors.noisy_history(true, chunks.rotations[chosen], generator, recipe.history_noise)
    if own is not None:
        root, rotations = own(chosen, root, rotations, generator)
    states = kinematics.encode(root, rotations)
    values = tensors.commanded(chunks.measures, chunks.params[chosen], true, root)
    values = values + jitter * torch.randn(values.shape, generator=generator, device=device)
    noise = torch.randn(states[:, HISTORY:].shape, generator=generator, device=device)
    tau = torch.rand(len(chosen), generator=generator, device=device)
    # Squared it is denser close to 0: from tau 0.1 on, the 15 noisy frames together reveal the outcome, so a model
    # learns to use its condition only below that.
    return states, values, noise, tau**2 if recipe.tau == "squared" else tau


@torch.no_grad()
def validation(objective: nn.Module, chunks: ChunkTensors, recipe: Recipe) -> float:
    """Return the mean loss on chunks. Errors of histories, noise and flow times are the same in every run."""
    device, count = chunks.root.device, min(len(chunks), _MOST_VALIDATED)
    chosen = torch.linspace(0, len(chunks) - 1, count, device=device).long()
    total = 0.0
    for number, part in enumerate(torch.split(chosen, recipe.batch)):
        total += len(part) * float(objective(*draw(chunks, part, recipe, seeded(device, 0, number))))
    return total / count


# -- processes ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Processes:
    """This process among those of torchrun. Each computes its share of every batch; the first saves and reports."""

    rank: int = 0
    count: int = 1

    @property
    def first(self) -> bool:
        """Whether this is the process that saves and reports."""
        return self.rank == 0

    def share(self, batch: Tensor) -> Tensor:
        """Return this process's rows of a batch (B, ...). Raises HumanclawError if they cannot be shared evenly."""
        if len(batch) % self.count:
            # Shares of different sizes would weigh differently in the mean of the gradients.
            raise HumanclawError(
                f"A batch of {len(batch)} chunks cannot be shared by {self.count} processes.",
                f"Give a --batch that is a multiple of {self.count}.",
            )
        return batch[self.rank :: self.count]

    def together(self, objective: nn.Module, batch: Batch) -> nn.Module:
        """Return the objective with gradients that are the mean over all processes. batch: an example."""
        if self.count == 1:
            return objective
        wrapped = DistributedDataParallel(objective)
        # DDP regroups gradients after its first backward pass, which changes the order of sums. Done here, a resumed
        # run sums as an uninterrupted one does, bit for bit. The step itself discards these gradients.
        wrapped(*map(self.share, batch)).backward()
        return wrapped

    def agreed(self, seconds: float, device: torch.device) -> float:
        """Return the first process's time. All need the same, because it sets the learning rate and the run's end."""
        if self.count == 1:
            return seconds
        shared = torch.tensor([seconds], dtype=torch.float64, device=device)
        dist.broadcast(shared, 0)
        return float(shared)


def _device_of(name: str) -> torch.device:
    """Return a torch device. auto: a GPU if there is one; each of several processes takes its own."""
    wanted = name if name != "auto" else "cuda" if torch.cuda.is_available() else "cpu"
    if wanted == "cuda" and dist.is_torchelastic_launched():
        wanted = f"cuda:{os.environ['LOCAL_RANK']}"
    return torch.device(wanted)


@contextmanager
def _joined(device: torch.device) -> Iterator[Processes]:
    """Join the other processes that torchrun started, if it did."""
    if not dist.is_torchelastic_launched():
        yield Processes()
        return
    if device.type == "cuda":
        torch.cuda.set_device(device)
    # Imported before there is a process group, which its functions would otherwise keep, as default arguments, beyond
    # its destruction. Then a thread of gloo that still lets go of a tensor while Python ends aborts the process.
    importlib.import_module("torch.distributed.nn")
    dist.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield Processes(dist.get_rank(), dist.get_world_size())
        # One that leaves while another still talks to it may end in an abort.
        dist.barrier()
    finally:
        # To let go of what it did, a thread of gloo needs the interpreter's lock. Whoever drops the group holds that
        # lock and waits for the thread (torch 2.13): now and then a run hung as it parted. Here the lock is free.
        time.sleep(0.5)
        dist.destroy_process_group()


# -- logs --------------------------------------------------------------------------------------------------------------
Log = Callable[[int, Mapping[str, float]], None]
"""Logs values at a step."""


@contextmanager
def _tensorboard(out: Path, recipe: Recipe, step: int) -> Iterator[Log]:
    from torch.utils.tensorboard import SummaryWriter

    # The steps after the last save are done again by a resumed run.
    with SummaryWriter(str(out / "tensorboard"), purge_step=step) as writer:

        def log(at: int, values: Mapping[str, float]) -> None:
            for name, value in values.items():
                writer.add_scalar(name, value, at)

        yield log


@contextmanager
def _wandb(out: Path, recipe: Recipe, step: int) -> Iterator[Log]:
    import wandb

    known = out / "wandb-run"
    again = {"id": known.read_text(), "resume": "allow"} if step and known.is_file() else {}
    project = os.environ.get("WANDB_PROJECT", "humanclaw")
    with wandb.init(project=project, name=out.name, dir=str(out), config=asdict(recipe), **again) as run:
        known.write_text(run.id)
        yield lambda at, values: run.log(dict(values), step=at)


LOGS: Final = {"tensorboard": _tensorboard, "wandb": _wandb}


def _check_logs(names: Sequence[str]) -> None:
    """Raise HumanclawError if a log's package is not installed."""
    for name in names:
        if importlib.util.find_spec(name) is None:
            raise HumanclawError(
                f"--logger {name} needs the package {name}, which is not installed.", f"Run `pip install {name}`."
            )


# -- a run -------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Session:
    """Where and how a run computes, apart from its recipe. logs: names of LOGS."""

    out: Path
    device: torch.device
    processes: Processes = Processes()
    fast: bool = False
    """Whether to compile the model."""
    logs: tuple[str, ...] = ()


class Run:
    """One run: the model, its optimiser, its running mean and its progress."""

    def __init__(self, model: Model, chunks: ChunkTensors, recipe: Recipe, session: Session, base: str = "") -> None:
        """Prepare a run from scratch. base: digest of the base that an adapter is trained on."""
        self.model, self.chunks, self.recipe, self.session = model, chunks, recipe, session
        # Checkpoints get the running mean, because single steps of the weights are noisy.
        self.mean = model.frozen()
        self.parameters = [parameter for parameter in model.parameters() if parameter.requires_grad]
        # 0.98, not 0.999: the rate falls within minutes, and the second moment has to follow it.
        self.optimiser = torch.optim.AdamW(
            self.parameters, lr=recipe.rate, betas=(0.9, 0.98), weight_decay=0.01, fused=True
        )
        self.jitter = recipe.jitter * chunks.params.std(0) if chunks.params.numel() else 0.0
        self.own: OwnHistories | None = None
        if recipe.rollout > 1:
            self.own = OwnHistories(chunks, predecessors(chunks), recipe.rollout - 1, self.mean.generate)
        self.base, self.step, self.seconds = base, 0, 0.0
        self.recent, self.least = deque[float](maxlen=_RECENT), math.inf

    @property
    def progress(self) -> float:
        """Share of the run that is done, 0 to 1."""
        recipe = self.recipe
        return self.step / recipe.steps if recipe.steps else self.seconds / (60 * recipe.minutes)

    @property
    def card(self) -> Card:
        """The checkpoint's notes on how it was made."""
        loss = asdict(LOSSES[self.recipe.terms])
        recipe = {**asdict(self.recipe), "name": self.chunks.name, "loss": loss, "done_steps": self.step}
        licences = dict.fromkeys((*recipe.pop("licences"), *self.chunks.licences))
        return Card(recipe, self.chunks.statistics, tuple(licences))

    def batch(self) -> Batch:
        """Draw the current step's batch.

        It depends on the seed and the step alone, so that a resumed run sees the same batches, and so do several
        processes together.
        """
        device = self.chunks.root.device
        generator = seeded(device, self.recipe.seed, self.step)
        chosen = torch.randint(len(self.chunks), (self.recipe.batch,), generator=generator, device=device)
        return draw(self.chunks, chosen, self.recipe, generator, self.jitter, self.own)

    def advance(self, objective: nn.Module) -> float:
        """Do one optimisation step. Returns the loss before it, of this process's share of the batch.

        Raises HumanclawError, with the weights unchanged, for a loss or a gradient that is not a finite number.
        """
        for group in self.optimiser.param_groups:
            group["lr"] = self.recipe.rate * _schedule(self.step, self.progress)
        loss: Tensor = objective(*map(self.session.processes.share, self.batch()))
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped.
        norm = float(nn.utils.clip_grad_norm_(self.parameters, 1.0))
        if not math.isfinite(norm):
            raise self._diverged(f"a loss of {loss.item():g} and a gradient of norm {norm:g}")
        self.optimiser.step()
        self.step += 1
        # A mean over about a sixth of the steps so far, later over the last thousand: it forgets the first weights.
        share = max(1e-3, 1 / (1 + self.step / 5))
        with torch.no_grad():
            means, weights = (list[Tensor](model.trained.parameters()) for model in (self.mean, self.model))
            torch._foreach_lerp_(means, weights, share)
        self.recent.append(float(loss.detach()))
        if self.step == _RECENT:  # While the rate is still low: whoever ends far above it has not learned.
            self.least = min(self.least, statistics.median(self.recent))
        return self.recent[-1]

    def _diverged(self, numbers: str, expected: str = "finite numbers") -> HumanclawError:
        out = self.session.out
        kept = f" from the last save, which {out} keeps, or from the beginning with another --out"
        return HumanclawError(
            f"Training diverged at step {self.step}: expected {expected}, got {numbers}.",
            f"Lower --rate (now {self.recipe.rate:g}) and start again{kept if (out / 'state.pt').exists() else ''}.",
        )

    def train(self, export: Callable[[], None], held_out: ChunkTensors | None) -> None:
        """Train to the end of the recipe; resume, save, validate and report on the way.

        export: writes the checkpoint. held_out: chunks to validate on.
        """
        out, first = self.session.out, self.session.processes.first
        out.mkdir(parents=True, exist_ok=True)
        self._resume(out / "state.pt")
        objective: nn.Module = Objective(self.model, self.recipe, self.session.fast)
        objective = self.session.processes.together(objective, self.batch())
        if first:
            self._begin(held_out)
        with ExitStack() as stack:
            names = dict.fromkeys(self.session.logs if first else ())
            logs = [stack.enter_context(LOGS[name](out, self.recipe, self.step)) for name in names]
            self._loop(objective, lambda: self._save(export, held_out, logs), logs)

    def _loop(self, objective: nn.Module, save: Callable[[], None], logs: Sequence[Log]) -> None:
        first, losses = self.session.processes.first, list[float]()
        saved = reported = clock = time.monotonic()
        begun = False
        while self.progress < 1:
            losses.append(self.advance(objective))
            now = time.monotonic()
            # The first step may compile, so the clock starts with the second.
            self.seconds += now - clock if begun else 0.0
            if not self.recipe.steps:
                self.seconds = self.session.processes.agreed(self.seconds, self.session.device)
            clock, begun = now, True
            if now - reported > _REPORT_SECONDS or self.progress >= 1:
                self._report(losses, now - reported, logs)
                losses, reported = [], now
            if first and now - saved > _SAVE_SECONDS:
                save()
                saved = time.monotonic()
        if first:
            save()

    def _save(self, export: Callable[[], None], held_out: ChunkTensors | None, logs: Sequence[Log]) -> None:
        """Save the whole state and the checkpoint, and validate. An interrupted save leaves the old state in place.

        Raises HumanclawError, and saves nothing, for weights too large for the half precision of checkpoints, and for a
        loss far above an earlier one.
        """
        loss = statistics.median(self.recent) if self.recent else self.least
        if loss > _WORSE * self.least:
            raise self._diverged(f"{loss:.4g}", f"a loss near the {self.least:.4g} of before")
        least = min(loss, self.least)
        if not all(weights.half().isfinite().all() for weights in self.mean.trained.parameters()):
            raise self._diverged("weights beyond the range of half precision")
        content = {
            "module": self.model.trained.state_dict(),
            "mean": self.mean.trained.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "least": least,
            "settings": self._settings(),
        }
        # Not write_atomically, which would hold the whole file in memory a second time.
        partial = self.session.out / "state.partial"
        torch.save(content, partial)
        partial.replace(self.session.out / "state.pt")
        self.least = least
        export()
        if held_out is not None:
            # Not compiled: that takes longer than all validations of a short run.
            loss = validation(Objective(self.mean, self.recipe), held_out, self.recipe)
            print(f"step {self.step:7d}  validation loss {loss:.4f}", flush=True)
            for log in logs:
                log(self.step, {"validation loss": loss})

    def _settings(self) -> dict[str, Any]:
        """Return what a resumed run must share with the run that it goes on from, by option of the command line."""
        free = ("steps", "minutes", "rate", "licences")
        recipe = {_OPTIONS[name]["flag"]: getattr(self.recipe, name) for name in _OPTIONS if name not in free}
        tensors = (self.chunks.root, self.chunks.rotations, self.chunks.params)
        digest = hashlib.sha256(b"".join(tensor.numpy(force=True).tobytes() for tensor in tensors))
        data = f"{self.chunks.name}, {len(self.chunks)} chunks, digest {digest.hexdigest()[:16]}"
        return recipe | {"--init": self.recipe.init, "--base": self.base, "--data": data}

    def _resume(self, path: Path) -> None:
        """Load a saved state, if there is one. Raises HumanclawError for a broken one or one of other settings."""
        if not path.exists():
            return
        try:
            # A flipped bit of a weight is a number as well, and torch does not look at checksums.
            with zipfile.ZipFile(path) as archive:
                if damaged := archive.testzip():
                    raise ValueError(f"{damaged} is damaged")
            content = torch.load(path, weights_only=True, map_location=self.session.device)
            before, module, mean, optimiser, step, seconds, least = (content[name] for name in _STATE)
            if not all(weights.isfinite().all() for part in (module, mean) for weights in part.values()):
                raise ValueError("weights that are not finite")
        except _UNREADABLE as error:
            raise HumanclawError(
                f"Expected the state of a run in {path}; the file is incomplete, damaged or has other content.",
                f"Put a copy back, remove it to begin the run again, or give another --out. ({type(error).__name__})",
            ) from error
        for name, now in self._settings().items():
            if before.get(name) != now:
                raise HumanclawError(
                    f"{path} is of a run with {name} {before.get(name)}; this run has {name} {now}.",
                    f"Give the same {name} to go on with that run, or another --out to begin a new one.",
                )
        if 0 < self.recipe.steps < step:
            raise HumanclawError(
                f"Expected --steps of {step} or more, which {path} has done; got {self.recipe.steps}.",
                "Give more steps to go on with that run, or another --out to begin a new one.",
            )
        self.model.trained.load_state_dict(module)
        self.mean.trained.load_state_dict(mean)
        self.optimiser.load_state_dict(optimiser)
        self.step, self.seconds, self.least = step, seconds, least

    def _begin(self, held_out: ChunkTensors | None) -> None:
        recipe, many = self.recipe, self.session.processes.count
        validated = "no held-out clips" if held_out is None else "validated on held-out clips"
        until = f"to step {recipe.steps}" if recipe.steps else f"for {recipe.minutes:g} minutes"
        where = f"{recipe.precision}{f', {many} processes' if many > 1 else ''} on {self.session.device}"
        print(f"{len(self.chunks)} chunks, {validated}, {where}, from step {self.step} {until}", flush=True)

    def _report(self, losses: Sequence[float], seconds: float, logs: Sequence[Log]) -> None:
        """Print and log the mean loss and the rate since the last report."""
        if not self.session.processes.first:
            return
        loss, rate, done = sum(losses) / len(losses), len(losses) / max(seconds, 1e-9), max(self.progress, 1e-6)
        left = self.seconds / done - self.seconds
        print(
            f"step {self.step:7d}  {100 * done:5.1f} %  loss {loss:.4f}  {rate:.2f} steps/s  "
            f"{rate * self.recipe.batch:.0f} chunks/s  {left / 60:.1f} min left",
            flush=True,
        )
        for log in logs:
            log(self.step, {"loss": loss, "learning rate": self.optimiser.param_groups[0]["lr"], "steps/s": rate})


def _schedule(step: int, progress: float) -> float:
    """Return the learning rate's factor: warm-up over 200 steps or 1/20 of a run, then a cosine down to 0.01."""
    # The sooner of both: 300 steps would else be a warm-up for the most part.
    return min(1.0, max((step + 1) / 200, progress / 0.05)) * (
        0.01 + 0.99 * (0.5 + 0.5 * math.cos(math.pi * min(progress, 1.0)))
    )


# -- the prior and the adapters ----------------------------------------------------------------------------------------
def train_base(folders: Sequence[Path], recipe: Recipe, session: Session) -> Path:
    """Train the prior on every file of chunks. Returns its checkpoint, base.safetensors."""
    chunks = tensors.load_all(folders)
    normaliser, start = moved(tensors.normaliser(chunks), session.device), tensors.standing(chunks)
    torch.manual_seed(recipe.seed)  # For the initial weights; batches have generators of their own.
    dit = DiT(SIZES[recipe.size]).to(session.device)
    run = Run(Model(Base(dit, normaliser, "")), chunks.to(session.device), recipe, session)
    path = session.out / "base.safetensors"

    def export() -> None:
        save_base(path, run.mean.dit, normaliser, start, run.card)

    run.train(export, _held_out(folders, "base", session))
    return path


def train_adapter(
    skill: str,
    folders: Sequence[Path],
    base: Base,
    recipe: Recipe,
    session: Session,
    init: Path | None = None,
    look: Callable[[Path], str] | None = None,
) -> Path:
    """Train one skill's adapter on the frozen base. Returns its checkpoint, adapter.safetensors.

    init: a checkpoint of this skill on this base to start from, instead of a copy of the base's blocks. look: called
    with each checkpoint; returns a text to print.
    """
    chunks = tensors.load(folders, skill).to(session.device)
    torch.manual_seed(recipe.seed)
    if init is None:
        adapter = Adapter(base.model, adapter_config(chunks, recipe.encoder))
    else:
        adapter = load_adapter(init, base, skill).train().requires_grad_()
        card = read_header(init)["card"]
        recipe = replace(recipe, init=str(card["recipe_digest"]), licences=(*recipe.licences, *card["licences"]))
    run = Run(Model(base.to(session.device), adapter.to(session.device)), chunks, recipe, session, base.digest)
    path = session.out / "adapter.safetensors"

    def export() -> None:
        assert run.mean.adapter is not None
        save_adapter(path, run.mean.adapter, base.digest, run.card)
        if look is not None and run.step:
            print(f"step {run.step:7d}  {look(path)}", flush=True)

    run.train(export, _held_out(folders, skill, session))
    return path


def adapter_config(chunks: ChunkTensors, asked: str = "auto") -> AdapterConfig:
    """Return the encoder of a skill, centred and scaled to the range of its data. asked: of Recipe."""
    params, width = chunks.params, chunks.params.shape[1]
    # Spatial conditions take Fourier features, scalars an MLP (paper, section 3.3). A turn alone is a scalar here.
    fitting: Encoder = "fourier" if width > 2 else "mlp"
    encoder: Encoder = "token" if not width else fitting if asked == "auto" else cast(Encoder, asked)
    # Quantiles, not extremes: in a step out of a seat the pelvis rises further than any command asks for.
    low, high = (params.quantile(edge, 0) if width else params.new_zeros(0) for edge in (0.01, 0.99))
    # A parameter with one value in the data would divide by 0.
    scale = ((high - low) / 2).clamp(min=1e-3)
    centre = _rounded((low + high) / 2)
    return AdapterConfig(chunks.name, encoder, chunks.names, centre, _rounded(scale), chunks.measures)


def _rounded(values: Tensor) -> tuple[float, ...]:
    return tuple(round(float(value), 5) for value in values)


def _held_out(folders: Sequence[Path], name: str, session: Session) -> ChunkTensors | None:
    """Load the held-out chunks of a skill, or of `base`, beside folders of chunks; None if there are none."""
    beside = [folder / "held_out" for folder in folders if (folder / "held_out" / f"{name}.npz").is_file()]
    return tensors.load(beside, name).to(session.device) if beside else None


# -- the command line --------------------------------------------------------------------------------------------------
def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line. It is argparse's, because this module also runs where there is no click."""
    options = _parser().parse_args(arguments)
    torch.set_num_threads(options.threads)
    device = _device_of(options.device)
    try:
        _check_logs(options.logger)
        with _joined(device) as processes:
            path, export = _trained(options, device, processes)
            if export and processes.first:
                export.parent.mkdir(parents=True, exist_ok=True)
                write_atomically(export, path.read_bytes())
                print(f"wrote {export}")
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _trained(options: argparse.Namespace, device: torch.device, processes: Processes) -> tuple[Path, Path | None]:
    """Train what the options say. Returns the checkpoint, and the file to copy it to."""
    given = {name: value for name, value in vars(options).items() if name in _OPTIONS}
    recipe = Recipe(**given | {"licences": tuple(options.licences)}).on(device)
    folders, skill = options.data or [CHUNKS], "base" if options.what == "base" else _named(options)
    session = Session(options.out or Path(".data") / skill, device, processes, options.compile, tuple(options.logger))
    if options.what == "base":
        return train_base(folders, recipe, session), options.export
    look = _live(options.base, skill, options.folder)
    path = train_adapter(skill, folders, load_base(options.base), recipe, session, options.init, look)
    return path, options.export or (options.folder / "adapter.safetensors" if options.folder else None)


def _named(options: argparse.Namespace) -> str:
    """Return the skill's name. Raises HumanclawError unless either the name or --skill is given."""
    if (options.skill is None) == (options.folder is None):
        raise HumanclawError("Expected one skill to train.", "Give either its name or --skill FOLDER.")
    return str(options.skill or options.folder.resolve().name)


def _live(base: Path, skill: str, folder: Path | None) -> Callable[[Path], str] | None:
    """Return the function that measures checkpoints.

    None without the plugin host, for a skill that neither `folder` declares nor is installed, or without parameters.
    """
    try:
        # Imported here, because a machine for training may have neither.
        from humanclaw import Plugins
        from humanclaw_train.eval.fidelity import live

        plugins = Plugins.discover()
    except ImportError:
        return None
    installed = plugins.skills.get(skill)
    declaration = Skill.from_folder(folder) if folder else installed
    if declaration is None or not declaration.parameters:
        return None
    return live(base, declaration, measures=plugins.measures)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="humanclaw train", description=__doc__.splitlines()[0] if __doc__ else "")
    kinds = parser.add_subparsers(dest="what", required=True)
    _add_options(kinds.add_parser("base"), without="rollout", out_is_required=True)
    adapter = kinds.add_parser("adapter")
    adapter.add_argument("skill", nargs="?", help="name of the skill, unless --skill is given")
    adapter.add_argument("--skill", dest="folder", type=Path, metavar="FOLDER", help="folder with its schema.json")
    adapter.add_argument("--base", type=Path, default=shipped_base(), help="base to train against (default: shipped)")
    adapter.add_argument("--init", type=Path, help="adapter to start from, instead of a copy of the base")
    _add_options(adapter, without="size", out_is_required=False)
    adapter.set_defaults(minutes=8.0)
    return parser


def _add_options(parser: argparse.ArgumentParser, without: str, out_is_required: bool) -> None:
    """Add the fields of Recipe, and the options of a Session. without: a field that this kind of run does not have."""
    add = parser.add_argument
    add("--data", type=Path, action="append", help=f"folder of chunks; repeatable (default: {CHUNKS})")
    add(
        "--out",
        type=Path,
        required=out_is_required,
        help="folder of the run; an existing run is resumed (default for adapters: .data/SKILL)",
    )
    add("--export", type=Path, help="copy the finished checkpoint to this file")
    for name, option in _OPTIONS.items():
        if name != without:
            add(option["flag"], dest=name, **option["argument"])
    add("--logger", choices=list(LOGS), action="append", default=[], help="also log to this; repeatable")
    add("--threads", type=int, default=1, help="CPU threads")
    add("--device", default="auto", help="torch device; auto takes CUDA if there is any")
    add("--compile", action="store_true", help="compile the model: takes half a minute, then a third faster")


if __name__ == "__main__":
    sys.exit(main())
