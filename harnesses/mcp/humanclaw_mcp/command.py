"""`humanclaw mcp`."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import click

from humanclaw import Choice, HumanclawError
from humanclaw.cli import check_options, engine_options, parse_pairs, plugin_options, scene_option, seed_option


@click.command("mcp")
@click.option("--http", is_flag=True, help="Serve streamable HTTP on 127.0.0.1 instead of the standard streams.")
@click.option("--port", type=click.IntRange(0, 65535), default=8000, show_default=True, help="Port for --http.")
@click.option("--auth-env", default="", metavar="NAME", help="Variable with a token that HTTP requests must carry.")
@scene_option("scenes", multiple=True, default=("house:0",), about="Scene that clients may choose. Repeatable.")
@click.option("--instruction", help="The task, if the client gives none.")
@seed_option(help="Seed of all random draws.")
@click.option(
    "--max-steps", type=click.IntRange(1, 10_000), default=100, show_default=True, help="Most steps of an episode."
)
@click.option("--bodies", type=click.IntRange(1), default=4, show_default=True, help="Most bodies at one time.")
@click.option("--idle", type=click.FloatRange(1), default=900, show_default=True, help="Seconds to keep an idle body.")
@click.option("--reasoning/--no-reasoning", default=False, help="Also ask what is seen and why, as in the benchmark.")
@click.option("--verifier", default="", help="Verifier by name: it checks each call before the body moves.")
@click.option("--option", "pairs", multiple=True, metavar="KEY=VALUE", help="Option of the verifier. Repeatable.")
@click.option("--profile", type=click.Choice(["default", "paper"]), default="default", show_default=True)
@engine_options
@click.option("--sensor", "sensors", metavar="NAME", multiple=True, help="Sensor besides the view. Repeatable.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder for records; without it none are kept.")
@plugin_options
def command(
    http: bool, port: int, files: tuple[Path, ...], choice: Choice, pairs: tuple[str, ...], **options: Any
) -> None:
    """Serve the skills to agents over the Model Context Protocol."""
    import anyio

    from humanclaw import Plugins
    from humanclaw_mcp.bodies import Bodies
    from humanclaw_mcp.handlers import Handlers
    from humanclaw_mcp.serve import serve_http, serve_stdio
    from humanclaw_mcp.settings import Settings

    # The name of a session gives access to its body, and the protocol library logs names below this level.
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    if options["auth_env"] and not http:
        raise HumanclawError("--auth-env protects HTTP only; over standard streams there is one client.", "Add --http.")
    given = {key: value for key, value in options.items() if value is not None}
    settings, plugins = Settings(**given, options=parse_pairs(pairs)), Plugins.discover(files, choice)
    # A wrong name or option is told now, not to the first client.
    plugins.require(*(("scenes", reference.partition(":")[0]) for reference in settings.scenes))
    if settings.verifier:
        verifier = plugins.make("verifiers", settings.verifier, settings.options)
        check_options(settings.options, settings.verifier, None, verifier)
    handlers = Handlers(Bodies(settings, plugins))
    try:
        if http:
            anyio.run(serve_http, handlers, port, lambda url: click.echo(f"Listening on {url}", err=True))
        else:
            anyio.run(serve_stdio, handlers)
    except KeyboardInterrupt:
        click.echo("Stopped.", err=True)
