"""A program that trains as `humanclaw train` does, saves after every step, and is interrupted before a step.

python cut_short.py STEP base --data CHUNKS ...
"""

import sys

import torch.distributed as dist

from humanclaw_train import train


def main(step: int, arguments: list[str]) -> int:
    advance, seconds = train.Run.advance, train._SAVE_SECONDS

    def interrupted(self, objective):
        if self.step == step:
            if dist.is_initialized():
                dist.barrier()  # One that leaves while another still talks to it may end in an abort.
            raise KeyboardInterrupt
        return advance(self, objective)

    train._SAVE_SECONDS = 0
    train.Run.advance = interrupted
    try:
        return train.main(arguments)
    except KeyboardInterrupt:
        return 0
    finally:
        train.Run.advance, train._SAVE_SECONDS = advance, seconds


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
