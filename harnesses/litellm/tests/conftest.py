"""Fixtures: a scripted model behind a real HTTP server, real skills, and a view."""

from __future__ import annotations

import dataclasses
import importlib

import numpy as np
import pytest
from model_servers import OpenAIServer, warm_up

import humanclaw_litellm
from humanclaw import EpisodeContext, EpisodeSpec, Observation, Plugins
from humanclaw.records import Feedback
from humanclaw_litellm import client

GOAL = "Find the couch and sit on it."


@pytest.fixture(autouse=True)
def no_keys(monkeypatch, tmp_path):
    """Use no key, no file .env and no rate limit of the person who runs the tests, and nothing of the test before."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(client, "_LEARNED", {})
    for name in (
        "OPENAI_API_KEY",
        "ANTHROPIC_API_KEY",
        "GEMINI_API_KEY",
        "GOOGLE_API_KEY",
        "OPENAI_BASE_URL",
        "OPENAI_API_BASE",
    ):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def plugins():
    host = Plugins()
    for name in ("walk", "step_back", "turn", "sit", "stop"):
        host.add(importlib.import_module(f"humanclaw_skill_{name}"), name)
    host.add(humanclaw_litellm, "litellm")
    return host


@pytest.fixture(scope="session")
def skills(plugins):
    """Return the skills, marked as trained; no test here runs the motion model."""
    return {name: dataclasses.replace(skill, adapter=None) for name, skill in plugins.skills.items()}


@pytest.fixture
def context(skills):
    return EpisodeContext(EpisodeSpec(id="one", instruction=GOAL, scene="house:0"), skills, seed=0)


@pytest.fixture
def begin(context):
    """begin(server, **options): return an agent or verifier that has begun an episode. Tests share no cache."""
    warm_up()
    host = Plugins()
    host.add(humanclaw_litellm, "litellm")

    def make(server: OpenAIServer, kind: str = "agents", about: EpisodeContext = context, **options):
        given = {"model": "openai/anything", "api_base": server.url, "backoff": 0.01, "timeout": 60}
        part = host.make(kind, "litellm", given | options)
        part.begin(about)
        return part

    return make


@pytest.fixture
def view():
    """view(step): return a view of smooth colours, different in each step."""
    ramp = np.linspace(0, 200, 512).astype(np.uint8)

    def observe(step: int = 0, feedback: Feedback | str = "") -> Observation:
        rgb = np.stack(np.broadcast_arrays(ramp[:, None], ramp[None, :], np.uint8(20 * step)), axis=-1)
        felt = feedback if isinstance(feedback, Feedback) else Feedback(refusal=feedback)
        return Observation(step, GOAL, np.ascontiguousarray(rgb), felt)

    return observe
