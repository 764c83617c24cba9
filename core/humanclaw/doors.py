"""Public names of packages load on first use; former paths answer for one more version."""

from __future__ import annotations

import ast
import importlib
import linecache
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, Final

FORMER: Final = {
    "half_physics": ("humanclaw.world",),
    "hookspecs": ("humanclaw.plugins",),
    "interfaces": ("humanclaw.world", "humanclaw.motion", "humanclaw.plugins", "humanclaw"),
    "measures": ("humanclaw.skills",),
    "meshes": ("humanclaw.world",),
    "navigation": ("humanclaw.world", "humanclaw.records"),
    "outcomes": ("humanclaw.records",),
    "pose": ("humanclaw.body",),
    "recipes": ("humanclaw.skills",),
    "scene": ("humanclaw.world",),
    "tasks": ("humanclaw.records",),
    "tools": ("humanclaw.skills", "humanclaw"),
}
"""Modules that were doors up to plugin API 1.0, and the doors that have their names now."""
MOVED: Final = {
    "humanclaw.motion": {"Course": "humanclaw.skills"},
    "humanclaw.records": {"writing": "humanclaw.storage"},
    "humanclaw.storage": {"pack_scene": "humanclaw.world", "unpack_scene": "humanclaw.world"},
}
"""Names that went to another door with plugin API 1.1."""


def door(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package.

    The package's public names are those that its `if TYPE_CHECKING:` block imports. Type checkers read the block as
    imports; at run time a name is imported on first use, so that importing the package costs nothing.
    """
    homes = dict(_imported(sys.modules[package]))
    moved = MOVED.get(package, {})

    def load(name: str) -> Any:
        if name in moved:
            return getattr(_deprecated(f"{package}.{name}", moved[name]), name)
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(homes[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    special = [name for name in vars(sys.modules[package]) if name.startswith("__")]
    return load, lambda: sorted({*special, *homes}), sorted(homes)


def _imported(module: ModuleType) -> Iterator[tuple[str, str]]:
    """Yield each name that a package imports for type checkers, and the module that defines it."""
    source = "".join(linecache.getlines(module.__file__ or "", vars(module)))  # It also reads from a zip.
    if not source:
        raise ImportError(f"Expected the source file of {module.__name__}, which lists its names; found none.")
    for block in ast.parse(source).body:
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING":
            for node in block.body:
                if isinstance(node, ast.ImportFrom) and node.module:
                    yield from ((name.name, node.module) for name in node.names)


def _deprecated(former: str, now: str) -> ModuleType:
    warnings.warn(f"{former} is deprecated: import it from {now}.", DeprecationWarning, stacklevel=3)
    return importlib.import_module(now)


def answer_for_former_doors() -> None:
    """Let modules of FORMER be imported, also after a reload of `humanclaw` (which adds no second finder)."""
    if not any(isinstance(finder, FormerPaths) for finder in sys.meta_path):
        sys.meta_path.append(FormerPaths())  # The one way to answer for a module without a file.


class FormerPaths:
    """Finds and loads the modules of FORMER, which have no file any more.

    It is a finder and a loader by its methods alone: importing importlib.abc takes longer than all of `humanclaw`.
    """

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> Any:
        """Return a spec for a former door; None for every other module."""
        package, _, name = fullname.rpartition(".")
        found = package == "humanclaw" and name in FORMER
        return ModuleSpec(fullname, self) if found else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to Python to make the module."""

    def exec_module(self, module: ModuleType) -> None:
        """Let the module answer with the names of the doors that took its place."""
        doors = FORMER[module.__name__.rpartition(".")[2]]
        warnings.warn(
            f"{module.__name__} is deprecated: import from {' or '.join(doors)}.", DeprecationWarning, stacklevel=2
        )
        homes = {name: one for one in reversed(doors) for name in importlib.import_module(one).__all__}

        def load(name: str) -> Any:
            if name not in homes:
                raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")
            return getattr(importlib.import_module(homes[name]), name)

        vars(module).update(__getattr__=load, __all__=sorted(homes), __dir__=lambda: sorted({*vars(module), *homes}))
