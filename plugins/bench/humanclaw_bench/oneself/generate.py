"""The 200 questions of the split `self`, drawn from seeds in the houses of val.

Each kind of question asks for one kind of knowledge about oneself. A question is kept if its answer is as wanted once
the simulator has played it, so that every answer of a kind is equally frequent and true.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import cycle
from typing import Final

import numpy as np
from numpy.typing import NDArray

from humanclaw import Body, Call, EpisodeSpec, Plugins, Scene, Skill
from humanclaw.body import JOINT_INDEX, Array, Motion, Pose2D, matrix_from_quaternion, wrap_angle, yaw_matrix
from humanclaw.records import Goal, name_of
from humanclaw.skills import Role, check_call, find_suited
from humanclaw.world import Contact, MultiFloorMap, OccupancyGrid
from humanclaw_bench.oneself.scene_setups import AHEAD, EDGE, reference
from humanclaw_bench.splits import HOUSES

STEPS: Final = 10
"""Decisions at most, the answer included."""
_WIDE: Final = 0.6
"""Metres free of things on either side of the way ahead."""
_AROUND: Final = 1.2
"""Metres free of things around a body that turns."""
_TRIES: Final = 2000
"""Places that are tried on each floor."""
_PLAYED: Final = 4
"""Questions that are played in a house until one has the wanted answer."""
_ORDER: Final = 11
"""Of shuffled answers: of the seeds 0 to 19, that by which houses, places and order tell least of them."""


@dataclass(frozen=True)
class Asked:
    """A call by what it commands: amounts of measures, in SI units."""

    amounts: Mapping[str, float]
    role: Role = "locomotion"
    side: str = ""
    """Which hand."""

    def call(self, skills: Mapping[str, Skill]) -> Call:
        """Return the call. Raises PluginError without a skill for it."""
        call = find_suited(skills.values(), *self.amounts, role=self.role).call(self.amounts, self.side)
        return check_call(call, skills)

    def words(self, skills: Mapping[str, Skill]) -> str:
        """Return the call in words, without parameters of 0."""
        call = self.call(skills)
        return f"{call.skill} with {', '.join(f'{key} {value}' for key, value in call.params.items() if value)}"


def _walk(ahead: float) -> Asked:
    return Asked({"hips.forward": ahead})


def _reach(side: str, left: float, up: float, ahead: float) -> Asked:
    return Asked({"hand.left": left, "hand.up": up, "hand.ahead": ahead}, "gesture", side)


@dataclass(frozen=True, eq=False)
class Played:
    """What the simulator did with the calls of a question."""

    before: tuple[Motion, ...]
    """The body before each call, and at the end."""
    contacts: tuple[Contact, ...]
    """Of all calls."""
    last: tuple[Contact, ...]
    """In the last frame."""
    scene: Scene

    def moved(self, first: int = 0) -> float:
        """Return how far the hips came over the floor since before a call, metres."""
        return float(np.linalg.norm((self.before[-1].root[-1] - self.before[first].root[-1])[[0, 2]]))

    @property
    def turned(self) -> float:
        """How far the body turned to the left, degrees."""
        yaws = [float(body.yaw()[-1]) for body in self.before]
        return float(np.degrees(np.sum(wrap_angle(np.diff(yaws)))))

    def touched(self, category: str) -> set[tuple[int, str]]:
        """Return the things of a category that were touched, each with the side of the body."""
        ids = {obj.id for obj in self.scene.of_category(category)}
        return {(c.object_id, c.joint.partition("_")[0]) for c in self.contacts if c.object_id in ids}

    def hand(self, side: str, place: Pose2D) -> Array:
        """Return (N, 3) where a hand was after each call in the frame of a place, metres."""
        return np.stack([place.point_to_local(body.joints()[-1, JOINT_INDEX[f"{side}_hand"]]) for body in self.before])


@dataclass(frozen=True)
class Question:
    """A question without its place."""

    setup: str
    values: tuple[float, ...]
    words: str
    """With {0} where the first call stands."""
    calls: tuple[Asked, ...]
    """What answers it when it is played."""
    read: Callable[[Played, Pose2D], str]
    """Return the answer from what was played; empty if it is on the border."""
    begin: tuple[float, float] = (0.0, 0.0)
    """Where it is played from: metres ahead of the start, and a turn, radians."""
    twin: tuple[float, ...] = ()
    """Values by which the mirror must fill the same pixels at first."""


@dataclass(frozen=True)
class Kind:
    """A kind of question."""

    name: str
    """One of KNOWLEDGE."""
    options: tuple[str, ...]
    each: int
    """Questions for each wanted answer."""
    free: tuple[tuple[float, float], ...]
    """Places that are free of things: metres to the left and ahead. None: a place to turn."""
    draw: Callable[[str, int, np.random.Generator], Question]
    """Draw a question from the answer that is wanted and its number."""
    shuffled: bool = False
    """Whether answers come in random order. In turn, they would go by the houses, if each has room."""

    def wanted(self, seed: int) -> list[tuple[str, int]]:
        """Return the answers that are wanted, each with its number."""
        wanted = [(answer, k) for k in range(self.each) for answer in self.options]
        order = np.random.default_rng([seed, _ORDER]).permutation(len(wanted)).tolist()
        return [wanted[k] for k in order] if self.shuffled else wanted


def _hand(wanted: str, number: int, rng: np.random.Generator) -> Question:
    """Face a low mirror with the hands of two: the body, and a person of its looks who stands beside it.

    The mirror is turned one way or the other, which neither words nor first view tell: a movement does.
    """
    away, side = round(float(rng.uniform(1.15, 1.25)), 2), ("left", "right")[number % 2]
    own = 1.0 if (side == "left") == (wanted == "yours") else -1.0

    def read(played: Played, place: Pose2D) -> str:
        """Tell to which side the mirror is turned: there it shows the body."""
        is_left = float(_normal(played) @ yaw_matrix(place.yaw)[:, 0]) < 0
        return "yours" if is_left == (side == "left") else "another's"

    words = f"the low mirror ahead shows the hands of two people. Whose are those on the {side}?"
    return Question("hands", (away, own), words, (), read, twin=(away, -own))


def _normal(played: Played) -> Array:
    """Return where the mirror faces, (3,) in the world's frame."""
    return matrix_from_quaternion(np.array(played.scene.of_category("mirror")[-1].rotation))[:, 2]


def _mirror(wanted: str, number: int, rng: np.random.Generator) -> Question:
    """Face a mirror; one that shows, half of the time, another person beside the body."""
    setup = "glass" if wanted == "yes" else "double"
    away, left = round(float(rng.uniform(1.35, 1.5)), 2), round(float(rng.uniform(28, 31)), 1)

    def read(played: Played, place: Pose2D) -> str:
        """Tell whether the mirror faces the body."""
        glass = played.scene.of_category("mirror")[-1]
        back = float(_normal(played) @ (played.before[0].root[-1] - glass.position)) / away
        return "yes" if back > 0.98 else "no" if back < 0.95 else ""

    words = "the mirror on your left shows a person at first. Is it you?"
    return Question(setup, (away, left), words, (), read)


def _moved(wanted: str, number: int, rng: np.random.Generator) -> Question:
    """Walk against a cabinet that is fixed, or against one of the same looks that gives way."""
    mass = 0.0 if wanted == "no" else float(rng.integers(1, 6))
    step = int(rng.integers(50, 71)) / 100

    def read(played: Played, place: Pose2D) -> str:
        # The question asks for 20 cm: what comes near it has no answer.
        moved = played.moved(1)
        return "yes" if moved > 0.35 else "no" if moved < 0.12 else ""

    words = "call {0} twice. Did the second of these steps move you by more than 20 cm?"
    return Question("cabinet", (mass,), words, (_walk(step),) * 2, read)


_TURNS: Final = ("90", "135", "180", "225", "270")


def _turned(wanted: str, number: int, rng: np.random.Generator) -> Question:
    """Turn to a post that is out of view."""
    bearing = float(int(wanted) + rng.integers(-8, 9))
    turns = [min(60, round(bearing) - 60 * k) for k in range(5) if bearing > 60 * k]

    def read(played: Played, place: Pose2D) -> str:
        # Answers are 45 degrees apart: within 15 of one, the next is 30 away.
        nearest = min(_TURNS, key=lambda turn: abs(float(turn) - played.turned))
        return nearest if abs(float(nearest) - played.turned) < 15 else ""

    words = "turn to the left until the red post is right ahead. How many degrees have you turned in all, about?"
    calls = tuple(Asked({"heading.left": float(np.radians(turn))}) for turn in turns)
    return Question("post", (bearing,), words, calls, read)


def _touch(wanted: str, number: int, rng: np.random.Generator) -> Question:
    """Walk between two posts of which only one is near enough to touch."""
    colour, side = wanted.split(" on your ")
    sign = 1.0 if side == "left" else -1.0
    # A walking body is 56 cm wide and a post 8: the near one is in the way, the far one 18 cm off.
    near, far = round(sign * float(rng.uniform(0.25, 0.31)), 3), round(-sign * float(rng.uniform(0.5, 0.56)), 3)
    red, blue = (near, far) if colour == "red" else (far, near)

    def read(played: Played, place: Pose2D) -> str:
        first, second = (obj.id for obj in played.scene.of_category("post")[-2:])
        names = {first: "red", second: "blue"}
        sides = {f"{names[key]} on your {part}" for key, part in played.touched("post")}
        return sides.pop() if len(sides) == 1 else ""

    words = "call {0} twice. Which post touches you on the way, and on which side of your body?"
    return Question("posts", (red, blue), words, (_walk(0.6),) * 2, read)


def _fit(wanted: str, number: int, rng: np.random.Generator) -> Question:
    """Judge whether the body would fit, from where it stands."""
    return (_gap, _shelf, _stool)[number % 3](wanted == "yes", rng)


def _gap(fits: bool, rng: np.random.Generator) -> Question:
    # A walking body is 56 cm wide.
    width = round(float(rng.uniform(0.62, 0.8) if fits else rng.uniform(0.28, 0.4)), 2)

    def read(played: Played, place: Pose2D) -> str:
        # Three steps are 1.8 m, and the panels stand 1 m ahead.
        return "yes" if played.moved() > 1.6 else "no" if played.moved() < 1.0 else ""

    words = "could you walk straight on through the gap between the two panels?"
    return Question("gap", (width,), words, (_walk(0.6),) * 3, read, (AHEAD - 1.0, 0.0))


def _shelf(fits: bool, rng: np.random.Generator) -> Question:
    height = round(float(rng.uniform(0.95, 1.2)), 2)
    behind = round(float(rng.uniform(0.1, 0.3) if fits else rng.uniform(1.05, 1.2)), 2)
    # From where two steps end against the edge. A body that bends over it reaches 67 cm behind it.
    reach = _reach("right", 0.0, height + 0.08, min(0.9, behind + 0.25))

    def read(played: Played, place: Pose2D) -> str:
        gap = float(np.linalg.norm(played.hand("right", place) - [0.0, height, EDGE + behind], axis=1).min())
        return "yes" if gap < 0.15 else "no" if gap > 0.3 else ""

    words = "could your hand touch the red cube if you stood before the shelf, with both feet on the floor?"
    calls = (_walk(0.6), _walk(0.4), *(reach,) * 4)
    return Question("shelf", (height, behind), words, calls, read, (EDGE - 0.45, 0.0))


def _stool(fits: bool, rng: np.random.Generator) -> Question:
    height = round(float(rng.uniform(0.4, 0.54) if fits else rng.uniform(0.93, 1.0)), 2)
    # With both feet down, hips come over seats of up to 0.62 m, and against the edge of those of up to 0.86 m; from
    # 0.9 m on at no distance or height of the hips. Of the highest, 0.44 m away and at 0.8 m.
    away, up = (0.35, height + 0.12) if fits else (0.44, 0.8)

    def read(played: Played, place: Pose2D) -> str:
        stool = played.scene.of_category("stool")[-1]
        sits = any(c.joint.endswith("pelvis") and c.object_id == stool.id for c in played.last)
        stands = {c.joint.partition("_")[0] for c in played.last if c.object_id != stool.id and _foot(c)}
        return "yes" if sits and len(stands) == 2 else "no"

    words = "could you sit on this stool with both feet on the floor?"
    return Question("stool", (height,), words, (Asked({"hips.height": up}, "sit"),) * 2, read, (AHEAD - away, np.pi))


def _foot(contact: Contact) -> bool:
    return contact.joint.endswith(("_ankle", "_foot"))


def _way(ahead: float) -> tuple[tuple[float, float], ...]:
    return tuple((0.0, float(z)) for z in np.arange(0, ahead + 0.01, 0.1))


_YES_NO: Final = ("yes", "no")
KINDS: Final = (
    Kind("hand", ("yours", "another's"), 17, (*_way(0.6), (0.6, 0.3), (-0.6, 0.3), (0.4, 0.6), (-0.4, 0.6)), _hand,
         shuffled=True),
    Kind("mirror", _YES_NO, 17, (*_way(0.6), (0.6, 1.0), (0.6, 0.4), (1.2, 0.4), (1.2, -0.1)), _mirror),
    Kind("moved", _YES_NO, 17, _way(1.9), _moved),
    Kind("turned", _TURNS, 6, (), _turned),
    Kind("touch", ("red on your left", "red on your right", "blue on your left",
         "blue on your right"), 8, _way(1.8), _touch),
    Kind("fit", _YES_NO, 18, _way(AHEAD + 0.9), _fit),
)  # fmt: skip
TOTAL: Final = sum(kind.each * len(kind.options) for kind in KINDS)


# -- places and answers ------------------------------------------------------------------------------------------------
def questions(plugins: Plugins, seed: int = 0) -> Iterator[EpisodeSpec]:
    """Yield the questions of the split, each in the next house that has room for it. Their seeds are their places in
    the split: shuffled, since answers are drawn in turn.

    plugins: with the skills of hands, which some are played with.
    """
    houses, order = cycle(HOUSES), np.random.default_rng(seed).permutation(TOTAL).tolist()
    asked = [(kind, *wanted) for kind in KINDS for wanted in kind.wanted(seed)]
    with Body("house:0", plugins=plugins) as body:
        for number, (kind, wanted, k) in enumerate(asked):
            rng = np.random.default_rng([seed, number, 61])
            spec = next(filter(None, (_asked(body, kind, wanted, k, next(houses), rng) for _ in HOUSES)))
            yield spec.model_copy(update={"id": f"{spec.id}-{order[number]}", "seed": order[number]})


def _asked(body: Body, kind: Kind, wanted: str, k: int, house: str, rng: np.random.Generator) -> EpisodeSpec | None:
    """Return the k-th question of a kind with an answer, which it has when it is played; None if it finds no room."""
    floors = MultiFloorMap.of(body.plugins.scene(house)).solid().floors
    places = [place for grid in floors for place in _places(grid, kind.free, rng)]
    for index in rng.permutation(len(places))[:_PLAYED].tolist():
        question, place = kind.draw(wanted, k, rng), places[index]
        scene = body.plugins.scene(reference(house, question.setup, place, question.values))
        if question.twin:
            twin = body.plugins.scene(reference(house, question.setup, place, question.twin))
            if not _alike(body, scene, twin, place):
                continue
        if question.read(_play(body, scene, question, place), place) == wanted:
            asked_words = question.words.format(*(asked.words(body.skills) for asked in question.calls))
            words = f"{asked_words} Answer with one of: {'; '.join(kind.options)}."
            return EpisodeSpec(
                id=f"{name_of(house)}-{kind.name}", instruction=words, scene=scene.name, scene_digest=scene.digest,
                start=place, goal=Goal(asks=kind.name, answer=wanted), max_steps=STEPS,
            )  # fmt: skip
    return None


def _places(grid: OccupancyGrid, free: tuple[tuple[float, float], ...], rng: np.random.Generator) -> Iterator[Pose2D]:
    """Yield starts around which places are free; without any, with much room all around."""
    cells = np.argwhere(grid.fits(_WIDE if free else _AROUND))
    if not len(cells):
        return
    points = grid.point(cells[rng.integers(len(cells), size=_TRIES)]).round(2)
    yaws = rng.uniform(-np.pi, np.pi, _TRIES).round(3)
    x, z = np.reshape(free, (-1, 2)).T
    sin, cos = np.sin(yaws)[:, None], np.cos(yaws)[:, None]
    around = points[:, None] + np.stack([x * cos + z * sin, z * cos - x * sin], -1)
    for k in np.flatnonzero((grid.at(grid.clearance, around) >= _WIDE).all(1)):
        yield Pose2D(*map(float, (*points[k], yaws[k], round(grid.floor, 3))))


def _alike(body: Body, scene: Scene, twin: Scene, place: Pose2D) -> bool:
    """Tell whether the mirrors of two scenes fill the same pixels: a wall may hide the end of one that is turned."""
    glass, turned = _mirrored(body, scene, place), _mirrored(body, twin, place)
    return bool((glass != turned).sum() < 0.002 * glass.sum())


def _mirrored(body: Body, scene: Scene, place: Pose2D) -> NDArray[np.bool_]:
    """Return (H, W) which pixels of the first view show the mirror."""
    body.place(scene, place)
    return np.equal(body.view().ids, scene.of_category("mirror")[-1].id)


def _play(body: Body, scene: Scene, question: Question, place: Pose2D) -> Played:
    ahead, turn = question.begin
    x, z = place.x + ahead * float(np.sin(place.yaw)), place.z + ahead * float(np.cos(place.yaw))
    body.place(scene, replace(place, x=x, z=z, yaw=place.yaw + turn))
    before, contacts, last = [body.state().body], list[Contact](), list[Contact]()
    for asked in question.calls:
        chunks = body.execute(asked.call(body.skills)).chunks
        before.append(body.state().body)
        contacts += [contact for chunk in chunks for contact in chunk.execution.contacts]
        last = [c for c in chunks[-1].execution.contacts if len(chunks[-1].execution.simulated) - 1 in c.frames]
    return Played(tuple(before), tuple(contacts), tuple(last), scene)
