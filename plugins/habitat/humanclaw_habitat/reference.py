"""References to scenes: the text after the colon in `hssd:PATH#SCENE?OPTIONS`.

PATH     folder of a dataset, or its *.scene_dataset_config.json
SCENE    name of a scene instance; may be omitted if there is only one
OPTIONS  missing=skip (leave out what cannot be loaded), movable=small (make small objects movable), triangles=N
         (approximate maximum per object)
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import parse_qsl, urlencode

from humanclaw import SceneError

TRIANGLES: Final = 1500
"""Approximate maximum of triangles per object."""
_CHOICES: Final = {(missing, movable) for missing in ("error", "skip") for movable in ("dataset", "small")}
_REMEDY: Final = (
    "Write 'hssd:/path/to/dataset#scene', optionally followed by ?missing=skip&movable=small&triangles=1500 "
    "(in quotes, because ? and & are special in a shell)."
)


@dataclass(frozen=True)
class Reference:
    """A scene of a dataset, and how to load it."""

    path: Path
    scene: str = ""
    """Empty: the only scene."""
    skip: bool = False
    """Whether to leave out what is missing or unsupported; otherwise it is an error."""
    small: bool = False
    """Whether small objects that the dataset fixes become movable."""
    triangles: int = TRIANGLES
    """Approximate maximum per object."""

    @classmethod
    def parse(cls, argument: str) -> Reference:
        """Parse a reference. Raises SceneError if the argument does not have the form PATH#SCENE?OPTIONS."""
        place, _, query = argument.partition("?")
        path, _, scene = place.partition("#")
        try:
            options = dict(parse_qsl(query, keep_blank_values=True, strict_parsing=True)) if query else {}
            missing, movable = options.pop("missing", "error"), options.pop("movable", "dataset")
            triangles = int(options.pop("triangles", str(TRIANGLES)))
        except ValueError as error:
            raise SceneError(f"cannot read the options {query!r} of a Habitat scene: {error}.", _REMEDY) from error
        if not path or options or (missing, movable) not in _CHOICES or triangles < 12:
            raise SceneError(f"{argument!r} is not a reference to a Habitat scene.", _REMEDY)
        return cls(Path(path).expanduser(), scene, missing == "skip", movable == "small", triangles)

    @property
    def argument(self) -> str:
        """The text from which parse() makes this reference."""
        options = {"missing": "skip"} if self.skip else {}
        options |= {"movable": "small"} if self.small else {}
        options |= {} if self.triangles == TRIANGLES else {"triangles": str(self.triangles)}
        return f"{self.path}#{self.scene}" + ("?" + urlencode(options) if options else "")
