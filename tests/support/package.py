"""Add a package to this repository: `make package KIND=skill NAME=salute`.

`humanclaw new` writes the package. Every list of the repository that names the package's neighbour then names it too.
"""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from humanclaw.cli.new import KINDS, Distribution, new

ROOT = Path(__file__).parents[2]
AUTHOR = "The HumanCLAW authors"
NEIGHBOURS = {"skill": "skills/walk", "agent": "harnesses/human", "verifier": "harnesses/human"}
"""An existing package of each kind, which stands in every list where a new one belongs; else plugins/habitat."""
LISTS = ("requirements-demo.txt", "requirements.txt", "pyproject.toml")
ENTRIES = (
    (r"^(-e \w+/)OLD\n", r"\g<0>\1{name}\n"),
    (r'^( +"humanclaw-(?:skill-)?)OLD(>.*\n)', r"\g<0>\1{dashed}\2"),
    (r"^OLD( = .*humanclaw-)OLD(>.*\n)", r"\g<0>{dashed}\1{dashed}\2"),
    (r'"humanclaw_(?:skill_)?OLD"', r'\g<0>, "humanclaw_{entry}"'),
    (r"(?<=[\[,])OLD(?=[\],])", r"\g<0>,{dashed}"),
)
"""How lists spell the neighbour OLD, and what replaces it: the neighbour and the new package."""


def add(arguments: Sequence[str]) -> Path:
    """Add a package by the arguments of `humanclaw new`; return its folder."""
    context = new.make_context("package", ["--author", AUTHOR, *arguments])
    kind, name, call = (context.params[key] for key in ("kind", "name", "call"))
    made = Distribution.of(KINDS[kind], name, call)
    home, _, neighbour = NEIGHBOURS.get(kind, "plugins/habitat").partition("/")
    folder = context.params["out"] = ROOT / home / made.name
    new.invoke(context)
    # The repository has one workflow and one list of ignored files.
    shutil.rmtree(folder / ".github")
    (folder / ".gitignore").unlink()
    for path in LISTS:
        (ROOT / path).write_text(listed((ROOT / path).read_text("utf-8"), neighbour, made), "utf-8")
    (table,) = (ROOT / "core").rglob("distributions.toml")
    table.write_text(registered(table.read_text("utf-8"), kind, made), "utf-8")
    return folder


def listed(text: str, neighbour: str, made: Distribution) -> str:
    """Return a file whose lists name a new distribution after its neighbour."""
    names = {"name": made.name, "entry": made.entry, "dashed": made.name.replace("_", "-")}
    for pattern, entry in ENTRIES:
        text = re.sub(pattern.replace("OLD", neighbour), entry.format(**names), text, flags=re.MULTILINE)
    return text


def registered(text: str, kind: str, made: Distribution) -> str:
    """Return the table of registered names with that of a new distribution; a metric and an observer are not in it."""
    line = f'{made.call} = "{made.project}"\n'
    rows = re.compile(rf"(?<=^\[{kind}s\]\n)(?:.+\n)+", re.MULTILINE)
    return rows.sub(lambda match: "".join(sorted([*match[0].splitlines(keepends=True), line])), text)


if __name__ == "__main__":
    print(f"Added {add(sys.argv[1:]).relative_to(ROOT)} to the lists of the repository. Next: make ci")
