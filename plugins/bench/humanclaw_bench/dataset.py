"""`humanclaw bench rollouts`: a folder that `datasets.load_dataset` reads, written episode by episode."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final, Self

import click
from tqdm import tqdm

from humanclaw import Plugins, RecordedEpisode, RecordError, load_run
from humanclaw.skills import Json
from humanclaw.storage import Folder, writing
from humanclaw_bench.attribution import CAUSES, attribute
from humanclaw_bench.difficulty import TIERS
from humanclaw_bench.rollouts import Conversations, Wanted, named, require_honest
from humanclaw_bench.scores import score

Rows = Sequence[tuple[Json, bytes]]
_ROWS: Final = 64 << 20
"""Maximum bytes of an episode's rows."""
_PARTS: Final = ("train", "test")


@dataclass(frozen=True)
class Dataset:
    """A folder of rows: a file for each wanted episode, and the pictures that its rows name."""

    folder: Folder
    wanted: Wanted

    @classmethod
    def at(cls, path: Path, wanted: Wanted) -> Self:
        """Return the dataset of a folder, which is made if it is missing."""
        with writing(path):
            path.mkdir(parents=True, exist_ok=True)
        return cls(Folder(path), wanted)

    def begin(self, kind: str) -> None:
        """Begin the folder, or continue it. Raises RecordError if it was begun with other options."""
        told = json.dumps({"kind": kind, **asdict(self.wanted)}, indent=2).encode()
        with writing(self.folder):
            if self.folder.has("options.json") and self.folder.read("options.json", _ROWS) != told:
                raise RecordError(
                    f"{self.folder.path} was begun with other options.", "Name another folder with --out."
                )
            self.folder.write("options.json", told)

    def name(self, recorded: RecordedEpisode) -> str:
        """Return the file of an episode's rows."""
        return f"{self.wanted.part(recorded.record.spec.scene)}/{named(recorded)}.jsonl"

    def add(self, recorded: RecordedEpisode, rows: Rows) -> None:
        """Write the rows of an episode, after their pictures: a file of rows is whole, or it is not there."""
        with writing(self.folder):
            for row, picture in rows:
                self.folder.write(row["images"][0], picture, settled=False)
            lines = "".join(json.dumps(row, ensure_ascii=False) + "\n" for row, _ in rows)
            self.folder.write(self.name(recorded), lines.encode())

    def written(self, part: str) -> Iterator[Json]:
        """Yield the rows of a part."""
        if (self.folder.path / part).is_dir():
            inner = Folder(self.folder.path / part)
            for name in sorted(inner.names(".jsonl")):
                # A model may write U+2028, at which str.splitlines would break.
                yield from map(json.loads, inner.read(name, _ROWS).decode().split("\n")[:-1])


def card(kind: str, parts: Mapping[str, Sequence[Json]], licences: Collection[str]) -> str:
    """Return the card of a dataset: where its parts are, counts, licences and how its words were written."""
    of = {part: _episodes(rows) for part, rows in parts.items()}
    lines = ["---", "configs:", "- config_name: default", "  data_files:"]
    lines += [f"  - split: {part}\n    path: {part}/*.jsonl" for part in parts if parts[part]]
    ours = all(one.startswith("Apache-2.0") for one in licences)
    lines += [f"license: {'apache-2.0' if ours else 'other'}", "---", f"# {kind}", ""]
    lines += ["| part | rows | episodes | houses | succeeded |", "| --- | ---: | ---: | ---: | ---: |"]
    for part, found in parts.items():
        houses, good = len({row["house"] for row in of[part]}), sum(row["success"] for row in of[part])
        lines.append(f"| {part} | {len(found)} | {len(of[part])} | {houses} | {good} |")
    for key in ("agent", "difficulty", "cause"):
        counted = Counter(row[key] or "none" for own in of.values() for row in own).most_common()
        lines += ["", f"Episodes by {key}: {', '.join(f'{name} {count}' for name, count in counted)}."]
    lines += [
        "",
        _ORIGIN,
        "",
        f"Licences of what is in the scenes: {'; '.join(sorted(set(licences))) or 'Apache-2.0'}.",
    ]
    return "\n".join(lines) + "\n"


def _episodes(rows: Sequence[Json]) -> list[Json]:
    """Return the last row of each episode: its pictures are in a folder of their own."""
    return list({Path(row["images"][0]).parent: row for row in rows}.values())


_ORIGIN: Final = (
    "Made by `humanclaw bench rollouts` from recorded runs in training houses. Words of agents that know the map were "
    "written from the view alone; their calls still go towards what no view has shown. Answers of a model are under "
    "the terms of its provider."
)


@click.command("rollouts")
@click.argument("runs", type=click.Path(path_type=Path), nargs=-1, required=True, metavar="RUN...")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the dataset.")
@click.option("--repaired", type=click.Path(path_type=Path), metavar="RUN",
              help="Write preference pairs: the same episodes with the blamed capability repaired.")  # fmt: skip
@click.option("--success", is_flag=True, help="Only episodes that succeeded.")
@click.option("--cause", type=click.Choice([one.label for one in CAUSES]), default=None, metavar="LABEL",
              help="Only failures with this root cause.")  # fmt: skip
@click.option("--difficulty", type=click.Choice(TIERS), help="Only episodes of this overall difficulty.")
@click.option("--test", type=click.FloatRange(0, 1), default=0.1, show_default=True, help="Share of houses in test.")
def rollouts(
    runs: tuple[Path, ...], out: Path, repaired: Path | None, success: bool, cause: str | None, difficulty: str | None,
    test: float,
) -> None:  # fmt: skip
    """Write recorded runs as conversations to train on.

    Tools and pictures are part of them, and houses are split.

    The same command continues where it was interrupted. `bench export --to lerobot` writes robots' data.
    """
    wanted = Wanted(success, cause or "", difficulty or "", test)
    better = {one.record.spec.id: one for one in load_run(repaired)} if repaired else None
    made = Conversations(Plugins.discover())
    episodes = [one for run in runs for one in load_run(run)]
    data, kind = Dataset.at(out, wanted), "Preferences" if repaired else "Rollouts"
    data.begin(kind)
    for recorded in tqdm(episodes, unit="episode"):
        require_honest(recorded)
        if not data.folder.has(data.name(recorded)) and (rows := _rows(made, wanted, recorded, better)):
            data.add(recorded, rows)
    parts = {part: list(data.written(part)) for part in _PARTS}
    licences = {licence for one in episodes for licence in one.record.licences}
    data.folder.write("README.md", card(kind, parts, licences).encode())
    click.echo(f"{out}: {', '.join(f'{len(rows)} rows in {part}' for part, rows in parts.items())}")


def _rows(
    made: Conversations, wanted: Wanted, recorded: RecordedEpisode, better: Mapping[str, RecordedEpisode] | None
) -> Rows:
    """Return the rows of an episode; none if it is not wanted."""
    scores = score(recorded)
    cause = attribute(recorded, scores)
    if not wanted.takes(recorded, scores, cause):
        return []
    if better is None:
        return list(made.rows(recorded, scores, cause))
    good = better.get(recorded.record.spec.id)
    if good is None or cause is None or not score(good).success:
        return []
    require_honest(good)
    pair = made.pair(recorded, good, cause)
    return [pair] if pair else []
