"""HumanCLAW plugin: train the motion prior and skill adapters, and measure what was learned.

The training modules need no plugin host: `python -m humanclaw_train.train` also runs on a machine that has torch,
numpy, safetensors and tqdm but neither pydantic, pluggy, click nor scipy.
"""

from __future__ import annotations

__version__ = "0.1.0"
