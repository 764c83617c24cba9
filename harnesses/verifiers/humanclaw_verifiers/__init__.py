"""HumanCLAW harness: training tasks as a taskset of `verifiers`: `vf-eval humanclaw-verifiers`."""

from humanclaw_verifiers.harness import BodyHarness
from humanclaw_verifiers.taskset import BodyEnv, BodyTaskset

__version__ = "0.1.0"
__all__ = ["BodyEnv", "BodyHarness", "BodyTaskset"]
