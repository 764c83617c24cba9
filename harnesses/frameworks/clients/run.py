"""Drive a body with agent frameworks by `body.tools`: python harnesses/frameworks/clients/run.py [NAME ...]

Each framework runs in its own environment, which falls back to the packages of this one. The check reads the requests
to a scripted model. Needs PyPI; no key, no other network.
"""

from __future__ import annotations

import sys
from pathlib import Path

import click

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "tests" / "support"))
from clients import environment, line, mark, metadata, ran, script, version  # noqa: E402

import model_servers  # noqa: E402  # isort: skip

CLIENTS = sorted(path.stem.removesuffix("_client") for path in HERE.glob("*_client.py"))
WORDS = ("Executed walk(x_cm=0, z_cm=40, yaw_deg=0).", "Executed turn_in_place(yaw_deg=30).", "Executed stop().")
HEAD = ("body.tools", "tried with", "calls executed", "text reaches the model", "pictures reach the model", "")


def trial(name: str) -> tuple[str, ...]:
    """Return a row of the table."""
    path = HERE / f"{name}_client.py"
    needs = metadata(path)
    python = environment("frameworks", name, needs["dependencies"], beside=True)
    server = getattr(model_servers, needs.get("dialect", "OpenAIServer"))
    with server(script()) as model:
        said, fault = ran([python, str(path)], {"MODEL_URL": model.url})
        # All requests together: Anthropic's client sends only new messages.
        seen = tuple(model.requests)
    told = all(any(words in request.text for request in seen) for words in WORDS)
    pictures = len({picture.tobytes() for request in seen for picture in request.images})
    executed = "Done. 3 steps" in said
    return name, version(needs["dependencies"][0]), mark(executed), mark(told), str(pictures), fault


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(CLIENTS))
def main(names: tuple[str, ...]) -> None:
    """Try the named frameworks, or all. Exits with 1 if the body does not execute a framework's calls."""
    print(line(HEAD), line(["---"] * len(HEAD)), sep="\n", flush=True)
    rows = []
    for name in names or CLIENTS:
        rows.append(trial(name))
        print(line(rows[-1]), flush=True)
    sys.exit(any(row[2] == "no" or row[3] == "no" for row in rows))


if __name__ == "__main__":
    main()
