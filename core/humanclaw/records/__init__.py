"""Values of an episode: specifications, decisions, feedback, records, and the facts read from them."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.records.acknowledgement import SEEN_PIXELS as SEEN_PIXELS, acknowledges as acknowledges
    from humanclaw.records.decisions import (
        Answer as Answer,
        Attempt as Attempt,
        Decision as Decision,
        Refusal as Refusal,
        Usage as Usage,
        Verdict as Verdict,
    )
    from humanclaw.records.difficulty import route_difficulty as route_difficulty
    from humanclaw.records.episode_files import read_episodes as read_episodes, write_episodes as write_episodes
    from humanclaw.records.feedback import (
        Displacement as Displacement,
        Feedback as Feedback,
        Proprioception as Proprioception,
        Touch as Touch,
    )
    from humanclaw.records.folder import (
        FRAME_BYTES as FRAME_BYTES,
        MOTION_BYTES as MOTION_BYTES,
        RECORD_BYTES as RECORD_BYTES,
        STEPS_BYTES as STEPS_BYTES,
        EpisodeWriter as EpisodeWriter,
        close_record as close_record,
        write_record as write_record,
    )
    from humanclaw.records.instructions import (
        ALIASES as ALIASES,
        SEATS as SEATS,
        category_of as category_of,
        free_episode as free_episode,
        instruction as instruction,
        targeted as targeted,
        wants_to_sit as wants_to_sit,
    )
    from humanclaw.records.limits import Meter as Meter
    from humanclaw.records.recorded_episode import (
        REPORT as REPORT,
        RecordedEpisode as RecordedEpisode,
        load_run as load_run,
    )
    from humanclaw.records.specification import (
        Difficulty as Difficulty,
        EpisodeSpec as EpisodeSpec,
        Goal as Goal,
        Partner as Partner,
        name_of as name_of,
    )
    from humanclaw.records.steps import (
        EpisodeRecord as EpisodeRecord,
        Outcome as Outcome,
        PlayedPart as PlayedPart,
        SkillInfo as SkillInfo,
        StepRecord as StepRecord,
    )
    from humanclaw.records.success import (
        FLOOR_THRESHOLD as FLOOR_THRESHOLD,
        REACHED as REACHED,
        answered as answered,
        brought as brought,
        end_distance as end_distance,
        ever_reached as ever_reached,
        in_view as in_view,
        is_met as is_met,
        on_target as on_target,
        opened as opened,
        reached as reached,
        role_of as role_of,
        sits_of as sits_of,
        stopped_seated as stopped_seated,
        stopped_within_reach as stopped_within_reach,
        touched_above_ground as touched_above_ground,
    )
    from humanclaw.records.transition import Transition as Transition
    from humanclaw.text.json import first_fault as first_fault
    from humanclaw.world.scene import Vec3 as Vec3

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
