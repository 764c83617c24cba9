"""A new metric: `humanclaw bench table RUN --only plugins --plugin examples/turning.py`.

It is computed from the record of an episode alone. Tables, exports and humanclaw_bench.load show it as a column.
"""

from humanclaw import hookimpl


@hookimpl(optionalhook=True)
def humanclaw_metrics(register):
    register("turning", lambda episode: sum(abs(step.yaw_end - step.yaw_start) for step in episode.steps), "radians")
