"""Metrics over many episodes: rates and means, their intervals, and paired differences."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import Final, Literal

import numpy as np

from humanclaw import EpisodeSpec, RecordError
from humanclaw_bench.oneself import KNOWLEDGE, STAGE
from humanclaw_bench.scores import Scores
from humanclaw_bench.statistics import Difference, Estimate, compare_rates, compare_ratios, holm, rate, ratio


@dataclass(frozen=True)
class Column:
    """A column of a table, and how its numbers are written."""

    name: str
    better: Literal["higher", "lower", ""] = ""
    percent: bool = False
    digits: int = 1
    meaning: str = ""
    """What a short name means, for a page's reader; empty if the name says it. The README has the definitions."""

    @property
    def head(self) -> str:
        return self.name + {"higher": " \u2191", "lower": " \u2193", "": ""}[self.better]

    def number(self, value: float) -> str:
        if not np.isfinite(value):
            return "\u2013"
        text = f"{100 * value if self.percent else value:.{self.digits}f}"
        return (text if text.strip("-0.") else text.lstrip("-")) + "%" * self.percent  # Avoid "-0.0".

    def interval(self, estimate: Estimate) -> str:
        """Return the interval as text, such as [38.1, 46.9]; empty without one."""
        if not np.isfinite([estimate.low, estimate.high]).all():
            return ""
        low, high = (self.number(bound).rstrip("%") for bound in (estimate.low, estimate.high))
        return f"[{low}, {high}]"

    @property
    def rounded(self) -> Column:
        """The column with per cents in whole numbers, which makes room for more columns."""
        return replace(self, digits=0 if self.percent else self.digits)


@dataclass(frozen=True, kw_only=True)
class Metric(Column):
    """A measured column: the sum of numerators over the sum of denominators, one pair for each episode."""

    parts: Callable[[Scores], tuple[float, float] | None]
    """Return numerator and denominator of an episode; None if the metric does not apply to it."""
    rate: bool = False
    """Whether it is a rate: each episode is one trial."""


def _rate(name: str, field: str, meaning: str = "") -> Metric:
    def parts(scores: Scores) -> tuple[float, float] | None:
        met = getattr(scores, field)
        return None if met is None else (float(met), 1.0)

    return Metric(name=name, better="higher", parts=parts, rate=True, percent=True, meaning=meaning)


def _stage(name: str, field: str, meaning: str) -> Metric:
    """Return the rate of a stage of tasks for hands."""

    def parts(scores: Scores) -> tuple[float, float] | None:
        return (float(scores.hands[field]), 1.0) if field in scores.hands else None

    return Metric(name=name, better="higher", parts=parts, rate=True, percent=True, meaning=meaning)


def _mean(
    name: str, value: Callable[[Scores], float], digits: int = 1, *, better: Literal["higher", "lower", ""] = "lower",
    percent: bool = False, meaning: str = "",
) -> Metric:  # fmt: skip
    def parts(scores: Scores) -> tuple[float, float] | None:
        number = value(scores)
        return (number, 1.0) if np.isfinite(number) else None

    return Metric(name=name, better=better, parts=parts, percent=percent, digits=digits, meaning=meaning)


def _collision(name: str, group: str, meaning: str = "") -> Metric:
    return _mean(name, lambda s: s.collisions[group], percent=True, meaning=meaning)


FIND: Final = _rate("FindSR", "find", "the target was in view, and the agent said so")
NAV: Final = _rate("NavSR", "nav", "stopped within 0.2 m of the target")
INTERACT: Final = _rate("InteractSR", "interact", "sat on the target and stopped there")
ARRIVE: Final = _rate("ArriveSR", "arrive", "NavSR with the whole body there, not a hand through a wall")
"""The headline of navigation: the paper's NavSR also counts a body behind a wall, and an outstretched arm."""
COLLISIONS: Final = _collision("Coll.", "any", "share of the half seconds in motion that touch an object")
UNASKED: Final = Metric(
    "unasked", "lower", parts=lambda s: (s.unasked, s.verified) if s.verified else None, percent=True
)
"""Share of the calls to verify that passed unverified."""
COST: Final = (
    Metric("in tok/step", "lower", parts=lambda s: (s.tokens_in, s.steps), digits=0),
    Metric("out tok/step", "lower", parts=lambda s: (s.tokens_out, s.steps), digits=0),
    _mean("tok/episode", lambda s: s.tokens_in + s.tokens_out, 0, meaning="tokens read and written"),
    _mean("cost ($)", lambda s: s.cost, 3),
    Metric("reasoning tok/step", "lower", parts=lambda s: (s.tokens_reasoning, s.steps), digits=0),
    UNASKED,
)  # fmt: skip
"""Tokens and cost of models."""
FALSE_CLAIMS: Final = _mean("false claims", lambda s: s.false_claims, percent=True)
"""The price of FindSR for an agent that always claims to see its target."""
REFUSED: Final = Metric(
    "refused", "lower", parts=lambda s: (s.refused, s.answers) if s.answers else None, percent=True,
    meaning="share of the agent's answers without a usable call",
)  # fmt: skip
MAIN: Final = (
    FIND, FALSE_CLAIMS, NAV, ARRIVE, INTERACT, COLLISIONS,
    _mean("#Dtb", lambda s: s.displaced, 2, meaning="objects displaced in an episode"),
    Metric(
        "dDtb (m)", "lower", digits=2, meaning="how far they were displaced",
        parts=lambda s: (s.displacement, s.displaced),
    ),
    _mean("Jerk", lambda s: s.jerk, meaning="roughness of the body's path, m/s\u00b3"),
    REFUSED,
    _mean("steps", lambda s: s.steps, better=""),
    _mean("motion (s)", lambda s: s.motion, better=""),
    *COST,
    _mean("SPL", lambda s: s.spl, 3, better="higher", meaning="NavSR, less for detours"),
    _mean("SoftSPL", lambda s: s.soft_spl, 3, better="higher", meaning="share of the way covered, less for detours"),
)  # fmt: skip
"""Columns of the paper's main table, and the cost."""
VARIANTS: Final = (
    FIND, _rate("GeoFindSR", "geo_find"), NAV, _rate("GeoNavSR", "geo_nav"), _rate("NavSR@1m", "nav_1m"),
    INTERACT, _rate("GeoInteractSR", "geo_interact"),
)  # fmt: skip
BODY: Final = (
    COLLISIONS, _collision("Arm/Hand", "arm_hand"), _collision("Torso", "torso"), _collision("Leg/Foot", "leg_foot"),
    _collision("Head", "head"),
)  # fmt: skip
OWN: Final = (
    Metric(
        "landing", "higher", percent=True,
        parts=lambda s: None if s.find is None else (float(bool(s.nav)), float(s.find)),
    ),
    _mean("reversals", lambda s: s.reversals, percent=True),
    _rate("near at the end", "ends_near"), _collision("Coll. fixed", "fixed"),
    _collision("people", "person", "share of the half seconds in motion that touch another body"),
    _mean("disturbed", lambda s: s.disturbed, 2),
    Metric("path (m)", "lower", parts=lambda s: (s.disturbed_path, s.disturbed), digits=2),
    _mean("falls", lambda s: s.falls, 2),
    _mean("rigid jerk", lambda s: s.rigid_jerk),
    _mean("Brier", lambda s: s.brier, 3, meaning="squared error of the success that the agent expected"),
)  # fmt: skip
"""Figures of the paper's text (landing rate: NavSR over FindSR; turn reversals), other readings of GeoNavSR, Coll.,
#Dtb, dDtb and Jerk, and the Brier score of the success that the agent expected."""
SOLVED: Final = _rate("solved", "done", "the goal was met, whatever was said before")
TASKS: Final = (SOLVED, *(metric for metric in MAIN if metric.name in ("FindSR", "NavSR", "Coll.", "refused", "steps")))
"""Columns of tasks of one's own."""
HANDS: Final = (
    FIND, NAV,
    _stage("ReachSR", "reach", "a hand came to the thing"),
    _stage("HoldSR", "hold", "a hand held it"),
    _stage("PlaceSR", "place", "it lay where it should, let go"),
    _stage("OpenSR", "open", "the furniture stood open"),
    _stage("AnswerSR", "answer", "looked inside and answered right"),
    SOLVED,
    _mean("dropped", lambda s: np.nan if s.dropped is None else s.dropped, 2, meaning="things lost from a hand"),
    COLLISIONS,
)  # fmt: skip
"""Columns of tasks for hands; the first seven count a stage after those before it."""
ALONE: Final = tuple(
    _stage(f"Geo{stage.capitalize()}SR", f"geo_{stage}", "by itself, whatever came before and was said")
    for stage in ("reach", "hold", "place", "open", "answer")
)
"""Stages of tasks for hands by themselves."""
SELF: Final = (*(_stage(f"{kind}?", STAGE + kind, about) for kind, about in KNOWLEDGE.items()), SOLVED)
"""Columns of questions about oneself: an agent's profile."""


def _touched(scores: Scores) -> float:
    """Return the steps that touch the partner; NaN where a hand is to meet the partner's."""
    return np.nan if "give" in scores.hands else scores.touched


TWO: Final = (
    _stage("ViewSR", "find", "the partner was in view"),
    _stage("MeetSR", "meet", "stopped within 1 m of the partner, who was in view within 45 degrees"),
    _stage("KeepSR", "keep", "stayed within 2 m of the walking partner, without a touch"),
    _stage("EndSR", "end", "and stopped once the partner had arrived"),
    _stage("HoldSR", "hold", "held what the partner asked for"),
    _stage("GiveSR", "give", "and gave it into the partner's hand"),
    SOLVED,
    _mean("motion (s)", lambda s: s.motion, better=""),
    _mean("apart (m)", lambda s: s.apart, 2, better="", meaning="mean distance to the partner"),
    _mean("touched", _touched, 2, meaning="steps that touch a partner to whom nothing is to be given"),
    _mean("words", lambda s: s.words, better="", meaning="words said"),
    COLLISIONS,
)  # fmt: skip
"""Columns of tasks with a partner."""
ALL: Final = tuple(
    {metric.name: metric for metric in (*MAIN, *VARIANTS, *BODY, *OWN, *HANDS, *ALONE, *SELF, *TWO)}.values()
)
"""Every metric once by name: tables share `motion (s)` and `HoldSR`."""


def extra_metric(name: str) -> Metric:
    """Return the column of a plugin's metric, averaged over episodes."""
    return _mean(name, lambda s: s.extra.get(name, np.nan), 3, better="")


def estimate(metric: Metric, scores: Sequence[Scores]) -> Estimate:
    """Return a metric over the finished episodes among these, with its interval."""
    known = [(pair, s) for s in scores if s.finished and (pair := metric.parts(s)) is not None]
    parts, houses = [pair for pair, _ in known], houses_of(s for _, s in known)
    if metric.rate:
        return rate([bool(met) for met, _ in parts], houses)
    return ratio([above for above, _ in parts], [below for _, below in parts], houses)


def houses_of(scores: Iterable[Scores]) -> list[str]:
    """Return the house of each score, by which intervals are clustered. What was put into it follows a "?"."""
    return [s.scene.partition("?")[0] for s in scores]


def compare(a: Sequence[Scores], b: Sequence[Scores]) -> dict[str, Difference]:
    """Compare run B with run A over the episodes that both finished, by metric name.

    p is corrected for the number of metrics (Holm), separately for FindSR, ArriveSR (without measured ways NavSR) and
    InteractSR, and for the rest, so that many side results do not hide the main ones.

    Raises RecordError if the runs share no episode, if one holds an episode twice, or if an episode differs.
    """
    pairs = common(a, b)
    differences: dict[str, Difference] = {}
    for metric in ALL:
        if difference := difference_of(metric, pairs):
            differences[metric.name] = difference
    way = ARRIVE if ARRIVE.name in differences else NAV
    headline = {metric.name: differences[metric.name] for metric in (FIND, way, INTERACT) if metric.name in differences}
    rest = {name: difference for name, difference in differences.items() if name not in headline}
    raised = [zip(family, holm(tuple(family.values())), strict=True) for family in (headline, rest)]
    return dict(chain(*raised))


def difference_of(metric: Metric, pairs: Sequence[tuple[Scores, Scores]]) -> Difference | None:
    """Compare one metric of B with A over the episodes to which it applies in both; None if there are none."""
    known = [(first, second, x) for x, y in pairs if (first := metric.parts(x)) and (second := metric.parts(y))]
    a, b = [first for first, _, _ in known], [second for _, second, _ in known]
    houses = houses_of(x for _, _, x in known)
    if metric.rate and known:
        return compare_rates([bool(met) for met, _ in a], [bool(met) for met, _ in b], houses)
    return compare_ratios(a, b, houses) if known else None


def common(a: Sequence[Scores], b: Sequence[Scores]) -> list[tuple[Scores, Scores]]:
    """Return pairs of the episodes that both runs finished. Raises RecordError as compare() does."""
    first, second = _by_episode(a), _by_episode(b)
    pairs = [(first[key], second[key]) for key in first if key in second]
    if not pairs:
        raise RecordError("the two runs share no finished episode.", "Compare runs of the same split.")
    for in_a, in_b in pairs:
        if unlike := _unlike(in_a, in_b):
            raise RecordError(
                f"episode {in_a.episode} is not the same in both runs: {', '.join(unlike)}.",
                "Compare runs of the same split and the same version of its scenes.",
            )
    return pairs


def _unlike(first: Scores, second: Scores) -> list[str]:
    """Return the fields in which two episodes differ, such as 'seed (0 and 99)'."""
    pairs: dict[str, tuple[object, object]] = {}
    if first.spec and second.spec:
        pairs = {name: (getattr(first.spec, name), getattr(second.spec, name)) for name in EpisodeSpec.model_fields}
    pairs |= {name: (getattr(first, name), getattr(second, name)) for name in ("category", "scene_digest")}
    return [f"{name} ({_short(a)} and {_short(b)})" for name, (a, b) in pairs.items() if a != b]


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 60 else f"{text[:12]}..."


def _by_episode(scores: Sequence[Scores]) -> dict[str, Scores]:
    by_name: dict[str, Scores] = {}
    for each in scores:
        if each.finished and each.episode in by_name:
            raise RecordError(
                f"a run holds episode {each.episode} twice, so it is not clear which one to pair.",
                "Name a folder with one agent's run of each episode.",
            )
        if each.finished:
            by_name[each.episode] = each
    return by_name
