"""Training tasks as a taskset: a seed each, rewards by name, and facts of success as metrics."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any, ClassVar

import verifiers.v1 as vf
from pydantic import Field
from verifiers.v1.envs.single_agent import SingleAgentEnv, SingleAgentEnvConfig

from humanclaw import Gym

FACTS = "humanclaw"
"""Key of `trace.info` under which the harness leaves what the rubric reads."""


class BodyConfig(vf.TasksetConfig):
    """Which tasks, and what they are rewarded for: `--env.taskset.tasks approach`."""

    tasks: str = "train"
    """Source of training tasks."""
    options: dict[str, Any] = Field(default_factory=dict)
    """Options of the source, such as {"houses": 40, "difficulty": "easy"}."""
    rewards: dict[str, float] | None = None
    """Weight of each reward by name; by default the tasks' own."""
    first: int = Field(0, ge=0)
    """Seed of the first task."""


class BodyData(vf.TaskData):
    """What leads to one task."""

    tasks: str
    options: dict[str, Any]
    rewards: dict[str, float] | None
    seed: int


class BodyTask(vf.Task[BodyData]):
    """One task. Its rubric is what the body did: the words of the agent count only for rewards of words."""

    @vf.reward
    async def earned(self, trace: vf.Trace) -> float:
        """Return the sum of the weighted rewards of all steps."""
        return float(trace.info[FACTS]["reward"])

    @vf.metric
    async def facts(self, trace: vf.Trace) -> dict[str, float]:
        """Return solved, found, arrived, seated, false claims, contacts and steps (docs/gym.md)."""
        return {name: float(value) for name, value in trace.info[FACTS].items() if name != "reward"}


class BodyTaskset(vf.Taskset[BodyTask, BodyConfig]):
    """Endless tasks: bound them with `-n`."""

    INFINITE: ClassVar[bool] = True

    def load(self) -> Iterator[BodyTask]:
        """Yield the task of each seed. Raises HumanclawError for wrong names and options, before any rollout."""
        config = self.config
        Gym(config.tasks, config.rewards, options=config.options)
        for seed in itertools.count(config.first):
            data = BodyData(
                name=f"{config.tasks}-{seed}", prompt="", tasks=config.tasks, options=config.options,
                rewards=config.rewards, seed=seed,
            )  # fmt: skip
            yield BodyTask(data, config.task)


class BodyEnvConfig(SingleAgentEnvConfig):
    """One agent, on this machine: its loop runs no code of the model."""

    agent: vf.AgentConfig = vf.AgentConfig(runtime=vf.SubprocessConfig())


class BodyEnv(SingleAgentEnv, vf.Env[BodyEnvConfig]):
    """One agent plays one task."""
