"""An episode as a conversation in the chat format: what a trainer shows a model, and what the model answers."""

from __future__ import annotations

from typing import Any, Final

from humanclaw.gym.gym import Gym, Turn
from humanclaw.prompting.prompts import step_content, system_message, system_prompt
from humanclaw.prompting.settings import PromptSettings
from humanclaw.records.decisions import Decision
from humanclaw.skills.tool_schemas import OPTIONAL_FIELDS, REASONING_FIELDS, THOUGHTS, Json

TURNS: Final = PromptSettings(history=0)
"""The conversation itself holds the past steps, so the message of a step does not repeat them."""


def opening(gym: Gym, turn: Turn, settings: PromptSettings = TURNS) -> list[Json]:
    """Return the first two messages of an episode: the benchmark's system prompt, and what the eyes see."""
    words = system_prompt(gym.context, gym.skills, settings, None)
    return [system_message(words, settings), {"role": "user", "content": situation(gym, turn, settings)}]


def situation(gym: Gym, turn: Turn, settings: PromptSettings = TURNS) -> list[Json]:
    """Return the content of the user message of a step, with the picture as a data URL."""
    return step_content(gym.context, turn.observation, gym.episode.history, "", settings)


def tool_call(decision: Decision, settings: PromptSettings) -> tuple[str, Json]:
    """Return name and arguments of the tool call that says what a decision with one call says."""
    (call,) = decision.calls
    names = [name for name in REASONING_FIELDS if settings.mid_level or not name.startswith("mid_level")]
    said: dict[str, Any] = {name: getattr(decision, name) for name in (*names, *settings.optional)}
    if "expected_success" in said:
        said["expected_success"] = round(100 * (decision.expected_success or 0.0))
    if settings.brief:
        optional = {name: said.pop(name) for name in OPTIONAL_FIELDS if name in said}
        lines = [f"{name}: {' '.join(str(words).split())}" for name, words in (said | optional).items() if words != ""]
        said = {THOUGHTS: "\n".join(lines)}
    return call.skill, {**said, **call.params}
