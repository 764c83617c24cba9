"""`humanclaw bench reproduce`: the paper's tables for models of several providers, over HTTP."""

import json
import re
from contextlib import ExitStack

import pytest
from click.testing import CliRunner
from model_servers import AnthropicServer, GeminiServer, OllamaServer, OpenAIServer, call, refusing, text

from humanclaw import Plugins, RecordedEpisode
from humanclaw.cli import build
from humanclaw.records import read_episodes, write_episodes
from humanclaw_bench.reproduce import PAPER_SETTINGS
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

    def reproduce(models, *more):
        (tmp_path / "models.toml").write_text(models)
        words = ["bench", "reproduce", "paper", "--models", "models.toml", "--out", "paper", *more]
        return CliRunner().invoke(build(Plugins.discover), words)

    return reproduce


def split_of(count, path, steps=1):
    write_episodes(path, [spec.model_copy(update={"max_steps": steps}) for spec in load_split("smoke")[:count]])


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
        assert re.search(rf"^\| {name} \+ litellm[^|]* \|", page, re.MULTILINE)  # The verifier asks the same model.


def test_time_and_cost_are_estimated_first_and_asked_once(reproduce, tmp_path):
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
    assert re.search(r"^\| mine \|", page, re.MULTILINE)
    assert "openai/scripted" not in page
    assert re.search(r"^\| history 0 \|", page, re.MULTILINE)
    assert (tmp_path / "paper/paper.md").read_text() == page


def test_a_model_that_refuses_the_papers_temperature_plays_without(reproduce, tmp_path):
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


def ablation_of(server, settings, more=""):
    return 'split = "one.jsonl"\nablation_split = "one.jsonl"' + row(
        "openai/scripted", server, f"ablation = {settings}\n{more}"
    )


def test_the_ablation_plays_ten_settings_and_stands_beside_the_paper(reproduce, tmp_path):
    split_of(1, tmp_path / "one.jsonl")
    with OpenAIServer([call("walk", **STEP)] * 40) as server:
        done = reproduce(ablation_of(server, "true"))
        asked = len(server.requests)
    assert done.exit_code == 0, done.output
    assert asked == 21, "table 2 asks agent and verifier; the verifier is asked in nine of the ten settings too"
    table = (tmp_path / "paper/paper.md").read_text().partition("**Ablation of openai-scripted**")[2]
    rows = [line.split(" | ")[0].strip("| ") for line in table.splitlines() if line.startswith("| ")][2:]
    own = [name for name in rows if not name.endswith("\u2020")]
    assert own == [name.removesuffix(" \u2020") for name in rows[10:]] == list(PAPER_SETTINGS)
    assert table.count("1 episode.") == table.count(", profile paper, ") == 10
    (spec,) = read_episodes(tmp_path / "one.jsonl")
    agents = {
        folder.name: RecordedEpisode(folder / spec.id).record.settings["agent"]
        for folder in (tmp_path / "paper/openai-scripted").iterdir()
    }
    assert (agents["history-50"]["history"], agents["images-5"]["images"]) == (50, 5)
    assert (agents["baseline"]["history"], agents["baseline"]["images"]) == (10, 1)
    assert not agents["without-mid-level"]["mid_level"]


def test_an_ablation_plays_the_settings_that_are_named(reproduce, tmp_path):
    split_of(1, tmp_path / "one.jsonl", steps=2)
    with OpenAIServer([call("walk", **STEP, note_to_self="the hall is empty")] * 20) as server:
        done = reproduce(ablation_of(server, ["without verifier", "memory notes", "memory map"]))
        asked = [json.dumps(request.body) for request in server.requests if request.tool_names != ["verdict"]]
    assert done.exit_code == 0, done.output
    assert [("the hall is empty" in body, "where you have been" in body) for body in asked[2:]] == [
        (False, False), (False, False), (False, False), (True, False), (False, False), (True, True),
    ]  # fmt: skip


def test_a_setting_that_meets_its_limit_keeps_its_row(reproduce, tmp_path):
    split_of(2, tmp_path / "one.jsonl")
    with OpenAIServer([call("walk", **STEP)] * 12) as server:
        settings = ["without verifier", "history 0"]
        done = reproduce(ablation_of(server, settings, 'limits = { "run.tokens" = 1 }'), "--yes")
    assert done.exit_code == 0, done.output
    page = (tmp_path / "paper/paper.md").read_text()
    assert all(re.search(rf"^\| {setting} \|", page, re.MULTILINE) for setting in settings)
    assert done.stderr.count("stopped: ") == 3


def test_a_model_can_be_named_without_a_file_and_not_beside_one(reproduce):
    assert "Name a file with --models, or models with --model." in reproduce("", "--model", "openai/scripted").output


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
