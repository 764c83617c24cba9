"""Commands that check records and publish results: `humanclaw bench verify`, `submit`, `leaderboard`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import click
from tqdm import tqdm

from humanclaw import HumanclawError, Plugins, load_run
from humanclaw.cli import counted, legible, plugin_files
from humanclaw.records import MOTION_BYTES, RECORD_BYTES
from humanclaw.storage import Folder, write_result
from humanclaw_bench import leaderboard as leaderboards, submission as submissions
from humanclaw_bench.cli import PARTIAL, RUN
from humanclaw_bench.replay import Replayed, replayed, sample
from humanclaw_bench.scoring import metrics_of
from humanclaw_bench.splits import load_split
from humanclaw_bench.verification import MANIFEST, check, split_digest

F = TypeVar("F", bound=Callable[..., object])
FOLDER = click.Path(file_okay=False, path_type=Path)


def replay_options(command: F) -> F:
    """Add the options for playing recorded calls again."""
    # More episodes than any run has.
    every = 10**6
    about = "Also play the recorded calls of N episodes again (default: all) and compare every field of every step."
    drawn = "Draws the N episodes that are played again; the default is new each time."
    how = click.option(
        "--replay", "again", type=click.IntRange(1), is_flag=False, flag_value=every, metavar="[N]", help=about
    )
    seed = click.option("--seed", type=click.IntRange(0), help=drawn)
    workers = click.option(
        "--workers", type=click.IntRange(1), default=1, show_default=True, help="Episodes at a time."
    )
    return how(seed(workers(command)))


@click.command()
@click.argument("run", type=RUN)
@replay_options
@plugin_files
def verify(run: Path, again: int | None, seed: int | None, workers: int, files: tuple[Path, ...]) -> None:
    """Check every file of a run against its digest, and the records against split and settings in run.json.

    Lists files that are damaged or belong to another run. Checks submission.json too, if there is one.
    """
    faulty = _verify_files(run)
    if again and not faulty:
        faulty = _verify_replay(run, again, seed, workers, files)
    if faulty:
        raise SystemExit(1)


def _verify_replay(run: Path, again: int, seed: int | None, workers: int, plugin_files: Sequence[Path]) -> bool:
    """Play episodes again and tell what differs. Returns whether anything does."""
    replays = _played_again(run, again, seed, workers, plugin_files)
    for episode in replays:
        for what in (*episode.differing, *filter(None, [episode.incomparable])):
            click.echo(f"{episode.episode}: {what}.")
    same, steps = sum(map(Replayed.same, replays)), counted(sum(episode.steps for episode in replays), "step")
    click.echo(f"{same} of {counted(len(replays), 'episode')} came out the same when played again ({steps}).")
    return same < len(replays)


def _played_again(
    run: Path, count: int, seed: int | None, workers: int, plugin_files: Sequence[Path]
) -> list[Replayed]:
    episodes = sample(run, count, seed)
    playing = replayed(episodes, plugin_files, workers)
    return list(tqdm(playing, "replay", len(episodes), unit="episode", disable=None, leave=False))


def _verify_files(run: Path) -> bool:
    """Check files and records, and tell what is wrong. Returns whether anything is."""
    count, known = check(run)
    asked = max(count, known.asked)
    verdict = f"{len(known.faults)} damaged, or not of this run." if known.faults else "all whole."
    if not known.faults and submissions.NAME in Folder(run).names():
        verdict += f" Submitted by {legible(submissions.read(run, load_run(run)).who)}."
    for fault in known.faults:
        click.echo(fault)
    if not known.asked:
        click.echo(f"There is no run.json in {run}: split and settings of the records are unknown.")
    of = f"{count} of " if count < asked else ""
    click.echo(f"{of}{counted(asked, 'record')} in {run}: {verdict}")
    return bool(known.faults)


@click.command()
@click.argument("run", type=RUN)
@click.option("--who", required=True, help="Author, as shown on the page.")
@click.option("--model-date", default="", help="Version or date of the model from its provider.")
@PARTIAL
@plugin_files
def submit(run: Path, who: str, model_date: str, partial: bool, files: tuple[Path, ...]) -> None:
    """Write submission.json into a run, which makes its folder a submission for `bench leaderboard`."""
    made = submissions.submit(run, who, model_date, partial, files)
    click.echo(write_result(None, run, submissions.NAME, made.model_dump_json(indent=1).encode()))


@click.command()
@click.argument("folder", type=FOLDER)
@click.option(
    "--any-pace", is_flag=True, help="Also rank runs whose calls move longer or faster than the paper's skills."
)
@click.option("--by", default="", metavar="NAME", help="Who plays recorded calls again, as the page names it.")
@click.option("--hidden", type=RUN, metavar="FILE", help="Episodes of the hidden test, whose table is marked.")
@click.option(
    "--pages",
    type=FOLDER,
    metavar="FOLDER",
    help="Write index.html there, with the records and the page of each run: a folder to publish.",
)
@replay_options
@plugin_files
def leaderboard(
    folder: Path,
    any_pace: bool,
    by: str,
    hidden: Path | None,
    pages: Path | None,
    again: int | None,
    seed: int | None,
    workers: int,
    files: tuple[Path, ...],
) -> None:
    """Make index.html from a folder of submitted runs, each a folder with a submission.json.

    Every number is computed from the records.
    """

    def played(run: Path) -> list[Replayed]:
        return _played_again(run, again or 0, seed, workers, files)

    test = split_digest(load_split(str(hidden))) if hidden else ""
    plugins = Plugins.discover(files)
    write = partial(_write_page, plugins) if pages else None
    if pages and pages.resolve() == folder.resolve():
        raise HumanclawError(f"{folder} holds what submitters sent.", "Name another folder with --pages.")
    checks = leaderboards.Checks(any_pace, played if again else None, by, test, write, pages, metrics_of(plugins))
    click.echo(leaderboards.leaderboard(folder, checks))


def _write_page(plugins: Plugins, run: Path, out: Path) -> None:
    """Copy the records of a run, which may be a stranger's, and none of its other files; write their page."""
    out.mkdir(parents=True, exist_ok=True)
    for episode in (record for whole in load_run(run) for record in (whole, *whole.company().values())):
        copy = Folder(out) / episode.files.path.relative_to(run).as_posix()
        for name in ("episode.json", *episode.record.files):
            copy.write(name, episode.files.read(name, MOTION_BYTES), settled=False)
    if Folder(run).has(MANIFEST):
        Folder(out).write(MANIFEST, Folder(run).read(MANIFEST, RECORD_BYTES))
    plugins.tell("humanclaw_run_end", run=out, episodes=load_run(out), plugins=plugins, tell=click.echo)
