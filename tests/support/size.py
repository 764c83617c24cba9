"""Compare the size of each package with its budget in size.toml: `make size`.

Counted are files that git tracks. code: lines of programs, templates, styles and data (WRITTEN) outside tests. tests:
such lines in a folder `tests`. words: words of *.md. Not counted: what programs write, settings of tools, plain text.
A package is a folder of plugins/, skills/ or harnesses/, or another top-level folder; `.` holds the
files at the top.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[2]
KINDS = ("code", "tests", "words")
WRITTEN = (
    ".c", ".cjs", ".css", ".html", ".j2", ".jinja", ".js", ".jsx", ".markdown", ".mjs", ".py", ".py.txt", ".pyi",
    ".pyx", ".rst", ".sh", ".toml", ".ts",
)  # fmt: skip
SETTINGS = ("pyproject.toml", "size.toml")
Sizes = Mapping[str, Mapping[str, int]]


def package(path: str) -> str:
    """Return the package that a file belongs to."""
    top, *inside = PurePosixPath(path).parts
    if not inside:
        return "."
    return f"{top}/{inside[0]}" if top in ("plugins", "skills", "harnesses") and len(inside) > 1 else top


def kind(path: str) -> str:
    """Return what a file is counted as: code, tests, words, or nothing."""
    if path.lower().endswith(WRITTEN) and PurePosixPath(path).name not in SETTINGS:
        return "tests" if "tests" in PurePosixPath(path).parts else "code"
    return "words" if path.endswith(".md") else ""


def measure(root: Path, paths: Iterable[str]) -> Sizes:
    """Count lines and words by package."""
    sizes: dict[str, Counter[str]] = defaultdict(Counter)
    for path in paths:
        if counted := kind(path):
            text = (root / path).read_text("utf-8")
            sizes[package(path)][counted] += len(text.split() if counted == "words" else text.splitlines())
    return sizes


def faults(sizes: Sizes, budget: Sizes) -> list[str]:
    """Return what exceeds its budget, and packages without a budget or without files."""
    problems = [f"{name} has no budget. Add it to size.toml." for name in sorted(set(sizes) - set(budget))]
    problems += [f"{name} of size.toml has no files. Remove it." for name in sorted(set(budget) - set(sizes))]
    for name in sorted(set(sizes) & set(budget)):
        for counted in KINDS:
            size, most = sizes[name].get(counted, 0), budget[name].get(counted, 0)
            if size > most:
                problems.append(f"{name}: {counted} {size} exceeds the budget of {most}.")
    return problems


def table(sizes: Sizes, budget: Sizes) -> Iterable[str]:
    """Yield a row a package, each size beside its budget, and a row of sums."""
    yield f"{'package':24}" + "".join(f"{counted:>9}{'budget':>9}" for counted in KINDS)
    rows = {name: (sizes.get(name, {}), budget.get(name, {})) for name in sorted({*sizes, *budget})}
    sums = [{k: sum(row[i].get(k, 0) for row in rows.values()) for k in KINDS} for i in (0, 1)]
    for name, pair in {**rows, "all": (sums[0], sums[1])}.items():
        yield f"{name:24}" + "".join(f"{counts.get(counted, 0):9}" for counted in KINDS for counts in pair)


def main(save: bool) -> int:
    file = ROOT / "size.toml"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    sizes = measure(ROOT, [path for path in listed.stdout.split("\0") if path and (ROOT / path).is_file()])
    if save:
        head = "# Lines of code and tests and words of Markdown by package: `make size`. Raise a row with the reason.\n"
        row = "{} = {{ code = {}, tests = {}, words = {} }}\n"
        rows = [row.format(f'"{name}"', *(sizes[name].get(k, 0) for k in KINDS)) for name in sorted(sizes)]
        file.write_text(head + "".join(rows), "utf-8")
    budget = tomllib.loads(file.read_text("utf-8"))
    print(*table(sizes, budget), sep="\n")
    print(*(problems := faults(sizes, budget)), sep="\n", end="\n" if problems else "")
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main("--save" in sys.argv[1:]))
