"""`humanclaw new`: a complete distribution from the one template that ours are made of.

The templates are distributions called "example" that work as they stand (humanclaw/templates): what all have in common,
and the package, the tests and the README of each kind. Their name is replaced by the one that is asked for.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import click

from humanclaw.errors import HumanclawError

TEMPLATES: Final = Path(__file__).parents[1] / "templates"
_NAME: Final = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
_CORE: Final = "humanclaw>=0.1,<0.2"
_RENAMED: Final = {
    "project.toml": "pyproject.toml",
    "gitignore": ".gitignore",
    "test.yml": ".github/workflows/test.yml",
}
"""Files that would act on our own repository under the name that they get,"""
_KEPT: Final = ".txt"
"""and modules that are none of ours."""


@dataclass(frozen=True)
class Kind:
    """What can be made anew. template: its folder. needs: what it requires beside the core. then: what to try."""

    template: str
    what: str
    needs: tuple[str, ...] = ()
    then: str = ""


TRAINED: Final = Kind("trained", "skill", ("numpy>=1.26",), "humanclaw data chunks --skill SKILL_FOLDER --clips DIR")
KINDS: Final = {
    "skill": Kind("skill", "skill", ("pydantic>=2.6",), "humanclaw skills"),
    "agent": Kind("agent", "agent", (), "humanclaw run --agent NAME"),
    "verifier": Kind("verifier", "verifier", (), "humanclaw run --verifier NAME"),
    "observer": Kind("observer", "observer", (), "humanclaw run"),
    "scene": Kind("scene", "scene source", ("numpy>=1.26",), "humanclaw run --scene NAME:0"),
    "metric": Kind("metric", "metric", (), "humanclaw bench table RUN --only plugins"),
    "simulator": Kind("simulator", "simulator", ("numpy>=1.26",), "humanclaw run --simulator NAME"),
}


@dataclass(frozen=True)
class Distribution:
    """What a new distribution is to be called, and by whom it is. call: the name of a skill in calls."""

    kind: Kind
    name: str
    call: str
    description: str
    author: str
    needs: tuple[str, ...]

    @classmethod
    def of(cls, kind: Kind, name: str, call: str = "", about: str = "", author: str = "") -> Distribution:
        """Fill in what is not told. Raises HumanclawError for a name that none can have."""
        name = name.replace("-", "_")
        if not _NAME.fullmatch(name) or not _NAME.fullmatch(call or name):
            raise HumanclawError(f"{call or name!r} is no name of a {kind.what}.", "Use small letters, digits and _.")
        description = f"HumanCLAW {kind.what}: {(about or name.replace('_', ' ')).rstrip('.')}."
        made = cls(kind, name, call or name, description, author, kind.needs)
        return made if author else cls(**vars(made) | {"author": f"The authors of {made.project}"})

    @property
    def entry(self) -> str:
        """Name of its entry point."""
        return f"skill_{self.name}" if self.kind.what == "skill" else self.name

    @property
    def project(self) -> str:
        """Name of the distribution."""
        return f"humanclaw-{self.entry}".replace("_", "-")

    def files(self) -> dict[str, bytes]:
        """Return every file by its path in the distribution."""
        found = {**_read(TEMPLATES / "common"), **_read(TEMPLATES / self.kind.template)}
        made = {self._filled(_RENAMED.get(path, path)): text for path, text in found.items()}
        made[f"humanclaw_{self.entry}/py.typed"] = ""
        return {path: (text if path == "LICENSE" else self._filled(text)).encode() for path, text in made.items()}

    def _filled(self, text: str) -> str:
        requirements = ", ".join(f'"{one}"' for one in (_CORE, *self.needs))
        camel = "".join(word.capitalize() for word in self.name.split("_"))
        pairs = {
            "DESCRIPTION": self.description,
            "AUTHOR": self.author,
            "DEPENDENCIES": f"[{requirements}]",
            "example_call": self.call,
            "humanclaw-example": self.project,
            "humanclaw_example": f"humanclaw_{self.entry}",
            "test_example": f"test_{self.entry}",
            'example = "': f'{self.entry} = "',
            "Example": camel,
            "example": self.name,
        }
        # All at once: what was filled in is not looked at again.
        return re.sub("|".join(map(re.escape, pairs)), lambda found: pairs[found[0]], text)


def _read(folder: Path) -> dict[str, str]:
    """Read the files of a template by their path in it."""
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {file.relative_to(folder).as_posix().removesuffix(_KEPT): file.read_text("utf-8") for file in files}


def write(distribution: Distribution, folder: Path) -> int:
    """Write a distribution into a folder that is not there or empty; returns the number of its lines, licence apart."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise HumanclawError(f"{folder} is there already.", "Name another folder with --out.")
    files = distribution.files()
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    return sum(content.count(b"\n") for path, content in files.items() if path != "LICENSE")


@click.command()
@click.argument("kind", type=click.Choice(list(KINDS)))
@click.argument("name")
@click.option("--trained", is_flag=True, help="A skill that is trained on motion, not played from keyframes.")
@click.option("--call", default="", metavar="NAME", help="By which models call a skill; NAME where it is not given.")
@click.option("--about", default="", metavar="TEXT", help="What it is, in a few words.")
@click.option("--author", default="", metavar="TEXT", help="Who made it.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write to; the distribution's name by default.")
def new(kind: str, name: str, trained: bool, call: str, about: str, author: str, out: Path | None) -> None:
    """Begin a skill, agent, scene ... of your own: a distribution with tests, licence, README and CI."""
    if trained and kind != "skill":
        raise click.UsageError("Only a skill is trained.")
    chosen = TRAINED if trained else KINDS[kind]
    made = Distribution.of(chosen, name, call, about, author)
    folder = out or Path(made.project)
    lines = write(made, folder)
    package = f"humanclaw_{made.entry}"
    then = chosen.then.replace("SKILL_FOLDER", f"{package}/{made.call}").replace("NAME", made.name)
    click.echo(f"wrote {folder}: {lines} lines. Next:")
    for line in (f"cd {folder}", "pip install -e . pytest", "pytest", then):
        click.echo(f"    {line}")
