"""The scored episodes behind a row of a table, and the notes below the table."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from humanclaw import RecordError
from humanclaw.cli import counted, legible
from humanclaw_bench.conditions import Conditions, labels, of_world, summary
from humanclaw_bench.failure_modes import Cause
from humanclaw_bench.oneself import STAGE
from humanclaw_bench.scores import LONGEST, Scores
from humanclaw_bench.statistics import Estimate
from humanclaw_bench.verification import Standing

NONE: Final = Estimate(float("nan"))
MOST_UNASKED: Final = 0.01
"""Share of unverified calls above which a note warns."""
MARK: Final = "\u2020"


@dataclass(frozen=True)
class Result:
    """The scored episodes of one agent in one run, with the root cause of each failure."""

    name: str
    scores: tuple[Scores, ...]
    causes: tuple[Cause | None, ...]
    """One for each score; None for an episode that did not fail."""
    known: Standing = field(default_factory=Standing)
    """Of the run's folder."""
    conditions: Conditions = field(default_factory=dict)
    """What the episodes were played with."""

    @property
    def finished(self) -> tuple[Scores, ...]:
        return tuple(s for s in self.scores if s.finished)

    @property
    def of_two(self) -> bool:
        """Whether its episodes have a partner."""
        return any(s.of_two for s in self.scores)

    @property
    def of_own(self) -> bool:
        """Whether functions of plugins decide the success of its episodes."""
        return any(s.spec and s.spec.success for s in self.scores)

    @property
    def of_hands(self) -> bool:
        """Whether its episodes are tasks for hands."""
        return any(s.hands for s in self.scores) and not (self.of_oneself or self.of_two or self.of_own)

    @property
    def of_oneself(self) -> bool:
        """Whether its episodes are questions about oneself."""
        return any(stage.startswith(STAGE) for s in self.scores for stage in s.hands)

    @property
    def total(self) -> int:
        """Number of episodes that the run should have."""
        return max(self.known.asked, len(self.scores))

    @property
    def partial(self) -> bool:
        """Whether episodes are missing (not run, cut short by a limit of the run, infra_error), or may be."""
        return not self.known.asked or len(self.finished) < self.total

    @property
    def note(self) -> str:
        """The note below a table: missing episodes, plugin errors, unverified calls, contradictions."""
        apart = Counter(s.outcome for s in self.scores if not s.finished)
        left_out = "".join(f"; not in any number: {count} {outcome}" for outcome, count in sorted(apart.items()))
        of = f"{len(self.finished)} of " if len(self.finished) < self.total else ""
        unknown = "" if self.known.asked else ", of an unknown total (no run.json)"
        extent = f"{of}{counted(self.total, 'episode')}{unknown}"
        note = " ".join([f"{self.name}: {extent}{left_out}.", *self._sentences()])
        return " ".join(legible(note).split())  # One line, whatever text a foreign record holds.

    def _sentences(self) -> Iterator[str]:
        """Yield what is to be known of the row besides its extent."""
        if roles := " and ".join(sorted({s.privileged for s in self.scores if s.privileged})):
            # What it may read: `seeing` uses the view's depth and ids, and no map.
            yield f"Privileged (may read scene, true state, target ids, and depth and ids of its view): {roles}."
        broken = Counter(s.error for s in self.finished if s.outcome == "plugin_error")
        yield from (f"Failed by a plugin, and counted: {count} ({error})." for error, count in sorted(broken.items()))
        unmet = Counter(cause.name for cause in self.causes if cause and cause.stage == "task")
        yield from (f"{count} {name.rstrip('.')}." for name, count in sorted(unmet.items()))
        verified, unasked = (sum(getattr(s, name) for s in self.finished) for name in ("verified", "unasked"))
        if verified:
            yield f"Calls executed unverified: {100 * unasked / verified:.1f} %."
        if unasked > MOST_UNASKED * verified:
            yield "Warning: this is not the verifier's row."
        if faults := self.known.faults:
            more = f" ({len(faults)} such faults: see `humanclaw bench verify`)" if len(faults) > 1 else ""
            yield f"Warning: {faults[0]}{more}"
        if self.known.in_process:
            yield "Played in the body's own process, which agent and verifier can change."
        if not all(s.in_pace for s in self.scores):
            yield f"Not at the paper's pace: {pace(self.scores)}."
        if targetless := sum(bool(s.spec and s.spec.success) and not s.category for s in self.scores):
            yield f"No target in {counted(targetless, 'episode')}: success is the function's alone."
        yield from self._refused()
        if self.conditions:
            yield f"Played with {summary(self.conditions)}."

    def _refused(self) -> Iterator[str]:
        """Yield what the model refused or had no room for."""
        if left_out := sorted({name for s in self.scores for name in s.left_out}):
            yield f"Asked without {', '.join(left_out)}, which the model refuses."
        if cut := [s for s in self.scores if s.refused and not s.finished]:
            refused, answers = (sum(getattr(s, name) for s in cut) for name in ("refused", "answers"))
            yield f"In episodes that did not end, {refused} of {answers} answers held no usable call."
        if dropped := sum(s.dropped_steps for s in self.finished):
            yield f"Past steps were dropped because the model's context was full: in {dropped} steps."
        if self.conditions.get("agent history", "0") != "0" and self.conditions.get("agent history_text") == "short":
            yield "Past steps were told with their words cut, in the paper in full."


def named(
    runs: Mapping[str, Sequence[tuple[Scores, Cause | None]]], known: Mapping[str, Standing] | None = None
) -> tuple[Result, ...]:
    """Group scored episodes into one result per run, agent, verifier and conditions.

    known: facts from each run's folder. A result's name includes the conditions in which it differs from others, and
    the run if the rest of the name repeats.
    """
    groups: dict[tuple[str, str, str], list[tuple[Scores, Cause | None]]] = defaultdict(list)
    for run, pairs in runs.items():
        for scores, cause in pairs:
            verifier = scores.verifier.removesuffix(f":{scores.agent}")  # The same model: its name stands there once.
            agent = scores.agent + (f" + {verifier}" if verifier else "")
            groups[agent, run, str(of_world(scores.conditions))].append((scores, cause))
    played = [shared_conditions([scores for scores, _ in pairs]) for pairs in groups.values()]
    suffixes = labels([(agent, conditions) for (agent, *_), conditions in zip(groups, played, strict=True)])
    names = [
        agent + label + _calls([scores for scores, _ in pairs])
        for ((agent, *_), pairs), label in zip(groups.items(), suffixes, strict=True)
    ]
    return tuple(
        Result(
            name if names.count(name) == 1 else f"{name} ({run})",
            tuple(scores for scores, _ in pairs), tuple(cause for _, cause in pairs),
            (known or {}).get(run, Standing()), conditions,
        )
        for ((_, run, _), pairs), name, conditions in zip(groups.items(), names, played, strict=True)
    )  # fmt: skip


def pace(scores: Sequence[Scores]) -> str:
    """Return the longest motion of a call, and the farthest in half a second, as text."""
    longest, fastest = max((s.longest for s in scores), default=0.0), max((s.fastest for s in scores), default=0.0)
    return f"a call moves the body for up to {longest:.1f} s, and by up to {fastest:.2f} m in half a second"


def _calls(scores: Sequence[Scores]) -> str:
    """Return a label for calls that move the body longer, or faster, than skills of the paper's kind."""
    if all(episode.in_pace for episode in scores):
        return ""
    longest = max(episode.longest for episode in scores)
    return f", {longest:.1f} s a call" if longest > LONGEST else f", {max(s.fastest for s in scores):.2f} m a call"


def shared_conditions(scores: Sequence[Scores]) -> Conditions:
    """Return the conditions of some episodes. An agent whose plugin failed at once has no settings."""
    return max((episode.conditions for episode in scores), key=len)


def require_whole(results: Sequence[Result], partial: bool) -> None:
    """Raise RecordError for a run with foreign records, and for one that may be incomplete without --partial."""
    for result in results:
        for fault in result.known.faults:
            raise RecordError(fault, "`humanclaw bench verify` lists everything that is wrong with the run.")
        if result.partial and not partial:
            known = "" if result.known.asked else "known to be "
            raise RecordError(f"the run is not {known}complete: {result.note}", "Continue it, or add --partial.")
