"""Drive a body with agent frameworks by `body.tools`: python harnesses/frameworks/clients/run.py [NAME ...]

Each framework is one small file with its tested version. It runs in its own environment, which falls back to the
packages of this one, and asks a scripted model on 127.0.0.1 that calls walk, turn_in_place and stop. The check reads
the model's requests. Needs PyPI; no key, no other network.
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
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click
import platformdirs

HERE = Path(__file__).parent
# No package contains the scripted model: it is a test helper of humanclaw-litellm.
sys.path.insert(0, str(HERE.parents[1] / "litellm" / "tests"))
import model_servers  # noqa: E402
from model_servers import Reply, Request, calls, text  # noqa: E402

CLIENTS = sorted(path.stem.removesuffix("_client") for path in HERE.glob("*_client.py"))
TASK = "Walk forward, turn to the left, and stop."
CALLS = (("walk", {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}), ("turn_in_place", {"yaw_deg": 30}), ("stop", {}))
WORDS = ("Executed walk(x_cm=0, z_cm=40, yaw_deg=0).", "Executed turn_in_place(yaw_deg=30).", "Executed stop().")
TIMEOUT = 300
HEAD = ("body.tools", "tried with", "calls executed", "text reaches the model", "pictures reach the model", "")


def script() -> Callable[[Request], Reply]:
    """Return a script of three calls and the framework's kind of end: text, or a tool of its own."""
    wanted, numbers = iter(CALLS), itertools.count()

    def reply(request: Request) -> Reply:
        for call in wanted:
            return _numbered(calls(call), next(numbers))
        end = "final_answer" in request.tool_names
        return _numbered(calls(("final_answer", {"answer": "Done."})), next(numbers)) if end else text("Done.")

    return reply


def _numbered(reply: Reply, number: int) -> Reply:
    """Return the reply with a unique call id, as providers send."""
    reply.body["choices"][0]["message"]["tool_calls"][0]["id"] = f"call_{number}"
    return reply


def trial(name: str) -> tuple[str, ...]:
    """Return a row of the table."""
    path = HERE / f"{name}_client.py"
    needs = metadata(path)
    python = environment(name, needs["dependencies"])
    server = getattr(model_servers, needs.get("dialect", "OpenAIServer"))
    with server(script()) as model:
        env = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        env |= {"TASK": TASK, "MODEL_URL": model.url}
        done = subprocess.run([python, path], env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        # All requests together: Anthropic's client sends only new messages.
        seen = tuple(model.requests)
    if done.returncode:
        print(done.stderr[-3000:], file=sys.stderr)
    fault = (done.stderr.strip().splitlines() or ["failed"])[-1][:120] if done.returncode else ""
    executed = "Done. 3 steps" in done.stdout
    told = all(any(words in request.text for request in seen) for words in WORDS)
    pictures = len({picture.tobytes() for request in seen for picture in request.images})
    version = re.sub(r"\[.*?\]", "", needs["dependencies"][0]).replace("==", " ")
    return name, version, _mark(executed), _mark(told), str(pictures), fault


def _mark(true: bool) -> str:
    return "yes" if true else "no"


def metadata(path: Path) -> dict[str, Any]:
    """Read the inline metadata of a script."""
    block = re.search(r"(?m)^# /// script\n((?:# .*\n)+)# ///$", path.read_text("utf-8"))
    assert block, f"{path} has no inline metadata"
    return tomllib.loads(re.sub(r"(?m)^# ", "", block[1]))


def environment(name: str, needs: Sequence[str]) -> str:
    """Return the Python of a cached environment with these packages, then those of this environment."""
    folder = Path(platformdirs.user_cache_dir("humanclaw")) / "frameworks" / name
    python, mark = folder / "bin" / "python", folder / "packages.json"
    ours = sysconfig.get_path("purelib")
    if not mark.exists() or json.loads(mark.read_text()) != [ours, *needs]:
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--only-binary=:all:", *needs], check=True)
        theirs = subprocess.run(
            [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        (Path(theirs) / "zz_humanclaw.pth").write_text(f"import site; site.addsitedir({ours!r})\n")
        mark.write_text(json.dumps([ours, *needs]))
    return str(python)


def line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


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
