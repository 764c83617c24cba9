"""HumanCLAW harness: the body as a Gymnasium environment. Importing it makes `gymnasium.make("HumanCLAW-v0")` known."""

from __future__ import annotations

import gymnasium

from humanclaw_gymnasium.actions import Actions
from humanclaw_gymnasium.env import BodyEnv

__version__ = "0.1.0"
__all__ = ["Actions", "BodyEnv"]

# The environment counts its own steps, so no TimeLimit is asked for.
gymnasium.register("HumanCLAW-v0", entry_point="humanclaw_gymnasium.env:BodyEnv")
