"""Everything a plugin can add, one function each. A plugin implements the hooks it needs with @humanclaw.hookimpl.

Factories are registered by name and run only when something asks for that name, so a plugin's module stays cheap to import.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import pluggy

if TYPE_CHECKING:
    import click

    from humanclaw.contract import Skill
    from humanclaw.interfaces import Agent, MotionGenerator, Renderer, Simulator, Verifier
    from humanclaw.records import EpisodeRecord, StepRecord
    from humanclaw.scene import Scene

PROJECT: Final = "humanclaw"
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


class RegisterSkill(Protocol):
    def __call__(self, skill: Skill | Path) -> None:
        """Offer a skill, or a folder that holds schema.json, checklist.toml and adapter.safetensors."""


class RegisterFactory(Protocol):
    def __call__(self, name: str, factory: Callable[..., Any], description: str = "") -> None:
        """Offer something under a name; the factory is called when it is asked for."""


@hookspec
def humanclaw_skills(register: RegisterSkill) -> None:
    """Register skills."""


@hookspec
def humanclaw_scenes(register: RegisterFactory) -> None:
    """Register scene sources: factory(argument: str) -> Scene, called with what follows the colon in name:argument."""


@hookspec
def humanclaw_simulators(register: RegisterFactory) -> None:
    """Register simulators: factory(profile: str = "default") -> Simulator."""


@hookspec
def humanclaw_renderers(register: RegisterFactory) -> None:
    """Register renderers: factory() -> Renderer."""


@hookspec
def humanclaw_motion_generators(register: RegisterFactory) -> None:
    """Register motion generators: factory(profile: str = "default") -> MotionGenerator."""


@hookspec
def humanclaw_agents(register: RegisterFactory) -> None:
    """Register decision makers: factory(options: Mapping[str, Any]) -> Agent, with the options of the run."""


@hookspec
def humanclaw_verifiers(register: RegisterFactory) -> None:
    """Register verifiers: factory(options: Mapping[str, Any]) -> Verifier, with the options of the run."""


@hookspec
def humanclaw_executors(register: RegisterFactory) -> None:
    """Register executors, which play the episodes of a run somewhere: factory(workers: int, address: str) -> Executor.

    humanclaw_bench.executors tells what one does; plugins/ray is one for a cluster.
    """


@hookspec
def humanclaw_metrics(register: RegisterFactory) -> None:
    """Register metrics of an episode, from its record: function(episode: RecordedEpisode) -> float, NaN if it does not apply.

    They are columns of `humanclaw bench table --only plugins`, of scores.jsonl and of humanclaw_bench.load.
    """


@hookspec
def humanclaw_reports(register: RegisterFactory) -> None:
    """Register reporters, which show a recorded run: factory(film: str = "mp4", renderer: str = "raster") -> Reporter."""


@hookspec
def humanclaw_commands(cli: click.Group) -> None:
    """Add commands to the command line."""


@hookspec
def humanclaw_step(episode: EpisodeRecord, step: StepRecord) -> None:
    """Called after each recorded step."""


@hookspec
def humanclaw_episode_end(episode: EpisodeRecord, folder: Path | None) -> None:
    """Called when an episode's record is complete; folder is where it was written, if anywhere."""


Options = Mapping[str, Any]
if TYPE_CHECKING:
    SceneFactory = Callable[[str], Scene]
    SimulatorFactory = Callable[..., Simulator]
    RendererFactory = Callable[[], Renderer]
    GeneratorFactory = Callable[..., MotionGenerator]
    DecisionMakerFactory = Callable[[Options], Agent]
    VerifierFactory = Callable[[Options], Verifier]
