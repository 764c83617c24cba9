"""The oracle's hands: it carries things, opens furniture and answers, from the true state of the scene."""

from __future__ import annotations

from humanclaw import Call
from humanclaw_scripted.actions import answering
from humanclaw_scripted.arms import Script
from humanclaw_scripted.carrying import Carrying
from humanclaw_scripted.opening import Opening


class HandyOracle(Carrying, Opening):
    """The oracle, with hands for episodes that have a goal for them."""

    def _play(self) -> Script:
        goal = self._spec.goal
        assert goal is not None
        if goal.on is not None:
            yield from self._carry(goal.things[0], goal.on)
        elif goal.things:
            yield from self._open([self._scene.by_id[key] for key in goal.things], goal.share)
            if goal.answer:
                yield from self._look_inside()
        if goal.answer:
            yield answering(self._context.skills, goal.answer), f"I know that the answer is {goal.answer}."
        while True:
            yield Call(self._stop), "The task is complete."
