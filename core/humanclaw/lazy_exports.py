"""Public names of packages load on first use."""

from __future__ import annotations

import ast
import importlib
import linecache
import sys
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any


def lazy_exports(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package.

    The package's public names are those that its `if TYPE_CHECKING:` block imports. Type checkers read the block as
    imports; at run time a name is imported on first use, so that importing the package costs nothing.
    """
    homes = dict(_imported(sys.modules[package]))

    def load(name: str) -> Any:
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
