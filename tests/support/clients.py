"""What the trials of clients and frameworks share: a scripted model, an environment for each client, a table.

A client is one small file with its tested versions in inline metadata. It asks a model on 127.0.0.1 that calls walk,
turn_in_place and stop.
"""

from __future__ import annotations

import itertools
import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import platformdirs
from model_servers import Reply, Request, calls, text

TASK = "Walk forward, turn to the left, and stop."
# All parameters are given: smolagents refuses a call without its optional ones.
CALLS = (("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}), ("turn_in_place", {"yaw_deg": 30}), ("stop", {}))
TIMEOUT = 300
"""Seconds for one client, with four model requests and three half seconds of motion."""


def script() -> Callable[[Request], Reply]:
    """Return a script of three calls and the client's kind of end: text, or a tool of its own."""
    wanted, numbers = iter(CALLS), itertools.count()

    def reply(request: Request) -> Reply:
        for call in wanted:
            return _numbered(calls(call), next(numbers))
        end = "final_answer" in request.tool_names
        return _numbered(calls(("final_answer", {"answer": "Done."})), next(numbers)) if end else text("Done.")

    return reply


def _numbered(reply: Reply, number: int) -> Reply:
    """Return the reply with a unique call id, as providers send and some clients require."""
    reply.body["choices"][0]["message"]["tool_calls"][0]["id"] = f"call_{number}"
    return reply


def ran(command: Sequence[str], env: Mapping[str, str]) -> tuple[str, str]:
    """Run a client. Return what it prints, and its error; empty on success."""
    clean = {key: value for key, value in {**os.environ, "TASK": TASK, **env}.items() if key != "PYTHONPATH"}
    done = subprocess.run(command, env=clean, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    if not done.returncode:
        return done.stdout, ""
    print(done.stderr[-3000:], file=sys.stderr)
    return done.stdout, (done.stderr.strip().splitlines() or ["failed"])[-1][:120]


def metadata(path: Path) -> dict[str, Any]:
    """Read the inline metadata of a script."""
    block = re.search(r"(?m)^# /// script\n((?:# .*\n)+)# ///$", path.read_text("utf-8"))
    assert block, f"{path} has no inline metadata"
    return tomllib.loads(re.sub(r"(?m)^# ", "", block[1]))


def version(need: str) -> str:
    """Return a requirement as words: `mcp==2.3.0` is mcp 2.3.0."""
    return re.sub(r"\[.*?\]", "", need).replace("==", " ")


def environment(name: str, needs: Sequence[str]) -> str:
    """Return the Python of a cached environment with these packages, and then those of this one."""
    folder = Path(platformdirs.user_cache_dir("humanclaw")) / "clients" / name
    python, mark = folder / "bin" / "python", folder / "packages.json"
    ours = sysconfig.get_path("purelib")
    if not mark.exists() or json.loads(mark.read_text()) != [*needs, ours]:
        venv.create(folder, with_pip=bool(needs), clear=True)
        if needs:
            subprocess.run([python, "-m", "pip", "install", "--quiet", "--only-binary=:all:", *needs], check=True)
        (theirs,) = folder.glob("lib/python*/site-packages")
        (theirs / "zz_humanclaw.pth").write_text(f"import site; site.addsitedir({ours!r})\n")
        mark.write_text(json.dumps([*needs, ours]))
    return str(python)


@contextmanager
def serving(*arguments: str) -> Iterator[str]:
    """Run `python ARGUMENTS --http` on a free port; yield the address that it prints."""
    command = [sys.executable, *arguments, "--http", "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr
        try:
            yield next(match[0] for line in server.stderr if (match := re.search(r"http://\S+", line)))
        finally:
            server.terminate()


def line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def mark(true: bool) -> str:
    return "yes" if true else "no"
