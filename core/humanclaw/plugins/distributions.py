"""Which first-party distribution brings a name, and the command that installs it."""

from __future__ import annotations

import json
import shlex
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
    """Return the command that installs first-party distributions from where the core was itself installed."""
    wanted = list(dict.fromkeys(distributions))
    if checkout := None if PUBLISHED else _checkout():
        wanted = [word for name in wanted for word in ("-e", str(_folder(checkout, name)))]
    elif not PUBLISHED:
        wanted = ["--find-links", WHEELS, *wanted]
    return shlex.join(["pip", "install", *wanted])


def _checkout() -> Path | None:
    """Return the folder from which the core was installed editable; None if it was installed from a wheel."""
    import importlib.metadata
    from urllib.request import url2pathname  # It loads http, and only advice on installing needs it.

    origin = json.loads(importlib.metadata.distribution("humanclaw").read_text("direct_url.json") or "{}")
    return Path(url2pathname(urlsplit(origin["url"]).path)) if origin.get("dir_info", {}).get("editable") else None


def _folder(checkout: Path, name: str) -> Path:
    """Return the folder of a distribution in the checkout, which is named after it."""
    short = name.removeprefix("humanclaw-").removeprefix("skill-").replace("-", "_")
    return next((path.parent for path in checkout.glob(f"*/{short}/pyproject.toml")), checkout)
