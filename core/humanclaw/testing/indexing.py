"""Make an index of plugins from wheels. No code of a wheel runs: it is read as data, in bounded pieces.

A wheel's skill folders are checked and their motion is measured, because they are data. Skills and other items that are
Python are listed by their hooks.
"""

from __future__ import annotations

import re
import tempfile
import zipfile
from collections.abc import Iterator
from email.parser import BytesParser
from pathlib import Path, PurePosixPath
from typing import Final

from packaging.utils import InvalidWheelFilename, canonicalize_name, parse_wheel_filename
from pydantic import ValidationError

from humanclaw.errors import HumanclawError
from humanclaw.plugins.host import Plugins
from humanclaw.plugins.index import HOOK, Entry, Followed, Index, IndexedSkill
from humanclaw.skills.adapter_checks import adapter_header
from humanclaw.skills.checks import read_draft
from humanclaw.skills.measures import from_si
from humanclaw.storage.archives import DAMAGED
from humanclaw.storage.files import Folder
from humanclaw.testing.examining import Report, examine
from humanclaw.text.json import first_fault

_MEMBERS: Final = 5000
_WHEEL: Final = 1 << 30
_TEXT: Final = 1 << 20
"""Bytes of a module, a schema or metadata that are read at most."""
_WEIGHTS: Final = 256 << 20
_SKILLS: Final = 50
_NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")
_PARTS: Final = re.compile(r"schema\.json|checklist\.toml|adapter[A-Za-z0-9_-]*\.safetensors")
"""The files of a skill that are data."""


def index_of(folder: Path, plugins: Plugins, by_name: bool = False) -> tuple[Index, dict[str, str]]:
    """Return the index of a folder's wheels, and for each file that is no wheel of a plugin the reason.

    plugins: whose measures and priors are known. by_name: leave out where the wheels lie; pip finds them by name.
    """
    entries, left_out = {}, {}
    for wheel in Folder(folder).names(".whl"):
        try:
            one = _entry(Folder(folder), wheel, plugins, by_name)
            if one.name in entries:
                raise HumanclawError(f"it is another wheel of {one.name}.")
            entries[one.name] = one
        except HumanclawError as error:
            left_out[wheel] = error.message
        except ValidationError as error:
            left_out[wheel] = first_fault(error)
        except (*DAMAGED, ValueError) as error:
            left_out[wheel] = f"it cannot be read: {error}"
    return Index("humanclaw-plugins-1", tuple(entries.values())), left_out


def _entry(folder: Folder, wheel: str, plugins: Plugins, by_name: bool) -> Entry:
    with folder.open(wheel, _WHEEL) as file, zipfile.ZipFile(file) as archive:
        if len(archive.infolist()) > _MEMBERS:
            raise HumanclawError(f"it holds more than {_MEMBERS} files.")
        told, hooks = _metadata(archive, wheel), _hooks(archive)
        if not hooks or told["name"] == "humanclaw":
            raise HumanclawError("it is no plugin: no module of it defines a hook.")
        skills = tuple(_skills(archive, plugins))
    digest = folder.digest(wheel, _WHEEL)
    place = {} if by_name else {"wheel": wheel.replace("+", "%2B"), "sha256": digest}
    return Entry(**told, hooks=hooks, skills=skills, **place)


def _metadata(archive: zipfile.ZipFile, file: str) -> dict[str, str]:
    """Return name, version, summary and licence. Raises HumanclawError unless the file's name says the same."""
    try:
        name, version, *_ = parse_wheel_filename(file)
    except InvalidWheelFilename as error:
        raise HumanclawError(str(error)) from error
    found = [one for one in archive.namelist() if re.fullmatch(r"[^/]+\.dist-info/METADATA", one)]
    told = BytesParser().parsebytes(_read(archive, found[0], _TEXT) if len(found) == 1 else b"")
    if canonicalize_name(str(told.get("Name", ""))) != name or str(told.get("Version", "")) != str(version):
        raise HumanclawError("its metadata name another distribution or version than its file.")
    licence = str(told.get("License-Expression") or told.get("License") or "")
    return {"name": name, "version": str(version), "summary": str(told.get("Summary", "")), "licence": licence[:200]}


def _hooks(archive: zipfile.ZipFile) -> tuple[str, ...]:
    modules = [one for one in archive.namelist() if one.endswith(".py")]
    found = {hook.decode() for one in modules for hook in HOOK.findall(_read(archive, one, _TEXT, whole=False))}
    return tuple(sorted(found))


def _skills(archive: zipfile.ZipFile, plugins: Plugins) -> Iterator[IndexedSkill]:
    folders = [PurePosixPath(one).parent for one in archive.namelist() if PurePosixPath(one).name == "schema.json"]
    if len(folders) > _SKILLS:
        raise HumanclawError(f"it holds more than {_SKILLS} skills.")
    for folder in sorted(folders):
        if not _NAME.fullmatch(folder.name):
            raise HumanclawError(f"a skill's folder has the name {folder.name[:80]!r}.")
        with tempfile.TemporaryDirectory() as temporary:
            copy = Path(temporary) / folder.name
            copy.mkdir()
            for member in archive.namelist():
                path = PurePosixPath(member)
                if path.parent == folder and _PARTS.fullmatch(path.name):
                    limit = _WEIGHTS if path.suffix == ".safetensors" else _TEXT
                    (copy / path.name).write_bytes(_read(archive, member, limit))
            yield _indexed(copy, plugins)


def _indexed(folder: Path, plugins: Plugins) -> IndexedSkill:
    draft, unreadable = read_draft(folder)
    if draft is None:
        return IndexedSkill(folder.name, faults=tuple(one.check for one in unreadable))
    role, data = draft.role, _data_licences(folder)
    if own := [one.measure for one in draft.parameters if one.measure not in plugins.measures]:
        return IndexedSkill(folder.name, role, (), f"{own[0]} is measured by a plugin's own code", {}, data)
    report = examine(folder, plugins.measures, plugins=plugins, engines=())
    faults = tuple(dict.fromkeys(one.check for one in report.faults))
    return IndexedSkill(folder.name, role, faults, "", dict(_fidelity(report)), data)


def _fidelity(report: Report) -> Iterator[tuple[str, Followed]]:
    for one, found in report.followed.items():
        if one.low == one.high:
            continue
        error, constant = (round(from_si(one.key, value), 1) for value in (found.error, found.constant))
        yield one.key, Followed(round(found.slope, 3), error, constant)


def _data_licences(folder: Path) -> tuple[str, ...]:
    header, _ = adapter_header(folder / "adapter.safetensors", "")
    return tuple(str(one) for one in header["card"]["licences"]) if header else ()


def _read(archive: zipfile.ZipFile, member: str, limit: int, whole: bool = True) -> bytes:
    """Read a member up to a limit, whatever size the archive states. whole: raise HumanclawError beyond it."""
    with archive.open(member) as file:
        content = file.read(limit + 1)
    if whole and len(content) > limit:
        raise HumanclawError(f"its {PurePosixPath(member).name[:80]} is larger than {limit >> 20} MB.")
    return content[:limit]
