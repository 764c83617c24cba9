"""`humanclaw bench reproduce`: the paper's tables for models of several providers, over HTTP."""

import re
from contextlib import ExitStack

import pytest
from click.testing import CliRunner
from model_servers import AnthropicServer, GeminiServer, OllamaServer, OpenAIServer, call, refusing, text

from humanclaw import Plugins
from humanclaw.cli import build
from humanclaw.records import write_episodes
from humanclaw_bench.splits import load_split

pytestmark = pytest.mark.integration

PROVIDERS = {
    "openai/scripted": OpenAIServer,
    "anthropic/claude-sonnet-4-5": AnthropicServer,
    "gemini/gemini-2.5-pro": GeminiServer,
    "ollama_chat/scripted": OllamaServer,
    "hosted_vllm/scripted": OpenAIServer,
}
STEP = {"visible_state": "A hall, no couch.", "progress": "Nothing yet.", "reasoning": "The way is free.", "z_cm": 40}
YES = {f"check_{k}_{part}": said for k in (1, 2) for part, said in (("evidence", "Free floor."), ("answer", "yes"))}


@pytest.fixture
def reproduce(tmp_path, monkeypatch, one_process):
    monkeypatch.chdir(tmp_path)
    for provider in ("OPENAI", "ANTHROPIC", "GEMINI"):
        monkeypatch.setenv(f"{provider}_API_KEY", "sk-planted-0123456789-abcdef")

    def reproduce(models):
        (tmp_path / "models.toml").write_text(models)
        words = ["bench", "reproduce", "paper", "--models", "models.toml", "--out", "paper"]
        return CliRunner().invoke(build(Plugins.discover), words)

    return reproduce


def split_of(count, path):
    write_episodes(path, [spec.model_copy(update={"max_steps": 1}) for spec in load_split("smoke")[:count]])


def row(model, server, more=""):
    return f"""
[[models]]
model = "{model}"
options = {{ api_base = "{server.url}", backoff = 0.01 }}
{more}"""


def test_one_file_of_models_of_five_providers_becomes_one_page(reproduce, tmp_path):
    split_of(1, tmp_path / "one.jsonl")
    with ExitStack() as stack:
        script = [call("walk", **STEP), call("verdict", **YES)]
        servers = {name: stack.enter_context(kind(script)) for name, kind in PROVIDERS.items()}
        done = reproduce('split = "one.jsonl"' + "".join(row(*pair) for pair in servers.items()))
        asked = [len(server.requests) for server in servers.values()]
    assert done.exit_code == 0, done.output
    assert asked == [2] * 5
    page = (tmp_path / "paper/paper.md").read_text()
    for name in PROVIDERS:
        assert re.search(rf"^\| [^|]*{name}[^|]* \|", page, re.MULTILINE)


def test_time_and_cost_are_estimated_first_and_a_second_call_asks_nothing_again(reproduce, tmp_path):
    split_of(5, tmp_path / "five.jsonl")
    split_of(1, tmp_path / "one.jsonl")
    with OpenAIServer([call("walk", **STEP), call("verdict", **YES)] * 7) as server:
        more = 'name = "mine"\nusd_per_million = [10, 50]\nablation = ["baseline", "history 0"]'
        models = 'split = "five.jsonl"\nablation_split = "one.jsonl"' + row("openai/scripted", server, more)
        first, asked = reproduce(models), len(server.requests)
        page = (tmp_path / "paper/paper.md").read_text()
        second = reproduce(models)
    assert (first.exit_code, second.exit_code) == (0, 0), first.output
    # A request has 1,000 tokens in and 100 out: 1.5 cents, 3 cents a step with its verdict.
    assert re.search(r"mine: Estimate for the remaining 4 episodes: 0:\d\d:\d\d and \$0\.12 \(", first.output)
    assert (asked, len(server.requests)) == (14, 14)
    assert "Ablation of mine" in page
    assert re.search(r"^\| history 0 \|", page, re.MULTILINE)
    assert (tmp_path / "paper/paper.md").read_text() == page


def test_a_model_that_refuses_the_papers_temperature_is_played_without_it(reproduce, tmp_path):
    split_of(2, tmp_path / "two.jsonl")
    with OpenAIServer(refusing("temperature", [call("walk", **STEP), call("verdict", **YES)] * 2)) as server:
        done = reproduce('split = "two.jsonl"' + row("openai/scripted", server))
        sent = ["temperature" in request.body for request in server.requests]
    assert done.exit_code == 0, done.output
    assert sent == [True, False, False, False, False]  # Refused once a run, by agent and verifier together.
    assert "Asked without temperature, which the model refuses." in (tmp_path / "paper/paper.md").read_text()


def test_a_model_that_only_talks_is_left_after_ten_answers(reproduce, tmp_path):
    write_episodes(tmp_path / "five.jsonl", load_split("smoke"))
    with OpenAIServer(lambda request: text("I walk on.")) as server:
        done = reproduce('split = "five.jsonl"' + row("openai/scripted", server))
        asked = len(server.requests)
    assert done.exit_code == 1
    assert asked == 10
    assert "10 answers in a row held no usable call" in done.output


@pytest.mark.parametrize(
    ("models", "said"),
    [
        ("", "models: Field required"),
        ('[[models]]\nmodel = "a/b"\nprice = 3', "models.0.price: Extra inputs are not permitted"),
        ('[[models]]\nmodel = "a/b"\n[[models]]\nmodel = "a-b"', "names two models alike"),
        ('[[models]]\nmodel = "a/b"\nablation = ["histry 0"]', "'histry 0' is none of baseline, history 0"),
        ("models = [", "cannot be read"),
    ],
)
def test_a_file_of_models_with_a_mistake_is_refused_with_its_place(reproduce, models, said):
    done = reproduce(models)
    assert done.exit_code == 2
    assert said in done.output
