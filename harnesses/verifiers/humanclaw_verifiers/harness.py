"""The loop of an agent: the model calls a skill, the body moves, the model sees its new view.

It runs in the process of verifiers. Every call of the model goes through its interception, so a trainer gets the
tokens.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence
from typing import Any, ClassVar

import verifiers.v1 as vf
from openai import AsyncOpenAI
from verifiers.v1.clients import ModelContext
from verifiers.v1.configs.harness import HarnessConfig
from verifiers.v1.runtimes import ProgramResult, Runtime

from humanclaw import TURNS, Call, CallError, Decision, Episode, Gym, Plugins, Turn, model_tools, opening, situation
from humanclaw.records import Transition, in_view, stopped_seated, stopped_within_reach, touched_above_ground
from humanclaw.skills import Json, read_call
from humanclaw_verifiers.taskset import FACTS, BodyData


class BodyHarnessConfig(HarnessConfig):
    """Options of the harness: there are none of its own."""


class BodyHarness(vf.Harness[BodyHarnessConfig]):
    """Plays one task in a body of its own, in a thread."""

    EXECUTES_CODE: ClassVar[bool] = False
    NEEDS_CONTAINER: ClassVar[bool] = False

    def __init__(self, config: BodyHarnessConfig) -> None:
        super().__init__(config)
        self._lock = threading.Lock()
        self._plugins: Plugins | None = None

    async def launch(
        self, ctx: ModelContext, trace: vf.Trace, runtime: Runtime, endpoint: str, secret: str,
        mcp_urls: dict[str, str], data: BodyData,
    ) -> ProgramResult:  # fmt: skip
        """Play the task to its end, and leave reward and facts in the trace."""
        gym = await asyncio.to_thread(self._gym, data)
        try:
            async with AsyncOpenAI(base_url=endpoint, api_key=secret) as client:
                reward, turn = await _play(gym, client, ctx.model, data.seed)
            trace.info[FACTS] = facts(gym.episode, turn) | {"reward": reward}
        finally:
            await asyncio.to_thread(gym.close)
        return ProgramResult(exit_code=0, stdout="", stderr="")

    def _gym(self, data: BodyData) -> Gym:
        with self._lock:  # Plugins are found once for all rollouts.
            self._plugins = self._plugins or Plugins.discover()
        return Gym(data.tasks, data.rewards, options=data.options, agent="verifiers", plugins=self._plugins)


async def _play(gym: Gym, client: AsyncOpenAI, model: str, seed: int) -> tuple[float, Turn]:
    """Play the task of a seed. Returns the sum of the rewards, and the last turn."""
    turn, reward = await asyncio.to_thread(gym.reset, seed), 0.0
    messages, tools = opening(gym, turn), model_tools(gym.skills, TURNS)
    while not turn.done:
        asked: Any = {"messages": messages, "tools": tools}
        answer = await client.chat.completions.create(model=model, **asked)
        # A server may refuse a message with neither words nor a call, even if the model sent it.
        said = {"content": ""} | answer.choices[0].message.model_dump(exclude_none=True)
        turn = await asyncio.to_thread(_step, gym, said)
        reward += turn.reward
        messages += [said, *_results(said, turn), {"role": "user", "content": situation(gym, turn)}]
    return reward, turn


def _step(gym: Gym, said: Json) -> Turn:
    """Execute the one call of an answer; any other number of calls costs the step."""
    calls = [call["function"] for call in said.get("tool_calls") or ()]
    if len(calls) == 1:
        return gym.call(calls[0]["name"], calls[0]["arguments"])
    return gym.submit(Decision(tuple(_read(call) for call in calls), raw=str(said.get("content") or "")))


def _read(call: Json) -> Call:
    try:
        return read_call(call["name"], call["arguments"])[1]
    except CallError:
        return Call(call["name"])  # Among several calls nothing is executed; this one only has to be counted.


def _results(said: Json, turn: Turn) -> list[Json]:
    return [
        {"role": "tool", "tool_call_id": call["id"], "content": turn.words} for call in said.get("tool_calls") or ()
    ]


def facts(episode: Episode, turn: Turn) -> dict[str, float]:
    """Return the facts of a finished episode by the benchmark's definitions, from its steps alone."""
    steps, sits = episode.steps, {name for name, skill in episode.body.skills.items() if skill.role == "sit"}
    transition = Transition(episode.record, steps, episode.body.scene, episode.success)
    claims = [(transition.claims(step), in_view(step)) for step in steps]
    false = [claim for claim, shown in claims if not shown]
    touched = [bool(touched_above_ground(transition, step)) for step in steps if step.motion_frames]
    return {
        "solved": float(turn.solved),
        "found": float((True, True) in claims),
        "arrived": float(stopped_within_reach(steps)),
        "seated": float(stopped_seated(episode.spec, steps, sits)),
        "false_claims": _share(false),
        "contacts": _share(touched),
        "steps": float(len(steps)),
    }


def _share(marks: Sequence[bool]) -> float:
    return sum(marks) / len(marks) if marks else 0.0
