"""Recorded runs as training data: conversations in the chat format of `datasets` and TRL, split by house.

A row is one step: the prompt that `humanclaw run --model` sends there, and the agent's tool call as the answer. A
preference row holds two answers to one prompt: that of a failed episode, and that of the same episode with the blamed
capability repaired, at the first step at which the two differ.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from humanclaw import (
    Decision,
    EpisodeContext,
    HistoryEntry,
    Observation,
    Plugins,
    PromptSettings,
    RecordedEpisode,
    RecordError,
    model_tools,
    step_content,
    system_prompt,
    tool_call,
)
from humanclaw.records import Feedback, name_of
from humanclaw.skills import Json
from humanclaw.storage import jpeg
from humanclaw_bench.causes import Cause
from humanclaw_bench.difficulty import overall
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
        told = f"{recorded.folder}: {record.agent} knows the map, and its words may tell what no eye sees."
        raise RecordError(told, "Play it with --option words=eyes.")


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
        index = next((k for k, (one, two) in pairs if _said(one.decision) != _said(two.decision)), None)
        if index is None or bad.steps[index].call is None or good.steps[index].call is None:
            return None
        prompt, view = self._prompt(bad, index), bad.view(bad.steps[index])
        if (prompt, view) != (self._prompt(good, index), good.view(good.steps[index])):
            return None
        about = self._about(bad, score(bad), cause) | {"step": index, "images": [_file(bad, index)]}
        rejected, chosen = (_answer(one.steps[index].decision) for one in (bad, good))
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
        return [one for name, one in self._skills.items() if name in recorded.record.skills and one.trained]

    def _prompt(self, recorded: RecordedEpisode, index: int) -> list[Json]:
        """Return the messages that a model would have been sent before a step."""
        steps, record = recorded.steps, recorded.record
        context = EpisodeContext(record.spec.told, self._skills, 0, gaze=record.gaze)
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
