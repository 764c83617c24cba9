"""An index of plugins: a static JSON file that anyone can host. Reading one runs no code of a plugin."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field
from http.client import HTTPException
from pathlib import Path
from typing import Annotated, Final, Literal
from urllib.error import URLError
from urllib.parse import unquote, urljoin, urlsplit
from urllib.request import urlopen

from packaging.utils import canonicalize_name
from pydantic import ConfigDict, StringConstraints, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from humanclaw.errors import HumanclawError
from humanclaw.plugins.bounded import Bounded
from humanclaw.storage.files import read_file
from humanclaw.text.json import first_fault
from humanclaw.text.words import counted, nearest

SHIPPED: Final = Path(__file__).with_name("index.json")
"""The first-party distributions, which pip finds by name."""
LARGEST: Final = 16 << 20
"""Bytes of an index that are read at most."""
_SECONDS: Final = 30
_HERE: Final = ("localhost", "127.0.0.1", "::1")
_CONFIG: Final = ConfigDict(extra="forbid")

# A terminal obeys control characters, and pip takes a name that begins with a dash for an option.
Line = Annotated[str, StringConstraints(max_length=1000, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
Name = Annotated[str, StringConstraints(max_length=200, pattern=r"^[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?$")]
Version = Annotated[str, StringConstraints(max_length=100, pattern=r"^[0-9][A-Za-z0-9.!+_-]*$")]
Wheel = Annotated[
    str,
    StringConstraints(
        max_length=1000, pattern=r"^(https?://[A-Za-z0-9/._:%+-]+\.whl|[A-Za-z0-9][A-Za-z0-9/._%+-]*\.whl)?$"
    ),
]
Digest = Annotated[str, StringConstraints(pattern=r"^([0-9a-f]{64})?$")]


@dataclass(frozen=True, config=_CONFIG)
class Followed:
    """How the motion of a trained skill follows one parameter: measured where the index was made, in the parameter's
    unit."""

    slope: float
    error: float
    constant: float
    """The error of the best constant."""


@dataclass(frozen=True, config=_CONFIG)
class IndexedSkill:
    """A skill of a wheel that is data alone: schema, checklist and adapter."""

    name: Line
    role: Line = ""
    faults: tuple[Line, ...] = ()
    """The checks that it fails."""
    unchecked: Line = ""
    """Why it could not be checked; empty if it was."""
    fidelity: Mapping[str, Followed] = field(default_factory=dict)
    """By parameter."""
    data: tuple[Line, ...] = ()
    """Licences of the data that its adapter was trained on."""


@dataclass(frozen=True, config=_CONFIG)
class Entry:
    """One distribution."""

    name: Name
    version: Version
    summary: Line = ""
    licence: Line = ""
    hooks: tuple[Line, ...] = ()
    """Hooks that its modules define, without humanclaw_: agents, skills."""
    skills: tuple[IndexedSkill, ...] = ()
    wheel: Wheel = ""
    """Where its wheel lies, relative to the index, or an address; empty if pip finds it by name."""
    sha256: Digest = ""

    @property
    def words(self) -> str:
        """All that a search looks at."""
        return " ".join([self.name, self.summary, *self.hooks, *(one.name for one in self.skills)]).lower()


@dataclass(frozen=True, config=_CONFIG)
class Index:
    """Entries, each name once. Raises ValueError for a name that occurs twice."""

    format: Literal["humanclaw-plugins-1"]
    plugins: tuple[Entry, ...]

    def __post_init__(self) -> None:
        names = Counter(canonicalize_name(one.name) for one in self.plugins)
        if twice := [name for name, times in names.items() if times > 1]:
            raise ValueError(f"the name {twice[0]} occurs twice")

    @classmethod
    def read(cls, place: str) -> Index:
        """Read a file, or what an https address answers. Raises HumanclawError for anything that is no index."""
        text = _fetched(place) if _is_address(place) else _loaded(Path(place))
        if len(text) > LARGEST:
            raise HumanclawError(f"{place} is larger than {LARGEST >> 20} MB.", "Give the address of an index.")
        try:
            return TypeAdapter(cls).validate_json(text)
        except ValidationError as error:
            remedy = "Make one with `humanclaw plugins index FOLDER_OF_WHEELS`."
            raise HumanclawError(f"{place} is no index of plugins: {first_fault(error)}.", remedy) from error

    def json(self) -> bytes:
        """Return the file's content."""
        return TypeAdapter(Index).dump_json(self, indent=1) + b"\n"

    def search(self, words: Sequence[str]) -> list[Entry]:
        """Return the entries that hold every word."""
        return [one for one in self.plugins if all(word.lower() in one.words for word in words)]

    def entry(self, name: str) -> Entry:
        """Return the entry of a name. Raises HumanclawError with the nearest name."""
        known = {canonicalize_name(one.name): one for one in self.plugins}
        if canonicalize_name(name) not in known:
            told = f"The index of {counted(len(known), 'plugin')} has no {name!r}."
            raise HumanclawError(told, nearest(name, dict.fromkeys(known, "")) or "See `humanclaw plugins search`.")
        return known[canonicalize_name(name)]


def requirement(entry: Entry, place: str) -> str:
    """Return what pip is to install: name and version, or the wheel with its digest, which pip compares.

    place: of the index. Raises HumanclawError for a wheel elsewhere than at https or beside the index.
    """
    if not entry.wheel:
        return f"{entry.name}=={entry.version}"
    address = place if _is_address(place) else Path(place).resolve().as_uri()
    found = urljoin(address, entry.wheel)
    if not entry.sha256 or ".." in unquote(entry.wheel):
        raise HumanclawError(f"The entry of {entry.name} has no digest, or leads out of its folder.", "Make it anew.")
    if urlsplit(found).scheme != "file":
        _refuse_open(found)
    return f"{entry.name} @ {found}#sha256={entry.sha256}"


def _loaded(path: Path) -> bytes:
    try:
        return read_file(path, LARGEST)
    except OSError as error:
        raise HumanclawError(f"{path} cannot be read: {error.strerror}.", "Give a file or an https address.") from error


def _is_address(place: str) -> bool:
    return place.lower().startswith(("https:", "http:"))


def _fetched(address: str) -> bytes:
    def read() -> tuple[str, bytes]:
        with urlopen(address, timeout=_SECONDS) as answer:
            return answer.url, answer.read(LARGEST + 1)

    try:
        _refuse_open(address)
        found, content = Bounded(_SECONDS)(read)
        _refuse_open(found)  # It may have sent us elsewhere.
        return content
    except (URLError, OSError, ValueError, HTTPException) as error:
        raise HumanclawError(f"{address} does not answer: {error}.", "Check the address.") from error


def _refuse_open(address: str) -> None:
    parts = urlsplit(address)
    if parts.scheme != "https" and parts.hostname not in _HERE:
        raise HumanclawError(f"{address} is not encrypted.", "Give an https address.")


HOOK: Final = re.compile(rb"^def humanclaw_(\w+)\(", re.MULTILINE)
"""The hooks of a module, read without running it."""
