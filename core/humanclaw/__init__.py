"""HumanCLAW: a human body for any tool-calling model.

The names below are the public door. docs/doors.md lists the other doors; every other module is private.
"""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.body.pose import Motion as Motion
    from humanclaw.episodes.backends import (
        SENSORS as SENSORS,
        Backends as Backends,
        default_simulator as default_simulator,
    )
    from humanclaw.episodes.company import Company as Company, places_together as places_together
    from humanclaw.episodes.embodiment import Body as Body
    from humanclaw.episodes.episode import Episode as Episode
    from humanclaw.episodes.execution import SkillExecution as SkillExecution
    from humanclaw.episodes.loop import run_episode as run_episode
    from humanclaw.episodes.moving import stand as stand
    from humanclaw.episodes.tools import body_tools as body_tools
    from humanclaw.errors import (
        CallError as CallError,
        CheckpointError as CheckpointError,
        HumanclawError as HumanclawError,
        LimitError as LimitError,
        PluginError as PluginError,
        ProviderClosedError as ProviderClosedError,
        ProviderError as ProviderError,
        RecordError as RecordError,
        ReplayError as ReplayError,
        SceneError as SceneError,
        TaskError as TaskError,
    )
    from humanclaw.gym.chat import TURNS as TURNS, opening as opening, situation as situation, tool_call as tool_call
    from humanclaw.gym.gym import Gym as Gym, Turn as Turn
    from humanclaw.motion.protocol import MotionGenerator as MotionGenerator
    from humanclaw.plugins.agents import (
        Agent as Agent,
        EpisodeContext as EpisodeContext,
        HistoryEntry as HistoryEntry,
        Observation as Observation,
        Reporter as Reporter,
        Verifier as Verifier,
    )
    from humanclaw.plugins.choice import Choice as Choice
    from humanclaw.plugins.hookspecs import hookimpl as hookimpl
    from humanclaw.plugins.host import Plugins as Plugins
    from humanclaw.prompting.prompts import (
        model_tools as model_tools,
        step_content as step_content,
        system_message as system_message,
        system_prompt as system_prompt,
        verifier_content as verifier_content,
        verifier_prompt as verifier_prompt,
    )
    from humanclaw.prompting.settings import PromptSettings as PromptSettings
    from humanclaw.records.decisions import Attempt as Attempt, Decision as Decision, Usage as Usage, Verdict as Verdict
    from humanclaw.records.limits import Meter as Meter
    from humanclaw.records.recorded_episode import RecordedEpisode as RecordedEpisode, load_run as load_run
    from humanclaw.records.specification import EpisodeSpec as EpisodeSpec
    from humanclaw.records.steps import EpisodeRecord as EpisodeRecord, StepRecord as StepRecord
    from humanclaw.skills.call import Call as Call
    from humanclaw.skills.contract import Check as Check, Skill as Skill
    from humanclaw.skills.decorator import skill as skill
    from humanclaw.skills.gaze_grip_speech import Gaze as Gaze, Grip as Grip, Speech as Speech
    from humanclaw.skills.plan import Control as Control, Keyframes as Keyframes
    from humanclaw.skills.proprioception import ProprioceptiveState as ProprioceptiveState
    from humanclaw.skills.reaching import Reach as Reach
    from humanclaw.world.scene import Scene as Scene
    from humanclaw.world.simulator import Chunk as Chunk, Simulator as Simulator
    from humanclaw.world.view import Renderer as Renderer

__version__ = "0.1.0"
if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
