"""Environments for TRL: `GRPOTrainer(environment_factory=environment("approach"))`. They need neither OpenEnv nor TRL.

TRL takes each public method of an environment for a tool and reads its signature and docstring, so every skill becomes
a method here.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from PIL import Image

from humanclaw import TURNS, Gym, Plugins, Turn, model_tools, opening
from humanclaw.skills import Json
from humanclaw.storage import from_jpeg, jpeg

_TYPES: Mapping[str, type] = {"integer": int, "number": float, "string": str, "boolean": bool, "array": list}
_THOUGHTS = "What you see, what the last call changed, your goal, and why this call: a line each."


class BodyEnvironment:
    """One rollout at a time. environment() adds a method for each skill."""

    _make: Callable[[], Gym]
    _pictures: bool

    def __init__(self) -> None:
        self._gym = type(self)._make()
        self._turn: Turn | None = None
        self._return = 0.0

    def reset(self, seed: int, **_: Any) -> str:
        """Begin the task of a seed, a column of the dataset; return what TRL appends to the prompt."""
        self._turn, self._return = self._gym.reset(int(seed)), 0.0
        system, user = opening(self._gym, self._turn)
        return "\n\n".join([system["content"], *(part["text"] for part in user["content"] if part["type"] == "text")])

    def get_reward(self) -> float:
        """Return the sum of the rewards of the steps so far."""
        return self._return

    def _call(self, name: str, arguments: Mapping[str, Any]) -> str | list[Json]:
        if self._turn is None or self._turn.done:
            return "The task is over."
        self._turn = self._gym.call(name, arguments)
        self._return += self._turn.reward
        if not self._pictures:
            return self._turn.words
        view = Image.fromarray(from_jpeg(jpeg(self._turn.observation.rgb)))
        return [{"type": "text", "text": self._turn.words}, {"type": "image", "image": view}]


def environment(
    tasks: str = "train",
    rewards: Mapping[str, float] | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    pictures: bool = True,
    plugins: Plugins | None = None,
) -> type[BodyEnvironment]:
    """Return a class whose instances play training tasks.

    Args:
        tasks, rewards, options: as of humanclaw.Gym.
        pictures: whether the result of a tool holds the view; False for a model that takes none.
    """
    host = plugins or Plugins.discover()
    made = Gym(tasks, rewards, options=options, plugins=host)
    tools = {tool["function"]["name"]: _method(tool["function"]) for tool in model_tools(made.skills, TURNS)}
    gym = staticmethod(lambda: Gym(tasks, rewards, options=options, agent="trl", plugins=host))
    return type("BodyEnvironment", (BodyEnvironment,), {**tools, "_make": gym, "_pictures": pictures})


def _method(spec: Json) -> Callable[..., Any]:
    """Return a method that calls a skill, with the signature and the docstring that TRL reads."""
    parts: Mapping[str, Json] = spec["parameters"]["properties"]

    def call(self: BodyEnvironment, **arguments: Any) -> str | list[Json]:
        return self._call(spec["name"], arguments)

    kinds = {key: _TYPES.get(part.get("type", ""), dict) for key, part in parts.items()}
    keyword = inspect.Parameter.KEYWORD_ONLY
    own = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    named = [inspect.Parameter(key, keyword, annotation=kind) for key, kind in kinds.items()]
    described = [f"    {key}: {part.get('description', _THOUGHTS)}" for key, part in parts.items()]
    call.__name__ = call.__qualname__ = spec["name"]
    call.__doc__ = "\n".join([spec["description"], "", "Args:", *described])
    call.__annotations__ = {**kinds, "return": str}
    # inspect reads it; typeshed has no such attribute.
    call.__signature__ = inspect.Signature([own, *named], return_annotation=str)  # type: ignore[attr-defined]
    return call
