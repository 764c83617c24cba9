"""Logs of training runs for TensorBoard and Weights & Biases. Both packages are optional."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

from humanclaw import HumanclawError

Write = Callable[[int, Mapping[str, float]], None]
"""Logs values at a step."""
Settings = Mapping[str, Any]
"""The run's recipe."""


@contextmanager
def _tensorboard(out: Path, settings: Settings, step: int) -> Iterator[Write]:
    from torch.utils.tensorboard import SummaryWriter

    # The steps after the last save are done again by a resumed run.
    with SummaryWriter(str(out / "tensorboard"), purge_step=step) as writer:

        def write(at: int, values: Mapping[str, float]) -> None:
            for name, value in values.items():
                writer.add_scalar(name, value, at)

        yield write


@contextmanager
def _wandb(out: Path, settings: Settings, step: int) -> Iterator[Write]:
    import wandb

    known = out / "wandb-run"
    resumed = known.read_text() if step and known.is_file() else None
    project = os.environ.get("WANDB_PROJECT", "humanclaw")
    again = {"id": resumed, "resume": "allow"} if resumed else {}
    with wandb.init(project=project, name=out.name, dir=str(out), config=dict(settings), **again) as run:
        known.write_text(run.id)
        yield lambda at, values: run.log(dict(values), step=at)


LOGS: Final = {"tensorboard": _tensorboard, "wandb": _wandb}


def check(names: Iterable[str]) -> None:
    """Raise HumanclawError if a log's package is not installed."""
    for name in names:
        if importlib.util.find_spec(name) is None:
            raise HumanclawError(
                f"--logger {name} needs the package {name}, which is not installed.", f"Run `pip install {name}`."
            )


@contextmanager
def opened(names: Sequence[str], out: Path, settings: Settings, step: int) -> Iterator[Write]:
    """Open logs of a run in the folder `out`. step: where it begins or resumes."""
    with ExitStack() as stack:
        writes = [stack.enter_context(LOGS[name](out, settings, step)) for name in dict.fromkeys(names)]

        def write(at: int, values: Mapping[str, float]) -> None:
            for one in writes:
                one(at, values)

        yield write
