"""Rollouts in half-physics: on a flat floor, and on stairs and seats that fit the command.

The loop is that of an episode: the motion model continues its own poses, re-rooted where physics left the body, or the
body's own. Before stairs or a seat, the previous skill runs on a flat floor. Then the body is put in front of the
stage, takes up its last pose and goes on from there. Half-physics drives velocities from pose to pose, so the pose is
the whole state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from tqdm import tqdm

from humanclaw import Motion, Scene, stand
from humanclaw.body import CHUNK, Array, Pose2D, next_history, re_rooted
from humanclaw.motion import DiTGenerator
from humanclaw.skills import floor_for, floor_scene
from humanclaw_train.data.chunks import canonical, stacked
from humanclaw_train.eval.rollouts import CHUNKS_IN_A_ROW, Command, Rollouts

if TYPE_CHECKING:
    from humanclaw import Simulator

_HOLD: Final = 10
"""Frames in which a body that was moved takes up the pose of its history."""


# -- a body in a simulator ---------------------------------------------------------------------------------------------
class Actor:
    """A body that a generator moves in a simulator. `simulated`: its motion since it was last placed."""

    def __init__(self, generator: DiTGenerator, simulator: Simulator, source: str = "generated") -> None:
        """source: of the history (humanclaw.body.next_history)."""
        self._generator, self._simulator, self._source = generator, simulator, source
        self.simulated = self._history = generator.start()

    def stand(self, scene: Scene) -> None:
        """Stand at the origin, as an episode begins."""
        self.simulated = self._history = stand(self._simulator, self._generator, scene, scene.start)

    def move_to(self, scene: Scene) -> None:
        """Move to the origin of another scene and take up the pose of the history."""
        origin = Pose2D.of(self._simulator.reset(scene, scene.start).body, floor=0.0)
        pose = origin.to_world(Pose2D.of(self._history, floor=0.0).to_local(self._history[-1:]))
        # The simulator has reset the body to its rest pose; holding one pose lets half-physics drive it there.
        held = Motion(np.repeat(pose.root, _HOLD, 0), np.repeat(pose.rotations, _HOLD, 0))
        self.simulated = self._simulator.execute(held).simulated
        self._history = re_rooted(self._history, self.simulated)

    def act(self, command: Command, values: Array, key: Sequence[int]) -> None:
        """Execute one chunk of a skill."""
        commanded = self._generator.generate(self._history, command.adapter, command.named(values), key)
        execution = self._simulator.execute(commanded)
        self.simulated = self.simulated.then(execution.simulated)
        self._history = next_history(self._history, commanded, execution.simulated, self._source)


# -- rollouts ----------------------------------------------------------------------------------------------------------
def roll_simulated(
    actor: Actor,
    command: Command,
    before: Sequence[Command],
    rollouts: int,
    seed: int,
) -> Rollouts:
    """Run a skill in half-physics, like rollouts.roll. On stairs the command stays the same; a seat is used once."""
    random = np.random.default_rng(seed)
    chunks: list[Motion] = []
    commands: list[Array] = []
    strange: list[bool] = []
    for index in tqdm(range(rollouts), command.skill, unit="rollout", disable=None):
        # Every second rollout follows another skill, each of them in turn.
        other = before[index // 2 % len(before)] if before and index % 2 else None
        asked = _commands(command, random)
        place = floor_scene(floor_for(command.declaration, command.named(asked[0]), CHUNKS_IN_A_ROW))
        actor.stand(floor_scene() if other else place)
        if other:
            actor.act(other, other.draw(1, random)[0], (seed, index, 0))
            if command.declaration.climbs or command.declaration.role == "sit":
                actor.move_to(place)
        for turn, values in enumerate(asked):
            actor.act(command, values, (seed, index, turn + 1))
            chunks.append(actor.simulated[-CHUNK:])
            commands.append(values)
            strange.append(other is not None and turn == 0)
    return Rollouts(*canonical(*stacked(chunks)), np.stack(commands), np.array(strange))


def _commands(command: Command, random: np.random.Generator) -> Array:
    # All steps of one staircase are equal, and a seat is used once.
    if command.declaration.climbs:
        return np.repeat(command.draw(1, random), CHUNKS_IN_A_ROW, 0)
    return command.draw(1 if command.declaration.role == "sit" else CHUNKS_IN_A_ROW, random)
