"""What follows the colon in `hssd:PATH#SCENE?OPTIONS`.

PATH     the folder of a dataset, or its *.scene_dataset_config.json
SCENE    name of a scene instance; may be left out if there is only one
OPTIONS  missing=skip (leave out what cannot be loaded), movable=small (small things can be moved), triangles=N (most
for one)
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import parse_qsl, urlencode

from humanclaw import SceneError

TRIANGLES: Final = 1500
_CHOICES: Final = {(missing, movable) for missing in ("error", "skip") for movable in ("dataset", "small")}
_REMEDY: Final = (
    "Write hssd:/path/to/dataset#scene, with ?missing=skip&movable=small&triangles=1500 behind it if wanted "
    "(in quotes: ? and & mean something to a shell)."
)


@dataclass(frozen=True)
class Reference:
    """A scene of a dataset, and how to load it."""

    path: Path
    scene: str = ""
    """Empty: the only one."""
    skip: bool = False
    """Whether what is missing or unsupported is left out; otherwise it is an error."""
    small: bool = False
    """Whether small things can be moved that the dataset fixes."""
    triangles: int = TRIANGLES
    """About the most that one object may have."""

    @classmethod
    def parse(cls, argument: str) -> Reference:
        """Parse a reference. Raises SceneError if the argument is not of the form PATH#SCENE?OPTIONS."""
        place, _, query = argument.partition("?")
        path, _, scene = place.partition("#")
        try:
            options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=True)) if query else {}
            missing, movable = options.pop("missing", "error"), options.pop("movable", "dataset")
            triangles = int(options.pop("triangles", str(TRIANGLES)))
        except ValueError as error:
            raise SceneError(f"cannot read the options {query!r} of a Habitat scene: {error}.", _REMEDY) from error
        if not path or options or (missing, movable) not in _CHOICES or triangles < 12:
            raise SceneError(f"{argument!r} does not name a Habitat scene.", _REMEDY)
        return cls(Path(path).expanduser(), scene, missing == "skip", movable == "small", triangles)

    @property
    def argument(self) -> str:
        """The text that parse() reads as this."""
        options = {"missing": "skip"} if self.skip else {}
        options |= {"movable": "small"} if self.small else {}
        options |= {} if self.triangles == TRIANGLES else {"triangles": str(self.triangles)}
        return f"{self.path}#{self.scene}" + ("?" + urlencode(options) if options else "")
