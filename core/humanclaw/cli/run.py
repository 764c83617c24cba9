"""Play the episode of `humanclaw run`: plugins, scene, body, episode, report."""

from __future__ import annotations

import datetime
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain, count
from pathlib import Path
from typing import Any, Final

import click
from rich.status import Status

from humanclaw.body.pose import Pose2D
from humanclaw.cli.options import INTERRUPTED, ChosenAgents, advice_after
from humanclaw.cli.progress import StepProgress, scoring, summary
from humanclaw.cli.terminal import Console
from humanclaw.episodes.backends import SHIPPED, SIMULATORS, Backends
from humanclaw.episodes.company import Company, places_together
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.episode import Clock
from humanclaw.episodes.loop import run_episode
from humanclaw.errors import HumanclawError, PluginError, PluginRunError, RecordError, blaming
from humanclaw.plugins.agents import Agent, Reporter, Verifier
from humanclaw.plugins.choice import Choice
from humanclaw.plugins.host import Plugins
from humanclaw.plugins.validation import origin
from humanclaw.records.instructions import free_episode, require_words
from humanclaw.records.limits import Meter
from humanclaw.records.recorded_episode import RecordedEpisode
from humanclaw.records.specification import EpisodeSpec, name_of
from humanclaw.records.steps import EpisodeRecord, StepRecord
from humanclaw.storage.files import writing
from humanclaw.world.navigation.approach import geodesics
from humanclaw.world.scene import Scene

PLAYING: Final = "Playing (the first time on a machine, this compiles for up to a minute)"
"""Shown from the making of the body on. One line of a terminal: Rich cannot take back a status that is wider."""

RUNS: Final = Path("runs")


def play(
    instruction: str,
    reference: str,
    agents: ChosenAgents,
    files: tuple[Path, ...],
    console: Console,
    status: Status,
    *,
    backends: Backends,
    max_steps: int,
    seed: int,
    out: Path | None,
    film: str,
    choice: Choice,
    partner: str,
    partner_instruction: str,
    clock: Clock,
) -> None:
    """Play one episode, or that of two bodies. The arguments are the options of `humanclaw run`. Exits with 130 after
    Ctrl-C."""
    plugins = Plugins.discover(files, choice)
    plugins.require(*_needed(plugins, agents, backends, reference))
    backends.chosen(plugins)  # An unknown sense or a missing key is told before the house and the body are made.
    tasks = [(instruction, agents)]
    if partner_instruction and not partner:
        raise HumanclawError("--with-instruction is for a second body, and there is none.", "Add --with NAME.")
    if partner:
        tasks.append((partner_instruction or instruction, agents.other(partner, plugins)))
    ready = _ready_agents(tasks, plugins)
    status.update("Making the scene")
    scene: Scene = plugins.scene(reference)
    out = out or new_folder("-with-".join(name_of(named.title) for _, named in tasks))
    starts, place = places_together(scene, len(tasks)), name_of(reference)
    numbers = range(1, 3) if partner else [0]
    roles = [
        _Role(_spec(text, scene, start, place, seed + k, max_steps), named, *ready[k], out, numbers[k])
        for k, ((text, named), start) in enumerate(zip(tasks, starts, strict=True))
    ]
    distances = not any(getattr(role.agent, "at_terminal", False) for role in roles)
    plugins.add(StepProgress(console, max_steps, distances=distances), "console_progress")
    status.update(PLAYING)
    _record(roles, scene, console, clock, seed=seed, plugins=plugins, backends=backends)
    _report(roles, plugins, backends, film, console, status)


def _ready_agents(tasks: Sequence[tuple[str, ChosenAgents]], plugins: Plugins) -> list[tuple[Agent, Verifier | None]]:
    """Make agent and verifier of each task. Raises HumanclawError if one of them says that it cannot begin."""
    for instruction, _ in tasks:
        require_words(instruction)
    made = [agents.make(plugins) for _, agents in tasks]
    for (instruction, _), pair in zip(tasks, made, strict=True):
        for agent in filter(None, pair):
            _require_ready(agent, instruction)
    return made


@dataclass(frozen=True)
class _Role:
    """One body's episode, and who decides for it."""

    spec: EpisodeSpec
    agents: ChosenAgents
    agent: Agent
    verifier: Verifier | None
    run: Path
    number: int = 0
    """Of its body, from 1 on; 0 for the only one."""

    @property
    def folder(self) -> Path:
        return self.run / self.spec.id

    @property
    def head(self) -> str:
        who = f"{self.agents.title} {self.number or ''}".rstrip()
        return f'{who} in {self.spec.scene}: "{self.spec.instruction}"\n{scoring(self.spec)}'


def _spec(text: str, scene: Scene, start: Pose2D, place: str, seed: int, max_steps: int) -> EpisodeSpec:
    spec = free_episode(text, scene, seed=seed, max_steps=max_steps, name=f"{place}-{seed}")
    return spec.model_copy(update={"start": start})


def _record(roles: Sequence[_Role], scene: Scene, console: Console, clock: Clock, **made: Any) -> None:
    """Play all roles into new folders, to their ends or until Ctrl-C. made: seed, plugins and backends of the body."""
    with ExitStack() as stack:
        for role in roles:
            claim(role.folder)
            stack.enter_context(left_empty(role.folder))
        interrupted = stack.enter_context(_interrupting())
        for role in roles:
            stack.enter_context(_kept(role.folder))
        _play_together(roles, scene, interrupted, console, clock, **made)


def _play_together(
    roles: Sequence[_Role], scene: Scene, interrupted: Callable[[], bool], console: Console, clock: Clock, **made: Any
) -> None:
    company_ids = [role.spec.id for role in roles] if len(roles) > 1 else ()

    def played(role: _Role, body: Body) -> None:
        run_episode(
            body, role.spec, role.agent, role.verifier, folder=role.folder, options=role.agents.options,
            distance=geodesics, meter=Meter(role.agents.limits), stopping=interrupted, company=company_ids,
            begun=partial(console.print, role.head, soft_wrap=True), clock=clock,
        )  # fmt: skip

    if len(roles) == 1:
        with Body(scene, **made) as body:
            played(roles[0], body)
        return
    with Company(scene, [role.spec.start or scene.start for role in roles], **made) as company:
        company.play([partial(played, role) for role in roles])


def _report(
    roles: Sequence[_Role], plugins: Plugins, backends: Backends, film: str, console: Console, status: Status
) -> None:
    """Say how each episode ended, write its report, and exit with the code that it calls for."""
    try:
        episodes = [RecordedEpisode(role.folder) for role in roles]
        for role, recorded in zip(roles, episodes, strict=True):
            console.print(said := summary(recorded.record, recorded.steps))
            getattr(role.agent, "show_result", lambda result, run: None)(said, role.run)
        status.stop()  # The film has a bar of its own.
        for role in roles:
            present(plugins, backends, role.run, role.folder, film, console)
    except KeyboardInterrupt:
        console.print(f"The report is not whole. `humanclaw report {roles[0].run}` writes it.", soft_wrap=True)
        raise
    for recorded in episodes:
        end(recorded.record, recorded.steps)


def _require_ready(agent: Any, instruction: str) -> None:
    """Raise HumanclawError if an agent or a verifier says that it cannot begin, PluginError if it breaks as it is
    asked."""
    try:
        with blaming(origin(agent), HumanclawError):
            if callable(ready := getattr(agent, "ready", None)):
                ready(instruction)
    except PluginRunError as fault:
        raise PluginError(f"{fault}, when it was asked whether it is ready.", "Mend its plugin.") from fault


def numbered(name: str) -> Iterator[str]:
    """Yield a name, and then the name with a number from 2 on."""
    return chain([name], (f"{name}-{number}" for number in count(2)))


def new_folder(agent: str) -> Path:
    """Make a new folder for a run. Two runs that begin in the same second get different folders."""
    first = RUNS / f"{datetime.datetime.now():%Y%m%d-%H%M%S}-{agent}"
    for name in numbered(first.name):
        with writing(first), suppress(FileExistsError):
            first.with_name(name).mkdir(parents=True)
            break
    return first.with_name(name)


@contextmanager
def _kept(folder: Path) -> Iterator[None]:
    """Ignore Ctrl-C, however often, if there is a record by then: its path is still printed."""
    try:
        yield
    except KeyboardInterrupt:
        if not (folder / "episode.json").exists():
            raise


@contextmanager
def left_empty(folder: Path) -> Iterator[None]:
    """Remove empty folders at the end, so that the same command can be given again."""
    try:
        yield
    finally:
        for empty in (folder, folder.parent, *{RUNS}.intersection(folder.parents)):
            with suppress(OSError):
                empty.rmdir()


def claim(folder: Path) -> None:
    """Make the folder of the record.

    Raises RecordError if it exists, since of two processes only one may use it, or if it would lie in the run of many
    episodes, whose numbers it would change.
    """
    if run := next((above for above in folder.absolute().parents if (above / "run.json").exists()), None):
        message = f"{run} holds a benchmark's run, and one more record would change its numbers."
        raise RecordError(message, "Name another folder with --out.")
    try:
        with writing(folder):
            folder.mkdir(parents=True)
    except RecordError as error:
        if not isinstance(error.__cause__, FileExistsError):
            raise
        raise RecordError(
            f"{folder} already holds a record.", "Name another folder with --out, or remove that one."
        ) from None


@contextmanager
def _interrupting() -> Iterator[Callable[[], bool]]:
    """Treat SIGTERM like Ctrl-C: the record is closed and the report written. Yields whether either was heard.

    Python drops an exception in a finalizer, a KeyboardInterrupt too: then the run stops before its next step.
    """
    heard: list[int] = []

    def handle(number: int, frame: object) -> None:
        heard.append(number)
        raise KeyboardInterrupt

    main = threading.current_thread() is threading.main_thread()
    signals = (signal.SIGINT, signal.SIGTERM) if main else ()
    heeded = [number for number in signals if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in heeded}
    try:
        yield lambda: bool(heard)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _needed(plugins: Plugins, agents: ChosenAgents, backends: Backends, reference: str) -> Iterator[tuple[str, str]]:
    """Yield kind and name of everything that an episode needs."""
    yield "scenes", reference.partition(":")[0]
    # Without a name any installed simulator will do. If none is installed, ask for the one with wheels everywhere.
    if backends.simulator or not plugins.registered("simulators"):
        yield "simulators", backends.simulator or SIMULATORS[-1]
    yield "renderers", backends.renderer
    yield "motion_generators", backends.generator
    if backends.prior != SHIPPED:
        yield "priors", backends.prior
    yield "agents", agents.agent
    if agents.verifier:
        yield "verifiers", agents.verifier


def present(plugins: Plugins, backends: Backends, out: Path, folder: Path, film: str, console: Console) -> None:
    """Let the installed reporters present the record, in order of their names, and print the paths of their files."""
    console.print(f"record: {folder}", soft_wrap=True)
    for report in sorted(plugins.registered("reports"), key=lambda report: report.name):
        reporter: Reporter = plugins.make("reports", report.name, film=film, renderer=backends.renderer)
        for name, path in reporter.write(out, RecordedEpisode(folder), plugins).items():
            console.print(f"{name}: {path}", soft_wrap=True)


def end(record: EpisodeRecord, steps: Sequence[StepRecord]) -> None:
    """Exit with the code of an episode that was not played to its end, or without any usable call."""
    if steps and all(step.status == "invalid" for step in steps):
        raise click.ClickException(f"no answer held a usable call. {advice_after(steps[-1].feedback.refusal)}")
    if record.outcome == "infra_error":
        raise click.ClickException(f"the provider failed: {record.error}")
    if record.outcome == "plugin_error":
        raise click.ClickException(f"a plugin failed: {record.error}")
    if record.outcome == "limit_reached":
        raise click.ClickException(f"a limit was reached: {record.error}")
    if record.outcome in ("interrupted", "running"):  # Running: a second Ctrl-C came before the end was written.
        sys.exit(INTERRUPTED)
