"""HumanCLAW-Bench: episodes, runs, metrics, root causes and tables (paper, section 4)."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from humanclaw import hookimpl
from humanclaw_bench.own import task as task

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import ModuleType

    import click
    import pandas as pd

    from humanclaw import Plugins, RecordedEpisode, Scene
    from humanclaw.plugins import Options, Register, SceneFactory, Tasks, TasksFactory
    from humanclaw_bench.hookspecs import Executor, ExecutorFactory
    from humanclaw_bench.overview import Page

__version__ = "0.1.0"
_TASKS = (
    ("train", "episodes as those of val, in training houses"),
    ("approach", "walk up to the target in front of you and stop"),
    ("turn", "turn until the target is in view, and say so"),
    ("sit", "sit down on what is behind you"),
    ("touch", "walk until something stops you, and say what touches you"),
    ("file", "episodes of a file that `humanclaw bench generate --train` wrote"),
)


def load(run: str | Path) -> pd.DataFrame:
    """Load a run as a pandas DataFrame, one row per episode: scores, costs and root cause. Needs pandas."""
    from humanclaw_bench import export

    return export.load(run)


@hookimpl
def humanclaw_hookspecs(register: Callable[[ModuleType], None]) -> None:
    from humanclaw_bench import hookspecs

    register(hookspecs)


@hookimpl
def humanclaw_executors(register: Register[ExecutorFactory]) -> None:
    register("local", _local, "processes of this machine")


@hookimpl
def humanclaw_scenes(register: Register[SceneFactory], plugins: Plugins) -> None:
    about = "A house with a mirror, a double, a gap ...: the scenes of the split `self`."
    register("self", partial(_set_up, plugins), about)


@hookimpl
def humanclaw_tasks(register: Register[TasksFactory]) -> None:
    for name, about in _TASKS:
        register(name, partial(_tasks, name), about)


@hookimpl(optionalhook=True)
def humanclaw_overview(runs: Mapping[Path, Sequence[RecordedEpisode]], page: Page, plugins: Plugins) -> None:
    from humanclaw_bench.overview import overview

    overview(runs, page, plugins)


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    from humanclaw.cli import LazyCommand

    about = "Run the benchmark and score it."
    cli.add_command(LazyCommand("bench", "humanclaw_bench.cli:bench", about))


def _tasks(name: str, options: Options) -> Tasks:
    from humanclaw_bench.training import tasks

    return tasks(name, options)


def _set_up(plugins: Plugins, argument: str) -> Scene:
    from humanclaw_bench.oneself.scene_setups import set_up

    return set_up(plugins, argument)


def _local(workers: int = 1, address: str = "") -> Executor:
    from humanclaw_bench.executors import LocalExecutor

    return LocalExecutor(workers)
