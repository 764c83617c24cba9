"""Training tasks as an OpenEnv environment: MCP-style tool calls, reward and done on the observation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from openenv.core.env_server.interfaces import Environment
from openenv.core.env_server.mcp_types import (
    CallToolAction,
    CallToolObservation,
    ListToolsAction,
    ListToolsObservation,
    Tool,
)
from openenv.core.env_server.types import Observation, State
from pydantic import Field

from humanclaw import TURNS, Gym, Turn, model_tools, opening, situation


class BodyObservation(CallToolObservation):
    """What a model is told after a tool call. The agent knows `result` alone; the rest is for the trainer."""

    result: list[dict[str, Any]] = Field(default_factory=list)
    """Content of the next user message in the chat format: words, and the view as a data URL."""
    system: str = ""
    """System prompt of the episode, after a reset."""
    rewards: dict[str, float] = Field(default_factory=dict)
    """The parts of the reward by name, before their weights."""
    solved: bool = False


class BodyState(State):
    """State of an episode."""

    instruction: str = ""
    solved: bool = False


class BodyEnvironment(Environment[CallToolAction, Observation, BodyState]):
    """One session: a body that plays one task at a time. The same seed begins the same episode."""

    SUPPORTS_CONCURRENT_SESSIONS: ClassVar[bool] = True

    def __init__(self, gym: Callable[[], Gym]) -> None:
        """gym: makes the gym of the session, with a body of its own."""
        super().__init__()
        self._gym = gym()
        self._turn: Turn | None = None
        self._episode_id: str | None = None

    def reset(self, seed: int | None = None, episode_id: str | None = None, **_: Any) -> BodyObservation:
        """Begin the task of a seed (default 0)."""
        self._turn = self._gym.reset(seed or 0)
        self._episode_id = episode_id or self._gym.episode.spec.id
        system, user = opening(self._gym, self._turn)
        return BodyObservation(tool_name="reset", result=user["content"], system=system["content"])

    def step(self, action: CallToolAction | ListToolsAction, timeout_s: float | None = None, **_: Any) -> Observation:
        """Call a skill, or list the skills; listing needs no episode and takes no step."""
        if isinstance(action, ListToolsAction):
            specs = [tool["function"] for tool in model_tools(self._gym.skills, TURNS)]
            return ListToolsObservation(tools=[Tool(input_schema=spec.pop("parameters"), **spec) for spec in specs])
        turn = self._turn = self._gym.call(action.tool_name, action.arguments)
        return BodyObservation(
            tool_name=action.tool_name, result=situation(self._gym, turn), reward=turn.reward, done=turn.done,
            rewards=dict(turn.rewards), solved=turn.solved,
        )  # fmt: skip

    @property
    def state(self) -> BodyState:
        if self._turn is None:
            return BodyState()
        episode, solved = self._gym.episode, self._turn.solved
        return BodyState(
            episode_id=self._episode_id, step_count=len(episode.steps), instruction=episode.spec.instruction,
            solved=solved,
        )  # fmt: skip

    def close(self) -> None:
        """Free the body."""
        self._gym.close()
        self._turn = None
