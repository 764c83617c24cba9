"""The checks that every skill passes, ours and anybody else's: what it says of itself, what it refuses, what it plays.

`humanclaw check` tells of them on a terminal, the pytest plugin makes a test of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from humanclaw.body.pose import FPS, FUTURE, HISTORY, Array, Motion, matrix_from_vector, rest_pose, vector_from_matrix
from humanclaw.body.skeleton import JOINTS
from humanclaw.episodes.backends import Backends
from humanclaw.episodes.embodiment import Body, SkillExecution, untrained
from humanclaw.errors import CallError, ContractError, HumanclawError, PluginError, in_words
from humanclaw.motion.checkpoint import read_header, shipped_base
from humanclaw.plugins.bounded import Bounded, OverdueError
from humanclaw.plugins.hookspecs import API_VERSION, hookimpl
from humanclaw.plugins.host import Plugins
from humanclaw.plugins.loading import check_api, load_file
from humanclaw.skills.adapter_checks import adapter_header, ranges, within
from humanclaw.skills.call import Call
from humanclaw.skills.checks import CHECKS, read_draft, skill_faults
from humanclaw.skills.contract import Skill
from humanclaw.skills.measures import MEASURES, Measure
from humanclaw.skills.plan import Control, Keyframes, MotionError, Part, parts
from humanclaw.testing.fakes import FAKE, Fakes, fake_body, fake_scene
from humanclaw.testing.sampling import illegal_calls, legal_calls

SPEED_LIMIT: Final = 1500.0
"""Degrees a second: about what the knee of a kick and the elbow of a throw reach."""
_LIMITS: Final = {
    "spine": 60, "hip": 135, "knee": 160, "ankle": 70, "foot": 70, "neck": 80, "collar": 60, "head": 85,
    "shoulder": 180, "elbow": 160, "wrist": 100, "hand": 80,
}  # fmt: skip
"""Degrees that a joint can turn from the standing pose, about any axis; a shoulder turns as far as there is."""
_KNEE_BACK: Final = 20.0
"""Degrees that a knee bends the wrong way."""
_UNCALLABLE: Final = frozenset(
    {"loads", "schema-file", "schema-object", "schema-valid", "references", "properties", "types", "bounds-order",
     "bounds-finite", "choices", "required-declared", "defaults-given", "defaults-legal"}
)  # fmt: skip
"""What leaves nobody a legal call."""
_FAR: Final = 20.0
"""Metres that no call of 10 s takes a body."""
PATIENCE: Final = 10.0
"""Seconds that planning one call may take: as long as a call lasts at most."""
LOADING: Final = 30.0
"""Seconds that importing a file and asking its hooks may take."""
PLAYING: Final = 120.0
"""Seconds that one world may take to play one call, also on a machine that does much besides."""
Faults = Iterator[ContractError]


@dataclass(frozen=True)
class Report:
    """What a check of one skill found. It passes if there are no faults."""

    skill: str
    faults: tuple[ContractError, ...]
    calls: int = 0
    """Legal calls that were played."""
    engines: tuple[str, ...] = ()
    """Simulators that played them, beside the fake one."""
    notes: tuple[str, ...] = ()
    """What could not be checked, and why."""

    @property
    def passed(self) -> bool:
        return not self.faults


@dataclass(frozen=True)
class _Bench:
    """What a skill is held to and played with."""

    plugins: Plugins
    measures: Mapping[str, Measure]
    engines: Sequence[str] | None
    samples: int
    seed: int
    ask: Bounded
    """Waits for the plan of a call, so long and no longer."""
    play: Bounded
    """The same for the playing of one."""
    base: str = field(default_factory=lambda: str(read_header(shipped_base())["digest"]))


def check_skill(
    skill: Skill | Path,
    measures: Mapping[str, Measure] = MEASURES,
    *,
    engines: Sequence[str] | None = None,
    samples: int = 3,
    seed: int = 0,
    trained: bool = False,
) -> Skill:
    """Hold a skill, or a skill folder, to every named check, as `humanclaw check` does.

    Args:
        measures: what its parameters may command; Plugins.measures has those of plugins too.
        engines: simulators that play it beside the fake one; None for each that is installed.
        samples: calls to play besides those at the bounds.
        trained: insist on an adapter; a skill that is still to be trained is else held to what it says of itself.

    Raises AssertionError that tells of all problems, each with its check and remedy; returns the skill.
    """
    report = examine(skill, measures, engines=engines, samples=samples, seed=seed)
    faults = [fault for fault in report.faults if trained or fault.check != "adapter-there"]
    assert not faults, "\n".join(f"{fault.check}: {fault}" for fault in faults)
    return Skill.from_folder(skill) if isinstance(skill, Path) else skill


def examine(
    skill: Skill | Path,
    measures: Mapping[str, Measure] = MEASURES,
    *,
    engines: Sequence[str] | None = None,
    samples: int = 3,
    seed: int = 0,
    plugins: Plugins | None = None,
    patience: float = PATIENCE,
    playing: float = PLAYING,
) -> Report:
    """Report on a skill as check_skill does, and raise nothing. patience, playing: seconds that planning a call and
    playing it may take."""
    if plugins is None:
        plugins = Plugins() if engines == () else Plugins.discover()
    bench = _Bench(plugins, measures, engines, samples, seed, Bounded(patience), Bounded(playing))
    if isinstance(skill, Skill):
        return _examined(skill, bench, ())
    draft, unreadable = read_draft(skill)
    return _examined(draft, bench, unreadable) if draft else Report(skill.name, unreadable)


def _examined(skill: Skill, bench: _Bench, unreadable: Sequence[ContractError]) -> Report:
    said = (*unreadable, *skill_faults(skill, bench.measures, bench.base, formats=True))
    if skill.adapter and not skill.adapter.is_file():
        missing = untrained(skill)
        said += (ContractError("adapter-there", missing.message, missing.remedy),)
    if {fault.check for fault in said} & _UNCALLABLE:
        return Report(skill.name, said)
    calls = [*_distinct(legal_calls(skill, bench.samples, bench.seed))]
    called = (*_refusal_faults(skill), *_plan_faults(skill, calls, bench))
    if any(fault.check not in _ELSEWHERE for fault in (*said, *called)):
        return Report(skill.name, _once((*said, *called)), notes=tuple(_untold(skill)))
    played, engines, notes = _play(skill, calls, bench)
    return Report(skill.name, _once((*said, *called, *played)), len(calls), engines, (*_untold(skill), *notes))


_ELSEWHERE: Final = frozenset(name for name in CHECKS if name.startswith("publish-"))
"""Checks that a skill may fail and still be played."""


def _once(faults: Sequence[ContractError]) -> tuple[ContractError, ...]:
    """Return the first fault of each check and message: a skill that breaks at its minimum breaks at its maximum
    too."""
    return tuple({(fault.check, fault.message): fault for fault in reversed(faults)}.values())[::-1]


def _distinct(calls: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    seen: list[dict[str, Any]] = []
    for call in calls:
        if call not in seen:
            seen.append(call)
            yield call


def _untold(skill: Skill) -> Iterator[str]:
    """Yield what an adapter's header leaves open."""
    if skill.adapter and skill.adapter.is_file() and len(skill.parameters) > 1:
        header, _ = adapter_header(skill.adapter, "")
        if header and not header["adapter"].get("measures"):
            yield "its adapter's header names no measures: two parameters of one unit exchanged would not be found"


# -- calls and plans ---------------------------------------------------------------------------------------------------
def _refusal_faults(skill: Skill) -> Faults:
    for check, params in illegal_calls(skill):
        try:
            skill.check(params)
        except CallError:
            continue
        except Exception as error:
            yield ContractError(check, f"{params} raises {type(error).__name__}: {error}.", "Mend the schema.")
            continue
        if check != "refuses-unknown" or skill.schema.get("additionalProperties") is False:
            message = f"skill {skill.name!r} takes {params}."
            yield ContractError(check, message, "Say type and bounds of each parameter in the schema.")


def _plan_faults(skill: Skill, calls: Sequence[dict[str, Any]], bench: _Bench) -> Faults:
    found: dict[str, ContractError] = {}
    for params in calls:
        for fault in _call_faults(skill, params, bench):
            found.setdefault(fault.check, fault)
    yield from found.values()


def _call_faults(skill: Skill, params: Mapping[str, Any], bench: _Bench) -> Faults:
    """Yield what is wrong with one legal call."""
    call = f"{skill.name}({', '.join(f'{key}={value}' for key, value in params.items())})"
    try:
        checked = skill.check(params)
    except CallError as error:
        message = f"the schema of skill {skill.name!r} refuses a call at its own bounds: {error}"
        yield ContractError("accepts-bounds", message, "Mend bounds and pattern.")
        return
    try:
        plan, again = (bench.ask(lambda: parts(skill.plan(checked))) for _ in range(2))
    except MotionError as error:
        yield ContractError(error.check, f"{call}: {error}.", _REMEDIES.get(error.check, "Mend the keyframes."))
        return
    except (Exception, SystemExit) as error:
        message = f"{call} raises {in_words(error)}."
        yield ContractError("plan-runs", message, "Bound its parameters so that every legal call can be planned.")
        return
    if repr(plan) != repr(again):  # Keys may be arrays, which are not simply equal.
        message = f"{call} is planned otherwise the second time."
        yield ContractError("plan-repeats", message, "Plan from the parameters alone: no clock, no random numbers.")
    pose = rest_pose(HISTORY)
    for part in plan:
        if isinstance(part, Keyframes):
            yield from _pose_faults(part, call, pose)
        elif part.adapter != skill.adapter:  # Its own is held to its schema already.
            yield from _control_faults(part, call, bench)


_REMEDIES: Final = {
    "duration": "Bound the parameters that set how long it lasts.",
    "plan-kind": "Return a Control, Keyframes, or a list of them.",
    "control-adapter": "Name the adapter of a skill that is trained.",
    "control-values": "Give one value for each parameter that the adapter's header names.",
    "control-finite": "Command finite numbers: metres and radians.",
    "keyframes-joints": "Name a joint of the body.",
    "keyframes-times": "Begin at 0 and increase, with one key a time.",
    "keyframes-finite": "Give three finite numbers a key, radians.",
}


def _control_faults(part: Control, call: str, bench: _Bench) -> Faults:
    header, faults = adapter_header(part.adapter, "Name the adapter of a skill that is trained.", bench.base)
    for fault in faults:
        yield ContractError("control-adapter", f"{call}: {fault.message}", fault.remedy)
    if not header:
        return
    trained = ranges(header)
    if set(part.values) != set(trained):
        message = f"{call} commands {', '.join(part.values) or 'nothing'}; its adapter takes "
        remedy = "Give one value for each parameter that the adapter's header names."
        yield ContractError("control-values", f"{message}{', '.join(trained) or 'nothing'}.", remedy)
        return
    for name, value in part.values.items():
        if not within(value, *trained[name]):
            centre, scale = trained[name]
            message = f"{call} commands {name}={value:.3g}; its adapter was trained on "
            remedy = "Command what lies in it: metres and radians."
            yield ContractError("control-range", f"{message}{centre - scale:.3g} to {centre + scale:.3g}.", remedy)


def _pose_faults(part: Keyframes, call: str, pose: Motion) -> Faults:
    motion = part.over(pose)
    angles = np.degrees(np.linalg.norm(motion.rotations - pose.rotations[-1], axis=-1))
    for index, joint in enumerate(JOINTS[1:], 1):
        limit = next(most for kind, most in _LIMITS.items() if kind in joint)
        back = -np.degrees(motion.rotations[:, index, 0].min()) if "knee" in joint else 0.0
        if angles[:, index].max() > limit or back > _KNEE_BACK:
            most = f"{limit} degrees" if back <= _KNEE_BACK else f"{_KNEE_BACK:g} degrees backwards"
            message = f"{call} turns {joint} by {max(angles[:, index].max(), back):.0f} degrees; it turns by {most}."
            yield ContractError("joint-limits", message, "Turn it less.")
    speeds = _speeds(pose[-1:].then(motion))
    fastest = int(speeds.max(0).argmax())
    if speeds.max() > SPEED_LIMIT:
        message = f"{call} turns {JOINTS[fastest]} by {speeds.max():.0f} degrees a second; bodies stay below"
        yield ContractError("joint-speed", f"{message} {SPEED_LIMIT:g}.", "Give it more time.")


def _speeds(motion: Motion) -> Array:
    """(T - 1, 24) degrees a second of every joint."""
    turned = matrix_from_vector(motion.rotations)
    steps = vector_from_matrix(turned[:-1].swapaxes(-1, -2) @ turned[1:])
    return np.asarray(np.degrees(np.linalg.norm(steps, axis=-1)) * FPS)


# -- playing it --------------------------------------------------------------------------------------------------------
def _play(
    skill: Skill, calls: Sequence[dict[str, Any]], bench: _Bench
) -> tuple[tuple[ContractError, ...], tuple[str, ...], tuple[str, ...]]:
    """Faults, the engines that played it, and notes of those that could not."""
    real = Skill(**{name: getattr(skill, name) for name in skill.__dataclass_fields__})
    faults = [*_on_fake(real, calls, bench)]
    engines: list[str] = []
    notes: list[str] = []
    names = [one.name for one in bench.plugins.registered("simulators")] if bench.engines is None else bench.engines
    for name in names:
        try:
            faults += _on_engine(name, real, calls, bench)
            engines.append(name)
        except HumanclawError as error:
            notes.append(f"not played on {name}: {error}")
    return tuple(faults), tuple(engines), tuple(notes)


def _on_fake(skill: Skill, calls: Sequence[dict[str, Any]], bench: _Bench) -> Faults:
    with fake_body(skill, measures=_own(bench.measures), seed=bench.seed) as body:
        for params in calls:
            call = Call(skill.name, skill.check(params))
            try:
                once, again = (bench.play(partial(_afresh, body, call, bench.seed)) for _ in range(2))
            except (Exception, SystemExit) as error:
                message = f"{call} raises {in_words(error)}."
                yield ContractError("body-plays", message, "Mend its motion.")
                continue
            if any(len(chunk.commanded) != FUTURE for chunk in once.chunks) or not _is_finite(once):
                yield ContractError("body-plays", f"{call} is no motion of whole chunks.", "Mend its motion.")
            if not _same(once, again):
                message = f"{call} at the same moment is another motion."
                yield ContractError("body-repeats", message, "Plan from the parameters alone.")


def _own(measures: Mapping[str, Measure]) -> list[Measure]:
    return [one for name, one in measures.items() if name not in MEASURES]


def _afresh(body: Body, call: Call, seed: int) -> SkillExecution:
    body.reset(body.scene, seed=seed)
    return body.execute(call)


def _is_finite(done: SkillExecution) -> bool:
    motions = [motion for chunk in done.chunks for motion in (chunk.commanded, chunk.execution.simulated)]
    return all(np.isfinite(one.root).all() and np.isfinite(one.rotations).all() for one in motions)


def _same(one: SkillExecution, other: SkillExecution) -> bool:
    return len(one.chunks) == len(other.chunks) and all(
        np.array_equal(a.commanded.root, b.commanded.root)
        and np.array_equal(a.commanded.rotations, b.commanded.rotations)
        for a, b in zip(one.chunks, other.chunks, strict=True)
    )


def _on_engine(name: str, skill: Skill, calls: Sequence[dict[str, Any]], bench: _Bench) -> Faults:
    """Play every call from standing on a floor. Raises HumanclawError if the engine cannot be had."""
    host = _host(name, skill, bench)
    moves = any(isinstance(part, Control) for params in calls for part in _parts(skill, params))
    backends = Backends(name, FAKE, "dit" if moves else FAKE)
    try:
        body = Body(fake_scene(), plugins=host, backends=backends)  # It takes up its stance: the engine has moved it.
    except HumanclawError:
        raise
    except Exception as error:
        message = f"standing on {name} raises {in_words(error)}."
        yield ContractError("engine-plays", message, "Mend the engine, or name others with --engine.")
        return
    with body:
        yield from _engine_faults(body, skill, calls, bench)


def _engine_faults(body: Body, skill: Skill, calls: Sequence[dict[str, Any]], bench: _Bench) -> Faults:
    name = body.backends.simulator
    for params in calls:
        call = Call(skill.name, skill.check(params))
        try:
            done = bench.play(partial(_afresh, body, call, bench.seed))
        except (Exception, SystemExit) as error:
            yield ContractError("engine-plays", f"{call} on {name} raises {in_words(error)}.", "Mend its motion.")
            return
        end = done.chunks[-1].execution.simulated.root[-1]
        if not _is_finite(done) or np.abs(end).max() > _FAR:
            message = f"{call} on {name} ends at {np.round(end, 2).tolist()}."
            yield ContractError("engine-finite", message, "Mend its motion.")


def _parts(skill: Skill, params: Mapping[str, Any]) -> tuple[Part, ...]:
    return parts(skill.plan(skill.check(params)))


def _host(engine: str, skill: Skill, bench: _Bench) -> Plugins:
    """Return a host with one engine and one skill, and fakes for the rest."""
    host = Plugins()
    host.add(Fakes([skill], _own(bench.measures)), FAKE)
    for kind, name in (("simulators", engine), ("motion_generators", "dit")):
        for one in bench.plugins.registered(kind):
            if one.name == name:
                host.add(_Borrowed(kind, name, one.value), f"{FAKE}-{kind}")
    return host


class _Borrowed:
    """A plugin that registers one factory of another host."""

    def __init__(self, kind: str, name: str, factory: Callable[..., Any]) -> None:
        def borrow(register: Callable[..., None]) -> None:
            register(name, factory)

        setattr(self, f"humanclaw_{kind}", hookimpl(borrow))


# -- what is to be checked ---------------------------------------------------------------------------------------------
def found_at(
    target: str, plugins: Plugins, patience: float = LOADING
) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    """Return the skills that a name, a folder or a Python file stands for, the measures that come with them, and why
    there are none.

    target: the name of an installed skill (owner:skill where two have it), the folder of one or of several, or a file
    with a hook humanclaw_skills. patience: seconds that importing it may take. Raises PluginError for a name that
    nobody knows.
    """
    path = Path(target)
    if path.suffix == ".py" or path.is_file():
        return _in_file(path.parent if path.name == "schema.json" else path, patience)
    if path.is_dir():
        return _in_file(path, patience)
    return [plugins.offered("skills", target)], {}, []


def check_target(target: str, plugins: Plugins, **options: Any) -> list[Report]:
    """Examine all that a name, a folder or a Python file stands for; options are those of examine.

    Raises PluginError for a name that nobody knows.
    """
    skills, measures, faults = found_at(target, plugins)
    known = {**plugins.measures, **measures}
    reports = [examine(one, known, plugins=plugins, **options) for one in skills]
    return [*reports, *([Report(target, tuple(faults))] if faults else [])]


def _in_file(
    path: Path, patience: float = LOADING
) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    if path.is_dir():
        folders = sorted(one.parent for one in path.rglob("schema.json")) or [path]
        return [*folders], {}, []
    try:
        return Bounded(patience)(partial(_loaded, path))
    except OverdueError as error:
        return [], {}, [ContractError("loads", f"plugin file {path}: {error}.", "Do nothing long at import.")]
    except ContractError as error:
        return [], {}, [error]
    except PluginError as error:
        cause = error.__cause__
        fault = (
            cause
            if isinstance(cause, ContractError)
            else ContractError("loads", error.message, error.remedy or "Mend the file.")
        )
        return [], {}, [fault]


def _loaded(path: Path) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    module = load_file(path)
    check_api(getattr(module, "HUMANCLAW_API", API_VERSION), path.stem)
    return _registered(module)


def _registered(module: ModuleType) -> tuple[list[Skill | Path], dict[str, Measure], list[ContractError]]:
    """Return what the hooks of a plugin's module register."""
    skills: list[Skill | Path] = []
    measures: list[Measure] = []
    for hook, found in (("humanclaw_skills", skills), ("humanclaw_measures", measures)):
        try:
            getattr(module, hook, lambda register: None)(register=found.append)
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # As the plugin host does: not even SystemExit ends the program.
            message = f"{module.__name__} raises {in_words(error)} in {hook}."
            return [], {}, [ContractError("loads", message, "Mend the hook.")]
    odd = [one for one in skills if not isinstance(one, Skill | Path)]
    if odd or not skills:
        message = f"register() got {odd[0]!r}." if odd else f"{module.__name__} registers no skill."
        remedy = "Register a Skill or its folder in a hook: @hookimpl def humanclaw_skills(register): register(...)."
        return [], {}, [ContractError("loads", message, remedy)]
    return skills, {one.name: one for one in measures}, []
