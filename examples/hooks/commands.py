"""A command that greets.

If a command's module is slow to import, add humanclaw.cli.LazyCommand("hello", "my_package.module:hello", "Greet.").
"""

import click

from humanclaw import hookimpl


@hookimpl
def humanclaw_commands(cli: click.Group) -> None:
    cli.add_command(hello)


@click.command("hello")
@click.option("--name", default="body", show_default=True, help="Whom to greet.")
def hello(name: str) -> None:
    """Greet somebody."""
    click.echo(f"Hello, {name}.")
