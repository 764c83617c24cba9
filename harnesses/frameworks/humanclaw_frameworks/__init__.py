"""HumanCLAW harness: the skills as tools of agent frameworks.

Body.tools("langchain") calls `langchain` of wrappers.py. A plugin can add a framework with the same hook.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from humanclaw import PluginError, hookimpl

if TYPE_CHECKING:
    from humanclaw.plugins import FrameworkFactory, Register
    from humanclaw.skills import BodyTool

__version__ = "0.1.0"

FRAMEWORKS: Final[Mapping[str, tuple[str, str]]] = {
    "openai": ("openai", "chat completions: a list for `tools=`, and `answer(message)` for the messages that follow"),
    "anthropic": ("anthropic", "runnable tools, for `client.beta.messages.tool_runner` and `messages.create`"),
    "google": ("google-genai", "a list of types.Tool, and `answer(response)` for the contents that follow"),
    "pydantic_ai": ("pydantic-ai-slim", "pydantic_ai.Tool"),
    "langchain": ("langchain-core", "langchain_core.tools.StructuredTool, for LangGraph's agents too"),
    "openai_agents": ("openai-agents", "agents.FunctionTool"),
    "smolagents": ("smolagents", "smolagents.Tool, and `see` for `step_callbacks`, which shows the model the pictures"),
}
"""Framework to its distribution, and to what Body.tools returns."""


@hookimpl
def humanclaw_frameworks(register: Register[FrameworkFactory]) -> None:
    for name, (distribution, description) in FRAMEWORKS.items():
        register(name, partial(_wrap, name, distribution), description)


def _wrap(name: str, distribution: str, tools: Sequence[BodyTool]) -> Any:
    from humanclaw_frameworks import wrappers

    try:
        return getattr(wrappers, name)(tools)
    except ModuleNotFoundError as error:
        needed = f'tools("{name}") needs {error.name}, which is not installed.'
        raise PluginError(needed, f"Run `pip install {distribution}`.") from error
