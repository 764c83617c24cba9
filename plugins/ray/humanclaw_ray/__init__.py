"""Play the episodes of a run on a Ray cluster."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw import hookimpl

if TYPE_CHECKING:
    from humanclaw.plugins import Register
    from humanclaw_bench.hookspecs import Executor, ExecutorFactory

__version__ = "0.1.0"


@hookimpl(optionalhook=True)
def humanclaw_executors(register: Register[ExecutorFactory]) -> None:
    register("ray", _ray, "a Ray cluster")


def _ray(workers: int = 1, address: str = "") -> Executor:
    from humanclaw_ray.executor import RayExecutor

    return RayExecutor(workers, address)
