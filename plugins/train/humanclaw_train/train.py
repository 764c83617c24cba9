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
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from humanclaw import HumanclawError
from humanclaw.motion import (
    PROFILES,
    SIZES,
    AdapterConfig,
    Card,
    Encoder,
    load_base as read_base,
    read_header,
    shipped_base,
)
from humanclaw.skills import MEASURES, Declaration
from humanclaw.storage import write_atomically
from humanclaw_train import logs
from humanclaw_train.data import tensors
from humanclaw_train.data.chunks import CHUNKS
from humanclaw_train.data.rollout_training import OwnHistories, predecessors
from humanclaw_train.data.tensors import ChunkTensors
from humanclaw_train.eval.rollouts import Installed, Measures, declared
from humanclaw_train.model.checkpoint import Base, load_adapter, load_base, save_adapter, save_base
from humanclaw_train.model.control import Adapter
from humanclaw_train.model.dit import DiT
from humanclaw_train.model.flow import LOSSES, Forward, Loss, Weights, generated, has_bfloat16, objective
from humanclaw_train.parallel import ALONE, Processes, device_of, joined
from humanclaw_train.trainer import M, Problem, Recipe, Trainer, run
from humanclaw_train.validation import Validation, held_out


@dataclass(frozen=True)
class Session:
    """Where and how a run computes, apart from its recipe. logs: names of humanclaw_train.logs.LOGS."""

    device: torch.device
    processes: Processes = ALONE
    fast: bool = False
    """Whether to compile the model."""
    logs: tuple[str, ...] = ()

    def run(
        self,
        trainer: Trainer[M],
        problem: Callable[[M, bool], Problem[M]],
        out: Path,
        export: Callable[[], None],
        held_out: ChunkTensors | None,
    ) -> None:
        """Train to the end of the recipe.

        problem: returns the loss of a module, compiled or not. held_out: chunks to validate on.
        """
        validate = None
        if held_out is not None:
            # Not compiled: that takes longer than all validations of a short run.
            validate = Validation(problem(trainer.mean, False), held_out.to(self.device), trainer.recipe).loss
        run(trainer, problem(trainer.module, self.fast), out, export, validate, self.logs)


def train_base(folders: Sequence[Path], out: Path, recipe: Recipe, session: Session) -> Path:
    """Train the prior on every file of chunks. Returns its checkpoint, out/base.safetensors."""
    chunks = tensors.load_all(folders)
    normaliser = tensors.normaliser(chunks).to(session.device)
    start = tensors.standing(chunks)
    torch.manual_seed(recipe.seed)  # For the initial weights; batches have generators of their own.
    model = DiT(SIZES[recipe.size]).to(session.device)
    trainer = Trainer(model, chunks.to(session.device), recipe, session.processes)
    path, loss = out / "base.safetensors", Loss(normaliser, LOSSES[recipe.terms])

    def problem(model: DiT, fast: bool) -> Problem[DiT]:
        def forward(history: Tensor, noisy: Tensor, tau: Tensor, condition: Tensor) -> Tensor:
            output: Tensor = model(history, noisy, model.modulations(tau))
            return output

        computed = objective(forward, loss, model.config.prediction, recipe.precision == "bf16", fast)
        return Problem(model, lambda values: values, computed)

    def export() -> None:
        save_base(path, trainer.mean, normaliser, start, _card(trainer, loss.weights, "base"))

    session.run(trainer, problem, out, export, held_out(folders, "base"))
    return path


def train_adapter(
    skill: str,
    folders: Sequence[Path],
    base: Base,
    out: Path,
    recipe: Recipe,
    session: Session,
    init: Path | None = None,
    look: Callable[[Path], str] | None = None,
) -> Path:
    """Train one skill's adapter on the frozen base. Returns its checkpoint, out/adapter.safetensors.

    init: a checkpoint of this skill on this base to start from, instead of a copy of the base's blocks. look: called
    with each checkpoint; returns a text to print.
    """
    device = session.device
    chunks = tensors.load(folders, skill).to(device)
    torch.manual_seed(recipe.seed)
    if init is None:
        adapter = Adapter(base.model, adapter_config(chunks))
    else:
        adapter = load_adapter(init, base, skill).train().requires_grad_()
        adapter.config = replace(adapter.config, measures=chunks.measures)  # Older headers lack them.
        card = read_header(init)["card"]
        recipe = replace(recipe, init=str(card["recipe_digest"]), licences=(*recipe.licences, *card["licences"]))
    frozen, normaliser, adapter = base.model.to(device), base.normaliser.to(device), adapter.to(device)
    trainer = Trainer(adapter, chunks, recipe, session.processes)
    path, loss = out / "adapter.safetensors", Loss(normaliser, LOSSES[recipe.terms])

    def forward_of(adapter: Adapter) -> Forward:
        def forward(history: Tensor, noisy: Tensor, tau: Tensor, condition: Tensor) -> Tensor:
            residual = adapter.residual(condition, adapter.modulations(frozen, tau))
            output: Tensor = frozen(history, noisy, frozen.modulations(tau), residual)
            return output

        return forward

    def problem(adapter: Adapter, fast: bool) -> Problem[Adapter]:
        forward, bf16 = forward_of(adapter), recipe.precision == "bf16"
        return Problem(adapter, adapter.condition, objective(forward, loss, frozen.config.prediction, bf16, fast))

    if recipe.rollout > 1:
        made = generated(forward_of(trainer.mean), normaliser, frozen.config.prediction, trainer.mean.condition)
        trainer.own = OwnHistories(chunks, predecessors(chunks), recipe.rollout - 1, made)

    def export() -> None:
        save_adapter(path, trainer.mean, base.digest, _card(trainer, loss.weights, skill))
        if look is not None and trainer.step:
            print(f"step {trainer.step:7d}  {look(path)}", flush=True)

    session.run(trainer, problem, out, export, held_out(folders, skill))
    return path


def adapter_config(chunks: ChunkTensors) -> AdapterConfig:
    """Return the encoder of a skill, centred and scaled to the range of its data."""
    params, width = chunks.params, chunks.params.shape[1]
    # Spatial conditions take Fourier features, scalars an MLP (paper, section 3.3).
    encoder: Encoder = "fourier" if width > 2 else "mlp" if width else "token"
    # Quantiles, not extremes: in a step out of a seat the pelvis rises further than any command asks for.
    low, high = (params.quantile(edge, 0) if width else params.new_zeros(0) for edge in (0.01, 0.99))
    scale = ((high - low) / 2).clamp(min=1e-3)
    centre = _rounded((low + high) / 2)
    return AdapterConfig(chunks.name, encoder, chunks.names, centre, _rounded(scale), chunks.measures)


def _rounded(values: Tensor) -> tuple[float, ...]:
    return tuple(round(float(value), 5) for value in values)


def _card(trainer: Trainer[Any], weights: Weights, name: str) -> Card:
    recipe = {**asdict(trainer.recipe), "name": name, "loss": asdict(weights), "done_steps": trainer.step}
    licences = dict.fromkeys((*recipe.pop("licences"), *trainer.chunks.licences))
    return Card(recipe, trainer.chunks.statistics, tuple(licences))


# -- the command line --------------------------------------------------------------------------------------------------
def main(
    arguments: Sequence[str] | None = None,
    measures: Measures = lambda: MEASURES,
    installed: Installed | None = None,
) -> int:
    """Run the command line.

    measures: returns the known measures. installed: returns the adapters of the installed skills. The caller passes
    them in, because this module runs without a plugin host.
    """
    options = _parser().parse_args(arguments)
    torch.set_num_threads(options.threads)
    device = device_of(options.device)
    try:
        logs.check(options.logger)
        with joined(device) as processes:
            session = Session(device, processes, options.compile, tuple(options.logger))
            path, export = _trained(options, session, measures, installed)
            if export and processes.first:
                _copy(path, export)
                print(f"wrote {export}")
    except HumanclawError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _trained(
    options: argparse.Namespace, session: Session, measures: Measures, installed: Installed | None
) -> tuple[Path, Path | None]:
    """Train what the options say. Returns the checkpoint, and the file to copy it to."""
    folders, recipe = options.data or [CHUNKS], _recipe(options, session.device)
    if options.what == "base":
        return train_base(folders, options.out, recipe, session), options.export
    skill, declared = _named(options, installed)
    path = train_adapter(
        skill,
        folders,
        load_base(options.base),
        options.out or Path(".data") / skill,
        recipe,
        session,
        options.init,
        _live(options.base, declared, measures),
    )
    return path, options.export or (options.folder / "adapter.safetensors" if options.folder else None)


def _recipe(options: argparse.Namespace, device: torch.device) -> Recipe:
    precision = options.precision
    return Recipe(
        size=options.size,
        batch=options.batch,
        rate=options.rate,
        minutes=options.minutes,
        steps=options.steps,
        seed=options.seed,
        history_noise=options.history_noise,
        jitter=options.jitter,
        tau=options.tau,
        precision=precision if precision != "auto" else "bf16" if has_bfloat16(device) else "float32",
        terms=options.loss,
        rollout=getattr(options, "rollout", 1),
        licences=tuple(options.licence),
    )


def _named(options: argparse.Namespace, installed: Installed | None) -> tuple[str, Path]:
    """Return the skill and the folder that declares it. Raises HumanclawError unless exactly one of both is given."""
    if (options.skill is None) == (options.folder is None):
        raise HumanclawError("Expected one skill to train.", "Give either its name or --skill FOLDER.")
    if options.folder is not None:
        return options.folder.resolve().name, options.folder
    return options.skill, declared(options.skill, Path("adapter.safetensors"), installed() if installed else {})


def _live(base: Path, folder: Path, measures: Measures) -> Callable[[Path], str] | None:
    """Return the function that measures checkpoints; None for a skill without schema.json or without parameters."""
    if not (folder / "schema.json").is_file():
        return None
    # Imported here, because only this function generates motion, and training also runs where little is installed.
    from humanclaw.motion import DiTGenerator
    from humanclaw_train.eval.fidelity import live

    declaration = Declaration.read(folder)
    generator = DiTGenerator(read_base(base), PROFILES["default"])
    return live(generator, declaration, measures=measures()) if declaration.parameters else None


def _copy(path: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(to, path.read_bytes())


def _licence(text: str) -> str:
    if not text.strip():  # For example from a shell variable that is not set.
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
            one.add_argument("skill", nargs="?", help="name of the skill, unless --skill is given")
            one.add_argument(
                "--skill", dest="folder", type=Path, metavar="FOLDER", help="folder with the skill's schema.json"
            )
            one.add_argument(
                "--base", type=Path, default=shipped_base(), help="base to train against (default: the shipped one)"
            )
            one.add_argument("--init", type=Path, help="adapter to start from, instead of a copy of the base")
            one.add_argument(
                "--rollout", type=int, default=1, help="chunks in a row, the earlier ones generated (default: 1)"
            )
        one.add_argument("--data", type=Path, action="append", help=f"folder of chunks; repeatable (default: {CHUNKS})")
        one.add_argument(
            "--out",
            type=Path,
            required=name == "base",
            help="folder of the run; an existing run is resumed (default for adapters: .data/SKILL)",
        )
        one.add_argument("--export", type=Path, help="copy the finished checkpoint to this file")
        one.add_argument("--size", choices=list(SIZES), default="lite", help="size of the base")
        one.add_argument("--minutes", type=float, default=40.0 if name == "base" else 8.0, help="training time")
        one.add_argument("--steps", type=int, default=0, help="end after this many steps instead of --minutes")
        one.add_argument("--batch", type=int, default=64, help="chunks per step, of all processes together")
        one.add_argument("--rate", type=float, default=1e-3, help="learning rate")
        one.add_argument("--seed", type=int, default=0, help="seed of all random numbers")
        one.add_argument("--history-noise", type=float, default=1.0, help="strength of the errors added to histories")
        one.add_argument(
            "--tau", choices=("squared", "uniform"), default="squared", help="flow times; the paper's are uniform"
        )
        one.add_argument(
            "--loss", choices=list(LOSSES), default="full", help="plain: the paper's, without terms for joints and feet"
        )
        one.add_argument(
            "--precision",
            choices=("auto", "float32", "bf16"),
            default="auto",
            help="of the layers; auto takes bf16 where the device is fast at it",
        )
        one.add_argument(
            "--logger", choices=list(logs.LOGS), action="append", default=[], help="also log to this; repeatable"
        )
        one.add_argument("--jitter", type=float, default=0.01, help="noise on conditions, in standard deviations")
        one.add_argument(
            "--licence",
            action="append",
            default=[],
            type=_licence,
            metavar="SOURCE: LICENCE",
            help="licence of a data source that its folder does not tell; repeatable",
        )
        one.add_argument("--threads", type=int, default=1, help="CPU threads")
        one.add_argument("--device", default="auto", help="torch device; auto takes CUDA if there is any")
        one.add_argument(
            "--compile", action="store_true", help="compile the model: takes half a minute, then a third faster"
        )
    return parser


if __name__ == "__main__":
    sys.exit(main())
