"""Play a skill's calls: on a body without dynamics, and on every installed engine."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import SimpleNamespace
from typing import Any, Final

import numpy as np

from humanclaw.body.pose import FUTURE, rest_pose
from humanclaw.checks.bounded import bounded
from humanclaw.checks.fakes import FAKE, Fakes, fake_body, fake_scene
from humanclaw.episodes.backends import Backends
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.execution import SkillExecution
from humanclaw.errors import ContractError, HumanclawError, in_words
from humanclaw.plugins.hookspecs import hookimpl
from humanclaw.plugins.host import Plugins
from humanclaw.skills.call import Call
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import MEASURES, Measure
from humanclaw.skills.plan import Control
from humanclaw.skills.plan_motion import Part
from humanclaw.skills.proprioception import ProprioceptiveState

_FAR: Final = 20.0
"""Metres that a body cannot cover in a call of 10 s."""
Faults = Iterator[ContractError]


@dataclass(frozen=True)
class Bench:
    """The plugins, base and engines that a skill is checked and played with."""

    plugins: Plugins
    measures: Mapping[str, Measure]
    engines: Sequence[str] | None
    samples: int
    seed: int
    patience: float
    """Seconds that planning a call may take."""
    playing: float
    """Seconds that playing a call may take."""


def played_faults(
    skill: Skill, calls: Sequence[dict[str, Any]], bench: Bench
) -> tuple[tuple[ContractError, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the faults, the engines that played the skill, and notes on those that could not."""
    faults = [*_on_fake(skill, calls, bench)]
    engines: list[str] = []
    notes: list[str] = []
    names = [item.name for item in bench.plugins.registered("simulators")] if bench.engines is None else bench.engines
    for name in names:
        try:
            faults += _on_engine(name, skill, calls, bench)
            engines.append(name)
        except HumanclawError as error:
            notes.append(f"not played on {name}: {error}")
    return tuple(faults), tuple(engines), tuple(notes)


def _on_fake(skill: Skill, calls: Sequence[dict[str, Any]], bench: Bench) -> Faults:
    with fake_body(skill, measures=_own(bench.measures), seed=bench.seed) as body:
        for params in calls:
            call = Call(skill.name, skill.check(params))
            try:
                once, again = (bounded(bench.playing, partial(_afresh, body, call, bench.seed)) for _ in range(2))
            except (Exception, SystemExit) as error:
                message = f"{call} raises {in_words(error)}."
                yield ContractError("body-plays", message, "Mend its motion.")
                return
            if any(len(chunk.commanded) != FUTURE for chunk in once.chunks) or not _is_finite(once):
                yield ContractError(
                    "body-plays", f"the motion of {call} is not a whole number of chunks.", "Mend its motion."
                )
            if not _same(once, again):
                message = f"{call} at the same moment is another motion."
                yield ContractError("body-repeats", message, "Plan from the parameters alone.")


def _own(measures: Mapping[str, Measure]) -> list[Measure]:
    return [measure for name, measure in measures.items() if name not in MEASURES]


def _afresh(body: Body, call: Call, seed: int) -> SkillExecution:
    body.reset(body.scene, seed=seed)
    return body.execute(call)


def _is_finite(done: SkillExecution) -> bool:
    motions = [motion for chunk in done.chunks for motion in (chunk.commanded, chunk.execution.simulated)]
    return all(np.isfinite(part.root).all() and np.isfinite(part.rotations).all() for part in motions)


def _same(first: SkillExecution, second: SkillExecution) -> bool:
    return len(first.chunks) == len(second.chunks) and all(
        np.array_equal(a.commanded.root, b.commanded.root)
        and np.array_equal(a.commanded.rotations, b.commanded.rotations)
        for a, b in zip(first.chunks, second.chunks, strict=True)
    )


def _on_engine(name: str, skill: Skill, calls: Sequence[dict[str, Any]], bench: Bench) -> Faults:
    """Play every call from standing on a floor. Raises HumanclawError if the engine cannot be had."""
    moves = any(isinstance(part, Control) for params in calls for part in _parts(skill, params))
    backends = Backends(name, FAKE, "dit" if moves else FAKE)
    doing = ""
    try:
        # A new body stands first: the engine has moved it into its stance.
        with Body(fake_scene(), plugins=_host(name, skill, bench), backends=backends) as body:
            for params in calls:
                doing = str(call := Call(skill.name, skill.check(params)))
                done = bounded(bench.playing, partial(_afresh, body, call, bench.seed))
                end = body.state().body.root[-1]
                if not _is_finite(done) or np.abs(end).max() > _FAR:
                    message = f"{doing} on {name} ends at {np.round(end, 2).tolist()}."
                    yield ContractError("engine-finite", message, "Mend its motion.")
    except (Exception, SystemExit) as error:
        if not doing and isinstance(error, HumanclawError):
            raise
        message = f"{doing or 'standing'} on {name} raises {in_words(error)}."
        yield ContractError("engine-plays", message, "Mend its motion, or name other engines with --engine.")


def _parts(skill: Skill, params: Mapping[str, Any]) -> tuple[Part, ...]:
    return skill.planned(skill.check(params), ProprioceptiveState.of(rest_pose()))


def _host(engine: str, skill: Skill, bench: Bench) -> Plugins:
    """Return a host with one engine and one skill, and fakes for the rest."""
    host = Plugins()
    host.add(Fakes([skill], _own(bench.measures)), FAKE)
    for kind, name in (("simulators", engine), ("motion_generators", "dit")):
        for item in bench.plugins.registered(kind):
            if item.name == name:
                host.add(_borrowed(kind, name, item.value), f"{FAKE}-{kind}")
    return host


def _borrowed(kind: str, name: str, factory: Callable[..., Any]) -> object:
    """Return a plugin that registers one factory of another host."""

    def borrow(register: Callable[..., None]) -> None:
        register(name, factory)

    return SimpleNamespace(**{f"humanclaw_{kind}": hookimpl(borrow)})
