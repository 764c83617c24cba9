"""Completion of names in a shell: of what is installed, and of what the files named by --plugin register."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import click
from click.shell_completion import BashComplete, CompletionItem, ZshComplete, add_completion_class, split_arg_string

Complete = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def names_of(kind: str) -> Complete:
    """Return what completes the name of a registered item, such as one of the `agents`.

    Of `scenes`, it completes the source and its colon, then the names that the source's factory tells.
    """

    def complete(context: click.Context, parameter: click.Parameter, begun: str) -> list[CompletionItem]:
        before, comma, last = begun.rpartition(",") if kind == "skills" else ("", "", begun)
        found: list[CompletionItem] = []
        with suppress(Exception):  # Completion never fails: a broken file has no names.
            files = tuple(map(Path, context.params.get("files") or ()))
            found += (CompletionItem(before + comma + name, help=told) for name, told in _names(kind, last, files))
        return [item for item in found if item.value.startswith(begun)]

    return complete


def names_or_files(kind: str) -> Complete:
    """Return what completes the name of a registered item, or a file."""
    names = names_of(kind)
    return lambda context, parameter, begun: [*names(context, parameter, begun), CompletionItem(begun, "file")]


def _names(kind: str, begun: str, files: tuple[Path, ...]) -> Iterator[tuple[str, str]]:
    """Yield names and descriptions of the registered items of a kind."""
    from humanclaw.plugins.host import Plugins

    source, colon, _ = begun.partition(":") if kind == "scenes" else ("", "", "")
    for one in Plugins.discover(files).registered(kind):
        if not colon:
            yield one.name + ":" * (kind == "scenes"), one.description
        elif one.name == source and hasattr(one.value, "names"):
            yield from ((f"{source}:{name}", "") for name in one.value.names())


@add_completion_class
class Bash(BashComplete):
    """Bash, which ends a word at a colon ($COMP_WORDBREAKS): the whole line is read here, and values begin after the
    colon there. No space follows a name that goes on."""

    source_template = """\
%(complete_func)s() {
    local IFS=$'\\n' line="${COMP_LINE:0:COMP_POINT}" type value
    while IFS=, read -r type value; do
        [[ $line == *:"$2" ]] && value=${value#*:}
        case $type in
            dir) compopt -o dirnames ;;
            file) compopt -o default -o filenames; COMPREPLY+=($(compgen -f -- "$value")) ;;
            *) COMPREPLY+=("$value"); [[ $value == *[:-] ]] && compopt -o nospace ;;
        esac
    done < <(COMP_WORDS="$line" %(complete_var)s=bash_complete "$1")
}
complete -o nosort -F %(complete_func)s %(prog_name)s
"""

    def get_completion_args(self) -> tuple[list[str], str]:
        _, *words, begun = split_arg_string(os.environ["COMP_WORDS"] + ".")
        return words, begun[:-1]


@add_completion_class
class Zsh(ZshComplete):
    """zsh, likewise without a space after a name that goes on."""

    source_template = (
        ZshComplete.source_template.replace("local -a response", "local -a response joining")
        .replace('"plain" ]]; then', '"plain" ]]; then\n            [[ $key == *[:-] ]] && joining=(-S "")')
        .replace("_descriptions -U", '_descriptions -U "${joining[@]}"')
        .replace("compadd -U", 'compadd -U "${joining[@]}"')
    )
