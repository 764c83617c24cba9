"""`humanclaw bench run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from humanclaw import HumanclawError, RecordError
from humanclaw.cli import Console, agent_options, plugin_options
from humanclaw.storage import Folder
from humanclaw_bench.cli import RUN
from humanclaw_bench.progress import RunProgress, stop_after_option

if TYPE_CHECKING:
    from humanclaw import Backends, Choice
    from humanclaw.cli import ChosenAgents


def _refuse_max_steps(context: click.Context, option: click.Parameter, value: int | None) -> None:
    if value is not None:
        message = "bench run takes no --max-steps: each episode of a split has its own max_steps."
        raise HumanclawError(message, "For a short trial play --split smoke, or add --limit episode.seconds=60.")


@click.command("run")
@click.option(
    "--split",
    "name",
    default="mini",
    show_default=True,
    help="val, val-400, mini, smoke, dev, hands, mini-hands, smoke-hands, self, two, a plugin's task, "
    "or a file of episodes.",
)
@agent_options
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Episodes at a time.")
@click.option("--executor", default="", help="Name of the executor that plays the episodes (default: local).")
@click.option(
    "--ray",
    "address",
    is_flag=False,
    flag_value="local",
    metavar="[ADDRESS]",
    help="Same as --executor ray: use the Ray cluster at this address, or start one on this machine.",
)
@click.option("--out", type=RUN, help="Folder of the run (default: runs/SPLIT-AGENT).")
@click.option(
    "--resume/--no-resume", default=True, show_default=True, help="Continue an existing run, or refuse its folder."
)
@click.option("--yes", is_flag=True, help="Do not ask for confirmation after the estimate of time and cost.")
@stop_after_option
@click.option(
    "--seed", type=click.IntRange(0), help="Of the agent's random numbers and the order of episodes (default: new)."
)
@click.option(
    "--in-process", is_flag=True, help="For debugging: play the agent beside the body, not in a process of its own."
)
@click.option(
    "--max-steps", type=int, hidden=True, expose_value=False, callback=_refuse_max_steps, help="Of `humanclaw run`."
)
@plugin_options
def run_command(
    name: str, agents: ChosenAgents, backends: Backends, workers: int, executor: str, address: str | None,
    out: Path | None, resume: bool, yes: bool, stop_after: int, seed: int | None, in_process: bool,
    files: tuple[Path, ...], choice: Choice,
) -> None:  # fmt: skip
    """Run a split, or resume it. Finished episodes are kept; others continue after their last recorded step."""
    # Imported here: they take half a second, and --help needs none of them.
    from humanclaw import Plugins, load_run
    from humanclaw.records import name_of
    from humanclaw_bench.runner import run_split
    from humanclaw_bench.scoring import metrics_of, results, unjudged
    from humanclaw_bench.splits import load_split
    from humanclaw_bench.tables import brief_tables
    from humanclaw_bench.tables_cli import filled, show
    from humanclaw_bench.worker import Job

    plugins = Plugins.discover(files, choice)
    specs = load_split(name, plugins)
    metrics = metrics_of(plugins)  # Refuses a metric with a reserved name now, not after hours of playing.
    if unknown := unjudged(specs, metrics):
        raise HumanclawError(*unknown)
    out = out or Path("runs") / f"{Path(name).stem}-{name_of(agents.title)}"
    if not resume and Folder(out).has("run.json"):
        raise RecordError(
            f"{out} already holds a run.", "Name another folder with --out, or continue it with --resume."
        )
    job = Job(
        agents.agent, agents.options, agents.verifier, backends.chosen(plugins), agents.limits,
        tuple(str(file.resolve()) for file in files), choice, in_process=in_process, stop_after=stop_after, seed=seed,
    )  # fmt: skip
    player = plugins.make("executors", executor or ("ray" if address else "local"), workers, address or "")
    with RunProgress(Console(), out) as progress:
        status = run_split(
            specs, job, player, out, plugins=plugins, watch=progress.watch,
            go_on=lambda forecast: progress.foresee(forecast, ask=not yes),
        )  # fmt: skip
        progress.end(status)
    if status.done:
        episodes = load_run(out)
        show(filled(brief_tables(results({out: episodes}, metrics))))
        plugins.tell("humanclaw_run_end", run=out, episodes=episodes, plugins=plugins, tell=click.echo)
    if status.failed or status.stopped:
        raise SystemExit(130 if status.stopped and not status.halted else 1)
