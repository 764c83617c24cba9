"""Skills: their contract, measures and recipes, and skills as tools of a model."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.skills.answer_parsing import (
        Reasoning as Reasoning,
        plain_name as plain_name,
        read_answer as read_answer,
        read_call as read_call,
        read_objects as read_objects,
        read_text as read_text,
    )
    from humanclaw.skills.body_tool import BodyTool as BodyTool, ToolResult as ToolResult
    from humanclaw.skills.call import Call as Call
    from humanclaw.skills.contract import (
        Skill as Skill,
        bounds as bounds,
        check_call as check_call,
        find_suited as find_suited,
        suited as suited,
    )
    from humanclaw.skills.floor_scenes import HIPS as HIPS, floor_for as floor_for, floor_scene as floor_scene
    from humanclaw.skills.gaze_grip_speech import Side as Side
    from humanclaw.skills.heading_correction import HeadingCorrection as HeadingCorrection
    from humanclaw.skills.measures import (
        MEASURES as MEASURES,
        ROLES as ROLES,
        Measure as Measure,
        Parameter as Parameter,
        Role as Role,
        find as find,
        from_si as from_si,
        outcomes as outcomes,
        parameters_of as parameters_of,
        to_si as to_si,
    )
    from humanclaw.skills.plan import MotionError as MotionError
    from humanclaw.skills.plan_motion import Plan as Plan, part_motion as part_motion, parts as parts
    from humanclaw.skills.recipes import (
        Draw as Draw,
        Feet as Feet,
        GaitParameters as GaitParameters,
        Recipe as Recipe,
        WindowTravel as WindowTravel,
    )
    from humanclaw.skills.regression import Regression as Regression
    from humanclaw.skills.thoughts import split_thoughts as split_thoughts
    from humanclaw.skills.tool_schemas import (
        REASONING_FIELDS as REASONING_FIELDS,
        THOUGHTS as THOUGHTS,
        Json as Json,
        answer_schema as answer_schema,
        call_schema as call_schema,
        in_format as in_format,
        parameter_schema as parameter_schema,
        reasoning_schema as reasoning_schema,
        tool_list as tool_list,
    )

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
