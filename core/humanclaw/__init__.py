"""HumanCLAW: a human body for any tool-calling model.

The names below are the public door. They load on first use, so that `import humanclaw` costs nothing. The other doors
are listed in docs/doors.md; every other module is private.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw._lazy import lazy

if TYPE_CHECKING:
    from humanclaw._backends import SENSORS, Backends, default_simulator
    from humanclaw.contract import Check, Control, Keyframes, Skill, skill
    from humanclaw.embodiment import Body, Chunk
    from humanclaw.episode import Episode
    from humanclaw.errors import (
        CallError,
        CheckpointError,
        HumanclawError,
        LimitError,
        PluginError,
        ProviderError,
        RecordError,
        ReplayError,
        SceneError,
    )
    from humanclaw.hookspecs import hookimpl
    from humanclaw.interfaces import (
        Agent,
        EpisodeContext,
        HistoryEntry,
        MotionGenerator,
        Observation,
        Renderer,
        Reporter,
        Simulator,
        Verifier,
    )
    from humanclaw.limits import Meter
    from humanclaw.loop import run_episode
    from humanclaw.plugins import Choice, Plugins
    from humanclaw.pose import Motion
    from humanclaw.records import (
        Attempt,
        Call,
        Decision,
        EpisodeRecord,
        EpisodeSpec,
        RecordedEpisode,
        StepRecord,
        Usage,
        Verdict,
        load_run,
    )
    from humanclaw.scene import Scene

__version__ = "0.1.0"

_HOMES = {
    "SENSORS": "_backends",
    "Agent": "interfaces",
    "Attempt": "records",
    "Backends": "_backends",
    "Body": "embodiment",
    "Call": "records",
    "CallError": "errors",
    "Check": "contract",
    "CheckpointError": "errors",
    "Choice": "plugins",
    "Chunk": "embodiment",
    "Control": "contract",
    "Decision": "records",
    "Episode": "episode",
    "EpisodeContext": "interfaces",
    "EpisodeRecord": "records",
    "EpisodeSpec": "records",
    "HistoryEntry": "interfaces",
    "HumanclawError": "errors",
    "Keyframes": "contract",
    "LimitError": "errors",
    "Meter": "limits",
    "Motion": "pose",
    "MotionGenerator": "interfaces",
    "Observation": "interfaces",
    "PluginError": "errors",
    "Plugins": "plugins",
    "ProviderError": "errors",
    "RecordError": "errors",
    "RecordedEpisode": "records",
    "Renderer": "interfaces",
    "ReplayError": "errors",
    "Reporter": "interfaces",
    "Scene": "scene",
    "SceneError": "errors",
    "Simulator": "interfaces",
    "Skill": "contract",
    "StepRecord": "records",
    "Usage": "records",
    "Verdict": "records",
    "Verifier": "interfaces",
    "default_simulator": "_backends",
    "hookimpl": "hookspecs",
    "load_run": "records",
    "run_episode": "loop",
    "skill": "contract",
}
__all__ = [
    "SENSORS",
    "Agent",
    "Attempt",
    "Backends",
    "Body",
    "Call",
    "CallError",
    "Check",
    "CheckpointError",
    "Choice",
    "Chunk",
    "Control",
    "Decision",
    "Episode",
    "EpisodeContext",
    "EpisodeRecord",
    "EpisodeSpec",
    "HistoryEntry",
    "HumanclawError",
    "Keyframes",
    "LimitError",
    "Meter",
    "Motion",
    "MotionGenerator",
    "Observation",
    "PluginError",
    "Plugins",
    "ProviderError",
    "RecordError",
    "RecordedEpisode",
    "Renderer",
    "ReplayError",
    "Reporter",
    "Scene",
    "SceneError",
    "Simulator",
    "Skill",
    "StepRecord",
    "Usage",
    "Verdict",
    "Verifier",
    "default_simulator",
    "hookimpl",
    "load_run",
    "run_episode",
    "skill",
]
__getattr__ = lazy(__name__, _HOMES)
