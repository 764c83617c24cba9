"""Plugins: the host, its hooks, and the protocols of agents, verifiers and reporters."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.plugins.agents import (
        Agent as Agent,
        EpisodeContext as EpisodeContext,
        HistoryEntry as HistoryEntry,
        Installed as Installed,
        Observation as Observation,
        Tasks as Tasks,
    )
    from humanclaw.plugins.choice import PluginInfo as PluginInfo
    from humanclaw.plugins.distributions import install as install, own as own
    from humanclaw.plugins.hookspecs import (
        API_VERSION as API_VERSION,
        AgentFactory as AgentFactory,
        FrameworkFactory as FrameworkFactory,
        GeneratorFactory as GeneratorFactory,
        Options as Options,
        Register as Register,
        RegisterMeasure as RegisterMeasure,
        RegisterSkill as RegisterSkill,
        RendererFactory as RendererFactory,
        ReporterFactory as ReporterFactory,
        Reward as Reward,
        SceneFactory as SceneFactory,
        SimulatorFactory as SimulatorFactory,
        TasksFactory as TasksFactory,
        VerifierFactory as VerifierFactory,
        hookspec as hookspec,
        noun as noun,
    )
    from humanclaw.plugins.host import Plugins as Plugins, package_in as package_in
    from humanclaw.plugins.validation import (
        StandIn as StandIn,
        admit as admit,
        name_of as name_of,
        origin as origin,
        read_options as read_options,
        settings_of as settings_of,
    )

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
