"""An agent in twenty lines: `humanclaw run --plugin examples/rover.py --agent rover`.

It walks while the view changes and turns when it does not: a body that is stuck at a wall keeps the same view.
"""

import numpy as np

from humanclaw import Call, Decision, hookimpl


class Rover:
    name, privileged = "rover", False

    def begin(self, context):
        self.last = context.spec.max_steps - 1

    def decide(self, observation, history):
        if observation.step == self.last:
            return Decision((Call("stop"),), reasoning="My time is up.")
        changed = np.abs(observation.rgb - (history[-1].rgb.astype(float) if history else 0)).mean()
        if changed < 8:
            return Decision((Call("turn_in_place", {"yaw_deg": 60}),), reasoning="The view is as before: I am stuck.")
        return Decision((Call("walk", {"z_cm": 50}),), reasoning="The way is free.")


@hookimpl
def humanclaw_agents(register):
    register("rover", lambda options: Rover(), "walks ahead, and turns when the view does not change")
