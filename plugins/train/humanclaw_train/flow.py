"""The flow matching problem on tensors (paper, section 3.3): the path, its velocity, and what a model's answer means.

    x(tau) = (1 - (1 - sigma_min) tau) noise + tau clean        v = clean - (1 - sigma_min) noise

A model may answer with v or with the clean future; the two say the same, and `velocity` and `clean` turn each into the
other.
"""

from __future__ import annotations

from torch import Tensor

from humanclaw.motion import SIGMA_MIN, Prediction


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
