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
        Reporter as Reporter,
        Tasks as Tasks,
        Verifier as Verifier,
    )
    from humanclaw.plugins.choice import Choice as Choice, PluginInfo as PluginInfo, Registration as Registration
    from humanclaw.plugins.deciders import (
        StandIn as StandIn,
        admit as admit,
        name_of as name_of,
        origin as origin,
        read_options as read_options,
        settings_of as settings_of,
    )
    from humanclaw.plugins.distributions import install as install, own as own
    from humanclaw.plugins.hookspecs import (
        API_VERSION as API_VERSION,
        OBSERVERS as OBSERVERS,
        PROJECT as PROJECT,
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
        hookimpl as hookimpl,
        hookspec as hookspec,
        humanclaw_agents as humanclaw_agents,
        humanclaw_chunk as humanclaw_chunk,
        humanclaw_commands as humanclaw_commands,
        humanclaw_episode_end as humanclaw_episode_end,
        humanclaw_frameworks as humanclaw_frameworks,
        humanclaw_hookspecs as humanclaw_hookspecs,
        humanclaw_measures as humanclaw_measures,
        humanclaw_motion_generators as humanclaw_motion_generators,
        humanclaw_priors as humanclaw_priors,
        humanclaw_renderers as humanclaw_renderers,
        humanclaw_reports as humanclaw_reports,
        humanclaw_rewards as humanclaw_rewards,
        humanclaw_scenes as humanclaw_scenes,
        humanclaw_simulators as humanclaw_simulators,
        humanclaw_skills as humanclaw_skills,
        humanclaw_step as humanclaw_step,
        humanclaw_tasks as humanclaw_tasks,
        humanclaw_verifiers as humanclaw_verifiers,
        noun as noun,
    )
    from humanclaw.plugins.host import Plugins as Plugins

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
