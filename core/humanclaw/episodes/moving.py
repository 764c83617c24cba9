"""How a body moves: the parts of a plan become motion, half a second at a time, each from where the last one ended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from humanclaw.body.hand_thigh_contact import lay_hands
from humanclaw.body.pose import FPS, FUTURE, Motion, Pose2D, next_history, re_rooted
from humanclaw.episodes.adapters import Adapters
from humanclaw.episodes.backends import Backends
from humanclaw.motion.carrying import Arms
from humanclaw.motion.profile import motion_profile
from humanclaw.motion.protocol import MotionGenerator
from humanclaw.motion.stand_up import is_down, rise
from humanclaw.records.feedback import HandAim
from humanclaw.skills.contract import Skill, untrained
from humanclaw.skills.gaze_grip_speech import Gaze, Grip, Speech
from humanclaw.skills.heading_correction import HeadingCorrection
from humanclaw.skills.plan import Control, Keyframes
from humanclaw.skills.plan_motion import Part, arms_of, part_motion
from humanclaw.skills.proprioception import ProprioceptiveState
from humanclaw.skills.reaching import Reach
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import Chunk, Execution, Simulator

STANDING: Final = Keyframes((FUTURE / FPS,), {}, absolute=True)
"""Half a second in which nothing of the body moves."""
_SHORT: Final = 0.03
"""Metres from its target at which a hand is there."""


class Mover:
    """Moves a body through one scene, from its start on."""

    def __init__(
        self, backends: Backends, adapters: Adapters, generator: MotionGenerator, simulator: Simulator,
        scene: Scene, start: Pose2D,
    ) -> None:  # fmt: skip
        """Stand the body on its start, with every object at rest."""
        self._profile, self._source, self.adapters = motion_profile(backends.profile), backends.motion_history, adapters
        self._generator, self._simulator = generator, simulator
        self.history = stand(simulator, generator, scene, start)
        """The five frames that the next motion continues (world frame)."""
        self.state = simulator.state()
        self.pitch: float | None = None
        """How far up the eyes look since a part turned them, radians; None while they look as they usually do."""
        self._heading, self.arms = HeadingCorrection(), Arms()

    @property
    def feeling(self) -> ProprioceptiveState:
        """What the body feels of itself."""
        return ProprioceptiveState.of(self.arms.pose(self.history), self.state.held)

    def rising(self) -> Motion:
        """Return the motion that stands up a body that is down; no frames for another, or if the profile does not."""
        down = self._profile.rises and is_down(self.state.body)
        return rise(self.state.body, self._generator.start()) if down else self.history[:0]

    def generate(self, owner: Skill | None, part: Control, key: tuple[int, ...]) -> Motion:
        """Generate the motion of a control; its command corrects earlier heading errors if the profile says so.

        owner: the skill of its adapter, if that is installed. key: seed of its random numbers.
        """
        owner = owner if self._profile.steers else None
        values = part.values if owner is None else self._heading.steer(owner, part.values)
        adapter = self.adapters.of(part.adapter, self._generator.digest)
        motion = self._generator.generate(self.history, adapter, values, key)
        if owner is not None:
            self._heading = self._heading.after(owner, part.values, self.history, motion)
        return motion

    def simulate(self, motion: Motion, part: Part) -> Chunk:
        """Drive the body through the motion of a part."""
        # A simulated history would hold the hands that the next chunk must not see.
        lays = self._profile.lays_hands and isinstance(part, Control) and self._source == "generated"
        commanded = lay_hands(motion) if lays else motion
        commanded = self.arms.over(commanded, arms_of(part), self.state.body)
        return self._moved(motion, part, Chunk(commanded, self._simulator.execute(commanded)))

    def _moved(self, motion: Motion, part: Part, chunk: Chunk) -> Chunk:
        """Go on from where a chunk of a part's motion has brought the body."""
        self.state = self._simulator.state()
        self.arms.after(chunk.execution.simulated, self.state.held, arms_of(part))
        self.history = next_history(self.history, motion, chunk.execution.simulated, self._source)
        return chunk

    def stands(self) -> Motion:
        """Return half a second of standing, for a world that goes on meanwhile: it tells stood() what became of it."""
        return self.arms.over(self._still(), arms_of(STANDING), self.state.body)

    def stood(self, execution: Execution) -> Chunk:
        """Go on from where half a second of standing has left the body."""
        return self._moved(self._still(), STANDING, Chunk(self.stands(), execution))

    def _still(self) -> Motion:
        return part_motion(STANDING, self.arms.pose(self.history), self.arms.palms)[0]

    def grip(self, part: Grip) -> str:
        """Close or open a hand, and return what it could not do. A simulator of plugin API 1.2 has no hands."""
        if not hasattr(self._simulator, "grip"):
            return "your hands hold nothing in this world"
        self._simulator.grip(part.hand, part.closed)
        self.state = self._simulator.state()
        missed = part.closed and part.hand not in self.state.held
        return f"your {part.hand} hand closed on nothing" if missed else ""

    def speak(self, part: Speech) -> str:
        """Let the others in the world hear it, and return why they will not. A simulator of one body has none."""
        heard = not hasattr(self._simulator, "speak") or self._simulator.speak(part.text)
        return "" if heard else "you have just spoken, and nobody hears more until half a second has passed"


class Playing:
    """One call under way, and what it found that the body could not do."""

    def __init__(self, mover: Mover, skill: Skill, plan: Sequence[Part], key: tuple[int, int], over: int = 0) -> None:
        """Take a skill's plan. key: seed of the episode and number of the step. over: parts of it that were played."""
        self._mover, self._skill, self._plan, self._key, self._over = mover, skill, plan, key, over
        self.limits: list[str] = []
        """What the body could not do, in words."""
        self.aims: list[HandAim] = []
        self.rise_frames = 0

    def chunks(self) -> Iterator[tuple[int, Motion, bool]]:
        """Yield the motion of the plan, 15 frames at a time: the number of the part, the motion, and whether more
        follows. Each is to be simulated before the next one is asked for."""
        index = self._over
        for number, part in enumerate(self._plan[self._over :], self._over):
            for commanded, left in self._pieces(part, index):
                yield number, commanded, left or number + 1 < len(self._plan)
                index += 1

    def _pieces(self, part: Part, index: int) -> Iterator[tuple[Motion, bool]]:
        """Yield the chunks of one part. index: number of its first chunk within the call."""
        if isinstance(part, Control):
            yield from self._controlled(part, index)
            return
        if isinstance(part, Speech) and (limit := self._mover.speak(part)):
            self.limits.append(limit)
        if isinstance(part, Grip) and (limit := self._mover.grip(part)):
            self.limits.append(limit)
        pose = self._mover.arms.pose(self._mover.history)
        motion, limits = part_motion(part, pose, self._mover.arms.palms)
        self.limits += limits
        yield from self._played(motion)
        if isinstance(part, Reach):
            self._aim(part, pose)
        elif isinstance(part, Gaze):
            self._mover.pitch = part.pitch(self._mover.state.body)

    def _controlled(self, part: Control, index: int) -> Iterator[tuple[Motion, bool]]:
        """Yield the chunk of a control, and before it those that stand a body up that is down."""
        self._mover.pitch = None
        if part.adapter == self._skill.adapter and not self._skill.trained:
            raise untrained(self._skill)
        owner = self._mover.adapters.owner(self._skill, part.adapter)
        if (owner or self._skill).role == "locomotion":
            for piece, _ in self._played(self._mover.rising()):
                self.rise_frames += len(piece)
                yield piece, True
        yield self._mover.generate(owner, part, (*self._key, index)), False

    def _played(self, motion: Motion) -> Iterator[tuple[Motion, bool]]:
        """Yield a ready motion 15 frames at a time, each from where the body is, and whether more follows."""
        before = self._mover.history.root[-1]
        for first in range(0, len(motion), FUTURE):
            piece = motion[first : first + FUTURE]
            level = [1.0, 0.0, 1.0] * (self._mover.history.root[-1] - before)
            yield Motion(piece.root + level, piece.rotations), first + FUTURE < len(motion)
            before = piece.root[-1]

    def _aim(self, part: Reach, pose: Motion) -> None:
        """Enter how far a hand is from its target. pose: in whose frame the target is."""
        short = part.short(pose, self._mover.state.body)
        self.aims.append(HandAim(part.hand, part.at, round(short, 4)))
        if short > _SHORT:
            self.limits.append(f"your {part.hand} hand stays {100 * short:.0f} cm short")


def stand(simulator: Simulator, generator: MotionGenerator, scene: Scene, start: Pose2D) -> Motion:
    """Stand a body on its start, in the stance that the motion model begins from.

    A simulator places the body in a pose of its own, so the stance is played first. Returns its five frames, the
    history of the first motion (world frame).
    """
    stance = re_rooted(generator.start(), simulator.reset(scene, start).body)
    return re_rooted(stance, simulator.execute(stance).simulated)
