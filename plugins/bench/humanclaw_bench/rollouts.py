"""`humanclaw bench rollouts`: recorded runs as conversations in the chat format of `datasets` and TRL, split by house.

A row is one step: the prompt that `humanclaw run --model` sends there, and the agent's tool call as the answer. A
preference row holds two answers to one prompt: that of a failed episode, and that of the same episode with the blamed
capability repaired, at the first step at which the two differ.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

import click
import numpy as np
from tqdm import tqdm

from humanclaw import (
    Decision,
    EpisodeContext,
    HistoryEntry,
    Observation,
    Plugins,
    PromptSettings,
    RecordedEpisode,
    RecordError,
    load_run,
    model_tools,
    step_content,
    system_prompt,
    tool_call,
)
from humanclaw.records import Feedback, name_of
from humanclaw.skills import Json
from humanclaw.storage import Folder, jpeg, writing
from humanclaw_bench.attribution import CAUSES, attribute
from humanclaw_bench.difficulty import TIERS, overall
from humanclaw_bench.failure_modes import Cause
from humanclaw_bench.scores import Scores, ended, score
from humanclaw_bench.training import house_of, require_training

PLACE: Final = {"type": "image"}
"""Where a picture stands in a message; the row's `images` name the files in the same order."""
SETTINGS: Final = PromptSettings(history_slack=10)
"""Contents of the prompt: those of `humanclaw run --model`."""
_UNSEEN: Final = np.zeros((1, 1, 3), np.uint8)


@dataclass(frozen=True)
class Wanted:
    """Which steps become data, and in what form."""

    success: bool = False
    """Only episodes that succeeded."""
    cause: str = ""
    """Only episodes that failed with this root cause."""
    difficulty: str = ""
    """Only episodes of this overall difficulty."""
    test: float = 0.1
    """Share of the houses whose episodes go into test.jsonl."""

    def takes(self, recorded: RecordedEpisode, scores: Scores, cause: Cause | None) -> bool:
        """Tell whether an episode is wanted."""
        spec, label = recorded.record.spec, cause.label if cause else ""
        tier = overall(spec.difficulty) if spec.difficulty else ""
        finished = bool(recorded.steps) and ended(recorded.record.outcome, recorded.record.limit)
        return (
            finished and (not self.success or bool(scores.success)) and self.cause in ("", label)
            and self.difficulty in ("", tier)
        )  # fmt: skip

    def part(self, scene: str) -> str:
        """Return 'train' or 'test': a house is in one of them alone, whatever else is exported."""
        share = int.from_bytes(hashlib.sha256(house_of(scene).encode()).digest()[:4]) / 2**32
        return "test" if share < self.test else "train"


def require_honest(recorded: RecordedEpisode) -> None:
    """Raise RecordError for words that may tell what the eyes do not see, and for houses that test others."""
    record = recorded.record
    require_training(record.spec.scene)
    settings = record.settings.get("agent", {})
    if record.settings.get("privileged", {}).get("agent") and settings.get("words") != "eyes":
        problem = f"{recorded.folder}: {record.agent} knows the map, and its words may tell what no eye sees."
        raise RecordError(problem, "Play it with --option words=eyes.")


# -- rows --------------------------------------------------------------------------------------------------------------
class Conversations:
    """Turns episodes into rows."""

    def __init__(self, plugins: Plugins) -> None:
        self._skills = plugins.skills

    def rows(self, recorded: RecordedEpisode, scores: Scores, cause: Cause | None) -> Iterator[tuple[Json, bytes]]:
        """Yield a row and its picture for each step with one usable call."""
        about = self._about(recorded, scores, cause)
        for index, step in enumerate(recorded.steps):
            picture = recorded.view(step)
            if step.call is not None and picture:
                messages = [*self._prompt(recorded, index), _answer(step.decision)]
                yield {**about, "step": step.step, "messages": messages, "images": [_file(recorded, index)]}, picture

    def pair(self, bad: RecordedEpisode, good: RecordedEpisode, cause: Cause) -> tuple[Json, bytes] | None:
        """Return the row of the first step at which two plays of an episode differ.

        None if a call is missing there, or if they were not shown the same until there: two tasks, or two engines.
        """
        pairs = enumerate(zip(bad.steps, good.steps, strict=False))
        index = next((k for k, (first, two) in pairs if _said(first.decision) != _said(two.decision)), None)
        if index is None or bad.steps[index].call is None or good.steps[index].call is None:
            return None
        prompt, view = self._prompt(bad, index), bad.view(bad.steps[index])
        if (prompt, view) != (self._prompt(good, index), good.view(good.steps[index])):
            return None
        about = self._about(bad, score(bad), cause) | {"step": index, "images": [_file(bad, index)]}
        rejected, chosen = (_answer(play.steps[index].decision) for play in (bad, good))
        return {**about, "prompt": prompt, "chosen": [chosen], "rejected": [rejected]}, view

    def _about(self, recorded: RecordedEpisode, scores: Scores, cause: Cause | None) -> Json:
        record = recorded.record
        spec, skills = record.spec, self._callable(recorded)
        return {
            "episode": spec.id, "agent": record.agent, "house": spec.scene, "success": bool(scores.success),
            "cause": cause.label if cause else "", "difficulty": overall(spec.difficulty) if spec.difficulty else "",
            "tools": json.dumps(model_tools(skills, SETTINGS), ensure_ascii=False),
        }  # fmt: skip

    def _callable(self, recorded: RecordedEpisode) -> list[Any]:
        return [skill for name, skill in self._skills.items() if name in recorded.record.skills and skill.trained]

    def _prompt(self, recorded: RecordedEpisode, index: int) -> list[Json]:
        """Return the messages that a model would have been sent before a step."""
        steps, record = recorded.steps, recorded.record
        context = EpisodeContext(record.spec.for_agent, self._skills, 0, gaze=record.gaze)
        history = [_past(recorded, k) for k in range(index)]
        feedback = steps[index - 1].feedback if index else Feedback()
        seen = Observation(index, record.spec.instruction, _UNSEEN, feedback)
        content = step_content(context, seen, history, "", SETTINGS)
        words = system_prompt(context, self._callable(recorded), SETTINGS, None)
        return [
            {"role": "system", "content": [{"type": "text", "text": words}]},
            {"role": "user", "content": [part if part["type"] == "text" else PLACE for part in content]},
        ]


def _past(recorded: RecordedEpisode, index: int) -> HistoryEntry:
    step = recorded.steps[index]
    return HistoryEntry(step.step, step.decision, step.feedback, jpeg(_UNSEEN))


def _answer(decision: Decision) -> Json:
    """Return the assistant's message. Its arguments are JSON text, as columns of a table need one type."""
    name, arguments = tool_call(decision, SETTINGS)
    function = {"name": name, "arguments": json.dumps(arguments, ensure_ascii=False)}
    return {"role": "assistant", "content": [], "tool_calls": [{"type": "function", "function": function}]}


def _said(decision: Decision) -> Decision:
    """Return the part of a decision that the answer holds."""
    return replace(decision, usage=Decision().usage, raw="", prompt_digest="")


def named(recorded: RecordedEpisode) -> str:
    """Return a file name for a played episode. Other runs may hold the same agent and id, hence the seal."""
    record = recorded.record
    return f"{name_of(record.agent)}--{record.spec.id}--{record.sealed.seal[:12]}"


def _file(recorded: RecordedEpisode, index: int) -> str:
    return f"pictures/{named(recorded)}/{index:04d}.jpg"


# -- the folder --------------------------------------------------------------------------------------------------------
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
        options = json.dumps({"kind": kind, **asdict(self.wanted)}, indent=2).encode()
        with writing(self.folder):
            if self.folder.has("options.json") and self.folder.read("options.json", _ROWS) != options:
                raise RecordError(
                    f"{self.folder.path} was begun with other options.", "Name another folder with --out."
                )
            self.folder.write("options.json", options)

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


def card(kind: str, parts: Iterable[str], licences: Collection[str]) -> str:
    """Return the card of a dataset: where its parts are, licences, and how its words were written."""
    ours = all(licence.startswith("Apache-2.0") for licence in licences)
    lines = ["---", "configs:", "- config_name: default", "  data_files:"]
    lines += [f"  - split: {part}\n    path: {part}/*.jsonl" for part in parts]
    lines += [f"license: {'apache-2.0' if ours else 'other'}", "---", f"# {kind}", "", _ORIGIN, ""]
    lines.append(f"Licences of what is in the scenes: {'; '.join(sorted(set(licences))) or 'Apache-2.0'}.")
    return "\n".join(lines) + "\n"


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
@click.option("--cause", type=click.Choice([rule.label for rule in CAUSES]), default=None, metavar="LABEL",
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
    better = {episode.record.spec.id: episode for episode in load_run(repaired)} if repaired else None
    made = Conversations(Plugins.discover())
    episodes = [episode for run in runs for episode in load_run(run)]
    data, kind = Dataset.at(out, wanted), "Preferences" if repaired else "Rollouts"
    data.begin(kind)
    for recorded in tqdm(episodes, unit="episode"):
        require_honest(recorded)
        if not data.folder.has(data.name(recorded)) and (rows := _rows(made, wanted, recorded, better)):
            data.add(recorded, rows)
    counts = {part: sum(1 for _ in data.written(part)) for part in _PARTS}
    licences = {licence for episode in episodes for licence in episode.record.licences}
    data.folder.write("README.md", card(kind, filter(counts.get, counts), licences).encode())
    click.echo(f"{out}: {', '.join(f'{count} rows in {part}' for part, count in counts.items())}")


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
