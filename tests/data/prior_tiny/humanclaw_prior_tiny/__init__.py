"""A second motion prior, and a skill whose adapter was trained against it."""

from pathlib import Path

from humanclaw import hookimpl

HERE = Path(__file__).parent


@hookimpl
def humanclaw_priors(register):
    register("tiny", HERE / "base.safetensors", "0.1 M parameters, trained for a minute")


@hookimpl
def humanclaw_skills(register):
    register(HERE / "stroll")
