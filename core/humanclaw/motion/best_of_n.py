"""Redraw first steps from standing in which both feet slide.

With few solver steps, five in a hundred small straight steps are the average of a left-first and a right-first one, and
both feet slide by centimetres. Such a chunk is drawn again, and the draw that slides least is taken, unaltered.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Motion
from humanclaw.motion.leg_ik import FEET

_STANDS: Final = 0.1
"""Metres a second. A body with both toes slower than this at the end of the history stands."""
_SLIDES: Final = 0.01
"""Metres by which both feet may slide; a proper step slides by a tenth of that."""

Draw = Callable[[Sequence[int], int], Sequence[Motion]]
"""Maps indices of bodies and the number of the attempt to futures."""


def best_of_n(histories: Sequence[Motion], draw: Draw, redraws: int) -> list[Motion]:
    """Return the futures of the first draw; one that slides is replaced by the least sliding of all its draws.

    histories: in the same frame as the drawn futures.
    """
    futures = list(draw(range(len(histories)), 0))
    slides = [_slide(*pair) for pair in zip(histories, futures, strict=True)]
    for attempt in range(1, 1 + redraws):
        again = [index for index, slide in enumerate(slides) if slide > _SLIDES]
        for index, future in zip(again, draw(again, attempt) if again else (), strict=True):
            slide = _slide(histories[index], future)
            if slide < slides[index]:
                futures[index], slides[index] = future, slide
    return futures


def _slide(history: Motion, future: Motion) -> float:
    """Return the path of the slower toe, metres; 0 for a body that does not start from standing."""
    if _toe_steps(history[-2:]).max() * FPS > _STANDS:
        return 0.0
    return float(_toe_steps(history[-1:].then(future)).min(-1).sum())


def _toe_steps(motion: Motion) -> Array:
    """Return (T - 1, 2) the step of each toe over the floor, metres."""
    steps = np.diff(motion.joints()[:, FEET], axis=0)[..., [0, 2]]
    return np.asarray(np.linalg.norm(steps, axis=-1))
