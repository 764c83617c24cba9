"""A submission to a leaderboard: a run's folder with a submission.json that names its author."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from humanclaw import HumanclawError, Plugins, RecordedEpisode, RecordError, load_run
from humanclaw.records import first_fault
from humanclaw.storage import Folder
from humanclaw_bench.results import Result, named, require_whole
from humanclaw_bench.scoring import Extra, metrics_of, scored, unjudged
from humanclaw_bench.verification import LARGEST, MANIFEST, Manifest, read_json, read_manifest, standing

NAME: Final = "submission.json"
_WRITE: Final = "Write it with `humanclaw bench submit`."

Text = Annotated[str, Field(max_length=500)]
Who = Annotated[Text, StringConstraints(strip_whitespace=True, min_length=1)]


class Submission(BaseModel):
    """What an author says about a run. It holds no number: whoever has the folder computes them from the records."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal[3] = 3
    who: Who
    """The author, as shown on the page."""
    made: date
    """Date of this file."""
    model_date: Text = ""
    """Version or date of the model from its provider: a name alone may change its meaning."""
    digest: Text = ""
    """SHA-256 of run.json and of the records (run_digest)."""


@dataclass(frozen=True)
class ScoredRun:
    """A whole and sealed run of one agent, scored from its records."""

    manifest: Manifest
    episodes: tuple[RecordedEpisode, ...]
    result: Result

    @classmethod
    def read(cls, run: Path, extra: Extra, judged: bool = False) -> ScoredRun:
        """Read and score a run. extra: metrics of plugins. judged: also raise HumanclawError, before it is scored, if a
        function decides the success of an episode and is not among these.

        Raises RecordError if it is damaged, of several agents, or not what run.json says.
        """
        manifest, episodes = read_manifest(run), tuple(load_run(run))
        if judged and (unknown := unjudged([episode.record.spec for episode in episodes], extra)):
            raise HumanclawError(*unknown)
        known = standing(run, episodes)
        if known.faults:
            more = f" ({len(known.faults)} such faults)" if len(known.faults) > 1 else ""
            raise RecordError(known.faults[0] + more, f"`humanclaw bench verify {run}` lists everything that is wrong.")
        result, *others = named({run.name: scored(episodes, extra, run.name)}, {run.name: known})
        if others:
            names = ", ".join(each.name for each in (result, *others))
            raise RecordError(f"{run} holds runs of several agents or settings ({names}).", "Name the folder of one.")
        return cls(manifest, episodes, result)


def submit(run: Path, who: str, model_date: str = "", partial: bool = True, files: Sequence[Path] = ()) -> Submission:
    """Return the submission of a run. partial: allow missing episodes. files: plugins that decide success.

    Raises RecordError without an author, and unless the records are whole, sealed and of one agent.
    """
    try:  # The author first: scoring a run takes a minute.
        made = Submission(who=who, made=datetime.now(UTC).date(), model_date=model_date)
    except ValidationError as error:
        said = f"no submission can be made: {first_fault(error)}."
        raise RecordError(said, "Give names of at most 500 letters.") from error
    run_scored = ScoredRun.read(run, metrics_of(Plugins.discover(files)), judged=True)
    require_whole([run_scored.result], partial)
    return made.model_copy(update={"digest": run_digest(run, run_scored.episodes)})


def run_digest(run: Path, episodes: Iterable[RecordedEpisode]) -> str:
    """Return the SHA-256 of a run's run.json and of its records, those of partners too, in any order."""
    records = (record for episode in episodes for record in (episode, *episode.company().values()))
    lines = [Folder(run).digest(MANIFEST, LARGEST), *sorted(record.digest for record in records)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def read(run: Path, episodes: Iterable[RecordedEpisode]) -> Submission:
    """Read the submission of a run. Raises RecordError if it is malformed, or of other records or settings."""
    submission = read_json(Submission, run, NAME, _WRITE)
    if submission.digest != run_digest(run, episodes):
        raise RecordError(f"{run / NAME} is of other records, or of another run.json.", _WRITE)
    return submission
