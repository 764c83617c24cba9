"""Which first-party distribution brings a name, and the command that installs it."""

from __future__ import annotations

import json
import shlex
import shutil
import sys
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

PUBLISHED: Final = False
"""Whether a package index has the distributions. The release sets it to True."""
WHEELS: Final = "dist"
"""The folder into which `make wheels` builds the distributions."""
DEMO = "demo"
"""The extra with everything that `humanclaw run` needs."""


@cache
def table() -> Mapping[str, Mapping[str, str]]:
    """Return the first-party distribution by kind and name."""
    return tomllib.loads(Path(__file__).with_name("distributions.toml").read_text("utf-8"))


@cache
def version() -> str:
    """Return the version of the installed core."""
    import importlib.metadata

    return importlib.metadata.version("humanclaw")


@cache
def own() -> frozenset[str]:
    """Return the first-party distributions."""
    return frozenset({"humanclaw"}.union(*(names.values() for names in table().values())))


def bringing(kind: str, name: str) -> str:
    """Return the first-party distribution that brings a name; empty if none does."""
    return table().get(kind, {}).get(name, "")


def requirements(distributions: Iterable[str]) -> list[str]:
    """Return what pip is asked for to install first-party distributions from where the core was itself installed."""
    wanted = list(dict.fromkeys(distributions))
    if checkout := None if PUBLISHED else _checkout():
        return [word for folder in _folders(checkout, wanted) for word in ("-e", _short(folder))]
    demo = _extra(DEMO)
    if len(demo & set(wanted)) > 1:
        wanted = [f"humanclaw[{DEMO}]", *(name for name in wanted if name not in demo)]
    source = () if PUBLISHED else ("--find-links", WHEELS)
    return [*source, *wanted]


def install(distributions: Iterable[str]) -> str:
    """Return the command that installs first-party distributions, as a line for a shell."""
    words = (f'"{word}"' if "[" in word else shlex.quote(word) for word in requirements(distributions))
    return " ".join([_pip(), "install", *words])


def _pip() -> str:
    """Return the pip of this interpreter: by its path, unless it is the first one on PATH."""
    own = shutil.which("pip", path=str(Path(sys.executable).parent))
    return "pip" if own in (None, shutil.which("pip")) else shlex.quote(str(own))


def _checkout() -> Path | None:
    """Return the folder from which the core was installed editable; None if it was installed from a wheel."""
    import importlib.metadata
    from urllib.request import url2pathname  # It loads http, and only advice on installing needs it.

    told = json.loads(importlib.metadata.distribution("humanclaw").read_text("direct_url.json") or "{}")
    return Path(url2pathname(urlsplit(told["url"]).path)) if told.get("dir_info", {}).get("editable") else None


def _folders(checkout: Path, wanted: Iterable[str]) -> list[Path]:
    """Return the folder in the checkout of each distribution."""
    files = [checkout / "pyproject.toml", *checkout.glob("*/*/pyproject.toml")]
    found = {tomllib.loads(file.read_text("utf-8"))["project"]["name"]: file.parent for file in files}
    return [found[name] for name in wanted]


def _short(folder: Path) -> str:
    """Return a path that pip does not take for a name: relative if the folder is in the current one."""
    return f"./{folder.relative_to(Path.cwd()).as_posix()}" if folder.is_relative_to(Path.cwd()) else str(folder)


def _extra(extra: str) -> set[str]:
    """Return the distributions that an extra of the core names, whatever the version of Python."""
    import importlib.metadata

    from packaging.requirements import Requirement  # Imported here: only an error needs it.

    requirements = map(Requirement, importlib.metadata.requires("humanclaw") or ())
    return {one.name for one in requirements if one.marker and f'extra == "{extra}"' in str(one.marker)}
