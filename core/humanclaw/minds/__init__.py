"""Minds: what a model is told of a body, and the gym in which it is trained."""

from typing import TYPE_CHECKING

from humanclaw.doors import door

if TYPE_CHECKING:
    from humanclaw.minds.chat import (
        TURNS as TURNS,
        opening as opening,
        situation as situation,
        tool_call as tool_call,
    )
    from humanclaw.minds.gym import Gym as Gym, Turn as Turn
    from humanclaw.minds.prompts import (
        data as data,
        first_told as first_told,
        model_tools as model_tools,
        step_content as step_content,
        system_message as system_message,
        system_prompt as system_prompt,
        verifier_content as verifier_content,
        verifier_prompt as verifier_prompt,
    )
    from humanclaw.minds.settings import PromptSettings as PromptSettings
    from humanclaw.skills.publishing import Json as Json

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = door(__name__)
