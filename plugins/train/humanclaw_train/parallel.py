"""Several training processes, one for each GPU, as `torchrun` starts them. Without torchrun there is one."""

from __future__ import annotations

import importlib
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from humanclaw import HumanclawError


@dataclass(frozen=True)
class Processes:
    """This process among all. Each computes its share of every batch; the first one saves and reports."""

    rank: int = 0
    count: int = 1

    @property
    def first(self) -> bool:
        """Whether this is the process that saves and reports."""
        return self.rank == 0

    def share(self, batch: Tensor) -> Tensor:
        """Return this process's rows of a batch (B, ...). Raises HumanclawError if they cannot be shared evenly."""
        if len(batch) % self.count:
            # Shares of different sizes would weigh differently in the mean of the gradients.
            told = f"A batch of {len(batch)} chunks cannot be shared by {self.count} processes."
            raise HumanclawError(told, f"Give a --batch that is a multiple of {self.count}.")
        return batch[self.rank :: self.count]

    def together(self, problem: nn.Module, batch: Sequence[Tensor]) -> nn.Module:
        """Return the problem with gradients that are the mean over all processes. batch: an example."""
        if self.count == 1:
            return problem
        wrapped = DistributedDataParallel(problem)
        # DDP regroups gradients after its first backward pass, which changes the order of sums. Done here, a resumed
        # run sums as an uninterrupted one does, bit for bit. The step itself discards these gradients.
        wrapped(*map(self.share, batch)).backward()
        return wrapped

    def agreed(self, seconds: float, device: torch.device) -> float:
        """Return the first process's time. All need the same, because it sets the learning rate and the run's end."""
        if self.count == 1:
            return seconds
        told = torch.tensor([seconds], dtype=torch.float64, device=device)
        dist.broadcast(told, 0)
        return float(told)


ALONE: Final = Processes()


def device_of(name: str) -> torch.device:
    """Return a torch device. auto: a GPU if there is one; each of several processes takes its own."""
    wanted = name if name != "auto" else "cuda" if torch.cuda.is_available() else "cpu"
    if wanted == "cuda" and dist.is_torchelastic_launched():
        wanted = f"cuda:{os.environ['LOCAL_RANK']}"
    return torch.device(wanted)


@contextmanager
def joined(device: torch.device) -> Iterator[Processes]:
    """Join the other processes that torchrun started, if it did."""
    if not dist.is_torchelastic_launched():
        yield ALONE
        return
    if device.type == "cuda":
        torch.cuda.set_device(device)
    # Imported before there is a process group, which its functions would otherwise keep, as default arguments, beyond
    # its destruction. Then a thread of gloo that still lets go of a tensor while Python ends aborts the process.
    importlib.import_module("torch.distributed.nn")
    dist.init_process_group("nccl" if device.type == "cuda" else "gloo")
    try:
        yield Processes(dist.get_rank(), dist.get_world_size())
        # One that leaves while another still talks to it may end in an abort.
        dist.barrier()
    finally:
        # To let go of what it did, a thread of gloo needs the interpreter's lock. Whoever drops the group holds that
        # lock and waits for the thread (torch 2.13): now and then a run hung as it parted. Here the lock is free.
        time.sleep(0.5)
        dist.destroy_process_group()
