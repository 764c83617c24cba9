"""The shared motion prior with its adapters, in numpy: load them, generate with them (paper, section 3.3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from humanclaw._lazy import lazy

if TYPE_CHECKING:
    from humanclaw.motion.checkpoint import (
        FORMAT,
        HEADER,
        MODEL,
        Base,
        Card,
        Tensors,
        broken,
        load_adapter,
        load_base,
        own_tensors,
        read_adapter,
        read_checkpoint,
        read_header,
        shipped_base,
    )
    from humanclaw.motion.control import FOURIER_FREQUENCIES, OCTAVES, AdapterConfig, Encoder
    from humanclaw.motion.course import Course
    from humanclaw.motion.dit import SIZES, ModelConfig, Prediction, Weights, time_frequencies
    from humanclaw.motion.flow import PROFILES, SIGMA_MIN, Solver, noise_of
    from humanclaw.motion.generator import DiTGenerator
    from humanclaw.motion.ik import REACH, SIDES, TOE_BASE, Limb, solve

_HOMES = {
    "AdapterConfig": "control",
    "Base": "checkpoint",
    "Card": "checkpoint",
    "Course": "course",
    "DiTGenerator": "generator",
    "Encoder": "control",
    "FORMAT": "checkpoint",
    "FOURIER_FREQUENCIES": "control",
    "HEADER": "checkpoint",
    "Limb": "ik",
    "MODEL": "checkpoint",
    "ModelConfig": "dit",
    "OCTAVES": "control",
    "PROFILES": "flow",
    "Prediction": "dit",
    "REACH": "ik",
    "SIDES": "ik",
    "SIGMA_MIN": "flow",
    "SIZES": "dit",
    "Solver": "flow",
    "TOE_BASE": "ik",
    "Tensors": "checkpoint",
    "Weights": "dit",
    "broken": "checkpoint",
    "load_adapter": "checkpoint",
    "load_base": "checkpoint",
    "noise_of": "flow",
    "own_tensors": "checkpoint",
    "read_adapter": "checkpoint",
    "read_checkpoint": "checkpoint",
    "read_header": "checkpoint",
    "shipped_base": "checkpoint",
    "solve": "ik",
    "time_frequencies": "dit",
}
__all__ = [
    "FORMAT",
    "FOURIER_FREQUENCIES",
    "HEADER",
    "MODEL",
    "OCTAVES",
    "PROFILES",
    "REACH",
    "SIDES",
    "SIGMA_MIN",
    "SIZES",
    "TOE_BASE",
    "AdapterConfig",
    "Base",
    "Card",
    "Course",
    "DiTGenerator",
    "Encoder",
    "Limb",
    "ModelConfig",
    "Prediction",
    "Solver",
    "Tensors",
    "Weights",
    "broken",
    "load_adapter",
    "load_base",
    "noise_of",
    "own_tensors",
    "read_adapter",
    "read_checkpoint",
    "read_header",
    "shipped_base",
    "solve",
    "time_frequencies",
]
__getattr__ = lazy(__name__, _HOMES)
