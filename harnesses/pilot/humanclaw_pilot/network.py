"""The pilot's eyes: a small convolutional network from a picture to what each cell of it shows, and how far away.

The order of the layers is written once, for numpy here and for torch in humanclaw_pilot.training. Arrays are (C, H, W).
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load

from humanclaw import HumanclawError
from humanclaw.storage import read_file

Floats = NDArray[np.float32]
CATEGORIES: Final = ("chair", "couch", "bed", "potted_plant", "tv", "toilet")
CLASSES: Final = ("other", "floor", "body", *CATEGORIES)
"""What a cell can show: floor is what a foot could stand on, body is the own one."""
SIZE: Final = 256
"""Side of the network's picture, pixels: half of the view's."""
CELLS: Final = 64
"""Side of the grid that it answers, cells."""
BRIGHTNESS: Final = np.minimum(1.15 * (0.5 - np.sin(np.arcsin(1 - np.arange(256) / 127.5) / 3)), 1).astype(np.float32)
"""Brightness of each tone of a picture, at most 1: the renderer's film curve, undone."""
WEIGHTS: Final = Path(__file__).with_name("pilot.safetensors")
_MOST_BYTES: Final = 64 << 20
"""Largest file of weights that is read; the shipped one has 3.6 MB."""
_REMEDY: Final = "Train some with `humanclaw pilot train`."


def _levels() -> dict[str, tuple[int, int, int]]:
    wide = {"half": 32, "quarter": 64, "eighth": 128, "least": 192}
    shapes = {"first": (4, 16, 5), "half": (16, 32, 3), "answer": (32, len(CLASSES) + 1, 1)}
    for below, name in zip(wide, list(wide)[1:], strict=False):
        shapes |= {name: (wide[below], wide[name], 3), f"{below}.up": (wide[name], wide[below], 1)}
        shapes |= {f"{below}.back{k}": (wide[below], wide[below], 3) for k in (1, 2)}
        shapes |= {f"{name}.on{k}": (wide[name], wide[name], 3) for k in (1, 2)}
    return shapes


SHAPES: Final = _levels()
"""Channels in, channels out, and side of the kernel of each convolution."""


def answer(layers: Any, picture: Any) -> Any:
    """Map a picture (4, SIZE, SIZE), colours and row, to (classes + 1, CELLS, CELLS): logits, then log metres.

    layers: conv(name, x, stride), relu(x) and up(x), which doubles height and width, for one kind of array.
    """
    relu, conv = layers.relu, layers.conv

    def block(x: Any, name: str) -> Any:
        return relu(x + conv(f"{name}2", relu(conv(f"{name}1", x))))

    x = relu(conv("half", relu(conv("first", picture, 2)), 2))
    passed = [("half", x)]
    for name in ("quarter", "eighth", "least"):
        x = block(relu(conv(name, x, 2)), f"{name}.on")
        passed.append((name, x))
    for name, before in passed[-2::-1]:
        x = block(relu(before + layers.up(conv(f"{name}.up", x))), f"{name}.back")
    return conv("answer", x)


class NumpyLayers:
    """The layers in numpy."""

    def __init__(self, weights: dict[str, Floats]) -> None:
        self._weights = weights

    def conv(self, name: str, x: Floats, stride: int = 1) -> Floats:
        kernel = self._weights[f"{name}.weight"]
        side = kernel.shape[-1]
        padded = np.pad(x, ((0, 0), (side // 2, side // 2), (side // 2, side // 2)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side), (1, 2))[:, ::stride, ::stride]
        high, wide = windows.shape[1:3]
        columns = windows.transpose(0, 3, 4, 1, 2).reshape(-1, high * wide)
        convolved = kernel.reshape(len(kernel), -1) @ columns + self._weights[f"{name}.bias"][:, None]
        return np.asarray(convolved.reshape(-1, high, wide))

    def relu(self, x: Floats) -> Floats:
        return np.maximum(x, 0)

    def up(self, x: Floats) -> Floats:
        return x.repeat(2, 1).repeat(2, 2)


@dataclass(frozen=True, eq=False)
class Glance:
    """What the network says of a view: share (classes, CELLS, CELLS) between 0 and 1; depth (CELLS, CELLS), metres."""

    share: Floats
    depth: Floats


@dataclass(frozen=True, eq=False)
class Eyes:
    """The network with its weights. digest: the first 16 digits of their SHA-256."""

    layers: NumpyLayers
    digest: str

    @classmethod
    def read(cls, path: Path = WEIGHTS) -> Eyes:
        """Read weights. Raises HumanclawError for a file that is none of this network's."""
        try:
            data = read_file(path, _MOST_BYTES)
            weights = {name: array.astype(np.float32) for name, array in load(data).items()}
        except (OSError, ValueError, KeyError, SafetensorError) as error:  # KeyError: a type numpy lacks.
            raise HumanclawError(f"cannot read the pilot's weights {path}: {error}.", _REMEDY) from error
        if {name: array.shape for name, array in weights.items()} != _shapes():
            raise HumanclawError(f"{path} holds another network than the pilot's.", _REMEDY)
        if not all(np.isfinite(array).all() for array in weights.values()):
            raise HumanclawError(f"{path} holds numbers that are not finite.", _REMEDY)
        return cls(NumpyLayers(weights), sha256(data).hexdigest()[:16])

    def __call__(self, rgb: NDArray[np.uint8]) -> Glance:
        """Look at a view (512, 512, 3)."""
        answered = answer(self.layers, prepared(halved(rgb)[None])[0])
        raised = np.exp(answered[:-1] - answered[:-1].max(0))
        return Glance(raised / raised.sum(0), np.exp(answered[-1]))


def _shapes() -> dict[str, tuple[int, ...]]:
    shapes: dict[str, tuple[int, ...]] = {}
    for name, (before, after, side) in SHAPES.items():
        shapes |= {f"{name}.weight": (after, before, side, side), f"{name}.bias": (after,)}
    return shapes


def halved(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a view (2 SIZE, 2 SIZE, 3) at half its size."""
    sums = rgb.reshape(SIZE, 2, SIZE, 2, 3).sum((1, 3), dtype=np.uint16)
    return np.asarray((sums + 2) // 4, np.uint8)


def prepared(pictures: NDArray[np.uint8]) -> Floats:
    """Map pictures (N, SIZE, SIZE, 3) to (N, 4, SIZE, SIZE): brightness of colours, and row, from -1 to 1."""
    colours = 2 * BRIGHTNESS[pictures.transpose(0, 3, 1, 2)] - 1
    rows = np.broadcast_to(np.linspace(-1, 1, SIZE, dtype=np.float32)[:, None], (len(pictures), 1, SIZE, SIZE))
    return np.concatenate([colours, rows], 1)
