"""A metric of one's own: `humanclaw bench table RUN --only plugins --plugin examples/turning.py`.

It is computed from an episode's record alone, and is a column of tables, exports and humanclaw_bench.load.
"""

from humanclaw import hookimpl


@hookimpl(optionalhook=True)
def humanclaw_metrics(register):
    register("turning", lambda episode: sum(abs(step.yaw_end - step.yaw_start) for step in episode.steps), "radians")
