"""Pictures of questions about oneself: python examples/oneself.py [FILE]

The default is docs/images/oneself.jpg. Needs the extra `hands`. Each picture is the last view of some calls.
"""

import sys
from typing import Any

import numpy as np
from PIL import Image

from humanclaw import Body
from humanclaw_bench.splits import load_split

SHOWN: dict[str, list[tuple[str, dict[str, Any]]]] = {
    "house-0-hand-": [],
    "house-0-hand": [("reach", {"side": "right", "x_cm": -45, "y_cm": 110, "z_cm": 30})],
    "house-34-mirror": [],
    "house-33-moved": [("walk", {"z_cm": 60})] * 2,
    "house-31-touch": [],
    "house-34-fit": [],
}
"""The begin of a question's id, and what is called first."""


def main(file: str = "docs/images/oneself.jpg") -> None:
    views = []
    with Body() as body:
        for begin, calls in SHOWN.items():
            spec = next(spec for spec in load_split("self") if spec.id.startswith(begin))
            body.reset(spec.scene, spec.start)
            for name, amounts in calls:
                body.call(name, **amounts)
            views.append(np.asarray(Image.fromarray(body.view().rgb).resize((256, 256), Image.Resampling.LANCZOS)))
    rows = [np.concatenate(views[k : k + 3], axis=1) for k in (0, 3)]
    Image.fromarray(np.concatenate(rows)).save(file, quality=85)


if __name__ == "__main__":
    main(*sys.argv[1:])
