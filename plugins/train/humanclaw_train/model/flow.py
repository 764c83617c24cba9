"""Flow matching on tensors (paper, section 3.3): the path, its velocity, and the loss of a batch.

    x(tau) = (1 - (1 - sigma_min) tau) noise + tau clean        v = clean - (1 - sigma_min) noise

A model may predict v or the clean future: humanclaw.motion.velocity and `clean` convert each into the other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor, nn

from humanclaw.body import CHUNK, FUTURE, HISTORY, N_JOINTS
from humanclaw.motion import SIGMA_MIN, Normaliser, Prediction
from humanclaw_train.model import kinematics


def noised(clean: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
    """Return x(tau) for futures (B, 15, 219) and flow times tau (B,)."""
    tau = tau[:, None, None]  # (B, 1, 1)
    return (1 - (1 - SIGMA_MIN) * tau) * noise + tau * clean


def target(clean: Tensor, noise: Tensor) -> Tensor:
    """Return the velocity that carries this noise to this future."""
    return clean - (1 - SIGMA_MIN) * noise


def clean(prediction: Prediction, output: Tensor, noisy: Tensor, tau: Tensor) -> Tensor:
    """Return the clean future that a model's output stands for."""
    if prediction == "clean":
        return output
    return (1 - (1 - SIGMA_MIN) * tau[:, None, None]) * output + (1 - SIGMA_MIN) * noisy


# -- the loss ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Weights:
    """Weights of the loss terms. Metric terms name their unit."""

    root: float = 4.0
    rotations: float = 1.0
    positions: float = 0.5
    velocities: float = 0.5
    joints: float = 0.3
    """Joint positions from the predicted rotations, per (3 cm) squared."""
    motion: float = 0.15
    """One-frame differences of those joint positions, per (5 mm) squared."""
    feet: float = 2.0
    """Extra weight of the feet in `motion`, relative to another joint."""
    stance: float = 12.0
    """Further extra weight of a foot at rest, which keeps feet from skating."""
    outcome: float = 0.2
    """Root at the last frame, per (1 cm) and (0.4 degrees) squared, linear beyond: what the skills' parameters command.
    Small errors of heading add up over a long walk."""


FULL: Final = Weights()
PLAIN: Final = Weights(1.0, 1.0, 1.0, 1.0, joints=0.0, motion=0.0, feet=0.0, stance=0.0, outcome=0.0)
"""The paper's: the mean square of what the model predicts, which for size `paper` is the velocity."""
LOSSES: Final = {"full": FULL, "plain": PLAIN}


class Loss:
    """The flow matching loss, weighted by block of the state, plus terms for joints, their motion and the outcome."""

    def __init__(self, normaliser: Normaliser, weights: Weights) -> None:
        self.normaliser = normaliser
        self.weights = weights
        device = normaliser.mean.device
        by_block = torch.empty(len(normaliser.mean), device=device)
        by_block[kinematics.ROTATIONS] = weights.rotations
        by_block[:6] = weights.root  # After the rotations, of which the root's are the first three.
        by_block[kinematics.POSITIONS] = weights.positions
        by_block[kinematics.VELOCITIES] = weights.velocities
        self.by_block = by_block / by_block.mean()  # Mean 1, so that the weights move no other term's share.
        self.feet = torch.zeros(N_JOINTS, 1, device=device)
        self.feet[list(kinematics.FEET)] = 1.0

    def __call__(self, predicted: Tensor, wanted: Tensor, clean: Tensor, states: Tensor) -> Tensor:
        """Return the loss of a batch.

        predicted, wanted: model outputs (B, 15, 219). clean: the future that `predicted` stands for, normalised.
        states: (B, 20, 219) in metres and radians.
        """
        matching = (self.by_block * (predicted - wanted).square()).mean()
        implied = self.normaliser.inverse(clean)  # (B, 15, 219), metres and radians
        root = implied[..., kinematics.ROOT]  # (B, 15, 3)
        # From the predicted rotations, not the predicted positions: rotations alone are played. (B, 15, 24, 3)
        joints = kinematics.joints(root, implied[..., kinematics.ROTATIONS].reshape(-1, FUTURE, N_JOINTS, 3))
        true = states[..., kinematics.POSITIONS].reshape(-1, CHUNK, N_JOINTS, 3)  # (B, 20, 24, 3)
        # The first step starts at the last history frame, so that the loss sees a jump at the seam.
        steps = torch.cat([true[:, HISTORY - 1 : HISTORY], joints], 1).diff(dim=1)  # (B, 15, 24, 3)
        true_steps = true[:, HISTORY - 1 :].diff(dim=1)  # (B, 15, 24, 3)
        return (
            matching
            + self.weights.joints * ((joints - true[:, HISTORY:]) / 0.03).square().mean()
            + self.weights.motion * (self._care(true_steps) * ((steps - true_steps) / 0.005).square()).mean()
            + self.weights.outcome * _outcome(implied[:, -1, :6] - states[:, -1, :6])
        )

    def _care(self, true_steps: Tensor) -> Tensor:
        """Return the weight of each joint's motion (B, 15, 24, 1)."""
        # 4 mm a frame, 12 cm/s: slower than a foot in the air, faster than the noise of a captured foot at rest.
        stance = self.feet * (true_steps.norm(dim=-1, keepdim=True) < 0.004)
        care: Tensor = 1 + self.weights.feet * self.feet + self.weights.stance * stance
        return care


def _outcome(error: Tensor) -> Tensor:
    """Return the loss of root translation and rotation errors (B, 6), metres and radians."""
    units = torch.tensor([0.01] * 3 + [math.radians(0.4)] * 3, device=error.device)
    return nn.functional.smooth_l1_loss(error / units, torch.zeros_like(error))
