"""The gym: one body plays training tasks one after the other, and each step is rewarded.

Harnesses for trainers are clients of Gym. Gym is a client of Episode, so a task in training is played, limited and
judged as an episode of a run is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from numbers import Integral
from typing import Any, Final, Self

import numpy as np

from humanclaw.episodes.backends import Backends
from humanclaw.episodes.embodiment import Body
from humanclaw.episodes.episode import Episode
from humanclaw.errors import CallError, HumanclawError, blaming
from humanclaw.plugins.agents import EpisodeContext, Observation, Tasks, Verifier
from humanclaw.plugins.host import Plugins
from humanclaw.records.decisions import Decision, Refusal
from humanclaw.records.specification import EpisodeSpec
from humanclaw.records.transition import Transition
from humanclaw.skills.answer_parsing import read_call
from humanclaw.skills.contract import Skill
from humanclaw.world.navigation.approach import geodesics
from humanclaw.world.scene import Scene
from humanclaw.world.simulator import DistanceFn

SCENES: Final = 4
"""Scenes and maps that a gym keeps in memory."""


@dataclass(frozen=True)
class Turn:
    """What an agent may know before its next decision, and the reward of the last one."""

    observation: Observation
    reward: float = 0.0
    rewards: Mapping[str, float] = field(default_factory=dict)
    """The parts of the reward by name, before their weights."""
    done: bool = False
    solved: bool = False
    """Whether the task is solved."""

    @property
    def words(self) -> str:
        """Outcome of the last decision; empty at the start."""
        return str(self.observation.feedback)


class Gym:
    """Plays tasks with one body. Not thread-safe; close it, or use it as a context manager."""

    def __init__(
        self,
        tasks: str | Tasks = "train",
        rewards: Mapping[str, float] | None = None,
        *,
        options: Mapping[str, Any] | None = None,
        agent: str = "gym",
        verifier: Verifier | None = None,
        plugins: Plugins | None = None,
        backends: Backends | None = None,
    ) -> None:
        """Find tasks and rewards; nothing is played before reset() or begin().

        Args:
            tasks: the name of a source (hook humanclaw_tasks), or one.
            rewards: weight by name (hook humanclaw_rewards); by default those of the tasks.
            options: of the source of tasks.
            agent: name of the agent, for records.
            verifier: checks each call before the body moves.

        Raises HumanclawError for unknown names and options, and for a weight that is no finite number.
        """
        self.plugins = plugins or Plugins.discover()
        self.tasks: Tasks = self.plugins.make("tasks", tasks, options or {}) if isinstance(tasks, str) else tasks
        weights = self.tasks.rewards if rewards is None else rewards
        self.weights = {name: _weight(name, value) for name, value in weights.items()}
        self._rewards = {name: self.plugins.offered("rewards", name) for name in {*self.weights, self.tasks.goal}}
        self._backends = (backends or Backends()).chosen(self.plugins)
        self._agent, self._verifier = agent, verifier
        self.scene: Callable[[str], Scene] = lru_cache(SCENES)(self.plugins.scene)
        """Return the scene of a reference; the last ones are kept."""
        self._ways = lru_cache(SCENES)(geodesics)
        self._body: Body | None = None
        self._episode: Episode | None = None

    @property
    def episode(self) -> Episode:
        """The current episode. Raises HumanclawError before the first one."""
        if self._episode is None:
            raise HumanclawError("no episode has begun.", "Call reset() first.")
        return self._episode

    @property
    def context(self) -> EpisodeContext:
        """What the agent of the current episode is told before its first step."""
        body = self.episode.body
        return EpisodeContext(self.episode.spec.for_agent, body.skills, self.episode.spec.seed, gaze=body.gaze)

    @property
    def skills(self) -> tuple[Skill, ...]:
        """The skills that can be called."""
        return tuple(skill for skill in self.plugins.skills.values() if skill.trained)

    def reset(self, seed: int) -> Turn:
        """Begin the task of a seed. Raises HumanclawError unless it is a whole number from 0."""
        if not isinstance(seed, Integral) or seed < 0:
            raise HumanclawError(f"a seed is a whole number from 0; got {seed!r}.", "Give another one.")
        return self.begin(self.tasks(seed))

    def begin(self, spec: EpisodeSpec) -> Turn:
        """Begin an episode. Raises SceneError for an unknown scene, or one with another digest."""
        self._end()
        scene = self.scene(spec.scene)
        if self._body is None:
            self._body = Body(scene, plugins=self.plugins, backends=self._backends)
        self._episode = Episode(
            self._body, spec, self._agent, self._verifier, scene=scene, distance=self._distance,
            # A learner must see that its call was refused: a refused call costs a step.
            attempts=1,
        )  # fmt: skip
        self._solved = False
        return Turn(self._episode.observe())

    def _distance(self, scene: Scene, targets: Sequence[int], floor: float) -> DistanceFn:
        return self._ways(scene, tuple(targets), floor)

    def submit(self, decision: Decision, refusal: str = "") -> Turn:
        """Take a step. refusal: why the answer held no call, in place of the episode's own words.

        Raises HumanclawError if the episode has ended.
        """
        episode = self.episode
        done = episode.submit(decision)
        assert not isinstance(done, Refusal), "one attempt a step"
        transition = Transition(episode.record, episode.steps, episode.body.scene, episode.success)
        rewards = {name: self._rewarded(name, transition) for name in self._rewards}
        self._solved = self._solved or rewards[self.tasks.goal] >= 1
        reward = sum(weight * rewards[name] for name, weight in self.weights.items())
        seen = episode.observe()
        if refusal:
            seen = replace(seen, feedback=replace(seen.feedback, refusal=refusal))
        return Turn(seen, reward, rewards, episode.done, self._solved)

    def call(self, name: str, arguments: str | Mapping[str, Any]) -> Turn:
        """Take a step by a tool call of a model: a skill's parameters behind the reasoning fields.

        A call that cannot be read or executed costs the step, and the words say why.
        """
        try:
            said, call = read_call(name, arguments)
        except CallError as fault:
            return self.submit(Decision(raw=str(arguments)), str(fault))
        return self.submit(Decision((call,), **vars(said)))

    def _rewarded(self, name: str, transition: Transition) -> float:
        """Return a reward. Raises PluginRunError, which names the plugin, for an error in its code or no number."""
        with blaming(self.plugins.owner(name, "rewards")):
            value = float(self._rewards[name](transition))
            if not np.isfinite(value):
                raise ValueError(f"reward {name!r} must be a finite number; got {value}")
        return value

    def _end(self) -> None:
        if self._episode:
            self._episode.close()
            self._episode = None

    def close(self) -> None:
        """End the episode and close the body."""
        self._end()
        if self._body:
            self._body.close()
            self._body = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _weight(name: str, value: Any) -> float:
    """Return the weight of a reward. Raises HumanclawError for anything but a finite number."""
    try:
        weight = float(value)
    except (TypeError, ValueError, OverflowError):
        weight = np.nan
    if not np.isfinite(weight):
        raise HumanclawError(f"the weight of {name} must be a finite number; got {value!r}.", "Give another one.")
    return weight
