"""A task of one's own: `humanclaw bench run --split turned_round --plugin examples/hooks/splits.py --agent still`."""

from humanclaw import EpisodeSpec, RecordedEpisode, hookimpl
from humanclaw_bench import task
from humanclaw_bench.hookspecs import RegisterTask


@task(EpisodeSpec(id="turn", instruction="turn once around.", scene="house:0", max_steps=20))
def turned_round(episode: RecordedEpisode) -> bool:
    """Turn by 350 degrees or more."""
    return abs(sum(step.yaw_end - step.yaw_start for step in episode.steps)) > 6.1


@hookimpl(optionalhook=True)
def humanclaw_splits(register: RegisterTask) -> None:
    register(turned_round)
