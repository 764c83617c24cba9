"""Let agent frameworks drive a body by `body.tools`: python harnesses/frameworks/clients/run.py [NAME ...]

Each framework is one small file with the version it was tried with. It runs in an environment of its own, which sees
the packages of this one behind its own, and asks a scripted model on 127.0.0.1 that calls walk, turn_in_place and stop.
What counts is what the model got: the requests. Needs PyPI; no key, no other network.
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
# The scripted model is a helper of the tests beside it, and no part of any package.
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
    """Three calls, then the end, in the way that the framework knows: with words, or with a tool of its own."""
    wanted, numbers = iter(CALLS), itertools.count()

    def reply(request: Request) -> Reply:
        for call in wanted:
            return _numbered(calls(call), next(numbers))
        end = "final_answer" in request.tool_names
        return _numbered(calls(("final_answer", {"answer": "Done."})), next(numbers)) if end else text("Done.")

    return reply


def _numbered(reply: Reply, number: int) -> Reply:
    """Return the reply with a name of its own for its call, as providers give them."""
    reply.body["choices"][0]["message"]["tool_calls"][0]["id"] = f"call_{number}"
    return reply


def trial(name: str) -> tuple[str, ...]:
    """One row of the table."""
    path = HERE / f"{name}_client.py"
    needs = metadata(path)
    python = environment(name, needs["dependencies"])
    server = getattr(model_servers, needs.get("dialect", "OpenAIServer"))
    with server(script()) as model:
        env = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        env |= {"TASK": TASK, "MODEL_URL": model.url}
        done = subprocess.run([python, path], env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        # All requests together: Anthropic's client sends what is new alone.
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
    assert block, f"{path} says no versions"
    return tomllib.loads(re.sub(r"(?m)^# ", "", block[1]))


def environment(name: str, needs: Sequence[str]) -> str:
    """Make an environment with these packages and, behind them, those of this one; return its Python."""
    folder = Path(platformdirs.user_cache_dir("humanclaw")) / "frameworks" / name
    python, mark = folder / "bin" / "python", folder / "packages.json"
    ours = sysconfig.get_path("purelib")
    if not mark.exists() or json.loads(mark.read_text()) != [ours, *needs]:
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--only-binary=:all:", *needs], check=True)
        theirs = subprocess.run(
            [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
            capture_output=True, text=True, check=True,
        ).stdout.strip()  # fmt: skip
        (Path(theirs) / "zz_humanclaw.pth").write_text(f"import site; site.addsitedir({ours!r})\n")
        mark.write_text(json.dumps([ours, *needs]))
    return str(python)


def line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


@click.command()
@click.argument("names", nargs=-1, type=click.Choice(CLIENTS))
def main(names: tuple[str, ...]) -> None:
    """Try the named frameworks, or all. Exits with 1 if one does not make the body do what the model called for."""
    print(line(HEAD), line(["---"] * len(HEAD)), sep="\n", flush=True)
    rows = []
    for name in names or CLIENTS:
        rows.append(trial(name))
        print(line(rows[-1]), flush=True)
    sys.exit(any(row[2] == "no" or row[3] == "no" for row in rows))


if __name__ == "__main__":
    main()
