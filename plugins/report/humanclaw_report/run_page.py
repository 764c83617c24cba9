"""The page of one or more runs: tables, and a list of episodes that can be sorted, filtered and opened."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Final

from humanclaw import RecordedEpisode
from humanclaw.cli import counted
from humanclaw.records import EpisodeSpec, Usage
from humanclaw_report.episode_page import PARTS, environment, link
from humanclaw_report.episode_summary import Facts, Milestone, listed, milestones

WORDS: Final = {True: "success", False: "failure", None: "not counted"}
"""The result of an episode in a word, for readers who do not see colours."""
FIRST: Final = 50
"""Rows of the list that a browser lays out when the page opens; the others follow on scrolling."""


# -- contributions of plugins ------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Cell:
    text: str
    share: float | None = None
    """Filled part of the bar under the text, per cent; None draws no bar."""

    @property
    def value(self) -> str:
        return self.text.partition(" [")[0]

    @property
    def interval(self) -> str:
        """The part of the text in brackets after the value, brackets included; it is shown on its own line."""
        return self.text[len(self.value) + 1 :]


@dataclass(frozen=True)
class Table:
    """A table of the summary."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()
    chart: bool = False
    """Whether its shares are drawn as bars at the top of the page."""

    @property
    def turned(self) -> Table:
        """The same with rows and columns exchanged."""
        columns = list(zip(*(row[1:] for row in self.rows), strict=True))
        rows = tuple((Cell(name), *column) for name, column in zip(self.head[1:], columns, strict=True))
        return replace(self, head=("", *(row[0].text for row in self.rows)), rows=rows)


@dataclass
class Collected:
    """Tables and facts that plugins added; implements humanclaw_report.hookspecs.Overview."""

    tables: list[Table] = field(default_factory=list)
    facts: dict[tuple[Path, str], Facts] = field(default_factory=dict)

    def table(
        self, title: str, head: Sequence[str], rows: Sequence[Sequence[str]], *,
        notes: Sequence[str] = (), shares: Sequence[Sequence[float]] = (), turned: bool = False,
    ) -> None:  # fmt: skip
        lined = [_cells(row, shares[n] if n < len(shares) else ()) for n, row in enumerate(rows)]
        made = Table(title, tuple(head), tuple(lined), tuple(notes), bool(shares))
        self.tables.append(made.turned if turned else made)

    def episode(
        self, run: Path, name: str, *, success: bool | None, cause: str = "", tier: str = "", step: int | None = None
    ) -> None:
        self.facts[run, name] = Facts(success, cause, tier, step)

    def told(self, run: Path, name: str) -> Facts:
        """Return what a benchmark told about an episode; empty if none did."""
        return self.facts.get((run, name), Facts())


def _cells(row: Sequence[str], shares: Sequence[float]) -> tuple[Cell, ...]:
    drawn = [100 * share if isfinite(share) else None for share in shares]
    drawn += [None] * (len(row) - 1 - len(drawn))
    return Cell(row[0]), *(Cell(text, share) for text, share in zip(row[1:], drawn, strict=False))


# -- the page ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Result:
    """Result of an episode in one run."""

    word: str
    outcome: str
    cause: str
    steps: int
    milestones: tuple[Milestone, ...]
    page: str
    """Address of its page, relative to this page."""
    picture: str
    """Address of its last view, relative to this page; empty if none was kept."""


@dataclass(frozen=True)
class Line:
    """A row of the list: an episode and its result in each run, None if the run does not have it."""

    spec: EpisodeSpec
    tier: str
    results: tuple[Result | None, ...]

    @property
    def changed(self) -> bool:
        """Whether its result differs between runs."""
        return len({result.word for result in self.results if result}) > 1

    @property
    def words(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(result.word for result in self.results if result))

    @property
    def causes(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(result.cause for result in self.results if result and result.cause))


Runs = Mapping[Path, Sequence[RecordedEpisode]]


def run_page(
    runs: Runs, collected: Collected, out: Path, page_of: Callable[[RecordedEpisode], Path], asked: Mapping[Path, int]
) -> str:
    """Return the HTML of the page.

    Args:
        out: Path that the page will be written to.
        page_of: Returns the path of an episode's page.
        asked: How many episodes each run was started with.
    """
    lines = _lines(runs, collected, out, page_of)
    every = [episode for episodes in runs.values() for episode in episodes]
    return environment().get_template("run.html").render(
        title=_title(runs, lines),
        folders=" and ".join(run.resolve().name for run in runs),
        names=_names(runs),
        counts=[
            (_won(lines, n), len(episodes), max(asked.get(run, 0), len(episodes)))
            for n, (run, episodes) in enumerate(runs.items())
        ],
        lines=lines,
        first=FIRST,
        charts=[table for table in collected.tables if table.chart],
        tables=[table for table in collected.tables if not table.chart],
        common=_common(collected.tables),
        totals=_totals(every),
        parts=PARTS,
        categories=sorted({line.spec.target_category for line in lines} - {""}),
        tiers=[tier for tier in ("easy", "medium", "hard") if any(line.tier == tier for line in lines)],
        causes=sorted({cause for line in lines for cause in line.causes}),
        words=[word for word in WORDS.values() if any(word in line.words for line in lines)],
    )  # fmt: skip


def _title(runs: Runs, lines: Sequence[Line]) -> str:
    """Return what was run: agents, number of episodes and targets."""
    targets = sorted({line.spec.target_category.replace("_", " ") for line in lines} - {""})
    wanted = f", to find a {listed(targets, 'or')}" if targets else ""
    agents = dict.fromkeys(e.record.agent for episodes in runs.values() for e in episodes)
    return f"{listed(list(agents))}: {counted(len(lines), 'episode')}{wanted}"


def _won(lines: Sequence[Line], run: int) -> int:
    """Return the number of successes in a run."""
    results = (line.results[run] for line in lines)
    return sum(result is not None and result.word == WORDS[True] for result in results)


def _common(tables: Sequence[Table]) -> tuple[str, ...]:
    """Return the notes that more than one table has; the page shows them once."""
    said = Counter(note for table in tables for note in table.notes)
    return tuple(note for note, times in said.items() if times > 1)


def _names(runs: Runs) -> list[str]:
    """Return the agent of each run, with the name of the run if several are shown."""
    agents = [", ".join(dict.fromkeys(e.record.agent for e in episodes)) for episodes in runs.values()]
    return agents if len(runs) == 1 else [f"{run.resolve().name} ({a})" for run, a in zip(runs, agents, strict=True)]


def _lines(runs: Runs, collected: Collected, out: Path, page_of: Callable[[RecordedEpisode], Path]) -> list[Line]:
    """Return every episode by its number; those whose result differs between runs come first."""
    by_name = [{episode.record.spec.id: episode for episode in episodes} for episodes in runs.values()]
    lines = []
    for name in sorted({name for episodes in by_name for name in episodes}, key=_natural):
        there = [episodes.get(name) for episodes in by_name]
        facts = [collected.facts.get((run, name)) for run in runs]
        results = tuple(
            _result(episode, fact, out, page_of(episode)) if episode else None
            for episode, fact in zip(there, facts, strict=True)
        )
        spec = next(episode.record.spec for episode in there if episode)
        lines.append(Line(spec, next((fact.tier for fact in facts if fact), ""), results))
    return sorted(lines, key=lambda line: not line.changed)


def _natural(name: str) -> list[tuple[int, str]]:
    """Return a sort key that orders house-2 before house-10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in name.split("-")]


def _result(episode: RecordedEpisode, facts: Facts | None, out: Path, page: Path) -> Result:
    met, record = milestones(episode, facts.success if facts else None), episode.record
    # Without a benchmark, an episode succeeds if it met all of its milestones.
    facts = facts or Facts(
        None if record.outcome in ("infra_error", "interrupted", "running") else all(m.met for m in met)
    )
    views = [step.frame_file for step in episode.steps if step.frame_file]
    return Result(
        word=WORDS[facts.success],
        outcome=record.outcome.replace("_", " "),
        cause=facts.cause,
        steps=len(episode.steps),
        milestones=met,
        page=link(page, out),
        picture=link(episode.folder / views[-1], out) if views else "",
    )


def _totals(episodes: Sequence[RecordedEpisode]) -> dict[str, object]:
    usage = sum((step.usage for episode in episodes for step in episode.steps), Usage())
    return {
        "episodes": len(episodes),
        "steps": sum(len(episode.steps) for episode in episodes),
        "times": {part: sum(s.seconds.get(part, 0.0) for e in episodes for s in e.steps) for part in PARTS},
        "tokens_in": usage.tokens_in,
        "tokens_out": usage.tokens_out,
        "cost": usage.cost,
        "errors": sum(episode.record.outcome == "infra_error" for episode in episodes),
    }
