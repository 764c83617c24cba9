"""Train the pilot's eyes with torch, and measure them on houses that they have not seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final
from zlib import crc32

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import save_file
from torch import Tensor, nn
from torch.nn import functional as F

from humanclaw import HumanclawError
from humanclaw_pilot.network import CATEGORIES, CLASSES, SHAPES, Glance, answer, prepared

PRICES: Final = torch.tensor([1.0, 1.0, 1.0, 4.0, 2.0, 1.5, 3.0, 3.0, 3.0])
"""What a wrong cell of each class costs: small and cluttered things more."""
BATCH: Final = 32
"""Pictures of a step. More would smooth the gradient and take as much longer on the processor."""
RATE: Final = 3e-3
"""Highest learning rate."""


class TorchLayers(nn.Module):
    """The network's layers, with batch normalization behind each convolution; saving folds it into the weights."""

    def __init__(self) -> None:
        super().__init__()
        self.convs = nn.ModuleDict({_key(name): _conv(*shape) for name, shape in SHAPES.items()})

    def conv(self, name: str, x: Tensor, stride: int = 1) -> Tensor:
        conv, norm = self._parts(name)
        side = conv.kernel_size[0]
        convolved: Tensor = norm(F.conv2d(x, conv.weight, conv.bias, stride, side // 2))
        return convolved

    def _parts(self, name: str) -> Any:
        return self.convs[_key(name)].children()

    def relu(self, x: Tensor) -> Tensor:
        return F.relu(x)

    def up(self, x: Tensor) -> Tensor:
        return F.interpolate(x, scale_factor=2)

    def forward(self, pictures: Tensor) -> Tensor:
        """Map pictures (N, 4, SIZE, SIZE) to (N, classes + 1, CELLS, CELLS)."""
        answered: Tensor = answer(self, pictures)
        return answered

    def folded(self) -> dict[str, Tensor]:
        """Return weights and biases in half precision, as humanclaw_pilot.network reads them."""
        weights: dict[str, Tensor] = {}
        for name in SHAPES:
            conv, norm = self._parts(name)
            weight, bias = conv.weight, torch.zeros(len(conv.weight)) if conv.bias is None else conv.bias
            if not isinstance(norm, nn.Identity):
                scale = norm.weight / (norm.running_var + norm.eps).sqrt()
                weight, bias = weight * scale[:, None, None, None], norm.bias - norm.running_mean * scale
            weights |= {f"{name}.weight": weight.detach().half(), f"{name}.bias": bias.detach().half()}
        return weights


def _key(name: str) -> str:
    return f"of_{name}".replace(".", "_")


def _conv(before: int, after: int, side: int) -> nn.Sequential:
    last = after == len(CLASSES) + 1
    norm: nn.Module = nn.Identity() if last else nn.BatchNorm2d(after)
    return nn.Sequential(nn.Conv2d(before, after, side, bias=last), norm)


# -- data --------------------------------------------------------------------------------------------------------------
Data = tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.float16]]
"""Pictures (N, SIZE, SIZE, 3), kinds and depths (N, CELLS, CELLS)."""


def read(files: Sequence[Path]) -> Data:
    """Read files of examples into one."""
    parts = []
    for file in files:
        with np.load(file) as arrays:
            parts.append(tuple(arrays[name] for name in ("picture", "kinds", "depth")))
    pictures, kinds, depth = (np.concatenate(part) for part in zip(*parts, strict=True))
    return pictures, kinds, depth


def _drawn(data: Data, rng: np.random.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Draw a batch: mirrored half of the time, in another light."""
    index = np.sort(rng.integers(len(data[0]), size=BATCH))
    pictures, kinds, depth = data[0][index], data[1][index], data[2][index]
    flip = rng.random(BATCH) < 0.5
    for part in (pictures, kinds, depth):
        part[flip] = part[flip][:, :, ::-1]
    x = torch.from_numpy(prepared(pictures))
    light = torch.from_numpy(rng.normal(1, 0.15, (BATCH, 3, 1, 1)).astype("f4"))
    shade = torch.from_numpy(rng.normal(0, 0.1, (BATCH, 1, 1, 1)).astype("f4"))
    x[:, :3] = (x[:, :3] * light + shade).clamp(-1, 1)
    return x.to(memory_format=torch.channels_last), torch.from_numpy(kinds).long(), torch.from_numpy(depth).float()


# -- training ----------------------------------------------------------------------------------------------------------
def train(data: Data, out: Path, steps: int, seed: int, report: Callable[[str], None], start: Path | None = None,
          every: int = 100) -> None:  # fmt: skip
    """Train and write weights. A checkpoint beside them lets the same call go on after a break, to the same weights.

    start: weights whose checkpoint to begin from, for data that were added. every: steps from checkpoint to checkpoint.
    Raises HumanclawError if there is no checkpoint to begin from, or if the one to go on from is of another call.
    """
    torch.manual_seed(seed)
    model = TorchLayers()
    model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]  # Its stubs lack this overload.
    optimizer = torch.optim.AdamW(model.parameters(), RATE, weight_decay=0.02)
    call = [steps, seed, crc32(data[1].tobytes())]
    done = _resumed(model, optimizer, out, call)
    if start and not done:
        model.load_state_dict(_checkpoint(start)["model"])
    for step in range(done, steps):
        optimizer.param_groups[0]["lr"] = RATE * min(1, (step + 1) / 80) * (1 + math.cos(math.pi * step / steps)) / 2
        loss = _loss(model, *_drawn(data, np.random.default_rng([seed, step])))
        optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped.
        optimizer.step()
        if (step + 1) % every == 0 or step + 1 == steps:
            save_file({name: part.contiguous() for name, part in model.folded().items()}, out)
            kept = {"model": model.state_dict(), "optimizer": optimizer.state_dict(), "step": step + 1}
            torch.save({**kept, "call": call}, _beside(out).with_suffix(".part"))
            _beside(out).with_suffix(".part").replace(_beside(out))
            report(f"step {step + 1} of {steps}: loss {loss.item():.3f}")


def _resumed(model: TorchLayers, optimizer: torch.optim.Optimizer, out: Path, call: list[int]) -> int:
    """Load the checkpoint of `out`, if there is one. Returns the steps that are done."""
    if not _beside(out).exists():
        return 0
    kept = _checkpoint(out)
    if kept["call"] != call:
        message = f"{_beside(out)} is of a training with other views, steps or seed."
        raise HumanclawError(message, "Give those again, or another --out.")
    model.load_state_dict(kept["model"])
    optimizer.load_state_dict(kept["optimizer"])
    return int(kept["step"])


def _checkpoint(weights: Path) -> dict[str, Any]:
    path = _beside(weights)
    if not path.exists():
        raise HumanclawError(f"there is no checkpoint {path}.", "Name weights whose training left one beside them.")
    checkpoint: dict[str, Any] = torch.load(path, weights_only=True)
    return checkpoint


def _beside(weights: Path) -> Path:
    return weights.with_suffix(".checkpoint.pt")


def _loss(model: TorchLayers, x: Tensor, kinds: Tensor, depth: Tensor) -> Tensor:
    # Without instructions for half precision a step takes ten times as long with it.
    with torch.autocast("cpu", torch.bfloat16, enabled=torch.cpu._is_avx512_bf16_supported()):
        answered = model(x)
    answered = answered.float()
    far = (answered[:, -1] - depth.clamp(0.1).log()).abs()
    loss: Tensor = F.cross_entropy(answered[:, :-1], kinds, PRICES) + far[kinds != 2].mean()
    return loss


# -- measuring ---------------------------------------------------------------------------------------------------------
def measure(
    look: Callable[[NDArray[np.uint8]], Glance], data: Data, certain: float
) -> Iterator[tuple[str, int, float, float, float]]:
    """For each category, by views: views with it, recall, precision; and the mean error of its depth, as a share.

    look: maps a view to a glance. certain: share of the answer from which a cell counts. A view has a category, and is
    said to have it, with 2 cells or more.
    """
    glances = [look(picture.repeat(2, 0).repeat(2, 1)) for picture in data[0]]
    share, depth = (np.stack([getattr(glance, name) for glance in glances]) for name in ("share", "depth"))
    for number, category in enumerate(CATEGORIES, 3):
        mine = data[1] == number
        there, said = mine.sum((1, 2)) >= 2, (share[:, number] > certain).sum((1, 2)) >= 2
        both = int((there & said).sum())
        wrong = np.abs(np.log(depth[mine]) - np.log(data[2][mine].astype(float)))
        yield category, int(there.sum()), both / max(1, there.sum()), both / max(1, said.sum()), float(wrong.mean())
