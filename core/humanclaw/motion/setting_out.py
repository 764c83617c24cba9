"""Who stands sets out with one foot, and not with both at once.

Four small straight steps in a hundred from standing are the average of a left-first and a right-first one, in which
both feet slide by centimetres: a few solver steps do not always choose. Such a chunk is drawn again. Nothing of what is
drawn is altered; of a few draws the one that slides least is taken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from humanclaw.body.pose import FPS, Array, Motion
from humanclaw.body.skeleton import JOINT_INDEX

_STANDS: Final = 0.1
"""Metres a second: a body whose toes are both slower at the end of the history stands."""
_SLIDES: Final = 0.01
"""Metres by which both feet may slide; a step that was chosen slides by a tenth of that."""
_DRAWS: Final = 4
"""At most: each fails once in twenty-five."""
_TOES: Final = (JOINT_INDEX["left_foot"], JOINT_INDEX["right_foot"])

Draw = Callable[[Sequence[int], int], Sequence[Motion]]
"""Indices of bodies and the number of the attempt to their futures."""


def set_out(histories: Sequence[Motion], draw: Draw) -> list[Motion]:
    """Return the futures of the first draw, each of those that slide replaced by the least sliding of up to three more.

    histories: in any frame, the same as that of what is drawn.
    """
    futures = list(draw(range(len(histories)), 0))
    slides = [_slide(*pair) for pair in zip(histories, futures, strict=True)]
    for attempt in range(1, _DRAWS):
        again = [index for index, slide in enumerate(slides) if slide > _SLIDES]
        for index, future in zip(again, draw(again, attempt) if again else (), strict=True):
            slide = _slide(histories[index], future)
            if slide < slides[index]:
                futures[index], slides[index] = future, slide
    return futures


def _slide(history: Motion, future: Motion) -> float:
    """Path of whichever toe is the slower one, metres; 0 for who does not set out from standing."""
    if _toe_steps(history[-2:]).max() * FPS > _STANDS:
        return 0.0
    return float(_toe_steps(history[-1:].then(future)).min(-1).sum())


def _toe_steps(motion: Motion) -> Array:
    """(T - 1, 2) metres over the floor."""
    steps = np.diff(motion.joints()[:, _TOES], axis=0)[..., [0, 2]]
    return np.asarray(np.linalg.norm(steps, axis=-1))
