"""`humanclaw bench reproduce`: play the paper's tables 2 and 3 for the models of a file, and write one page."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final

import click
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from humanclaw import Backends, EpisodeSpec, HumanclawError, Plugins
from humanclaw.cli import Console, counted
from humanclaw.records import name_of
from humanclaw.storage import Folder, read_file, write_result
from humanclaw_bench.progress import RunProgress, foresight, stop_after_option
from humanclaw_bench.results import Result
from humanclaw_bench.runner import RunStatus, run_split
from humanclaw_bench.scoring import results_of
from humanclaw_bench.splits import load_split
from humanclaw_bench.tables import ResultTable, all_tables, result_table
from humanclaw_bench.worker import Job
from humanclaw_bench.writers import markdown

MAIN: Final = "main"
"""Folder of a model's run for table 2; the other folders are settings of table 3."""
PAPER_SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "baseline": {},
    **{f"history {steps}": {"history": steps} for steps in (0, 20, 50, 100)},
    **{f"images {count}": {"images": count} for count in (2, 5, 10)},
    "without verifier": {"verifier": ""},
    "without mid-level": {"mid_level": False},
}
"""The rows of the paper's table 3 by name: what differs from `--profile paper`."""
SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    **PAPER_SETTINGS,
    "memory notes": {"memory": "notes"},
    "memory map": {"memory": "map"},
}
"""The same with rows that the paper does not have; they are played if named."""


def _known(name: str) -> str:
    if name not in SETTINGS:
        raise ValueError(f"{name!r} is none of {', '.join(SETTINGS)}")
    return name


Setting = Annotated[str, AfterValidator(_known)]


class Model(BaseModel):
    """A row of the paper's tables."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())

    model: Annotated[str, Field(min_length=1)]
    """Provider and name, as litellm writes them."""
    name: Annotated[str, Field(pattern=r"^[\w.-]*$")] = ""
    """Name of the row and of its folder; the default is made from the model."""
    usd_per_million: tuple[float, float] | None = None
    """US dollars for a million tokens in and out; the default is litellm's list of prices."""
    options: Mapping[str, Any] = {}
    """Further options of agent and verifier, as for `--option`."""
    limits: Mapping[str, float] = {}
    """Limits of each run, as for `--limit`."""
    ablation: bool | tuple[Setting, ...] = False
    """Whether to play the ten settings of table 3 too, or the names of some."""

    @property
    def folder(self) -> str:
        return self.name or re.sub(r"[^\w.-]+", "-", self.model)

    @property
    def settings(self) -> tuple[str, ...]:
        """The settings of table 3 to play."""
        return (tuple(PAPER_SETTINGS) if self.ablation else ()) if isinstance(self.ablation, bool) else self.ablation

    def job(self, setting: str) -> Job:
        """Return the job of a setting; that of table 2 is the baseline's."""
        params: dict[str, Any] = dict(self.options.get("params", {}))
        if self.usd_per_million:
            costs = (usd / 1_000_000 for usd in self.usd_per_million)
            params |= dict(zip(("input_cost_per_token", "output_cost_per_token"), costs, strict=True))
        options = {"profile": "paper", **self.options, "model": self.model} | ({"params": params} if params else {})
        options |= SETTINGS[setting]
        verifier = options.pop("verifier", "litellm")
        return Job("litellm", options, verifier, Backends(profile="paper"), self.limits)


class Plan(BaseModel):
    """The file of models."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    models: Annotated[tuple[Model, ...], Field(min_length=1)]
    split: str = "val"
    """Split of table 2."""
    ablation_split: str = "mini"
    """Split of table 3."""

    @classmethod
    def read(cls, path: Path) -> Plan:
        """Read a file. Raises HumanclawError, which names the first fault."""
        try:
            plan = cls.model_validate(tomllib.loads(read_file(path, 1 << 20).decode("utf-8")))
        except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", error)
            raise HumanclawError(f"{path} cannot be read: {why}.", "Name a TOML file of models.") from error
        except ValidationError as error:
            # Of a choice of types the one that fits best.
            fault = max(error.errors(), key=lambda fault: len(fault["loc"]))
            where = ".".join(map(str, fault["loc"]))
            raise HumanclawError(f"{path}: {where}: {fault['msg']}.", "See docs/howto/measure.md.") from error
        folders = [model.folder.lower() for model in plan.models]
        if len(set(folders)) < len(folders):
            raise HumanclawError(f"{path} names two models alike.", "Give each a `name` of its own.")
        return plan

    def runs(self, model: Model) -> Iterator[tuple[str, tuple[EpisodeSpec, ...], Job]]:
        """Yield folder, episodes and job of every run of a model."""
        yield MAIN, load_split(self.split), model.job("baseline")
        for setting in model.settings:
            yield _folder(setting), load_split(self.ablation_split), model.job(setting)


def _folder(setting: str) -> str:
    return name_of(setting).replace(" ", "-")


@click.command()
@click.argument("what", type=click.Choice(["paper"]))
@click.option("--models", "file", type=click.Path(path_type=Path), help="TOML file of models.")
@click.option("--model", "names", multiple=True, help="Any litellm model; in the place of a file. Repeatable.")
@click.option("--out", type=click.Path(path_type=Path), default=Path("runs/paper"), show_default=True, help="Folder.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Episodes at a time.")
@stop_after_option
@click.option("--yes", is_flag=True, help="Do not ask for confirmation after the estimate of time and cost.")
def reproduce(
    what: str, file: Path | None, names: tuple[str, ...], out: Path, workers: int, stop_after: int, yes: bool
) -> None:
    """Play the paper's tables 2 and 3 for some models, or continue.

    First each model plays three episodes, and the command estimates time and cost of everything. At the end, and after
    Ctrl-C, `paper.md` in the folder holds the tables.
    """
    if bool(file) == bool(names):
        raise click.UsageError("Name a file with --models, or models with --model.")
    plan = Plan.read(file) if file else Plan(models=tuple(Model(model=name, ablation=True) for name in names))
    player = _Player(workers, stop_after)
    if not yes and not _agreed([player.forecast(plan, model, out) for model in plan.models], plan.models):
        return
    try:
        failed = [player.play(plan, model, out) for model in plan.models]
    finally:
        click.echo(f"page: {_write(plan, out)}")
    if any(failed):
        raise SystemExit(1)


class _Player:
    """Plays runs with the benchmark's local executor."""

    def __init__(self, workers: int, stop_after: int) -> None:
        self._workers, self._stop_after, self._plugins = workers, stop_after, Plugins.discover()
        self._halted: set[str] = set()
        """Models whose runs stopped by themselves: they get no further question."""

    def forecast(self, plan: Plan, model: Model, out: Path) -> RunStatus | None:
        """Play a model's first episodes and estimate the rest of all its runs; None if they are (almost) done."""
        forecasts: list[RunStatus] = []
        folder, specs, job = next(plan.runs(model))
        if self._run(specs, job, out / model.folder / folder, forecasts, until_forecast=True).halted:
            self._halted.add(model.folder)
        if not forecasts:
            return None
        later = sum(len(others) for name, others, _ in plan.runs(model) if name != MAIN)
        return replace(forecasts[0], total=forecasts[0].total + later)

    def play(self, plan: Plan, model: Model, out: Path) -> bool:
        """Play a model's runs to their end or limit. Returns whether an episode failed by infrastructure.

        A model whose run stops by itself counts as failed, and its other runs are not begun. Ctrl-C exits with 130.
        """
        failed = model.folder in self._halted
        for folder, specs, job in () if failed else plan.runs(model):
            status = self._run(specs, job, out / model.folder / folder, [])
            if status.halted:
                return True
            if status.stopped and not status.limited:
                raise SystemExit(130)
            failed |= status.failed > 0
        return failed

    def _run(
        self,
        specs: Sequence[EpisodeSpec],
        job: Job,
        out: Path,
        forecasts: list[RunStatus],
        *,
        until_forecast: bool = False,
    ) -> RunStatus:
        def go_on(forecast: RunStatus) -> bool:
            forecasts.append(forecast)
            return not until_forecast

        with RunProgress(Console(stderr=True), out) as progress:
            player = self._plugins.make("executors", "local", self._workers, "")
            job = replace(job, backends=job.backends.chosen(self._plugins), stop_after=self._stop_after)
            status = run_split(specs, job, player, out, plugins=self._plugins, watch=progress.watch, go_on=go_on)
            progress.end(status)
        # Ctrl-C, or a limit, before there was an estimate.
        if status.stopped and until_forecast and not (forecasts or status.halted):
            raise SystemExit(130)
        return status


def _agreed(forecasts: Sequence[RunStatus | None], models: Sequence[Model]) -> bool:
    """Print the estimates and ask whether to play. Without a terminal nobody is asked."""
    known = [(model, forecast) for model, forecast in zip(models, forecasts, strict=True) if forecast]
    for model, forecast in known:
        click.echo(f"{model.folder}: {foresight(forecast)}")
    hours, cost = (sum(getattr(forecast, what) for _, forecast in known) for what in ("seconds_left", "cost_left"))
    if not known or not Console().is_terminal:
        return True
    return click.confirm(f"All together: {hours / 3600:.1f} h and ${cost:.2f}. Continue?", default=True)


def _write(plan: Plan, out: Path) -> Path:
    """Write the page of everything that was played so far; return its path."""
    parts = [f"# The paper's tables for {counted(len(plan.models), 'model')}"]
    if played := [model for model in plan.models if _holds_episodes(out / model.folder / MAIN)]:
        tables = all_tables([result for model in played for result in _results(model, out)]).values()
        parts += [markdown(table) for table in tables if table.rows and table.columns]
    for model in plan.models:
        settings = {setting: out / model.folder / _folder(setting) for setting in model.settings}
        if table := _ablation({name: run for name, run in settings.items() if _holds_episodes(run)}):
            parts.append(markdown(replace(table, title=f"{table.title} of {model.folder}")))
    return write_result(None, out, "paper.md", ("\n\n".join(parts) + "\n").encode())


def _results(model: Model, out: Path) -> Sequence[Result]:
    """Return the results of a model's run for table 2, by the name that the file gives the model."""
    table_results = results_of([out / model.folder / MAIN])
    return [replace(table_results[0], name=model.name)] if model.name and len(table_results) == 1 else table_results


def _ablation(runs: Mapping[str, Path]) -> ResultTable | None:
    """Return table 3 of one model, from its runs by setting; None without runs."""
    named = [replace(result, name=setting) for setting, run in runs.items() for result in results_of([run])]
    return result_table("ablation", named) if named else None


def _holds_episodes(run: Path) -> bool:
    return bool(Folder(run).holding("episode.json"))
