"""Train the prior or one skill's adapter (paper, section 3.3).

    python -m humanclaw_train.train base --data CHUNKS --out DIR
    python -m humanclaw_train.train adapter NAME --data CHUNKS --base base.safetensors --out DIR
    python -m humanclaw_train.train adapter --skill FOLDER

With --skill the folder's name is the skill's, chunks are looked for where `humanclaw data chunks` puts them, and the
finished adapter goes into the folder. Whenever the run saves its state it also tells how faithful the adapter is by
then, for a skill whose schema.json is at hand.

A run saves its whole state every two minutes and, started again with the same --out, goes on from there. Every random
number of a step depends on the seed and the step alone, so a run that was interrupted ends with the weights of one that
was not (with --steps; with --minutes the schedule follows the clock).
"""

from __future__ import annotations

import argparse
import copy
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from humanclaw import HumanclawError
from humanclaw.body import CHUNK, FUTURE, HISTORY, N_JOINTS
from humanclaw.motion import (
    PROFILES,
    SIZES,
    AdapterConfig,
    Card,
    DiTGenerator,
    Encoder,
    Prediction,
    load_base as read_base,
    read_header,
    shipped_base,
)
from humanclaw.skills import MEASURES, Declaration
from humanclaw.storage import write_atomically
from humanclaw_train import data, flow, kinematics
from humanclaw_train.checkpoint import Base, Normaliser, load_adapter, load_base, save_adapter, save_base
from humanclaw_train.control import Adapter
from humanclaw_train.data import ChunkTensors
from humanclaw_train.dit import DiT
from humanclaw_train.fidelity import live
from humanclaw_train.rollouts import Measures, declared

CHUNKS: Final = Path(".data/chunks")
"""Where `humanclaw data` puts chunks."""
_SAVE_SECONDS: Final = 120
_REPORT_SECONDS: Final = 15


@dataclass(frozen=True)
class Recipe:
    """All that decides what a run learns, its data apart. minutes or steps ends it, whichever is given."""

    size: str = "lite"
    batch: int = 64
    rate: float = 1e-3
    minutes: float = 40.0
    steps: int = 0
    seed: int = 0
    history_noise: float = 1.0
    jitter: float = 0.01
    """Noise on a condition, in units of its own deviation."""
    init: str = ""
    """Recipe digest of the checkpoint that the run began from; empty when it began from nothing."""
    licences: tuple[str, ...] = ()
    """Of the data, for the checkpoint's header."""


@dataclass(frozen=True)
class Weights:
    """How the terms of the loss are weighed against one another. The unit of the metric terms is named with each."""

    root: float = 4.0
    rotations: float = 1.0
    positions: float = 0.5
    velocities: float = 0.5
    joints: float = 0.3
    """Forward kinematics of the predicted rotations, per (3 cm) squared."""
    motion: float = 0.15
    """Their one-frame differences, per (5 mm) squared."""
    feet: float = 2.0
    """Of those, how much more the feet count than another joint,"""
    stance: float = 12.0
    """and how much more a foot that is at rest: this is what keeps feet from skating."""
    outcome: float = 0.2
    """Root at the last frame, per (1 cm) and (0.4 degrees) squared, linear beyond: what the skills' parameters command.
    Of the heading little is enough to lead a long walk astray."""


class Loss:
    """Flow matching, weighed by block of the state, with what the state implies for the joints and for the outcome."""

    def __init__(self, normaliser: Normaliser, weights: Weights) -> None:
        self.normaliser = normaliser
        self.weights = weights
        device = normaliser.mean.device
        by_block = torch.empty(len(normaliser.mean), device=device)
        by_block[kinematics.ROTATIONS] = weights.rotations
        by_block[:6] = weights.root
        by_block[kinematics.POSITIONS] = weights.positions
        by_block[kinematics.VELOCITIES] = weights.velocities
        self.by_block = by_block / by_block.mean()
        self.feet = torch.zeros(N_JOINTS, 1, device=device)
        self.feet[list(kinematics.FEET)] = 1.0

    def __call__(self, predicted: Tensor, wanted: Tensor, clean: Tensor, states: Tensor) -> Tensor:
        """predicted, wanted: outputs (B, 15, 219). clean: the future that predicted means. states: (B, 20, 219) in
        metres."""
        matching = (self.by_block * (predicted - wanted).square()).mean()
        implied = self.normaliser.inverse(clean)
        root = implied[..., kinematics.ROOT]
        joints = kinematics.joints(root, implied[..., kinematics.ROTATIONS].reshape(-1, FUTURE, N_JOINTS, 3))
        true = states[..., kinematics.POSITIONS].reshape(-1, CHUNK, N_JOINTS, 3)
        steps = torch.cat([true[:, HISTORY - 1 : HISTORY], joints], 1).diff(dim=1)
        true_steps = true[:, HISTORY - 1 :].diff(dim=1)
        return (
            matching
            + self.weights.joints * ((joints - true[:, HISTORY:]) / 0.03).square().mean()
            + self.weights.motion * (self._care(true_steps) * ((steps - true_steps) / 0.005).square()).mean()
            + self.weights.outcome * _outcome(implied[:, -1, :6] - states[:, -1, :6])
        )

    def _care(self, true_steps: Tensor) -> Tensor:
        """(B, 15, 24, 1) how much each joint's motion matters."""
        stance = self.feet * (true_steps.norm(dim=-1, keepdim=True) < 0.004)
        care: Tensor = 1 + self.weights.feet * self.feet + self.weights.stance * stance
        return care


def _outcome(error: Tensor) -> Tensor:
    """(B, 6) root translation and rotation errors, metres and radians."""
    units = torch.tensor([0.01] * 3 + [math.radians(0.4)] * 3, device=error.device)
    return nn.functional.smooth_l1_loss(error / units, torch.zeros_like(error))


Forward = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
"""(history, noisy future, tau, encoded condition) to the model's output."""
Objective = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
"""(states, encoded condition, noise, tau) to the loss."""
Encode = Callable[[Tensor], Tensor]
"""Condition values (B, k) to (B, 1, hidden). Left outside what is compiled, so that one compilation serves all
skills."""


def objective(forward: Forward, loss: Loss, prediction: Prediction, fast: bool = False) -> Objective:
    """Return the flow matching problem of a batch, answered by `forward`, judged by `loss`. fast: compiled as a
    whole."""

    def value(states: Tensor, condition: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
        normal = loss.normaliser.forward(states)
        future = normal[:, HISTORY:]
        noisy = flow.noised(future, noise, tau)
        with torch.autocast(states.device.type, torch.bfloat16, enabled=_has_bfloat16(states.device)):
            output = forward(normal[:, :HISTORY], noisy, tau, condition)
        output = output.float()
        wanted = future if prediction == "clean" else flow.target(future, noise)
        return loss(output, wanted, flow.clean(prediction, output, noisy, tau), states)

    return torch.compile(value) if fast else value


def _has_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 pays: a processor without AVX-512 emulates it, thirteen times slower than float32 (measured on
    AVX2)."""
    return device.type != "cpu" or torch.backends.cpu.get_cpu_capability() == "AVX512"


M = TypeVar("M", bound=nn.Module)


class Trainer(Generic[M]):
    """One run: the trainable module, its optimiser, its running mean, and where they have got to."""

    def __init__(self, module: M, chunks: ChunkTensors, recipe: Recipe) -> None:
        self.module = module
        self.chunks = chunks
        self.recipe = recipe
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
        """From 0 to 1."""
        recipe = self.recipe
        return self.step / recipe.steps if recipe.steps else self.seconds / (60 * recipe.minutes)

    def batch(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """States (B, 20, 219) in metres, condition values (B, k), noise (B, 15, 219) and tau (B,) of the current
        step."""
        device = self.chunks.root.device
        generator = torch.Generator(device)
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
        # Not uniform: the noisy joints of 15 frames together betray the outcome from tau 0.1 on, so what a model makes
        # of its condition is decided close to 0.
        return states, values, noise, torch.rand(size, generator=generator, device=device) ** 2

    def advance(self, problem: Objective, encode: Encode) -> Tensor:
        """One optimisation step; the loss before it."""
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
        share = max(1e-3, 1 / (1 + self.step / 5))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.mean.parameters()), list(self.module.parameters()), share)

    def save(self, path: Path) -> None:
        """Write the whole state, all of it or nothing."""
        content = {
            "module": self.module.state_dict(),
            "mean": self.mean.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds,
            "seed": self.recipe.seed,
        }
        partial = path.with_suffix(".partial")
        torch.save(content, partial)
        partial.replace(path)

    def resume(self, path: Path) -> None:
        """Go on from a saved state, if there is one. Raises HumanclawError for that of a run with another seed."""
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
    """Linear warm-up over 200 steps, or a twentieth of a shorter run; a cosine down to a hundredth."""
    return min(1.0, max((step + 1) / 200, progress / 0.05)) * (
        0.01 + 0.99 * (0.5 + 0.5 * math.cos(math.pi * min(progress, 1.0)))
    )


def run(trainer: Trainer[Any], problem: Objective, encode: Encode, out: Path, export: Callable[[], None]) -> None:
    """Train to the end of the recipe, resuming, saving and reporting on the way."""
    out.mkdir(parents=True, exist_ok=True)
    trainer.resume(out / "state.pt")
    saved = reported = clock = time.monotonic()
    total, begun = 0.0, trainer.step
    first = begun
    while trainer.progress < 1:
        total += float(trainer.advance(problem, encode))
        now = time.monotonic()
        # The first step may compile, which is no training: the clock runs from the second.
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


def _report(trainer: Trainer[Any], loss: float, rate: float) -> None:
    done = max(trainer.progress, 1e-6)
    left = trainer.seconds / done - trainer.seconds
    print(
        f"step {trainer.step:7d}  {100 * done:5.1f} %  loss {loss:.4f}  {rate:.2f} steps/s  "
        f"{rate * trainer.recipe.batch:.0f} chunks/s  {left / 60:.1f} min left",
        flush=True,
    )


def train_base(folders: Sequence[Path], out: Path, recipe: Recipe, device: torch.device, fast: bool = False) -> Path:
    """Train the prior on `base.npz` and the skills' chunks; the path of its checkpoint, out/base.safetensors."""
    chunks = data.load_all(folders)
    normaliser = data.normaliser(chunks).to(device)
    start = data.standing(chunks)
    torch.manual_seed(recipe.seed)
    model = DiT(SIZES[recipe.size]).to(device)
    trainer = Trainer(model, chunks.to(device), recipe)
    path = out / "base.safetensors"

    def forward(history: Tensor, noisy: Tensor, tau: Tensor, condition: Tensor) -> Tensor:
        output: Tensor = model(history, noisy, model.modulations(tau))
        return output

    def export() -> None:
        save_base(path, trainer.mean, normaliser, start, _card(trainer, Weights(), "base"))

    problem = objective(forward, Loss(normaliser, Weights()), model.config.prediction, fast)
    run(trainer, problem, lambda values: values, out, export)
    return path


def train_adapter(
    skill: str,
    folders: Sequence[Path],
    base: Base,
    out: Path,
    recipe: Recipe,
    device: torch.device,
    fast: bool = False,
    init: Path | None = None,
    look: Callable[[Path], str] | None = None,
) -> Path:
    """Train the adapter of one skill on the frozen base; the path of its checkpoint, out/adapter.safetensors.

    init: a checkpoint of this skill on this base to go on from, instead of a copy of the base's blocks. look: told of
    each checkpoint, says what to print of it.
    """
    chunks = data.load(folders, skill).to(device)
    torch.manual_seed(recipe.seed)
    if init is None:
        adapter = Adapter(base.model, adapter_config(chunks))
    else:
        adapter = load_adapter(init, base, skill).train().requires_grad_()
        adapter.config = replace(adapter.config, measures=chunks.measures)  # Older headers do not say.
        recipe = replace(recipe, init=str(read_header(init)["card"]["recipe_digest"]))
    frozen, normaliser, adapter = base.model.to(device), base.normaliser.to(device), adapter.to(device)
    trainer = Trainer(adapter, chunks, recipe)
    path = out / "adapter.safetensors"

    def forward(history: Tensor, noisy: Tensor, tau: Tensor, condition: Tensor) -> Tensor:
        residual = adapter.residual(condition, adapter.modulations(frozen, tau))
        output: Tensor = frozen(history, noisy, frozen.modulations(tau), residual)
        return output

    def export() -> None:
        save_adapter(path, trainer.mean, base.digest, _card(trainer, Weights(), skill))
        if look is not None and trainer.step:
            print(f"step {trainer.step:7d}  {look(path)}", flush=True)

    problem = objective(forward, Loss(normaliser, Weights()), frozen.config.prediction, fast)
    run(trainer, problem, adapter.condition, out, export)
    return path


def adapter_config(chunks: ChunkTensors) -> AdapterConfig:
    """Return the encoder of a skill, centred and scaled to the range of its data."""
    params, width = chunks.params, chunks.params.shape[1]
    # Spatial conditions take Fourier features, scalars an MLP (paper, section 3.3).
    encoder: Encoder = "fourier" if width > 2 else "mlp" if width else "token"
    # Not the extremes: standing up from a seat into a step is in the data, and is a rise that no command asks for.
    low, high = (params.quantile(edge, 0) if width else params.new_zeros(0) for edge in (0.01, 0.99))
    scale = ((high - low) / 2).clamp(min=1e-3)
    centre = _rounded((low + high) / 2)
    return AdapterConfig(chunks.name, encoder, chunks.names, centre, _rounded(scale), chunks.measures)


def _rounded(values: Tensor) -> tuple[float, ...]:
    return tuple(round(float(value), 5) for value in values)


def _card(trainer: Trainer[Any], weights: Weights, name: str) -> Card:
    recipe = {**asdict(trainer.recipe), "name": name, "loss": asdict(weights), "done_steps": trainer.step}
    licences = recipe.pop("licences")
    return Card(recipe, trainer.chunks.statistics, tuple(licences))


def main(arguments: Sequence[str] | None = None, measures: Measures = lambda: MEASURES) -> int:
    """Run the command line.

    measures: finds what a skill's parameters may command; this module itself knows of no plugins.
    """
    options = _parser().parse_args(arguments)
    torch.set_num_threads(options.threads)
    device = torch.device(
        options.device if options.device != "auto" else "cuda" if torch.cuda.is_available() else "cpu"
    )
    recipe = Recipe(
        options.size,
        options.batch,
        options.rate,
        options.minutes,
        options.steps,
        options.seed,
        options.history_noise,
        options.jitter,
        licences=tuple(options.licence),
    )
    folders = options.data or [CHUNKS]
    try:
        if options.what == "base":
            export = options.export
            path = train_base(folders, options.out, recipe, device, options.compile)
        else:
            skill, declared = _named(options)
            export = options.export or (options.folder / "adapter.safetensors" if options.folder else None)
            path = train_adapter(
                skill,
                folders,
                load_base(options.base),
                options.out or Path(".data") / skill,
                recipe,
                device,
                options.compile,
                options.init,
                _live(options.base, declared, measures),
            )
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if export:
        _copy(path, export)
        print(f"wrote {export}")
    return 0


def _named(options: argparse.Namespace) -> tuple[str, Path]:
    """Return the skill and the folder that declares it, if there is one.

    Raises HumanclawError unless one of both is given.
    """
    if (options.skill is None) == (options.folder is None):
        raise HumanclawError("Which skill is to be trained?", "Give its name or --skill FOLDER.")
    if options.folder is not None:
        return options.folder.resolve().name, options.folder
    return options.skill, declared(options.skill, Path("adapter.safetensors"))


def _live(base: Path, folder: Path, measures: Measures) -> Callable[[Path], str] | None:
    """None for a skill that nothing here declares, or that takes no parameters."""
    if not (folder / "schema.json").is_file():
        return None
    declaration = Declaration.read(folder)
    generator = DiTGenerator(read_base(base), PROFILES["default"])
    return live(generator, declaration, measures=measures()) if declaration.parameters else None


def _copy(path: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(to, path.read_bytes())


def _licence(text: str) -> str:
    if not text.strip():  # As of a variable of the shell that is not set.
        raise argparse.ArgumentTypeError("the licence is empty; write SOURCE: LICENCE")
    return text


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="humanclaw_train.train", description=__doc__.splitlines()[0] if __doc__ else ""
    )
    what = parser.add_subparsers(dest="what", required=True)
    for name in ("base", "adapter"):
        one = what.add_parser(name)
        if name == "adapter":
            one.add_argument("skill", nargs="?", help="its name, or --skill")
            one.add_argument("--skill", dest="folder", type=Path, metavar="FOLDER", help="folder of its schema.json")
            one.add_argument(
                "--base", type=Path, default=shipped_base(), help="base to train against; the shipped one by default"
            )
            one.add_argument("--init", type=Path, help="adapter to go on from, instead of a copy of the base")
        one.add_argument(
            "--data", type=Path, action="append", help=f"folder of chunks; may be given several times ({CHUNKS})"
        )
        one.add_argument(
            "--out",
            type=Path,
            required=name == "base",
            help="folder of the run; a run that is there goes on (.data/SKILL)",
        )
        one.add_argument("--export", type=Path, help="copy the finished checkpoint to this file")
        one.add_argument("--size", choices=list(SIZES), default="lite", help="shape of the base")
        one.add_argument("--minutes", type=float, default=40.0 if name == "base" else 8.0)
        one.add_argument("--steps", type=int, default=0, help="end after this many steps, whatever the time")
        one.add_argument("--batch", type=int, default=64)
        one.add_argument("--rate", type=float, default=1e-3, help="learning rate")
        one.add_argument("--seed", type=int, default=0)
        one.add_argument("--history-noise", type=float, default=1.0, help="strength of the offsets on histories")
        one.add_argument("--jitter", type=float, default=0.01, help="noise on conditions, in units of their deviation")
        one.add_argument(
            "--licence", action="append", default=[], type=_licence, metavar="SOURCE: LICENCE",
            help="of the data; written into the checkpoint",
        )  # fmt: skip
        one.add_argument("--threads", type=int, default=1)
        one.add_argument("--device", default="auto")
        one.add_argument(
            "--compile", action="store_true", help="compile the model first: half a minute, then a third faster"
        )
    return parser


if __name__ == "__main__":
    sys.exit(main())
