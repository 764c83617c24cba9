"""Examine a skill: every check of the contract, then its calls, its plans and its motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from humanclaw.body.pose import HISTORY, Motion, rest_pose
from humanclaw.checks.bounded import bounded
from humanclaw.checks.following import followed, following_faults, weight_faults
from humanclaw.checks.playing import Bench, Faults, played_faults
from humanclaw.checks.quality import motion_faults, moves
from humanclaw.checks.sampling import illegal_calls, legal_calls, missing_bounds, values_of
from humanclaw.errors import CallError, ContractError, in_words
from humanclaw.plugins.host import Plugins
from humanclaw.skills.adapter_checks import adapter_header, ranges, within
from humanclaw.skills.checks import read_draft, skill_faults
from humanclaw.skills.contract import Skill, untrained
from humanclaw.skills.measures import MEASURES, Measure
from humanclaw.skills.plan import Control, MotionError
from humanclaw.skills.plan_motion import Part
from humanclaw.skills.proprioception import ProprioceptiveState

_UNCALLABLE: Final = frozenset(
    {"loads", "schema-file", "schema", "bounds-order", "choices", "required-declared", "defaults-given",
     "defaults-legal"}
)  # fmt: skip
"""Faults that leave no legal call."""
PATIENCE: Final = 10.0
"""Seconds that planning one call may take: the maximum length of a call."""
PLAYING: Final = 120.0
"""Seconds that one engine may take to play one call, also on a busy machine."""


@dataclass(frozen=True)
class Report:
    """Result of checking one skill. It passes if there are no faults."""

    skill: str
    faults: tuple[ContractError, ...]
    calls: int = 0
    """Number of legal calls that were played."""
    engines: tuple[str, ...] = ()
    """Engines that played them, besides the fake one."""
    notes: tuple[str, ...] = ()
    """Checks that could not run, and why."""

    @property
    def passed(self) -> bool:
        return not self.faults


def check_skill(
    skill: Skill | Path,
    measures: Mapping[str, Measure] = MEASURES,
    *,
    engines: Sequence[str] | None = None,
    samples: int = 3,
    seed: int = 0,
    trained: bool = False,
) -> Skill:
    """Check a skill, or a skill folder, as `humanclaw check` does, and return the skill.

    Args:
        measures: measures that parameters may command; Plugins.measures includes those of plugins.
        engines: simulators that play the skill besides the fake one; None for all installed ones.
        samples: number of calls to play besides those at the bounds.
        trained: require an adapter; otherwise an untrained skill is checked as far as its files go.

    Raises AssertionError with all problems, each with its check and remedy.
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
    """Return a report on a skill; like check_skill, but it raises nothing.

    patience, playing: seconds that planning a call and playing it may take.
    """
    if plugins is None:
        plugins = Plugins() if engines == () else Plugins.discover()
    bench = Bench(plugins, measures, engines, samples, seed, patience, playing)
    if isinstance(skill, Skill):
        return _examined(skill, bench, ())
    draft, unreadable = read_draft(skill)
    return _examined(draft, bench, unreadable) if draft else Report(skill.name, unreadable)


def _examined(skill: Skill, bench: Bench, unreadable: Sequence[ContractError]) -> Report:
    said = (*unreadable, *skill_faults(skill, bench.measures, bench.plugins.priors))
    if skill.adapter and not skill.adapter.is_file():
        missing = untrained(skill)
        said += (ContractError("adapter-there", missing.message, missing.remedy),)
    if not said:
        said = tuple(weight_faults(skill, bench))
    if {fault.check for fault in said} & _UNCALLABLE:
        return Report(skill.name, said)
    calls = [*_distinct(legal_calls(skill, bench.samples, bench.seed))]
    called = (*_refusal_faults(skill), *_plan_faults(skill, calls, bench))
    if said or called:
        return Report(skill.name, _once((*said, *called)), notes=tuple(_untold(skill)))
    played, engines, notes = played_faults(skill, calls, bench)
    faults = _once((*said, *called, *played, *following_faults(skill, followed(skill, bench))))
    return Report(skill.name, faults, len(calls), engines, (*_untold(skill), *notes))


def _once(faults: Sequence[ContractError]) -> tuple[ContractError, ...]:
    """Return one fault for each check and message: a skill often fails at both bounds in the same way."""
    return tuple({(fault.check, fault.message): fault for fault in reversed(faults)}.values())[::-1]


def _distinct(calls: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    seen: list[dict[str, Any]] = []
    for call in calls:
        if call not in seen:
            seen.append(call)
            yield call


def _untold(skill: Skill) -> Iterator[str]:
    """Yield a note for everything that an adapter's header does not state."""
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
        message = f"skill {skill.name!r} takes {params}."
        yield ContractError(check, message, "Say type and bounds of each parameter in the schema.")


def _plan_faults(skill: Skill, calls: Sequence[dict[str, Any]], bench: Bench) -> Faults:
    faults: dict[str, ContractError] = {}
    for params in calls:
        # A number without bounds is called with huge values: these explain its faults better than any other remedy.
        missing = missing_bounds(skill, params)
        remedy = f"Give bounds: {missing}." if missing else ""
        for fault in _call_faults(skill, params, bench):
            faults.setdefault(fault.check, ContractError(fault.check, fault.message, remedy or fault.remedy))
        if faults.keys() & {"plan-runs", "body-plays"}:
            break  # One call that never returns is waited for, not each of them.
    yield from faults.values()
    if not faults and skill.schema.get("properties"):
        yield from _idle_faults(skill, calls)


def _idle_faults(skill: Skill, calls: Sequence[dict[str, Any]]) -> Faults:
    """Yield parameters that change nothing, and a default that moves nothing while other calls do."""
    feeling = ProprioceptiveState.of(rest_pose(HISTORY))

    def plan(params: Mapping[str, Any]) -> tuple[Part, ...]:
        return skill.planned(skill.check(params), feeling)

    for key in skill.schema.get("properties", {}):
        pairs = [(call, call | {key: value}) for call in calls for value in values_of(skill, key)]
        if pairs and all(repr(plan(plain)) == repr(plan(other)) for plain, other in pairs):
            message = f"parameter {key!r} of skill {skill.name!r} changes nothing."
            yield ContractError("parameters-used", message, "Use it, or remove it.")
    given = [call for call in calls if set(call) <= set(skill.schema.get("required", ()))]
    if given and not moves(plan(given[0])) and any(moves(plan(call)) for call in calls):
        message = f"skill {skill.name!r} does nothing with its defaults."
        yield ContractError("default-moves", message, "Choose defaults that move.")


def _call_faults(skill: Skill, params: Mapping[str, Any], bench: Bench) -> Faults:
    """Yield the faults of one legal call."""
    call = f"{skill.name}({', '.join(f'{key}={value}' for key, value in params.items())})"
    try:
        checked = skill.check(params)
    except CallError as error:
        message = f"the schema of skill {skill.name!r} refuses a call at its own bounds: {error}"
        yield ContractError("accepts-bounds", message, "Mend bounds and pattern.")
        return
    feeling = ProprioceptiveState.of(rest_pose(HISTORY))
    try:
        plan, again = (bounded(bench.patience, lambda: skill.planned(checked, feeling)) for _ in range(2))
    except MotionError as error:
        yield ContractError(error.check, f"{call}: {error}.", _REMEDIES.get(error.check, "Mend the keyframes."))
        return
    except (Exception, SystemExit) as error:
        message = f"{call} raises {in_words(error)}."
        yield ContractError("plan-runs", message, "Mend the function, or bound the parameters that it cannot plan.")
        return
    if repr(plan) != repr(again):  # Keyframes may hold arrays, which == compares elementwise.
        message = f"{call} is planned otherwise the second time."
        yield ContractError("plan-repeats", message, "Plan from the parameters alone: no clock, no random numbers.")
    yield from _execution_faults(skill, call, checked, plan, bench)


def _execution_faults(
    skill: Skill, call: str, params: Mapping[str, Any], plan: tuple[Part, ...], bench: Bench
) -> Faults:
    """Yield the faults of what a call commands, and of its motion. plan: that of a standing body."""

    def from_pose(pose: Motion) -> tuple[Part, ...]:
        return skill.planned(params, ProprioceptiveState.of(pose)) if skill.feels else plan

    for part in plan:
        # The skill's own adapter has been checked against its schema already.
        if isinstance(part, Control) and part.adapter != skill.adapter:
            yield from _control_faults(part, call, bench)
    try:
        yield from bounded(bench.playing, lambda: tuple(motion_faults(from_pose, call)))
    except (Exception, SystemExit) as error:
        yield ContractError("body-plays", f"{call} raises {in_words(error)}.", "Plan for every pose of the body.")


_REMEDIES: Final = {
    "duration": "Bound the parameters that set how long it lasts.",
    "plan-kind": "Return a Control, Keyframes, a Reach, a Gaze, a Grip, a Speech, a Motion, or a list of them.",
    "aim-hand": "Name the left or the right hand.",
    "aim-finite": "Give three finite numbers, metres in the body's frame.",
    "motion-finite": "Give one frame or more of finite numbers.",
    "control-adapter": "Name the adapter of a skill that is trained.",
    "control-values": "Give one value for each parameter that the adapter's header names.",
    "control-finite": "Command finite numbers: metres and radians.",
    "keyframes-joints": "Name a joint of the body, and its axis: x, y or z.",
    "keyframes-times": "Begin at 0 and increase, with one key a time.",
    "keyframes-finite": "Give three finite numbers a key, radians.",
    "joint-limits": "Turn it less.",
}


def _control_faults(part: Control, call: str, bench: Bench) -> Faults:
    header, faults = adapter_header(part.adapter, "Name the adapter of a skill that is trained.", bench.plugins.priors)
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
