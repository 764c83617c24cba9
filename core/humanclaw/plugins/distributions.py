"""Which distribution brings something that is not installed: names in, lines to type out."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

DEMO = "demo"
"""The extra with all that `humanclaw run` needs."""


@cache
def table() -> Mapping[str, Mapping[str, str]]:
    """Kind to name to first-party distribution."""
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
    """Return the first-party distribution that brings something; empty if none does."""
    return table().get(kind, {}).get(name, "")


def install(distributions: Iterable[str]) -> str:
    """Return the shortest line that installs some distributions: by the extra `demo` where it holds several of them."""
    wanted, demo = list(dict.fromkeys(distributions)), _extra(DEMO)
    if len(demo & set(wanted)) > 1:
        wanted = [f'"humanclaw[{DEMO}]"', *(name for name in wanted if name not in demo)]
    return f"pip install {' '.join(wanted)}"


def _extra(extra: str) -> set[str]:
    """Return the distributions that an extra of the core names, whatever the version of Python."""
    import importlib.metadata

    from packaging.requirements import Requirement  # Only who misses something waits for these.

    requirements = map(Requirement, importlib.metadata.requires("humanclaw") or ())
    return {one.name for one in requirements if one.marker and f'extra == "{extra}"' in str(one.marker)}
