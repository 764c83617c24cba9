"""Eyes: they find an agent's target in its view, by the ids of drawn objects or by a detector on the colours alone.

A detector is any program. It reads pictures from its input, 512 x 512 x 3 bytes each, rows from the top, red, green and
blue. It answers each with one line of JSON, a list of [x0, y0, x1, y1, score, name]: corners in pixels, a score from
0 to 1, and the name of a COCO category ("chair", "couch", "potted plant", "bed", "toilet", "tv").
"""

from __future__ import annotations

import os
import shlex
import subprocess
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Final, Protocol

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from humanclaw import EpisodeSpec, HumanclawError
from humanclaw.world import BODY_ID, Gaze, View
from humanclaw_scripted.options import DetectorOptions
from humanclaw_scripted.sight import Mask, Sight

THICK: Final = (0.2, 1.0)
"""Bounds of the assumed half depth of an object, metres; between them it is half the width."""
_Score = Annotated[float, Field(ge=0, le=1)]
_BOXES: Final = TypeAdapter(
    list[tuple[float, float, float, float, _Score, str]], config=ConfigDict(allow_inf_nan=False)
)
Box = tuple[float, float, float, float, float, str]


class Eyes(Protocol):
    """Turn views into points, and mark the points of targets."""

    settings: Mapping[str, Any]

    def begin(self, spec: EpisodeSpec, gaze: Gaze) -> None:
        """Begin an episode with its target."""

    def look(self, view: View) -> Sight:
        """Return the view as points, with the targets marked."""


class PerfectEyes:
    """Finds every pixel of the target by its id."""

    settings: Mapping[str, Any] = {}

    def begin(self, spec: EpisodeSpec, gaze: Gaze) -> None:
        self._targets, self._gaze = list(spec.target_ids), gaze

    def look(self, view: View) -> Sight:
        shown = (view.ids != 0) & (view.ids != BODY_ID)
        return Sight.of(view, shown, np.isin(view.ids, self._targets), self._gaze)


class DetectorEyes:
    """Finds a target by a detector's boxes; depth separates the object in a box from its background."""

    def __init__(self, options: DetectorOptions) -> None:
        self.settings: Mapping[str, Any] = options.model_dump()
        self._options, self._detector = options, Detector(options.detector, options.seconds)

    def begin(self, spec: EpisodeSpec, gaze: Gaze) -> None:
        self._name, self._gaze = spec.target_category.replace("_", " "), gaze

    def look(self, view: View) -> Sight:
        boxes = [box for box in self._detector(view.rgb) if box[5] == self._name and box[4] >= self._options.score]
        return Sight.of(view, np.isfinite(view.depth), filled(boxes, view), self._gaze).apart()


def filled(boxes: Sequence[Box], view: View) -> Mask:
    """Return a mask (H, W) of the pixels in boxes whose depth is within half a box's width of that at its middle."""
    mask = np.zeros(view.depth.shape, bool)
    for x0, y0, x1, y1, *_ in boxes:
        part = slice(max(0, round(y0)), max(0, round(y1))), slice(max(0, round(x0)), max(0, round(x1)))
        depth = view.depth[part]
        high, wide = (side // 4 for side in depth.shape)
        inner = depth[high : len(depth) - high, wide : depth.shape[1] - wide]
        middle = float(np.median(inner)) if inner.size else np.inf
        if np.isfinite(middle):  # A box of mostly sky shows no object.
            half = middle * depth.shape[1] / len(mask)  # With 90 degrees the picture is 2 x depth wide.
            mask[part] |= np.abs(depth - middle) < np.clip(half, *THICK)
    return mask


def _asked(process: subprocess.Popen[bytes], picture: bytes) -> bytes:
    """Send a picture; return the line of the answer, empty if the program ends."""
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(picture)
        process.stdin.flush()
        return process.stdout.readline()
    except OSError:
        return b""


def _within(seconds: float, ask: Callable[[], bytes]) -> bytes | None:
    """Return an answer, or None if it takes longer than `seconds`.

    Its thread is then abandoned, because children of a killed program may keep its output open.
    """
    answers: list[bytes] = []
    asking = threading.Thread(target=lambda: answers.append(ask()), daemon=True)
    asking.start()
    asking.join(seconds)
    return answers[0] if answers else None


def _fate(process: subprocess.Popen[bytes]) -> str:
    try:
        return f"ended with exit status {process.wait(timeout=2.0)}"
    except subprocess.TimeoutExpired:
        process.kill()
        return "closed its output"


class Detector:
    """A detector program. It starts with the first picture and is killed with this object."""

    def __init__(self, command: str, seconds: float = 60.0) -> None:
        """seconds: time limit of one answer."""
        self._command, self._seconds = command, seconds
        self._process: subprocess.Popen[bytes] | None = None

    def __call__(self, picture: np.ndarray[Any, np.dtype[np.uint8]]) -> Sequence[Box]:
        """Return the boxes in an (H, W, 3) picture.

        Raises HumanclawError if the program cannot be started, ends, does not answer, or gives an invalid answer.
        """
        process = self._process = self._process or self._started()
        line = _within(self._seconds, partial(_asked, process, np.ascontiguousarray(picture).tobytes()))
        if line is None:
            process.kill()
            raise self._wrong(f"has not answered within {self._seconds:g} s")
        if not line:
            raise self._wrong(f"{_fate(process)} instead of answering")
        try:
            return _BOXES.validate_json(line)
        except ValidationError:
            raise self._wrong(f"answered {line[:80]!r}") from None

    def _started(self) -> subprocess.Popen[bytes]:
        try:
            # Windows splits a command line itself; shlex would take its backslashes for escapes.
            command = self._command if os.name == "nt" else shlex.split(self._command)
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        except (OSError, ValueError) as error:
            raise self._wrong(f"cannot be started ({error})") from None
        weakref.finalize(self, process.kill)
        return process

    def _wrong(self, told: str) -> HumanclawError:
        return HumanclawError(
            f"the detector {self._command!r} {told}.",
            "It must answer every picture with one line of JSON: a list of [x0, y0, x1, y1, score, name].",
        )
