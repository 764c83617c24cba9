"""What the prompt of a model contains, whoever sends it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class PromptSettings(BaseModel):
    """Contents of the prompt of a step, and the form of the answer that it asks for."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    history: Annotated[int, Field(ge=0)] = 20
    """Past steps in the prompt."""
    history_slack: Annotated[int, Field(ge=0)] = 0
    """Extra past steps that accumulate before the oldest are dropped together, so that a provider's cache applies."""
    history_text: Literal["short", "whole"] = "short"
    """Whether the model's own words of past steps are cut, what it saw to 240 characters and the rest to 100 or 140."""
    images: Annotated[int, Field(ge=0)] = 1
    """Pictures in the prompt, the current view included; 0 for a model that takes none."""
    mid_level: bool = True
    """Whether the model keeps a mid-level goal (an ablation of the paper)."""
    guide: bool = True
    """Whether the prompt also gives the distance to the floor for rows of the picture, when a target counts as
    reached, how many turns make a circle, and one worked example."""
    brief: bool = True
    """Whether a tool takes the reasoning as one text of named lines instead of five fields."""
    memory: Literal["", "notes", "map"] = ""
    """What the prompt holds beyond the past steps: nothing, a note that the model writes and replaces, or that and a
    sketch map of its own motion and words."""
    expected_success: bool = False
    """Whether each answer says how likely the goal would count as reached if the episode ended now."""
    detail: Literal["", "low", "high", "auto"] = ""
    """Resolution at which the provider reads a picture, if it supports the parameter; empty for its default."""

    @property
    def optional(self) -> tuple[str, ...]:
        """Names of the OPTIONAL_FIELDS of an answer."""
        return ("expected_success",) * self.expected_success + ("note_to_self",) * bool(self.memory)

    def first_told(self, steps: int) -> int:
        """Return the index of the oldest of `steps` past steps in the prompt.

        It advances history_slack + 1 steps at a time.
        """
        if not self.history:
            return steps
        stride = self.history_slack + 1
        return max(0, steps - self.history) // stride * stride

    @property
    def marks_cache(self) -> bool:
        """Whether the provider needs cache marks. For other models a mark does nothing or harms."""
        return False
