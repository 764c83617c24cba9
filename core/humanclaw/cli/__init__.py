"""The command line, and helpers that it shares with the commands of plugins."""

from typing import TYPE_CHECKING

from humanclaw.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from humanclaw.cli.group import Commands as Commands, LazyCommand as LazyCommand, build as build, main as main
    from humanclaw.cli.options import (
        ChosenAgents as ChosenAgents,
        advice_after as advice_after,
        agent_options as agent_options,
        check_options as check_options,
        engine_options as engine_options,
        parse_pairs as parse_pairs,
        plugin_files as plugin_files,
        plugin_options as plugin_options,
        scene_option as scene_option,
        seed_option as seed_option,
    )
    from humanclaw.cli.serving import (
        BACKLOG as BACKLOG,
        CONNECTIONS as CONNECTIONS,
        HOST as HOST,
        Handler as Handler,
        Server as Server,
        listening as listening,
    )
    from humanclaw.cli.tables import show_markdown as show_markdown
    from humanclaw.cli.terminal import Console as Console
    from humanclaw.text.words import counted as counted, legible as legible

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy_exports(__name__)
