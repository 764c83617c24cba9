"""Rollouts in half-physics: on a flat floor, and on stairs and seats that fit the command.

The loop is that of an episode: the motion model continues its own poses, re-rooted where physics left the body, or the
body's own. Before stairs or a seat, the previous skill runs on a flat floor. Then the body is put in front of the
stage, takes up its last pose and goes on from there. Half-physics drives velocities from pose to pose, so the pose is
the whole state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from humanclaw import Body, Call, Motion, Scene, Skill, stand
from humanclaw.body import CHUNK, LINKS, Array, Capsule, Pose2D, next_history, re_rooted
from humanclaw.motion import HEEL_END, TOE_END, DiTGenerator
from humanclaw.skills import from_si
from humanclaw.world import SceneBuilder
from humanclaw_train.data.chunks import canonical, stacked
from humanclaw_train.eval.rollouts import CHUNKS_IN_A_ROW, Command, Rollouts

if TYPE_CHECKING:
    from humanclaw import Simulator

_HOLD: Final = 10
"""Frames in which a body that was moved takes up the pose of its history."""


# -- stages ------------------------------------------------------------------------------------------------------------
def _hips_below() -> float:
    pelvis = next(link.shape for link in LINKS if link.joint == "pelvis")
    assert isinstance(pelvis, Capsule)
    return pelvis.radius - pelvis.a[1]


HIPS: Final = _hips_below()
"""Distance from the pelvis joint down to the surface that touches a seat, metres."""
_SEAT_FRONT: Final = -0.13
"""Front of a seat, metres along the facing: just behind the hips of a standing body."""
_CLEAR: Final = 0.01
"""Clearance of the toes from a riser, metres."""
_TREAD, _SEATED = 0.28, 0.5
"""Depth of a tread and height of seated hips, metres, for skills without such a parameter."""


def flat(side: float = 30.0) -> Scene:
    """Return a scene with a flat square floor alone. side: metres."""
    return _scene("flat", [("floor", (side, 0.2, side), (0.0, -0.2, 0.0))])


def stage(skill: Skill, values: Mapping[str, float], chunks: int = CHUNKS_IN_A_ROW) -> Scene:
    """Return the scene that a skill with these parameters needs. The body is at the origin, facing +Z, floor at 0.

    Skills that command a rise or drop of the hips get stairs. Skills that sit get a seat of the commanded height.
    """
    asked = {parameter.measure: values[parameter.name] for parameter in skill.parameters}
    tread = asked.get("hips.forward", _TREAD)
    if "hips.rise" in asked:
        return _scene("up", _ascent(asked["hips.rise"], tread, chunks))
    if "hips.drop" in asked:
        return _scene("down", _descent(asked["hips.drop"], tread, chunks))
    if skill.role == "sit":
        # The seat's top is where the hips of a body at the commanded height would touch it.
        return bench(max(asked.get("hips.height", _SEATED) - HIPS, 0.02))
    return flat()


def bench(top: float) -> Scene:
    """Return a scene with a bench of this height, metres, behind the body."""
    seat = ("bench", (1.2, top, 1.0), (0.0, 0.0, _SEAT_FRONT - 0.5))
    return _scene("seat", [("floor", (30.0, 0.2, 30.0), (0.0, -0.2, 0.0)), seat])


_Boxes = list[tuple[str, tuple[float, float, float], tuple[float, float, float]]]


def _ascent(h: float, d: float, chunks: int) -> _Boxes:
    # As in real climbing, the landing foot has its ankle over the edge; the standing toes stay clear of the riser.
    riser = max(TOE_END + _CLEAR, d + 2 * _CLEAR)
    treads: _Boxes = [("stairs", (2.0, h * (k + 1), d), (0.0, 0.0, riser + d * (k + 0.5))) for k in range(chunks)]
    landing = ("floor", (2.0, h * (chunks + 1), 4.0), (0.0, 0.0, riser + d * chunks + 2.0))
    return [("floor", (30.0, 0.2, 30.0), (0.0, -0.2, 0.0)), *treads, landing]


def _descent(h: float, d: float, chunks: int) -> _Boxes:
    # Downstairs the middle of the foot is over the edge, so that the next heel clears it.
    edge, low = (TOE_END + HEEL_END) / 2, -h * (chunks + 2)  # Every tread is a box that reaches down to low.
    treads: _Boxes = [("stairs", (2.0, -h * (k + 1) - low, d), (0.0, low, edge + d * (k + 0.5))) for k in range(chunks)]
    upper = ("floor", (2.0, -low, 4.0), (0.0, low, edge - 2.0))
    return [upper, *treads, ("floor", (2.0, h, 4.0), (0.0, low, edge + d * chunks + 2.0))]


def _scene(name: str, boxes: _Boxes) -> Scene:
    builder = SceneBuilder()
    for category, size, place in boxes:
        builder.box(category, size, place)
    return replace(builder.scene(), name=name)


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
    tick: Callable[[], object] = lambda: None,
) -> Rollouts:
    """Run a skill in half-physics, like rollouts.roll. On stairs the command stays the same; a seat is used once."""
    random = np.random.default_rng(seed)
    chunks: list[Motion] = []
    commands: list[Array] = []
    strange: list[bool] = []
    for index in range(rollouts):
        # Every second rollout follows another skill, each of them in turn.
        other = before[index // 2 % len(before)] if before and index % 2 else None
        asked = _commands(command, random)
        actor.stand(flat() if other else stage(command.declaration, command.named(asked[0])))
        if other:
            actor.act(other, other.draw(1, random)[0], (seed, index, 0))
            if command.declaration.climbs or command.declaration.role == "sit":
                actor.move_to(stage(command.declaration, command.named(asked[0])))
        for turn, values in enumerate(asked):
            actor.act(command, values, (seed, index, turn + 1))
            chunks.append(actor.simulated[-CHUNK:])
            commands.append(values)
            strange.append(other is not None and turn == 0)
        tick()
    return Rollouts(*canonical(*stacked(chunks)), np.stack(commands), np.array(strange))


def _commands(command: Command, random: np.random.Generator) -> Array:
    # All steps of one staircase are equal, and a seat is used once.
    if command.declaration.climbs:
        return np.repeat(command.draw(1, random), CHUNKS_IN_A_ROW, 0)
    return command.draw(1 if command.declaration.role == "sit" else CHUNKS_IN_A_ROW, random)


def called(body: Body, skill: Skill, asked: Mapping[str, float]) -> Motion:
    """Call a skill of a body as an agent would; returns the simulated motion.

    asked: SI, by measure; the middle of its range for a parameter that is not among them.
    """
    params: dict[str, Any] = {}
    for parameter in skill.parameters:
        low, high = parameter.low, parameter.high
        value = np.clip(asked.get(parameter.measure, (low + high) / 2), low, high)
        params[parameter.key] = round(from_si(parameter.key, float(value)))
    chunks = body.execute(Call(skill.name, skill.check(params))).chunks
    parts = [chunk.execution.simulated for chunk in chunks]
    return Motion(np.concatenate([part.root for part in parts]), np.concatenate([part.rotations for part in parts]))
