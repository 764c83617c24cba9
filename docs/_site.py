"""Generate pages for mkdocs: one for each package's README, the commands, the table of checks, and docstrings."""

from __future__ import annotations

import posixpath
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
from click.testing import CliRunner
from mkdocs.structure.files import File, Files

from humanclaw import Plugins
from humanclaw.cli import LazyCommand, build
from humanclaw.skills.checks import CHECKS
from humanclaw_bench.splits import load_split

ROOT = Path(__file__).parents[1]
INCLUDED = {"plugins/bench/README.md": "benchmark.md"}
"""READMEs whose page has another name."""
REPLAYED = "smoke"
"""The split whose replays are on the site."""
_REPLAY = re.compile(r"!\[([^\]]*)\]\((images/replay-(\w+)\.jpg)\)")
_PICTURE = re.compile(r"!\[([^\]]*)\]\((?!https?://)([^)\s]+)\)")
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?!https?://|#)([^)#\s]+)(#[^)\s]*)?\)")

_SOURCE = re.compile(r"^\* \[(humanclaw[\w.]+)\]\([^)\s]+\.py\)$", re.MULTILINE)
_HOOKS = """
    options:
      filters: ["^humanclaw_"]
      show_root_heading: false
      show_root_toc_entry: false"""


# -- READMEs -----------------------------------------------------------------------------------------------------------
def pages() -> dict[str, str]:
    """Map the path of each README in the repository to its page on the site."""
    roots = [path.relative_to(ROOT) for kind in ("plugins", "skills", "harnesses") for path in ROOT.glob(f"{kind}/*/")]
    listed = {f"{path}/README.md": f"packages/{path.parts[0]}-{path.name}.md" for path in roots}
    return {path: page for path, page in {**listed, **INCLUDED}.items() if (ROOT / path).is_file()}


def on_files(files: Files, config: Any) -> Files:
    """Add a page and the pictures of every README of a package, and a page that lists them."""
    for path, page in pages().items():
        text = (ROOT / path).read_text("utf-8")
        files.append(File.generated(config, page, content=_shown(relinked(text, path, page), path, page)))
        for picture in _pictures(text, path):
            if files.get_file_from_path(picture) is None:
                files.append(File(picture, str(ROOT), config.site_dir, config.use_directory_urls))
    files.append(File.generated(config, "packages.md", content="\n".join(_listed())))
    return files


def _listed() -> Iterator[str]:
    yield "# Packages\n\nEvery distribution of the repository, by its README.\n"
    for path, page in sorted(pages().items()):
        text = (ROOT / path).read_text("utf-8")
        first = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", text.split("\n\n")[1].replace("\n", " "))
        yield f"* [`{Path(path).parent.as_posix()}`]({page}): {first}"


def _pictures(text: str, path: str) -> list[str]:
    """Return the pictures of a README as paths in the repository, which are also their paths on the site."""
    return [_target(path, match[2]) for match in _PICTURE.finditer(text)]


def _target(path: str, link: str) -> str:
    return posixpath.normpath(posixpath.join(posixpath.dirname(path), link))


def relinked(text: str, path: str, page: str) -> str:
    """Point the links of a file of the repository at the site; a link to a file without a page becomes its path."""
    written = [file.relative_to(ROOT / "docs").as_posix() for file in (ROOT / "docs").rglob("*.md")]
    listed = {f"{kind}/README.md": "packages.md" for kind in ("plugins", "skills", "harnesses")}
    known = {**pages(), **listed, **{f"docs/{file}": file for file in written}}

    def link(match: re.Match[str]) -> str:
        target = _target(path, match[2])
        goal = known.get(target)
        if goal is None:
            return f"{match[1]} (`{target}`)" if target not in match[1] else match[1]
        return f"[{match[1]}]({posixpath.relpath(goal, posixpath.dirname(page) or '.')}{match[3] or ''})"

    return _LINK.sub(link, text)


def _shown(text: str, path: str, page: str) -> str:
    """Point the pictures of a README at the site."""

    def picture(match: re.Match[str]) -> str:
        shown = posixpath.relpath(_target(path, match[2]), posixpath.dirname(page) or ".")
        return f"![{match[1]}]({shown})"

    return _PICTURE.sub(picture, text)


# -- replays -----------------------------------------------------------------------------------------------------------
def gallery(markdown: str) -> str:
    """Make each picture of an episode lead to its replay."""
    played = {spec.target_category: spec.id for spec in load_split(REPLAYED)}
    return _REPLAY.sub(
        lambda match: f'<a href="replays/{played[match[3]]}/page.html"><img src="{match[2]}" alt="{match[1]}"></a>',
        markdown,
    )


def on_post_build(config: Any) -> None:
    """Play the episodes of the gallery, so that its replays are never older than the code."""
    run = ["bench", "run", "--split", REPLAYED, "--agent", "seeing", "--yes", "--out", f"{config.site_dir}/replays"]
    subprocess.run([sys.executable, "-m", "humanclaw", *run], check=True, stdout=subprocess.DEVNULL)


# -- docstrings --------------------------------------------------------------------------------------------------------
def documented(markdown: str) -> str:
    """Put the docstrings of a name in the place of its link to the source, which readers of the clone follow."""
    return _SOURCE.sub(lambda match: f"::: {match[1]}" + (_HOOKS if match[1].endswith("hookspecs") else ""), markdown)


# -- checks ------------------------------------------------------------------------------------------------------------
def checks() -> str:
    """Return the table of the checks of a skill, as Markdown."""
    rows = (f"| `{name}` | {says} |" for name, says in CHECKS.items())
    return "\n".join(["| check | what holds for a skill that passes it |", "| --- | --- |", *rows])


# -- commands ----------------------------------------------------------------------------------------------------------
def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Point links into the repository at the site, and replace the marks of some pages with what the code says."""
    name = page.file.src_path
    if (ROOT / "docs" / name).is_file():  # Other pages are READMEs, whose links are.
        markdown = relinked(documented(markdown), f"docs/{name}", name)
    if name == "index.md":
        return gallery(markdown)
    if name == "commands.md":
        return markdown.replace("<!-- commands -->", "\n".join(commands()))
    if name == "check.md":
        return markdown.replace("<!-- checks -->", checks())
    return markdown


def commands() -> Iterator[str]:
    """Yield every installed command with every option, as Markdown."""
    root = build(Plugins.discover)
    for words, command in walk(root, ("humanclaw",)):
        context = click.Context(command, info_name=" ".join(words))
        yield f"\n## `{' '.join(words)}`\n\n{command.help or ''}\n"
        if command.context_settings.get("ignore_unknown_options"):
            yield from _forwarded(command)
            continue
        usage = command.collect_usage_pieces(context)
        yield f"```text\n{' '.join([*words, *usage])}\n```\n"
        options = [option.get_help_record(context) for option in command.get_params(context)]
        rows = [f"| `{_cell(record[0])}` | {_cell(record[1])} |" for record in options if record]
        yield "\n".join(["| option | |", "| --- | --- |", *rows]) + "\n"


def _forwarded(command: click.Command) -> Iterator[str]:
    """Yield the help text of a command whose options another module parses, and of its subcommands."""
    text = _help(command)
    yield f"```text\n{text}\n```\n"
    subcommands = re.search(r"\{([a-z,]+)\} \.\.\.", text)
    for name in subcommands[1].split(",") if subcommands else ():
        yield f"```text\n{_help(command, name)}\n```\n"


def _help(command: click.Command, *words: str) -> str:
    done = CliRunner(env={"COLUMNS": "110"}).invoke(command, [*words, "--help"])
    return done.output.strip() if done.exit_code == 0 else f"Needs {done.exception}."


def walk(command: click.Command, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Yield every command below a group that is no group itself, with the words that call it."""
    if not isinstance(command, click.Group):
        yield words, command
        return
    if command.invoke_without_command:
        yield words, command
    context = click.Context(command, info_name=words[-1])
    for name in command.list_commands(context):
        subcommand = command.get_command(context, name)
        if subcommand is not None and not subcommand.hidden:
            yield from walk(subcommand.load() if isinstance(subcommand, LazyCommand) else subcommand, (*words, name))


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ").replace("<", "&lt;")
