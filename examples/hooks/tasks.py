"""Training tasks, a couch in every house: `Gym("corridor", plugins=Plugins.discover(["examples/hooks/tasks.py"]))`."""

from collections.abc import Mapping

from humanclaw import EpisodeSpec, hookimpl
from humanclaw.plugins import Register, TasksFactory


class Corridor:
    goal = "success"
    rewards: Mapping[str, float] = {"success": 1.0, "progress": 0.1}

    def __call__(self, seed: int) -> EpisodeSpec:
        return EpisodeSpec(id=f"corridor-{seed}", instruction="find a couch", scene=f"house:train-{seed}", seed=seed)


@hookimpl
def humanclaw_tasks(register: Register[TasksFactory]) -> None:
    register("corridor", lambda options: Corridor(), "a couch in every house")
