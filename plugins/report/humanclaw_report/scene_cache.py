"""The houses of a run as its pages need them: maps, names and a script with the meshes, without the scene itself."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from pydantic import TypeAdapter, ValidationError

from humanclaw import HumanclawError, RecordedEpisode, Scene, __version__
from humanclaw.storage import Cache, source_digest
from humanclaw.world import floors_of
from humanclaw_report.episode_summary import named
from humanclaw_report.floor_plan import HouseMap, house_maps
from humanclaw_report.replay import as_json, house

_CODE: Final = tuple(
    f"humanclaw_report/{name}.py" for name in ("episode_summary", "scene_cache", "floor_plan", "replay")
)
"""What may change the drawing of the same scene."""
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

    @classmethod
    def of(cls, scene: Scene) -> Drawn:
        script = f"{SCRIPT}{as_json(house(scene))};"
        return cls(house_maps(scene, "house"), scene.digest, named(scene), floors_of(scene), script)

    @classmethod
    def missing(cls, why: str) -> Drawn:
        return cls((HouseMap("house", (0, 0, 0, 0)),), note=f"The house is not drawn: {why}")


_PACKED: Final = TypeAdapter(Drawn)


class Houses:
    """The houses of recorded episodes. What was drawn once comes from the cache, whatever scene is installed now; a
    house that cannot be loaded is replaced by a note."""

    def __init__(self, load: Callable[[str], Scene]) -> None:
        self._load, self._store = load, Cache("pages")
        self._drawn = lru_cache(KEPT)(self._stored_or_drawn)

    def of(self, recorded: RecordedEpisode) -> Drawn:
        return self._drawn(recorded.record.spec.scene, recorded.record.scene_digest)

    def _stored_or_drawn(self, name: str, digest: str) -> Drawn:
        return self._stored(digest) or self._draw(name, digest)

    def _stored(self, digest: str) -> Drawn | None:
        data = self._store.get(_key(digest)) if digest else None
        try:
            return _PACKED.validate_json(data) if data else None
        except ValidationError:
            return None

    def _draw(self, name: str, digest: str) -> Drawn:
        try:
            scene = self._load(name)
        except HumanclawError as fault:
            return Drawn.missing(str(fault))
        # Another version of the house would show walls where the body walked.
        if digest and scene.digest != digest:
            return Drawn.missing("the installed scene differs from the one of the record.")
        drawn = Drawn.of(scene)
        self._store.put(_key(scene.digest), _PACKED.dump_json(drawn))
        return drawn


def _key(digest: str) -> str:
    return hashlib.sha256(f"{__version__}|{source_digest(_CODE)}|{digest}".encode()).hexdigest()
