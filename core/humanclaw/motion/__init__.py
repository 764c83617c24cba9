"""Motion: the prior and its adapters, in numpy (paper, section 3.3)."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.body.ik import REACH as REACH, SIDES as SIDES, TOE_BASE as TOE_BASE, Limb as Limb, solve as solve
    from humanclaw.motion.checkpoint import (
        FORMAT as FORMAT,
        HEADER as HEADER,
        MODEL as MODEL,
        Base as Base,
        Card as Card,
        Normaliser as Normaliser,
        Tensors as Tensors,
        broken as broken,
        load_adapter as load_adapter,
        load_base as load_base,
        own_tensors as own_tensors,
        read_adapter as read_adapter,
        read_checkpoint as read_checkpoint,
        read_header as read_header,
        shipped_base as shipped_base,
    )
    from humanclaw.motion.control import (
        FOURIER_FREQUENCIES as FOURIER_FREQUENCIES,
        OCTAVES as OCTAVES,
        Adapter as Adapter,
        AdapterConfig as AdapterConfig,
        Controlled as Controlled,
        Encoder as Encoder,
    )
    from humanclaw.motion.dit import (
        SIZES as SIZES,
        DiT as DiT,
        ModelConfig as ModelConfig,
        Modulations as Modulations,
        Prediction as Prediction,
        Weights as Weights,
        time_frequencies as time_frequencies,
    )
    from humanclaw.motion.flow import (
        SIGMA_MIN as SIGMA_MIN,
        Solver as Solver,
        noise_of as noise_of,
        velocity as velocity,
    )
    from humanclaw.motion.generator import DiTGenerator as DiTGenerator
    from humanclaw.motion.leg_collision_avoidance import (
        HEEL_END as HEEL_END,
        TOE_END as TOE_END,
        apart as apart,
        widened as widened,
    )
    from humanclaw.motion.profile import PROFILES as PROFILES, MotionProfile as MotionProfile
    from humanclaw.motion.protocol import MotionGenerator as MotionGenerator
    from humanclaw.motion.runtime import NumpyRuntime as NumpyRuntime, Runtime as Runtime, reread as reread

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
