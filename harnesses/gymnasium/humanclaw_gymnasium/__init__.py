"""HumanCLAW harness: the body as a Gymnasium environment. The import registers `HumanCLAW-v0`."""

from __future__ import annotations

import gymnasium

from humanclaw_gymnasium.actions import Actions
from humanclaw_gymnasium.env import BodyEnv

__version__ = "0.1.0"
__all__ = ["Actions", "BodyEnv"]

# No max_episode_steps: the environment counts its own steps.
gymnasium.register("HumanCLAW-v0", entry_point="humanclaw_gymnasium.env:BodyEnv")
