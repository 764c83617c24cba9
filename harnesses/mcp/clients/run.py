"""Drive the body with existing MCP clients: python harnesses/mcp/clients/run.py [NAME ...]

Each client is one small file with its tested versions. It runs in its own environment, over HTTP and over standard
streams, and asks a scripted model on 127.0.0.1 that calls walk, turn_in_place and stop. The check reads the server's
record and the model's requests. Needs PyPI, and npx for the Inspector; no key, no other network.
"""

from __future__ import annotations

import copy
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import platformdirs

from humanclaw import load_run

HERE = Path(__file__).parent
# No package contains the scripted model: it is a test helper of humanclaw-litellm.
sys.path.insert(0, str(HERE.parents[1] / "litellm" / "tests"))
from model_servers import OpenAIServer, Reply, Request, call, text  # noqa: E402

CLIENTS = {
    "MCP Inspector (CLI)": "inspector",
    "mcp (official Python)": "official",
    "openai-agents": "openai_agents",
    "langchain-mcp-adapters": "langchain_adapters",
    "pydantic-ai": "pydantic_ai_agent",
    "smolagents": "smolagents_agent",
    "fastmcp": "fastmcp_client",
}
TASK = "Walk forward, turn to the left, and stop."
WANTED = [("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}), ("turn_in_place", {"yaw_deg": 30}), ("stop", {})]
COMMAND = (sys.executable, "-m", "humanclaw", "mcp", "--instruction", TASK, "--out")
TIMEOUT = 300
"""Seconds for one client, with four model requests and three half seconds of motion."""


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
        marks = {True: "yes", False: "no"}
        pictures = str(self.pictures) if self.pictures >= 0 else "-"
        words = marks[self.words] if self.pictures >= 0 else "-"
        return self.client, self.versions, self.transport, marks[self.called], words, pictures, self.fault or ""


def script() -> Callable[[Request], Reply]:
    """Return a script of three calls and the client's kind of end: text, or a tool of its own."""
    # All parameters are given: smolagents refuses a call without its optional ones.
    calls = iter([call("walk", x_cm=0, z_cm=40, yaw_deg=0), call("turn_in_place", yaw_deg=30), call("stop")])
    numbers = itertools.count()

    def reply(request: Request) -> Reply:
        end = call("final_answer", answer="Done.") if "final_answer" in request.tool_names else text("Done.")
        return numbered(next(calls, end), next(numbers))

    return reply


def numbered(reply: Reply, number: int) -> Reply:
    """Return the reply with a unique call id, as providers send and some clients require."""
    body = copy.deepcopy(reply.body)
    for wanted in body["choices"][0]["message"].get("tool_calls", ()):
        wanted["id"] = f"call_{number}"
    return replace(reply, body=body)


# -- one client --------------------------------------------------------------------------------------------------------
def trial(name: str, transport: str, folder: Path) -> Row:
    path = HERE / f"{CLIENTS[name]}.py"
    needs = requirements(path)
    versions = ", ".join(re.sub(r"\[.*?\]", "", need).replace("==", " ") for need in needs["dependencies"][:1])
    python = environment(path.stem, needs["dependencies"])
    with OpenAIServer(script()) as model:
        fault = attempt([python, str(path)], transport, model.url, folder)
        seen = tuple(model.requests)
    agentless = "npm" in needs
    versions = versions or needs["npm"][-1].rpartition("@")[2]
    told = any("Executed walk" in request.text for request in seen)
    pictures = -1 if agentless else max((len(request.images) for request in seen), default=0)
    return Row(name, versions, transport, executed(folder, agentless), told, pictures, fault)


def attempt(command: Sequence[str], transport: str, model: str, folder: Path) -> str:
    """Run a client. Return the error, empty on success."""
    env = os.environ | {"TASK": TASK, "MODEL_URL": model}
    if transport == "stdio":
        return _run([*command, *COMMAND, str(folder)], env)
    with http_server(folder) as url:
        return _run(command, env | {"MCP_URL": url})


def _run(command: Sequence[str], env: dict[str, str]) -> str:
    clean = {key: value for key, value in env.items() if key != "PYTHONPATH"}
    done = subprocess.run(command, env=clean, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    if done.returncode:
        print(done.stderr[-3000:], file=sys.stderr)
    return "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["failed"])[-1][:120]


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
    return [step for episode in steps for step in episode] == WANTED if agentless else WANTED in steps


# -- environments ------------------------------------------------------------------------------------------------------
def requirements(path: Path) -> dict[str, Any]:
    """Return the inline metadata of a script."""
    block = re.search(r"(?m)^# /// script\n((?:# .*\n)+)# ///$", path.read_text())
    assert block, f"{path} has no inline metadata"
    return tomllib.loads(re.sub(r"(?m)^# ", "", block[1]))


def environment(name: str, needs: Sequence[str]) -> str:
    """Return the Python of a cached environment with exactly these packages and their dependencies."""
    folder = Path(platformdirs.user_cache_dir("humanclaw")) / "mcp-clients" / name
    python, mark = folder / "bin" / "python", folder / "packages.json"
    if not mark.exists() or json.loads(mark.read_text()) != list(needs):
        venv.create(folder, with_pip=bool(needs), clear=True)
        if needs:
            subprocess.run([python, "-m", "pip", "install", "--quiet", *needs], check=True)
        mark.write_text(json.dumps(list(needs)))
    return str(python)


# -- the table ---------------------------------------------------------------------------------------------------------
HEAD = ("client", "version", "transport", "calls executed", "text reaches the model", "pictures reach the model", "")


def line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


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
