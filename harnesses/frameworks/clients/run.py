"""Drive a body with existing clients: python harnesses/frameworks/clients/run.py [NAME ...]

A client has the tools of a body in its own process (body.tools), or those of `humanclaw mcp` over HTTP or standard
streams. Each runs in an environment of its own, which falls back to the packages of this one. The checks read the
server's record and the requests to a scripted model. Needs PyPI, and npx for the Inspector; no key, no other network.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import click

from humanclaw import load_run

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "tests" / "support"))
from clients import CALLS, TASK, environment, line, mark, metadata, ran, script, serving, version  # noqa: E402

import model_servers  # noqa: E402  # isort: skip

CLIENTS = sorted(path.stem.removesuffix("_client") for path in HERE.glob("*_client.py"))
SERVER = ("-m", "humanclaw", "mcp", "--instruction", TASK, "--out")
WORDS = ("Executed walk(x_cm=0, z_cm=40, yaw_deg=0).", "Executed turn_in_place(yaw_deg=30).", "Executed stop().")
HEAD = ("client", "tried with", "way", "calls executed", "text reaches the model", "pictures reach the model", "")


def trial(name: str, way: str, folder: Path) -> tuple[str, ...]:
    """Return a row of the table."""
    path = HERE / f"{name}_client.py"
    needs = metadata(path)
    python = environment(name, needs["dependencies"])
    with getattr(model_servers, needs.get("dialect", "OpenAIServer"))(script()) as model:
        said, fault = attempt([python, str(path)], way, model.url, folder)
        # All requests together: Anthropic's client sends only new messages.
        seen = tuple(model.requests)
    done = "Done. 3 steps" in said if way == "body.tools" else executed(folder, "npm" in needs)
    read = all(any(words in request.text for request in seen) for words in WORDS)
    pictures = len({picture.tobytes() for request in seen for picture in request.images})
    reached = ("-", "-") if "npm" in needs else (mark(read), str(pictures))
    tried = version((needs["dependencies"] or needs["npm"][-1:])[0])
    return name, tried, way, mark(done), *reached, fault


def attempt(command: Sequence[str], way: str, model: str, folder: Path) -> tuple[str, str]:
    """Run a client. Return what it prints, and its error; empty on success."""
    if way == "body.tools":
        return ran(command, {"MODEL_URL": model})
    if way == "stdio":
        return ran([*command, sys.executable, *SERVER, str(folder)], {"MODEL_URL": model})
    with serving(*SERVER, str(folder)) as url:
        return ran(command, {"MODEL_URL": model, "MCP_URL": url})


def executed(folder: Path, agentless: bool) -> bool:
    """Whether the body executed the script: in one episode, or in one for each call without an agent."""
    episodes = load_run(folder) if folder.exists() else []  # By name, which begins with the time.
    steps = [[(step.call.skill, step.call.params) for step in episode.steps if step.call] for episode in episodes]
    return [step for episode in steps for step in episode] == [*CALLS] if agentless else [*CALLS] in steps


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(CLIENTS))
def main(names: tuple[str, ...]) -> None:
    """Try the named clients, or all. Exits with 1 if the body does not execute a client's calls."""
    rows = []
    print(line(HEAD), line(["---"] * len(HEAD)), sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name in names or CLIENTS:
            for way in metadata(HERE / f"{name}_client.py")["ways"]:
                rows.append(trial(name, way, Path(scratch) / f"{name}-{way}"))
                print(line(rows[-1]), flush=True)
    sys.exit(any(fault or "no" in (done, read) for *_, done, read, _, fault in rows))


if __name__ == "__main__":
    main()
