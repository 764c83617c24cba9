"""Train the pilot's eyes with torch, and measure them on houses that they have not seen."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.torch import load_file, save_file
from torch import Tensor, nn
from torch.nn import functional as F

from humanclaw_pilot.network import CATEGORIES, CLASSES, SHAPES, Glance, answer, prepared

PRICES: Final = torch.tensor([1.0, 1.0, 1.0, 4.0, 2.0, 1.5, 3.0, 3.0, 3.0])
"""What a wrong cell of each class costs: small and cluttered things more."""
BATCH: Final = 32
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
        found: Tensor = norm(F.conv2d(x, conv.weight, conv.bias, stride, side // 2))
        return found

    def _parts(self, name: str) -> Any:
        return self.convs[_key(name)].children()

    def relu(self, x: Tensor) -> Tensor:
        return F.relu(x)

    def up(self, x: Tensor) -> Tensor:
        return F.interpolate(x, scale_factor=2)

    def forward(self, pictures: Tensor) -> Tensor:
        """Map pictures (N, 4, SIZE, SIZE) to (N, classes + 1, CELLS, CELLS)."""
        found: Tensor = answer(self, pictures)
        return found

    def folded(self) -> dict[str, Tensor]:
        """Return weights and biases in half precision, as humanclaw_pilot.network reads them."""
        found: dict[str, Tensor] = {}
        for name in SHAPES:
            conv, norm = self._parts(name)
            weight, bias = conv.weight, torch.zeros(len(conv.weight)) if conv.bias is None else conv.bias
            if not isinstance(norm, nn.Identity):
                scale = norm.weight / (norm.running_var + norm.eps).sqrt()
                weight, bias = weight * scale[:, None, None, None], norm.bias - norm.running_mean * scale
            found |= {f"{name}.weight": weight.detach().half(), f"{name}.bias": bias.detach().half()}
        return found


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
        with np.load(file) as found:
            parts.append(tuple(found[name] for name in ("picture", "kinds", "depth")))
    pictures, kinds, depth = (np.concatenate(one) for one in zip(*parts, strict=True))
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
def train(data: Data, out: Path, minutes: float, seed: int, told: Callable[[str], None], start: Path | None = None
          ) -> None:  # fmt: skip
    """Train for some minutes of processor time, and write weights.

    A checkpoint beside them lets the same call go on after a break.

    start: a checkpoint to go on from, for data that were added.
    """
    torch.manual_seed(seed)
    rng, model = np.random.default_rng(seed), TorchLayers()
    model.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimizer, spent, checkpoint = torch.optim.AdamW(model.parameters(), RATE, weight_decay=0.02), 0.0, _beside(out)
    if checkpoint.exists() or start:
        model.load_state_dict(load_file(checkpoint if checkpoint.exists() else _beside(start or out)))
    clock = out.with_suffix(".minutes")
    spent = float(clock.read_text()) if clock.exists() else 0.0
    step, begun = 0, time.process_time() - 60 * spent
    while (spent := (time.process_time() - begun) / 60) < minutes:
        optimizer.param_groups[0]["lr"] = RATE * min(1, spent / 0.5 + 0.05) * (1 + np.cos(np.pi * spent / minutes)) / 2
        loss = _loss(model, *_drawn(data, rng))
        optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        step += 1
        if step % 100 == 0:
            told(f"{spent:.1f} min, step {step}: loss {loss.item():.3f}")
            _keep(model, out, spent)
    _keep(model, out, spent)


def _loss(model: TorchLayers, x: Tensor, kinds: Tensor, depth: Tensor) -> Tensor:
    with torch.autocast("cpu", torch.bfloat16):
        found = model(x)
    found = found.float()
    far = (found[:, -1] - depth.clamp(0.1).log()).abs()
    loss: Tensor = F.cross_entropy(found[:, :-1], kinds, PRICES) + far[kinds != 2].mean()
    return loss


def _beside(out: Path) -> Path:
    return out.with_suffix(".checkpoint.safetensors")


def _keep(model: TorchLayers, out: Path, spent: float) -> None:
    save_file({name: part.contiguous() for name, part in model.state_dict().items()}, _beside(out))
    save_file({name: part.contiguous() for name, part in model.folded().items()}, out)
    out.with_suffix(".minutes").write_text(f"{spent:.3f}")


# -- measuring ---------------------------------------------------------------------------------------------------------
def measure(
    look: Callable[[NDArray[np.uint8]], Glance], data: Data, certain: float
) -> Iterator[tuple[str, int, float, float, float]]:
    """For each category, by views: views with it, recall, precision; and the mean error of its depth, as a share.

    look: maps a view to a glance. certain: share of the answer from which a cell counts. A view has a category, and is
    said to have it, with 2 cells or more.
    """
    glances = [look(picture.repeat(2, 0).repeat(2, 1)) for picture in data[0]]
    share, depth = (np.stack([getattr(one, name) for one in glances]) for name in ("share", "depth"))
    for number, category in enumerate(CATEGORIES, 3):
        mine = data[1] == number
        there, said = mine.sum((1, 2)) >= 2, (share[:, number] > certain).sum((1, 2)) >= 2
        both = int((there & said).sum())
        wrong = np.abs(np.log(depth[mine]) - np.log(data[2][mine].astype(float)))
        yield category, int(there.sum()), both / max(1, there.sum()), both / max(1, said.sum()), float(wrong.mean())
