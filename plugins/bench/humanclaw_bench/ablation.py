"""The paper's ablation (table 3), with a model or with a scripted agent in its place.

With a model, ten settings of the harness are played and their rows stand beside the paper's. The scripted agent is a
check that the benchmark responds: a bounded agent (humanclaw_scripted.faulty) plays the same episodes under five
settings. The four directions of the paper must result from how the agent works; nothing in this module makes a success
rate fall.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from humanclaw import Backends, RecordError
from humanclaw_bench.metrics import FIND, INTERACT, NAV, Metric, common, difference_of, estimate
from humanclaw_bench.scores import Scores
from humanclaw_bench.statistics import Difference, holm
from humanclaw_bench.worker import Job

AGENT: Final = "faulty"
VERIFIER: Final = "oracle"
LEVEL: Final = 0.01


@dataclass(frozen=True)
class Setting:
    """A row of the ablation. falls: the rates that are lower than the baseline's in the paper."""

    name: str
    options: Mapping[str, Any] = field(default_factory=dict)
    verifier: str = VERIFIER
    falls: tuple[Metric, ...] = ()

    def job(self, backends: Backends) -> Job:
        """Return the job of this row."""
        return Job(AGENT, {"bounded": True} | dict(self.options), self.verifier, backends)


BASELINE: Final = Setting("baseline")
SETTINGS: Final = (
    BASELINE,
    Setting("no-verifier", verifier="", falls=(NAV, INTERACT)),
    Setting("no-mid-level", {"mid_level": False}, falls=(INTERACT,)),
    Setting("history-0", {"history": 0}, falls=(NAV, INTERACT)),
    Setting("images-10", {"images": 10}, falls=(NAV,)),
)


MODEL_SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "baseline": {},
    **{f"history {steps}": {"history": steps} for steps in (0, 20, 50, 100)},
    **{f"images {count}": {"images": count} for count in (2, 5, 10)},
    "without verifier": {"verifier": ""},
    "without mid-level": {"mid_level": False},
}
"""The rows of the paper's table by name: what differs from `--profile paper`."""
FURTHER_SETTINGS: Final[Mapping[str, Mapping[str, Any]]] = {
    "memory notes": {"memory": "notes"},
    "memory map": {"memory": "map"},
}
"""Rows that the paper does not have; they are played if named."""


def model_jobs(
    options: Mapping[str, Any], limits: Mapping[str, float], names: Sequence[str] = tuple(MODEL_SETTINGS)
) -> dict[str, Job]:
    """Return the jobs of these rows. options: of agent and verifier, the model included."""
    found, known = {}, {**MODEL_SETTINGS, **FURTHER_SETTINGS}
    for name in names:
        changed = known[name]
        given = {"profile": "paper", **options, **changed}
        verifier = given.pop("verifier", "litellm")
        found[name] = Job("litellm", given, verifier, Backends(profile="paper"), limits)
    return found


@dataclass(frozen=True)
class Finding:
    """One direction of the paper: a rate under a setting compared with the baseline's."""

    setting: str
    metric: str
    difference: Difference

    @property
    def reproduced(self) -> bool:
        return self.difference.value < 0 and self.difference.p < LEVEL


def findings(scores: Mapping[str, Sequence[Scores]]) -> tuple[Finding, ...]:
    """Return every direction, from the scored episodes by setting. p is corrected for their number (Holm).

    Raises RecordError if a setting shares no episode with the baseline.
    """
    asked = [(setting, metric) for setting in SETTINGS for metric in setting.falls]
    raw = [_difference(scores[BASELINE.name], scores[setting.name], metric) for setting, metric in asked]
    return tuple(
        Finding(setting.name, metric.name, found) for (setting, metric), found in zip(asked, holm(raw), strict=True)
    )


def _difference(a: Sequence[Scores], b: Sequence[Scores], metric: Metric) -> Difference:
    found = difference_of(metric, common(a, b))
    if found is None:
        said = f"{metric.name} applies to no episode that both settings finished."
        raise RecordError(said, "Run a split with such episodes.")
    return found


def markdown(scores: Mapping[str, Sequence[Scores]]) -> str:
    """Return the rates of every setting and the paper's directions with their p, as Markdown."""
    lines = ["| setting | episodes | FindSR | NavSR | InteractSR |", "| --- | --- | --- | --- | --- |"]
    for setting in SETTINGS:
        rates = " | ".join(_rate(metric, scores[setting.name]) for metric in (FIND, NAV, INTERACT))
        lines.append(f"| {setting.name} | {len(scores[setting.name])} | {rates} |")
    lines += ["", "| direction | baseline | setting | p | reproduced |", "| --- | --- | --- | --- | --- |"]
    for found in findings(scores):
        d = found.difference
        lines.append(
            f"| {found.setting}: {found.metric} falls | {100 * d.a:.1f} % | {100 * d.b:.1f} % | {d.p:.2g} | "
            f"{'yes' if found.reproduced else 'no'} |"
        )
    return "\n".join(lines)


def plain(scores: Mapping[str, Sequence[Scores]]) -> dict[str, Any]:
    """Return the same for JSON: rates as fractions, None without episodes."""
    rates = {
        setting.name: {"episodes": len(scores[setting.name])}
        | {metric.name: _share(metric, scores[setting.name]) for metric in (FIND, NAV, INTERACT)}
        for setting in SETTINGS
    }
    directions = [
        {"setting": one.setting, "metric": one.metric, "baseline": one.difference.a, "with": one.difference.b,
         "p": one.difference.p, "reproduced": one.reproduced}
        for one in findings(scores)
    ]  # fmt: skip
    return {"settings": rates, "directions": directions}


def _share(metric: Metric, scores: Sequence[Scores]) -> float | None:
    found = estimate(metric, scores)
    return found.value if found.count else None


def _rate(metric: Metric, scores: Sequence[Scores]) -> str:
    found = estimate(metric, scores)
    return f"{100 * found.value:.1f} % [{100 * found.low:.0f}, {100 * found.high:.0f}]" if found.count else "-"
