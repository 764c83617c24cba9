"""`humanclaw bench generate`: the splits, a hidden test, and training tasks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from functools import partial
from itertools import groupby
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource
from rich.text import Text
from tqdm import tqdm

from humanclaw import EpisodeSpec, Plugins
from humanclaw.cli import Console, parse_pairs, seed_option
from humanclaw.plugins import Tasks
from humanclaw.records import write_episodes
from humanclaw_bench.hands.generate import choose, episodes
from humanclaw_bench.oneself.generate import TOTAL, questions
from humanclaw_bench.splits import (
    DEV_HOUSES,
    HOUSES,
    SELF,
    STARTS,
    TWO,
    candidates,
    hidden,
    make,
    secret_houses,
    summary,
)
from humanclaw_bench.training import TOGETHER
from humanclaw_bench.two import generate as two_bodies

Draw = Callable[..., list[EpisodeSpec]]


@click.command()
@click.option("--out", type=click.Path(path_type=Path), default=Path("splits"), show_default=True,
              help="Folder for the splits.")  # fmt: skip
@click.option(
    "--starts",
    type=click.IntRange(1),
    default=STARTS,
    show_default=True,
    help="Starts to draw in each house for each category and range of distances.",
)
@seed_option(help="All randomness derives from it.")
@click.option(
    "--secret",
    type=click.IntRange(0),
    metavar="SEED",
    help="Make a hidden test instead: test.jsonl, with houses and starts derived from this number alone. Use at least "
    "64 random bits: a small number can be guessed.",
)
@click.option(
    "--train",
    type=click.IntRange(1),
    metavar="N",
    help="Make N training tasks instead: NAME.jsonl with the tasks of the seeds from --seed on, in houses of no split.",
)
@click.option("--task", default="train", show_default=True, metavar="NAME", help="Source of the training tasks.")
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE",
              help="Of that source, such as houses=40, difficulty=easy, category=couch (repeatable).")  # fmt: skip
@click.option("--hands", is_flag=True, help="Make the splits for hands instead.")
@click.option("--self", "oneself", is_flag=True, help="Make the split of questions about oneself instead (15 min).")
@click.option("--two", is_flag=True, help="Make the split with a partner instead.")
@click.option("--workers", type=click.IntRange(1), default=1, show_default=True, help="Houses at a time.")
def generate(
    out: Path, starts: int, seed: int, secret: int | None, train: int | None, task: str,
    pairs: tuple[str, ...], hands: bool, oneself: bool, two: bool, workers: int,
) -> None:  # fmt: skip
    """Make splits from seeds, a hidden test, or training tasks."""
    _refuse_unused(secret, train)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        if train:
            made: Mapping[str, Sequence[EpisodeSpec]] = _training(
                pool, task, parse_pairs(pairs), range(seed, seed + train)
            )
        elif hands:
            made = choose(_drawn(pool, HOUSES, 0, (seed,), _for_hands))
        elif oneself:
            asked = tqdm(questions(Plugins.discover(), seed), total=TOTAL, unit="question")
            made = {SELF: sorted(asked, key=lambda spec: spec.seed)}
        elif two:
            made = {TWO: two_bodies.choose(_drawn(pool, HOUSES, 0, (seed,), _with_partner))}
        elif secret is None:
            made = make(_drawn(pool, (*HOUSES, *DEV_HOUSES), starts, (seed,)))
        else:
            made = hidden(_drawn(pool, secret_houses(secret), starts, (secret, 2)))
    for name, specs in made.items():
        _write(out / f"{name}.jsonl", specs)


def _refuse_unused(secret: int | None, train: int | None) -> None:
    """Raise UsageError for options that would have no effect."""
    source = click.get_current_context().get_parameter_source
    given = {
        name
        for name in ("seed", "train", "task", "pairs", "starts", "secret", "hands", "oneself", "two")
        if source(name) is not ParameterSource.DEFAULT
    }
    if secret is not None and given & {"seed", "train"}:
        problem = f"--{min(given & {'seed', 'train'})} has no effect with --secret, which determines everything"
        raise click.UsageError(f"{problem}: leave it out.")
    if given & {"hands", "oneself", "two"} and given & {"secret", "train", "starts"}:
        raise click.UsageError(f"--{min(given & {'secret', 'train', 'starts'})} has no effect with --hands, --self or "
                               "--two: leave it out.")  # fmt: skip
    if train is None and given & {"task", "pairs"}:
        raise click.UsageError("--task and --option are of training tasks: add --train N.")


def _drawn(
    pool: Executor, houses: Sequence[str], starts: int, seed: Sequence[int], draw: Draw | None = None
) -> list[EpisodeSpec]:
    """Return the candidates of some houses. draw: how; as for val by default."""
    batches = pool.map(partial(draw or _candidates, starts=starts, seed=seed), houses, range(len(houses)))
    return [spec for house in _shown(batches, len(houses)) for spec in house]


def _candidates(house: str, number: int, starts: int, seed: Sequence[int]) -> list[EpisodeSpec]:
    return list(candidates(Plugins.discover().scene(house), number, starts=starts, seed=seed))


def _for_hands(house: str, number: int, starts: int, seed: Sequence[int]) -> list[EpisodeSpec]:
    return list(episodes(Plugins.discover().scene(house), number, seed[0]))


def _with_partner(house: str, number: int, starts: int, seed: Sequence[int]) -> list[EpisodeSpec]:
    return list(two_bodies.episodes(Plugins.discover().scene(house), number, seed[0]))


def _training(
    pool: Executor, task: str, options: Mapping[str, Any], seeds: Sequence[int]
) -> dict[str, Sequence[EpisodeSpec]]:
    """Return the tasks of some seeds; those that share a house are drawn together."""
    Plugins.discover().make("tasks", task, options)  # Refuses a wrong name or option before anything is drawn.
    blocks = [list(block) for _, block in groupby(seeds, lambda seed: seed // TOGETHER)]
    batches = pool.map(partial(_tasks, task, options), blocks)
    return {task: [spec for block in _shown(batches, len(blocks)) for spec in block]}


def _tasks(task: str, options: Mapping[str, Any], seeds: Sequence[int]) -> list[EpisodeSpec]:
    source: Tasks = Plugins.discover().make("tasks", task, options)
    return [source(seed) for seed in seeds]


def _shown(batches: Iterable[list[EpisodeSpec]], total: int) -> Iterable[list[EpisodeSpec]]:
    return tqdm(batches, desc="houses", total=total, unit="house")


def _write(path: Path, specs: Sequence[EpisodeSpec]) -> None:
    """Write a file of episodes, and print its composition."""
    write_episodes(path, specs)
    Console().print(Text(str(path), style="bold"), soft_wrap=False)
    whole = all(spec.difficulty and spec.target_category for spec in specs)
    for key, value in (summary(specs) if whole else {"episodes": str(len(specs))}).items():
        click.echo(f"  {key:<13} {value}")
