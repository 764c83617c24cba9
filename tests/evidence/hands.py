"""How far hands stay short over the workspace, and random sequences of all skills with full hands.

`python tests/evidence/hands.py reach` or `... fuzz --first 0 --last 100`, each with `--engine bullet` or `mujoco`.
"""

from __future__ import annotations

import argparse
import sys
from itertools import product
from pathlib import Path

import numpy as np

from humanclaw import Backends, Body, Call, Plugins
from humanclaw.checks.fakes import FAKE, Fakes
from humanclaw.testing import legal_calls
from humanclaw.world import SceneBuilder

SKILLS = Path(__file__).parents[2] / "skills"
PACKAGES = [SKILLS / name / f"humanclaw_skill_{name}" for name in ("crouch", "gaze", "handle", "hands")]
HEIGHTS = {"standing": (20, 60, 90, 120, 150, 180), "crouched": (10, 30, 60, 90), "seated": (50, 75, 100, 125)}
ASIDE, AHEAD = (-45, -25, -5), (30, 45, 60)
THINGS = (((0.07, 0.1, 0.07), 0.3), ((0.2, 0.05, 0.14), 0.8), ((0.1, 0.25, 0.1), 1.5), ((0.25, 0.2, 0.25), 5.0))


def room(thing: int = 0, seat: bool = False) -> tuple[SceneBuilder, int, list[int]]:
    """Return a room with a table and a thing on it, the id of the thing, and those of what is fixed."""
    builder, (size, mass) = SceneBuilder(), THINGS[thing % len(THINGS)]
    builder.floor()
    fixed = [builder.box("table", (0.9, 0.85, 0.4), (0, 0, 0.7 + 3 * seat))]
    held = builder.box("thing", size, (-0.15, 0.85, 0.55 + 3 * seat), movable=True, mass=mass)
    if seat:
        builder.box("seat", (0.6, 0.45, 0.5), (0, 0, -0.4))
    fixed += [builder.box("wall", (6, 2.5, 0.2), (0, 0, -2.5)), builder.box("wall", (0.2, 2.5, 6), (1.8, 0, 0))]
    fixed += [builder.box("block", (0.5, 1.0, 0.5), (-1.3, 0, -0.6))]
    return builder, held, fixed


def take(body: Body, thing: int) -> None:
    """Take what is on the table with the right hand, and step back with it."""
    x, _, z = body.state().objects[thing][:3]
    beside = round(100 * (x - np.ptp(body.scene.vertices(thing)[:, 0]) / 2 - 0.04))
    near, far = round(100 * z) - 12, round(100 * z) - 6
    for place in ((beside, 105, near), (beside, 105, near), (beside, 93, far)):
        reach(body, *place)
    body.call("grasp", side="right")
    for _ in range(2):
        reach(body, -22, 112, 38)
    body.call("step_back", z_cm=40)


def reach(body: Body, x: int, y: int, z: int) -> float:
    """Reach with the right hand; return how far it stays short, metres."""
    body.call("reach", side="right", x_cm=x, y_cm=y, z_cm=z)
    assert body.last
    return body.last.aims[-1].error


def reach_errors(plugins: Plugins, engine: str) -> None:
    """Print the table of reach errors: of two calls for each place, the second."""
    print("| body | height | median | 90 % | worst | within 3 cm |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    for posture, holds in (("standing", False), ("standing", True), ("crouched", False), ("seated", False)):
        builder, thing, _ = room(seat=posture == "seated")
        with Body(builder.scene(), plugins=plugins, backends=Backends(engine, renderer=FAKE)) as body:
            if holds:
                take(body, thing)
            elif posture != "seated":
                body.call("step_back", z_cm=40)
            calls = {"seated": [Call("sit_in_place", {"h_cm": 54})] * 2, "crouched": [Call("crouch", {"h_cm": 60})]}
            for call in calls.get(posture, []):
                body.execute(call)
            for y in HEIGHTS[posture]:
                short = 100 * np.array([(reach(body, *p), reach(body, *p))[1] for x, z in product(ASIDE, AHEAD)
                                        for p in [(x, y, z)]])  # fmt: skip
                case = f"{posture}{', holding .3 kg' if holds else ''}"
                low, high, worst = np.median(short), np.quantile(short, 0.9), short.max()
                print(f"| {case} | {y} cm | {low:.1f} cm | {high:.1f} cm | {worst:.1f} cm | {(short < 3).mean():.0%} |")


def fuzz(plugins: Plugins, engine: str, first: int, last: int) -> bool:
    """Play sequences of ten random calls with full hands; print what went deepest. Returns whether all was sound."""
    names = sorted(name for name, skill in plugins.skills.items() if skill.role != "stop" and skill.trained)
    deepest, landing, lost, sound = 0.0, 0.0, 0, True
    for k in range(first, last):
        rng, (builder, thing, fixed) = np.random.default_rng([7, k]), room(k)
        with Body(builder.scene(), plugins=plugins, backends=Backends(engine, renderer=FAKE), seed=k) as body:
            take(body, thing)
            for _ in range(10):
                name, held = str(rng.choice(names)), bool(body.state().held)
                body.call(name, **legal_calls(plugins.skills[name], 1, int(rng.integers(2**31)))[-1])
                assert body.last
                lost += held and not body.state().held and plugins.skills[name].role != "release"
                for chunk in body.last.chunks:
                    joints = chunk.execution.simulated.joints()
                    sound &= bool(np.isfinite(joints).all() and np.abs(joints).max() < 10)
                    depths = [depth(body, thing, fixed, pose) for pose in chunk.execution.objects.get(thing, [])]
                    deepest = max([deepest, *(inside for inside, _ in depths)])
                    landing = max([landing, *(below for _, below in depths)])
    print(f"{engine}: sequences {first} to {last}, sound: {sound}; knocked out of the hand {lost} times; "
          f"deepest in furniture {100 * deepest:.2f} cm, in the floor {100 * landing:.2f} cm")  # fmt: skip
    return sound and deepest < 0.01


def depth(body: Body, thing: int, fixed: list[int], pose: np.ndarray) -> tuple[float, float]:  # type: ignore[type-arg]
    """Return how deep a corner of a thing is in what is fixed, and in the floor, metres."""
    hull = body.scene.hulls(thing, pose)[0]
    boxes = [body.scene.aabb(key) for key in fixed]
    return max(0.0, *(float(np.minimum(hull - a, b - hull).min(1).max()) for a, b in boxes)), -float(hull[:, 1].min())


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("reach", "fuzz"))
    parser.add_argument("--engine", default="mujoco")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=100)
    given = parser.parse_args()
    plugins = Plugins.discover(PACKAGES)
    plugins.add(Fakes(), FAKE)
    if given.what == "fuzz":
        return 0 if fuzz(plugins, given.engine, given.first, given.last) else 1
    reach_errors(plugins, given.engine)
    return 0


if __name__ == "__main__":
    sys.exit(main())
