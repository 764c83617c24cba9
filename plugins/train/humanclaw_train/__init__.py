"""HumanCLAW plugin: train the motion prior and skill adapters, and measure what was learned.

The training modules also run on a machine that has torch, numpy, safetensors and tqdm alone: `python -m
humanclaw_train.train`.
"""

from __future__ import annotations

__version__ = "0.1.0"
