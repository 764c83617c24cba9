"""Play 20 decisions with a language model on this machine in each way of asking, and count the usable calls.

python tests/evidence/local_models.py smollm2 gemma3 /path/to/another.gguf     # the weights: examples/local_llm.py
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import count
from pathlib import Path

from humanclaw import Attempt, Body, Episode, HumanclawError, Plugins, StepRecord
from humanclaw.records import free_episode

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
from local_llm import WEIGHTS, served

DECISIONS = 20
MODES = ("tools", "tools_auto", "schema", "prompt")
OPTIONS = {"images": 0, "history": 2, "max_tokens": 150, "temperature": 0.8, "timeout": 900, "num_retries": 0}
HEAD = ("model", "mode", "usable calls", "refused", "tokens in", "tokens out", "s to decide")


def reason(attempt: Attempt) -> str:
    """Return the kind of a refusal."""
    if json.loads(attempt.decision.raw)["finish_reason"] == "length":
        return "cut off"
    kinds = {"held no": "no call", "among other words": "no call", " calls": "several calls", "": "wrong parameters"}
    return next(kind for words, kind in kinds.items() if words in attempt.error)


def played(body: Body, name: str, url: str, mode: str) -> Iterator[StepRecord]:
    """Yield DECISIONS steps of one decision each, in as many episodes as it takes."""
    options = {"model": f"openai/{name}", "api_base": url, "mode": mode, "params": {"seed": 0}, **OPTIONS}
    agent, left = body.plugins.make("agents", "litellm", options), DECISIONS
    for number in count():
        spec = free_episode("find a couch and sit on it", body.scene, max_steps=left, name=f"{mode}-{number}")
        with Episode(body, spec, agent, attempts=1) as episode:
            while not episode.done:
                episode.ask()
        yield from episode.steps
        left -= len(episode.steps)
        if not left:
            return


def row(body: Body, name: str, url: str, mode: str) -> tuple[str, ...]:
    began = time.monotonic()
    try:
        steps = list(played(body, name, url, mode))
    except HumanclawError as error:
        return name, mode, "0", str(error), "", "", f"{time.monotonic() - began:.0f}"
    attempts = [attempt for step in steps for attempt in step.attempts]
    refused = Counter(reason(attempt) for attempt in attempts if attempt.error)
    reasons = ", ".join(f"{number} {kind}" for kind, number in refused.most_common()) or "none"
    tokens = [str(sum(getattr(step.usage, part) for step in steps)) for part in ("tokens_in", "tokens_out")]
    seconds = sum(step.seconds.get("decide", 0.0) for step in steps)
    return name, mode, str(sum(not attempt.error for attempt in attempts)), reasons, *tokens, f"{seconds:.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", default=[*WEIGHTS], help="names of examples/local_llm.py, or GGUF files")
    parser.add_argument("--modes", nargs="*", default=MODES)
    asked = parser.parse_args()
    for line in (HEAD, ["---"] * len(HEAD)):
        print(f"| {' | '.join(line)} |")
    with Body("house:0", plugins=Plugins.discover()) as body:
        for model in asked.models:
            path = WEIGHTS[model]() if model in WEIGHTS else Path(model)
            with served(path, threads=1) as url:
                for mode in asked.modes:
                    print(f"| {' | '.join(row(body, path.stem, url, mode))} |", flush=True)


if __name__ == "__main__":
    main()
