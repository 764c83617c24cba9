"""`humanclaw new`: write a complete distribution from the templates that the first-party packages follow too.

The templates (cli/templates) make working distributions named "example": `common` holds the files that all kinds
share, and each other folder the package, the tests and the README text of one kind. `humanclaw new` replaces the name.
"""

from __future__ import annotations

import json
import keyword
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import click

from humanclaw.errors import HumanclawError
from humanclaw.plugins.distributions import bringing

TEMPLATES: Final = Path(__file__).parent / "templates"
_NAME: Final = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
_LONGEST: Final = 64
"""Letters of a name: file systems allow 255 in a file's, which holds more."""
_CORE: Final = "humanclaw>=0.1,<0.2"
# Under their final names these files would act on this repository.
_RENAMED: Final = {
    "project.toml": "pyproject.toml",
    "gitignore": ".gitignore",
    "test.yml": ".github/workflows/test.yml",
}
# This suffix keeps tools from taking template modules for modules of the core.
_KEPT: Final = ".txt"


@dataclass(frozen=True)
class Kind:
    """A kind of distribution. template: its folder. run: a command that tries it. extra: of the core, for `run`."""

    template: str
    what: str
    run: str
    needs: tuple[str, ...] = ()
    extra: str = "demo"


_NUMPY: Final = ("numpy>=1.26",)
TRAINED: Final = Kind("trained", "skill", "humanclaw skills", _NUMPY, extra="")
TRAIN: Final = "humanclaw data chunks --skill humanclaw_example/example_call --clips DIR"
KINDS: Final = {
    "skill": Kind("skill", "skill", "humanclaw skills", ("pydantic>=2.6",), extra=""),
    "agent": Kind("agent", "agent", "humanclaw run --agent example"),
    "verifier": Kind("verifier", "verifier", "humanclaw run --verifier example"),
    "observer": Kind("observer", "observer", "humanclaw run"),
    "scene": Kind("scene", "scene source", 'humanclaw run --scene example:0 --instruction "find the chair"', _NUMPY),
    "metric": Kind("metric", "metric", "humanclaw bench table RUN --only plugins", extra="bench"),
    "simulator": Kind("simulator", "simulator", "humanclaw run --simulator example", _NUMPY),
    "reporter": Kind("reporter", "reporter", "humanclaw run"),
    "framework": Kind("framework", "framework", "humanclaw plugins"),
    "command": Kind("command", "command", "humanclaw example --help", ("click>=8.1",)),
}


@dataclass(frozen=True)
class Distribution:
    """A new distribution. call: the name under which models call a skill. needs: its requirements but for the core."""

    kind: Kind
    name: str
    call: str
    description: str
    author: str
    needs: tuple[str, ...]

    @classmethod
    def of(cls, kind: Kind, name: str, call: str = "", about: str = "", author: str = "") -> Distribution:
        """Fill in defaults for empty arguments. Raises HumanclawError for an invalid name, or a text that is no line of
        printable characters."""
        name = name.replace("-", "_")
        for word in (name, call or name):
            if not _NAME.fullmatch(word) or len(word) > _LONGEST or keyword.iskeyword(word):
                message = f"{word[: _LONGEST + 1]!r} is not a valid name for a {kind.what}."
                rule = f"Use up to {_LONGEST} lower-case letters, digits and _, begin with a letter"
                raise HumanclawError(message, f"{rule}, and avoid Python's keywords.")
        for text in (about, author):
            if not text.isprintable():
                raise HumanclawError(
                    f"expected one line of text; got {text!r:.80}.", "Remove line breaks and controls."
                )
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
        """Return the content of every file by its path in the distribution."""
        texts = {**_read(TEMPLATES / "common"), **_read(TEMPLATES / self.kind.template)}
        about = texts.pop("about.md").rstrip()
        texts["README.md"] = texts["README.md"].replace("ABOUT", about).replace("RUN", self.kind.run, 1)
        made = {self.filled(_RENAMED.get(path, path)): text for path, text in texts.items()}
        made[f"humanclaw_{self.entry}/py.typed"] = ""
        return {
            path: (text if path == "LICENSE" else self.filled(text, quoted=not path.endswith(".md"))).encode()
            for path, text in made.items()
        }

    def filled(self, text: str, quoted: bool = False) -> str:
        """Return a text of the templates with the values of this distribution.

        quoted: whether description and author stand in quotation marks, as Python and TOML have them.
        """
        words = [self.description, self.author]
        # Python and TOML read JSON's escapes.
        description, author = (json.dumps(word, ensure_ascii=False)[1:-1] for word in words) if quoted else words
        requirements = ", ".join(f'"{word}"' for word in (_CORE, *self.needs))
        camel = "".join(word.capitalize() for word in self.name.split("_"))
        pairs = {
            "DESCRIPTION": description,
            "AUTHOR": author,
            "DEPENDENCIES": f"[{requirements}]",
            "INSTALL": f'"humanclaw[{self.kind.extra}]" {self.project}' if self.kind.extra else self.project,
            "example_call": self.call,
            "humanclaw-example": self.project,
            "humanclaw_example": f"humanclaw_{self.entry}",
            "test_example": f"test_{self.entry}",
            'example = "': f'{self.entry} = "',
            "Example": camel,
            "example": self.name,
        }
        # In one pass, so that no value is taken for a placeholder.
        return re.sub("|".join(map(re.escape, pairs)), lambda match: pairs[match[0]], text)


def _read(folder: Path) -> dict[str, str]:
    """Read the files of a template by their path in it."""
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {file.relative_to(folder).as_posix().removesuffix(_KEPT): file.read_text("utf-8") for file in files}


def write(distribution: Distribution, folder: Path) -> int:
    """Write a distribution into a new or empty folder; return the number of lines, without the licence."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise HumanclawError(f"{folder} already exists.", "Name another folder with --out.")
    files = distribution.files()
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    return sum(content.count(b"\n") for path, content in files.items() if path != "LICENSE")


@click.command(epilog=f"KIND is one of: {', '.join(KINDS)}.")
@click.argument("kind", type=click.Choice(list(KINDS)), metavar="KIND")
@click.argument("name")
@click.option("--trained", is_flag=True, help="A skill that is trained on motion, not played from keyframes.")
@click.option("--call", default="", metavar="NAME", help="Name of the skill in calls; default: the package's name.")
@click.option("--about", default="", metavar="TEXT", help="Description in a few words.")
@click.option("--author", default="", metavar="TEXT", help="Name of the author.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder to write to; default: the distribution's name.")
def new(kind: str, name: str, trained: bool, call: str, about: str, author: str, out: Path | None) -> None:
    """Begin a skill, agent, scene ... of your own: a distribution with tests, licence, README and CI."""
    if trained and kind != "skill":
        raise click.UsageError("Only a skill is trained.")
    chosen = TRAINED if trained else KINDS[kind]
    made = Distribution.of(chosen, name, call, about, author)
    for word in dict.fromkeys((made.name, made.call) if made.kind.what == "skill" else ()):
        if owner := bringing("skills", word):
            message = f"{word!r} is already a skill of {owner}."
            raise HumanclawError(message, "Choose another name, for the skill and for --call.")
    folder = out or Path(made.project)
    lines = write(made, folder)
    click.echo(f"wrote {folder}: {lines} lines. Next:")
    for line in (f"cd {folder}", "pip install -e . pytest", "pytest", made.filled(TRAIN if trained else chosen.run)):
        click.echo(f"    {line}")
