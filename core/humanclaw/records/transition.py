"""An episode up to its last step, as rewards are given it."""

from __future__ import annotations

from dataclasses import dataclass

from humanclaw.records.acknowledgement import acknowledges
from humanclaw.records.steps import EpisodeRecord, StepRecord
from humanclaw.world.scene import Scene


@dataclass(frozen=True)
class Transition:
    """An episode up to its last step. A reward is a function of it, so recorded steps can be rewarded too."""

    record: EpisodeRecord
    steps: tuple[StepRecord, ...]
    """One or more; the last one is rewarded."""
    scene: Scene
    success: bool
    """Whether the agent has stopped within reach of a target, and seated on it if the task says so."""

    @property
    def step(self) -> StepRecord:
        return self.steps[-1]

    @property
    def stopped(self) -> bool:
        """Whether the last step is an active stop."""
        return self.step.status == "stopped"

    def claims(self, step: StepRecord) -> bool:
        """Tell whether the words of a step say that the target is in view (the text rule of FindSR)."""
        category = self.record.spec.target_category
        return bool(category) and acknowledges(step.decision.visible_state, category)
