"""The worker that plays episodes of a run, in a process of this machine or on a node of a cluster."""

from __future__ import annotations

import contextlib
import hashlib
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Self

from humanclaw import (
    Backends,
    Body,
    Choice,
    Company,
    Episode,
    EpisodeSpec,
    HumanclawError,
    Meter,
    Plugins,
    RecordedEpisode,
    RecordError,
    ReplayError,
    Scene,
    StepRecord,
)
from humanclaw.plugins import package_in
from humanclaw.records import MOTION_BYTES, Outcome, Refusal, Usage, close_record
from humanclaw.storage import Folder, writing
from humanclaw.world import geodesics
from humanclaw_bench.isolation.agents import IsolatedAgents
from humanclaw_bench.two.partners import PARTNER, Ending, accompany, company_of

FAILED: Final = "infra_error"
ROLES: Final = {"agents": "agent", "verifiers": "verifier"}


@dataclass(frozen=True)
class Job:
    """The settings that all episodes of a run share: plain values, which can be sent to other machines."""

    agent: str
    options: Mapping[str, Any] = field(default_factory=dict)
    verifier: str = ""
    """Name of the verifier; empty for none."""
    backends: Backends = field(default_factory=Backends)
    limits: Mapping[str, float] = field(default_factory=dict)
    """Limits as in humanclaw.limits. Limits of a run hold for one session."""
    files: tuple[str, ...] = ()
    """Plugin files to load besides the installed plugins."""
    choice: Choice = field(default_factory=Choice)
    """Choice of plugins and skills."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Own names of agent ("agents") and verifier ("verifiers"), for records if they cannot be created."""
    in_process: bool = False
    """Whether unprivileged agents and verifiers play beside the body too, for debugging: they could change it."""
    apart: Mapping[str, str] = field(default_factory=dict)
    """Kind to place of those that play in a process of its own. The privileged have no place there."""
    absent: tuple[str, ...] = ()
    """Plugins, by name or by path of their file, that are not loaded beside the body, since they bring agents and
    verifiers alone."""
    stop_after: int = 0
    """Refused answers in a row of one worker after which the run stops; 0 plays on, also after provider failures."""
    seed: int | None = None
    """Of the order of the episodes and of the agents' random numbers. None draws one for a new run. Episodes number
    their seeds, so that an agent that could compute its seed from theirs would know which episode it plays."""

    def seed_of(self, spec: EpisodeSpec) -> int:
        """Return the seed that agent and verifier are told in an episode."""
        return int.from_bytes(hashlib.sha256(f"{self.seed} {spec.seed}".encode()).digest()[:4])


@dataclass(frozen=True)
class WorkerReport:
    """The end of an episode, or of its worker."""

    episode: str
    outcome: Outcome
    limit: str = ""
    """Scope of the limit that was reached; empty if none was."""
    steps: int = 0
    """Steps of the episode, including those of earlier sessions."""
    seconds: float = 0.0
    cost: float = 0.0
    """US dollars that this session has spent on it."""
    tokens: int = 0
    error: str = ""
    refusal: str = ""
    """Words of the last refused answer, if the job's stop_after was reached; the episode was cut off there."""
    fatal: bool = False
    """Whether every other episode would meet the error too, so that the user must fix it first."""
    worker: str = ""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """Path to content of the record's files, from a worker that cannot write to the folder of the run."""


class Worker:
    """Plays one episode after another. It builds the house of the previous episode only once."""

    def __init__(
        self, job: Job, out: Path, stopping: Callable[[], bool] = lambda: False, name: str = "", *, plugins: Any = None
    ) -> None:
        """Load the plugins. out: folder of the run. stopping: called after each step; True ends the episode there."""
        self._job, self._out, self._name = job, Folder(out), name
        self._plugins: Plugins = plugins or _beside_the_body(job)
        asked = {"agents": job.agent, "verifiers": job.verifier, "options": dict(job.options), "names": dict(job.names)}
        self._isolated = IsolatedAgents(job.apart, asked, {"files": job.files, "choice": asdict(job.choice)})
        self._stopping = stopping
        self._meter = Meter(job.limits)
        self._body: Body | None = None
        self._episode: Episode | None = None
        self._refused = 0
        """Refused answers in a row, over all episodes of this worker."""
        self._refusal = ""
        self._replayed = Usage()
        """Usage of the steps that an earlier session played."""

    def play(self, spec: EpisodeSpec) -> WorkerReport:
        """Play an episode, or the rest of it. Never raises: errors are in the report."""
        self._episode, self._replayed = None, Usage()
        began = time.perf_counter()
        error, fatal = "", False
        try:
            self._play(spec)
        except KeyboardInterrupt:
            pass  # A person who decides the steps pressed Ctrl-C: the record says so.
        except HumanclawError as fault:
            error, fatal = str(fault), True
        except BaseException as fault:  # Even SystemExit: a plugin that exits must not end other episodes.
            error = f"{type(fault).__name__}: {fault}"
            self._clean_up(spec, error)
        return self._report(spec, time.perf_counter() - began, error, fatal)

    def _clean_up(self, spec: EpisodeSpec, error: str) -> None:
        """Mark the record as failed and close the body, ignoring further errors."""
        with contextlib.suppress(Exception):
            traceback.print_exc()
        for tidy in (partial(mark, self._out / spec.id, FAILED, error), self.close):
            with contextlib.suppress(BaseException):
                tidy()

    def _play(self, spec: EpisodeSpec) -> None:
        folder = self._out / spec.id
        if spec.partner is not None:
            self._play_beside(spec, folder)
            return
        try:
            begun = recorded(folder)
            replay = begun.steps if begun else ()
        except RecordError as fault:
            print(f"{fault.message} The episode starts again.", flush=True)
            replay = ()
        try:
            self._episode = self._begun(spec, folder, replay)
        except ReplayError as fault:  # Only errors of the replay; a plugin's errors have other types.
            print(f"{fault} The episode starts again.", flush=True)
            self._episode = self._begun(spec, folder, ())
        self._finish(self._episode)

    def _finish(self, episode: Episode, in_vain: Callable[[], bool] = lambda: False) -> None:
        with episode:
            while not (episode.done or in_vain() or self._stopping() or self._is_hopeless):
                self._note(episode.ask())
        if episode.fault:
            traceback.print_exception(episode.fault)

    def _play_beside(self, spec: EpisodeSpec, folder: Folder) -> None:
        """Play an episode from its beginning, with a partner in a second body."""
        assert spec.partner is not None
        ending = Ending()

        def play(body: Body) -> None:
            with ending:
                self._episode = self._begun(spec, folder, (), body, company=company_of(spec))
                self._finish(self._episode, lambda: ending.alone)
                ending.whole = self._episode.outcome in ("stopped", "out_of_steps")
                ending.frames = sum(step.motion_frames for step in self._episode.steps)

        scene: Scene = self._plugins.scene(spec.scene)
        starts = [spec.start or scene.start, spec.partner.start]
        parts: list[Callable[[Body], None]] = [play, partial(accompany, spec, folder / PARTNER, ending)]
        with Company(scene, starts, plugins=self._plugins, backends=self._job.backends) as company:
            company.play(parts)

    def _note(self, answer: StepRecord | Refusal) -> None:
        """Count refused answers in a row."""
        self._refusal = answer.error if isinstance(answer, Refusal) else answer.feedback.refusal
        self._refused = self._refused + 1 if self._refusal else 0

    @property
    def _is_hopeless(self) -> bool:
        return 0 < self._job.stop_after <= self._refused

    def _begun(
        self, spec: EpisodeSpec, folder: Folder, replay: tuple[StepRecord, ...], body: Body | None = None,
        company: tuple[str, ...] = (),
    ) -> Episode:  # fmt: skip
        """Begin or resume an episode. Raises ReplayError if the world no longer reproduces the record."""
        job, plugins = self._job, self._plugins
        if body is None:
            body = self._body = self._body or Body(spec.scene, plugins=plugins, backends=job.backends)
        apart = self._isolated.make()
        agent = apart.get("agents") or self._made("agents", job.agent)
        verifier = apart.get("verifiers") or self._made("verifiers", job.verifier)
        self._replayed = sum((step.usage for step in replay), Usage())
        return Episode(
            body, spec, agent, verifier, folder=folder, options=job.options, distance=geodesics, replay=replay,
            meter=self._meter, apart={role: job.apart[kind] for kind, role in ROLES.items() if kind in job.apart},
            agent_seed=job.seed_of(spec), company=company,
        )  # fmt: skip

    def _made(self, kind: str, name: str) -> Any:
        """Create an agent or a verifier; None without a name. If that fails, the record has the name from the job."""
        return self._plugins.make_agent(kind, name, self._job.options, self._job.names.get(kind, "")) if name else None

    def _report(self, spec: EpisodeSpec, seconds: float, error: str, fatal: bool) -> WorkerReport:
        report = WorkerReport(spec.id, FAILED, seconds=round(seconds, 3), error=error, fatal=fatal, worker=self._name)
        if self._episode is None:
            return report
        end, before = self._episode.record, self._replayed
        if not error or end.outcome == "plugin_error":
            report = replace(report, outcome=end.outcome, error=end.error)
        cost = end.usage.cost - before.cost
        tokens = end.usage.tokens_in + end.usage.tokens_out - before.tokens_in - before.tokens_out
        refusal = self._refusal if self._is_hopeless and end.outcome == "interrupted" else ""
        return replace(report, limit=end.limit, steps=end.steps, cost=cost, tokens=tokens, refusal=refusal)

    def close(self) -> None:
        body, self._body = self._body, None
        self._isolated.close()
        if body is not None:
            body.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _beside_the_body(job: Job) -> Plugins:
    """Load the plugins of a job, but for those that bring agents and verifiers alone."""
    files = [path for path in map(package_in, map(Path, job.files)) if str(path) not in job.absent]
    return Plugins.discover(files, job.choice, absent=job.absent)


def recorded(folder: Folder) -> RecordedEpisode | None:
    """Return the record in an episode's folder; None if there is none. Raises RecordError if it is damaged."""
    if not folder.has("episode.json"):
        return None
    episode, name = RecordedEpisode(folder), folder.path.name
    if episode.record.spec.id != name:
        said = f"{folder.path} must hold the record of {name!r}; it holds that of {episode.record.spec.id!r}."
        raise RecordError(said, "Remove the folder.")
    return episode


def mark(folder: Path | Folder, outcome: Outcome, error: str) -> None:
    """Write the end of an episode into its record if the episode could not. Damaged records stay: they are replaced."""
    try:
        episode = recorded(Folder.of(folder))
    except RecordError:
        return
    if episode:
        close_record(folder, episode.record.ended(outcome, error, steps=len(episode.steps)))


# -- sending records ---------------------------------------------------------------------------------------------------
def pack(folder: Path | Folder) -> dict[str, bytes]:
    """Return path in the folder to content of every file of a record; empty if there is none."""
    record = Folder.of(folder)
    inside = ("frames", PARTNER, f"{PARTNER}/frames")
    names = [*record.names(), *(f"{home}/{name}" for home in inside for name in (record / home).names())]
    return {
        name: record.read(name, MOTION_BYTES) for name in names if record.has(name) and not name.endswith(".partial")
    }


def unpack(folder: Path | Folder, files: Mapping[str, bytes]) -> None:
    """Write a record. episode.json comes last, because a folder with it counts as a record.

    Raises RecordError if it cannot be written, as for a name that leads out of the folder.
    """
    record = Folder.of(folder)
    with writing(record):
        record.root.mkdir(parents=True, exist_ok=True)
        for name, data in sorted(files.items(), key=lambda item: item[0] == "episode.json"):
            record.write(name, data)
