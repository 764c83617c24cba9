"""Everything a plugin can add, one function each. A plugin implements the hooks that it needs with @humanclaw.hookimpl.

A factory is registered under a name and runs only when that name is asked for, so a plugin stays cheap to import. A
plugin may specify hooks of its own (humanclaw_hookspecs). Implementations of such hooks are marked
@hookimpl(optionalhook=True), so that they also load where the specifying plugin is not installed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeAlias, TypeVar

import pluggy

if TYPE_CHECKING:
    import click
    import numpy as np
    from numpy.typing import NDArray

    from humanclaw.motion.protocol import MotionGenerator
    from humanclaw.plugins.agents import Agent, Installed, Reporter, Tasks, Verifier
    from humanclaw.records.steps import EpisodeRecord, StepRecord
    from humanclaw.records.transition import Transition
    from humanclaw.skills.body_tool import BodyTool
    from humanclaw.skills.contract import Skill
    from humanclaw.skills.measures import Measure
    from humanclaw.world.scene import Scene
    from humanclaw.world.simulator import Chunk, Simulator
    from humanclaw.world.view import Renderer

PROJECT: Final = "humanclaw"
API_VERSION: Final = "1.2"
"""Version of the plugin API, major.minor: the hooks below with the values that they pass, the skill contract, and the
doors of docs/doors.md. A plugin may name the version that it was made for in HUMANCLAW_API. The host uses the plugin if
the major is equal and the minor is not later, and otherwise refuses it with the reason (docs/stability.md)."""
OBSERVERS: Final = frozenset({"humanclaw_chunk", "humanclaw_step", "humanclaw_episode_end"})
"""Hooks that an episode waits for."""
hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)
F = TypeVar("F", contravariant=True)


class RegisterSkill(Protocol):
    def __call__(self, skill: Skill | Path) -> None:
        """Register a skill, or a folder that holds schema.json, checklist.toml and adapter.safetensors."""


class RegisterMeasure(Protocol):
    def __call__(self, measure: Measure) -> None:
        """Register a measure under its own name, which `x-measure` in a skill's schema.json refers to."""


class Register(Protocol[F]):
    def __call__(self, name: str, value: F, description: str = "") -> None:
        """Register a value under a name, described in a line. A factory is called when its name is asked for."""


Options: TypeAlias = Mapping[str, Any]
SceneFactory: TypeAlias = "Callable[[str], Scene]"
SimulatorFactory: TypeAlias = "Callable[..., Simulator]"
RendererFactory: TypeAlias = "Callable[[], Renderer]"
GeneratorFactory: TypeAlias = "Callable[..., MotionGenerator]"
AgentFactory: TypeAlias = "Callable[[Options], Agent]"
VerifierFactory: TypeAlias = "Callable[[Options], Verifier]"
ReporterFactory: TypeAlias = "Callable[..., Reporter]"
TasksFactory: TypeAlias = "Callable[[Options], Tasks]"
Reward: TypeAlias = "Callable[[Transition], float]"
FrameworkFactory: TypeAlias = "Callable[[Sequence[BodyTool]], Any]"


def noun(kind: str) -> str:
    """Return the noun for one item of a kind: "motion generator" for "motion_generators"."""
    return kind.removesuffix("s").replace("_", " ")


@hookspec
def humanclaw_hookspecs(register: Callable[[ModuleType], None]) -> None:
    """Register modules of hook specifications, to extend the host. A hook whose only argument is `register` defines a
    kind of named items: Plugins.registered(kind) lists them, Plugins.make(kind, name) calls their factories.
    USES = {kind: function(item, plugins)} in the module lets `humanclaw check` use an item once."""


@hookspec
def humanclaw_measures(register: RegisterMeasure) -> None:
    """Register measures of half a second of motion, which parameters can command (humanclaw.skills.Measure).

    A schema names one in "x-measure". humanclaw.skills.MEASURES holds the core's.
    """


@hookspec
def humanclaw_skills(register: RegisterSkill) -> None:
    """Register skills: a Skill, as the decorator @skill makes, or the folder of a trained one. A skill that breaks the
    contract is disabled by name; others stay."""


@hookspec
def humanclaw_scenes(register: Register[SceneFactory], plugins: Installed) -> None:
    """Register scene sources: factory(argument: str) -> Scene, called with what follows the colon in name:argument.

    plugins: the host, for a source that adds to scenes of others. Ask it when a scene is made, not before.

    A scene holds assets, objects made of them, rooms and a start pose. An object is fixed, movable with a mass, or on a
    joint: SceneObject(..., movable=True, mass=25.0, joint=Hinge(point, low, high), state=angle), or
    joint=Slide(low, high). A cupboard is a fixed carcass and one such object for each door and drawer.
    """


@hookspec
def humanclaw_simulators(register: Register[SimulatorFactory]) -> None:
    """Register simulators: factory(profile: str = "default") -> Simulator, which passes
    humanclaw.testing.SimulatorConformance."""


@hookspec
def humanclaw_renderers(register: Register[RendererFactory]) -> None:
    """Register renderers: factory() -> Renderer, which draws one moment of a world or a record as colours, depth and
    object ids. humanclaw.body.skin() is the body's mesh; posed moves it, headless hides its head from its own eyes."""


@hookspec
def humanclaw_motion_generators(register: Register[GeneratorFactory]) -> None:
    """Register motion generators: factory(profile: str = "default", prior: Path | None = None) -> MotionGenerator,
    which continues five frames by fifteen, given an adapter and named values.

    prior: the checkpoint of another prior than the shipped one; leave the parameter out if there can be none.
    """


@hookspec
def humanclaw_priors(register: Register[Path]) -> None:
    """Register motion priors: the path of a base checkpoint, as `humanclaw train base` writes it.

    `--prior NAME` runs an episode with it. An adapter names by digest the prior that it was trained against, and a body
    offers the skills with an adapter for its prior. A skill may have several: adapter-ANYTHING.safetensors.
    """


@hookspec
def humanclaw_agents(register: Register[AgentFactory]) -> None:
    """Register agents: factory(options: Mapping[str, Any]) -> Agent, with the options of the run.

    An agent gets what a model gets: instruction, skills, limit of steps and a seed of its own. A privileged agent also
    gets scene, start, targets, state and the episode's seed and id, and its records say so.
    """


@hookspec
def humanclaw_verifiers(register: Register[VerifierFactory]) -> None:
    """Register verifiers: factory(options: Mapping[str, Any]) -> Verifier, with the options of the run.

    Before each call a verifier sees the current view and the skill's checklist, and accepts or replaces the call.
    """


@hookspec
def humanclaw_reports(register: Register[ReporterFactory]) -> None:
    """Register reporters, which present a recorded run in order of their names: factory(film: str = "mp4",
    renderer: str = "raster") -> Reporter."""


@hookspec
def humanclaw_frameworks(register: Register[FrameworkFactory]) -> None:
    """Register agent frameworks, for Body.tools: factory(tools: Sequence[BodyTool]) -> the framework's own objects."""


@hookspec
def humanclaw_tasks(register: Register[TasksFactory]) -> None:
    """Register sources of training tasks: factory(options: Mapping[str, Any]) -> Tasks. Calling it with a seed gives an
    episode, always the same one. goal names the reward that is 1 when a task is solved; rewards holds the weights."""


@hookspec
def humanclaw_rewards(register: Register[Reward]) -> None:
    """Register rewards of a step: function(transition: humanclaw.records.Transition) -> float, of an episode up to its
    last step. It must be a finite number; an error in it names its plugin."""


@hookspec
def humanclaw_commands(cli: click.Group) -> None:
    """Add commands to the command line. humanclaw.cli holds the options that the built-in commands share."""


@hookspec
def humanclaw_chunk(episode: EpisodeRecord, step: int, chunk: Chunk) -> None:
    """Observe each half second of a call, before the next is generated. step: number of steps recorded so far."""


@hookspec
def humanclaw_step(episode: EpisodeRecord, step: StepRecord, view: NDArray[np.uint8]) -> None:
    """Observe a recorded step. view: (height, width, 3) uint8 picture that the agent saw before it."""


@hookspec
def humanclaw_episode_end(episode: EpisodeRecord, folder: Path | None) -> None:
    """Observe the end of an episode, once its record is complete. folder: where it was written; None if nowhere."""
