"""FLOW_DOC"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from humanclaw.body import N_JOINTS
from humanclaw.motion import (
    SIGMA_MIN,
    Prediction,
)
from humanclaw.pose import CHUNK, FUTURE, HISTORY
from humanclaw_train import kinematics
from humanclaw_train.checkpoint import Normaliser


def noised(clean: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
    """x(tau); tau (B,) against (B, 15, 219)."""
    tau = tau[:, None, None]
    return (1 - (1 - SIGMA_MIN) * tau) * noise + tau * clean


def target(clean: Tensor, noise: Tensor) -> Tensor:
    """Return the velocity that carries this noise to this future."""
    return clean - (1 - SIGMA_MIN) * noise


def velocity(prediction: Prediction, output: Tensor, noisy: Tensor, tau: Tensor) -> Tensor:
    """Return the velocity that a model's output means. tau (B,) below 1."""
    if prediction == "velocity":
        return output
    return (output - (1 - SIGMA_MIN) * noisy) / (1 - (1 - SIGMA_MIN) * tau[:, None, None])


def clean(prediction: Prediction, output: Tensor, noisy: Tensor, tau: Tensor) -> Tensor:
    """Return the clean future that a model's output means."""
    if prediction == "clean":
        return output
    return (1 - (1 - SIGMA_MIN) * tau[:, None, None]) * output + (1 - SIGMA_MIN) * noisy


# -- the loss ----------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Weights:
    """How the terms of the loss are weighed against one another. The unit of the metric terms is named with each."""

    root: float = 4.0
    rotations: float = 1.0
    positions: float = 0.5
    velocities: float = 0.5
    joints: float = 0.3
    """Forward kinematics of the predicted rotations, per (3 cm) squared."""
    motion: float = 0.15
    """Their one-frame differences, per (5 mm) squared."""
    feet: float = 2.0
    """Of those, how much more the feet count than another joint,"""
    stance: float = 12.0
    """and how much more a foot that is at rest: this is what keeps feet from skating."""
    outcome: float = 0.2
    """Root at the last frame, per (1 cm) and (0.4 degrees) squared, linear beyond: what the skills' parameters command.
    Of the heading little is enough to lead a long walk astray."""


class Loss:
    """Flow matching, weighed by block of the state, with what the state implies for the joints and for the outcome."""

    def __init__(self, normaliser: Normaliser, weights: Weights) -> None:
        self.normaliser = normaliser
        self.weights = weights
        device = normaliser.mean.device
        by_block = torch.empty(len(normaliser.mean), device=device)
        by_block[kinematics.ROTATIONS] = weights.rotations
        by_block[:6] = weights.root
        by_block[kinematics.POSITIONS] = weights.positions
        by_block[kinematics.VELOCITIES] = weights.velocities
        self.by_block = by_block / by_block.mean()
        self.feet = torch.zeros(N_JOINTS, 1, device=device)
        self.feet[list(kinematics.FEET)] = 1.0

    def __call__(self, predicted: Tensor, wanted: Tensor, clean: Tensor, states: Tensor) -> Tensor:
        """predicted, wanted: outputs (B, 15, 219). clean: the future that predicted means. states: (B, 20, 219) in
        metres."""
        matching = (self.by_block * (predicted - wanted).square()).mean()
        implied = self.normaliser.inverse(clean)
        root = implied[..., kinematics.ROOT]
        joints = kinematics.joints(root, implied[..., kinematics.ROTATIONS].reshape(-1, FUTURE, N_JOINTS, 3))
        true = states[..., kinematics.POSITIONS].reshape(-1, CHUNK, N_JOINTS, 3)
        steps = torch.cat([true[:, HISTORY - 1 : HISTORY], joints], 1).diff(dim=1)
        true_steps = true[:, HISTORY - 1 :].diff(dim=1)
        return (
            matching
            + self.weights.joints * ((joints - true[:, HISTORY:]) / 0.03).square().mean()
            + self.weights.motion * (self._care(true_steps) * ((steps - true_steps) / 0.005).square()).mean()
            + self.weights.outcome * _outcome(implied[:, -1, :6] - states[:, -1, :6])
        )

    def _care(self, true_steps: Tensor) -> Tensor:
        """(B, 15, 24, 1) how much each joint's motion matters."""
        stance = self.feet * (true_steps.norm(dim=-1, keepdim=True) < 0.004)
        care: Tensor = 1 + self.weights.feet * self.feet + self.weights.stance * stance
        return care


def _outcome(error: Tensor) -> Tensor:
    """(B, 6) root translation and rotation errors, metres and radians."""
    units = torch.tensor([0.01] * 3 + [math.radians(0.4)] * 3, device=error.device)
    return nn.functional.smooth_l1_loss(error / units, torch.zeros_like(error))


# -- the problem of a batch --------------------------------------------------------------------------------------------
Forward = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
"""(history, noisy future, tau, encoded condition) to the model's output."""
Objective = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]
"""(states, encoded condition, noise, tau) to the loss."""


def objective(forward: Forward, loss: Loss, prediction: Prediction, fast: bool = False) -> Objective:
    """Return the flow matching problem of a batch, answered by `forward`, judged by `loss`. fast: compiled as a
    whole."""

    def value(states: Tensor, condition: Tensor, noise: Tensor, tau: Tensor) -> Tensor:
        normal = loss.normaliser.forward(states)
        future = normal[:, HISTORY:]
        noisy = noised(future, noise, tau)
        with torch.autocast(states.device.type, torch.bfloat16, enabled=_has_bfloat16(states.device)):
            output = forward(normal[:, :HISTORY], noisy, tau, condition)
        output = output.float()
        wanted = future if prediction == "clean" else target(future, noise)
        return loss(output, wanted, clean(prediction, output, noisy, tau), states)

    return torch.compile(value) if fast else value


def _has_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 pays: a processor without AVX-512 emulates it, thirteen times slower than float32 (measured on
    AVX2)."""
    return device.type != "cpu" or torch.backends.cpu.get_cpu_capability() == "AVX512"
