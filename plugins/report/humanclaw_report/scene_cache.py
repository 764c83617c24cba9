"""The houses of a run as its pages need them: maps, names and a script with the meshes, without the scene itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from humanclaw import HumanclawError, RecordedEpisode, Scene
from humanclaw.world import floors_of
from humanclaw_report.episode_summary import named
from humanclaw_report.floor_plan import HouseMap, house_maps
from humanclaw_report.replay import as_json, house

SCRIPT: Final = "window.humanclawHouse = "
KEPT: Final = 4
"""Houses in memory. A run has dozens, and its episodes come house by house."""


@dataclass(frozen=True)
class Drawn:
    """A scene, ready for pages."""

    maps: tuple[HouseMap, ...]
    digest: str = ""
    """Digest of the scene; empty if it is not drawn."""
    names: Mapping[int, str] = field(default_factory=dict)
    """Object id to its name, such as "couch 20"."""
    floors: tuple[float, ...] = ()
    """Heights of the floors, metres, lowest first."""
    script: str = ""
    """A script that gives the house to a page: a page opened from disk may load scripts, but no data files."""
    note: str = ""
    """Why the house is not drawn; empty if it is."""

    @property
    def open_floor(self) -> bool:
        """Whether the scene is drawn and has no rooms."""
        return bool(self.digest) and not any(storey.rooms for storey in self.maps)

    @classmethod
    def of(cls, scene: Scene) -> Drawn:
        script = f"{SCRIPT}{as_json(house(scene))};"
        return cls(house_maps(scene, "house"), scene.digest, named(scene), floors_of(scene), script)

    @classmethod
    def missing(cls, why: str) -> Drawn:
        return cls((HouseMap("house", (0, 0, 0, 0)),), note=f"The house is not drawn: {why}")


class Houses:
    """The houses of recorded episodes; one that cannot be loaded is replaced by a note."""

    def __init__(self, load: Callable[[str], Scene]) -> None:
        self._load = load
        self._drawn = lru_cache(KEPT)(self._draw)

    def of(self, recorded: RecordedEpisode) -> Drawn:
        return self._drawn(recorded.record.spec.scene, recorded.record.scene_digest)

    def _draw(self, name: str, digest: str) -> Drawn:
        try:
            scene = self._load(name)
        except HumanclawError as fault:
            return Drawn.missing(str(fault))
        # Another version of the house would show walls where the body walked.
        if digest and scene.digest != digest:
            return Drawn.missing("the installed scene differs from the one of the record.")
        return Drawn.of(scene)
