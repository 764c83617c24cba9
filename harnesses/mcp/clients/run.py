"""Drive the body with existing MCP clients: python harnesses/mcp/clients/run.py [NAME ...]

Each client runs in its own environment, over HTTP and over standard streams. The check reads the server's record and
the requests to a scripted model. Needs PyPI, and npx for the Inspector; no key, no other network.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import click

from humanclaw import load_run

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[2] / "tests" / "support"))
from clients import CALLS, TASK, environment, line, mark, metadata, ran, script, version  # noqa: E402

from model_servers import OpenAIServer  # noqa: E402  # isort: skip

CLIENTS = {
    "MCP Inspector (CLI)": "inspector",
    "mcp (official Python)": "official",
    "openai-agents": "openai_agents",
    "langchain-mcp-adapters": "langchain_adapters",
    "pydantic-ai": "pydantic_ai_agent",
    "smolagents": "smolagents_agent",
    "fastmcp": "fastmcp_client",
}
COMMAND = (sys.executable, "-m", "humanclaw", "mcp", "--instruction", TASK, "--out")
HEAD = ("client", "version", "transport", "calls executed", "text reaches the model", "pictures reach the model", "")


@dataclass(frozen=True)
class Row:
    """Result of one client over one transport."""

    client: str
    versions: str
    transport: str
    called: bool
    """Whether the record holds the script's calls as executed."""
    words: bool
    """Whether the model got the text of its results."""
    pictures: int
    """Most views in one model request; -1 for a client without a model."""
    fault: str = ""

    def cells(self) -> tuple[str, ...]:
        pictures = str(self.pictures) if self.pictures >= 0 else "-"
        words = mark(self.words) if self.pictures >= 0 else "-"
        return self.client, self.versions, self.transport, mark(self.called), words, pictures, self.fault


def trial(name: str, transport: str, folder: Path) -> Row:
    path = HERE / f"{CLIENTS[name]}.py"
    needs = metadata(path)
    python = environment("mcp-clients", path.stem, needs["dependencies"])
    with OpenAIServer(script()) as model:
        fault = attempt([python, str(path)], transport, model.url, folder)
        seen = tuple(model.requests)
    agentless = "npm" in needs
    versions = needs["npm"][-1].rpartition("@")[2] if agentless else version(needs["dependencies"][0])
    told = any("Executed walk" in request.text for request in seen)
    pictures = -1 if agentless else max((len(request.images) for request in seen), default=0)
    return Row(name, versions, transport, executed(folder, agentless), told, pictures, fault)


def attempt(command: Sequence[str], transport: str, model: str, folder: Path) -> str:
    """Run a client. Return the error, empty on success."""
    if transport == "stdio":
        return ran([*command, *COMMAND, str(folder)], {"MODEL_URL": model})[1]
    with http_server(folder) as url:
        return ran(command, {"MODEL_URL": model, "MCP_URL": url})[1]


@contextmanager
def http_server(folder: Path) -> Iterator[str]:
    command = [*COMMAND, str(folder), "--http", "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr
        try:
            yield next(found[0] for line in server.stderr if (found := re.search(r"http://\S+", line)))
        finally:
            server.terminate()


def executed(folder: Path, agentless: bool) -> bool:
    """Whether the body executed the script: in one episode, or in one for each call without an agent."""
    episodes = sorted(load_run(folder), key=lambda episode: episode.folder.stat().st_mtime) if folder.exists() else []
    steps = [[(step.call.skill, step.call.params) for step in episode.steps if step.call] for episode in episodes]
    return [step for episode in steps for step in episode] == [*CALLS] if agentless else [*CALLS] in steps


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(list(CLIENTS)))
def main(names: tuple[str, ...]) -> None:
    """Try the named clients, or all. Exits with 1 if the body does not execute a client's calls."""
    rows = []
    print(line(HEAD), line(["---"] * len(HEAD)), sep="\n", flush=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name in names or CLIENTS:
            for transport in ("HTTP", "stdio"):
                rows.append(trial(name, transport, Path(scratch) / f"{CLIENTS[name]}-{transport}"))
                print(line(rows[-1].cells()), flush=True)
    sys.exit(any(row.fault or not row.called for row in rows))


if __name__ == "__main__":
    main()
