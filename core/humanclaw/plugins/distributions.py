"""Which first-party distribution brings a name, and the command that installs it."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

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


def install(distributions: Iterable[str]) -> str:
    """Return the shortest command that installs some distributions: by the extra `demo` if it holds several of them."""
    wanted, demo = list(dict.fromkeys(distributions)), _extra(DEMO)
    if len(demo & set(wanted)) > 1:
        wanted = [f'"humanclaw[{DEMO}]"', *(name for name in wanted if name not in demo)]
    return f"pip install {' '.join(wanted)}"


def _extra(extra: str) -> set[str]:
    """Return the distributions that an extra of the core names, whatever the version of Python."""
    import importlib.metadata

    from packaging.requirements import Requirement  # Imported here: only an error needs it.

    requirements = map(Requirement, importlib.metadata.requires("humanclaw") or ())
    return {one.name for one in requirements if one.marker and f'extra == "{extra}"' in str(one.marker)}
