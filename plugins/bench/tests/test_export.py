"""Exported runs contain the numbers of the records."""

import csv
import json
import math
import sys
import types

import numpy as np
import pytest
from click.testing import CliRunner
from made import record_episode
from rollouts import rollout, step

import humanclaw_bench as benchmark
from humanclaw import Plugins, RecordedEpisode, RecordError, load_run
from humanclaw.cli import build
from humanclaw_bench.export import load, rows, to_csv, to_inspect, to_lerobot
from humanclaw_bench.scoring import metrics_of
from humanclaw_bench.worker import mark

METRIC = """
from humanclaw import hookimpl

@hookimpl
def humanclaw_metrics(register):
    register("turning", turning, "radians turned")

def turning(episode):
    return sum(abs(step.yaw_end - step.yaw_start) for step in episode.steps)
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Two episodes of the oracle in the test room, and one that a provider broke."""
    folder = tmp_path_factory.mktemp("export") / "run"
    for name in ("couch-0", "couch-1", "couch-2"):
        record_episode(folder / name, name=name)
    mark(folder / "couch-2", "infra_error", "503")
    return folder


def command(*args):
    return CliRunner().invoke(build(Plugins.discover), ["bench", *map(str, args)])


def test_a_csv_holds_every_episode_with_its_numbers(run, tmp_path):
    table = list(csv.DictReader(to_csv(run, tmp_path / "episodes.csv").open()))
    assert [line["episode"] for line in table] == ["couch-0", "couch-1", "couch-2"]
    assert (table[0]["interact"], table[2]["outcome"]) == ("True", "infra_error")
    assert float(table[0]["steps"]) == len(load_run(run)[0].steps)


def test_a_dataset_is_not_written_into_a_folder_that_is_there(run, tmp_path, monkeypatch):
    lerobot = types.SimpleNamespace(LeRobotDataset=None)
    monkeypatch.setitem(sys.modules, "lerobot.datasets.lerobot_dataset", lerobot)
    with pytest.raises(RecordError, match="already exists"):
        to_lerobot(run, tmp_path)


def test_the_export_command_says_where_it_wrote(run, tmp_path):
    result = command("export", run, "--to", "csv", "--out", tmp_path / "x.csv")
    assert result.exit_code == 0
    assert (tmp_path / "x.csv").exists()
    assert str(tmp_path / "x.csv") in result.output


def test_a_metric_of_a_plugin_is_in_rows_scores_and_tables(run, tmp_path):
    plugin = tmp_path / "turning.py"
    plugin.write_text(METRIC)
    plugins = Plugins.discover([plugin])
    assert "turning" in metrics_of(plugins)
    expected = [sum(abs(s.yaw_end - s.yaw_start) for s in episode.steps) for episode in load_run(run)]
    assert [line["turning"] for line in rows(run, plugins)] == pytest.approx(expected)
    result = command("rescore", run, "--out", tmp_path / "scores.jsonl", "--plugin", plugin)
    assert result.exit_code == 0
    assert json.loads((tmp_path / "scores.jsonl").read_text().splitlines()[0])["turning"] == pytest.approx(expected[0])
    table = json.loads(command("table", run, "--only", "plugins", "--json", "--plugin", plugin).output)["plugins"]
    value = table["rows"][0]["turning"]["value"]
    assert value == pytest.approx(np.mean(expected[:2]))  # the broken episode is in no number


def test_a_run_is_a_data_frame_with_one_call(run):
    pytest.importorskip("pandas", reason="pandas is not installed")
    frame = benchmark.load(run)
    assert list(frame.index) == ["couch-0", "couch-1", "couch-2"]
    assert frame.loc["couch-0", "success"]
    assert list(~frame["nav"]) == [not line["nav"] for line in rows(run)]
    assert math.isclose(frame["distance"].iloc[0], rows(run)[0]["distance"])
    assert load(str(run)).shape == frame.shape


def test_an_inspect_log_reads_back_as_the_episodes(run, tmp_path):
    log = pytest.importorskip("inspect_ai.log", reason="inspect_ai is not installed")
    logged = log.read_eval_log(str(to_inspect(run, tmp_path / "run.eval")))
    assert logged.eval.model == "oracle"
    assert [sample.id for sample in logged.samples] == ["couch-0", "couch-1", "couch-2"]
    sample, recorded = logged.samples[0], load_run(run)[0]
    calls = [message.tool_calls[0] for message in sample.messages if message.role == "assistant"]
    assert [call.function for call in calls] == [step.decision.calls[0].skill for step in recorded.steps]
    assert sample.scores["interact"].value == "C"
    assert logged.samples[2].error.message == "503"
    views = [message.metadata["view"] for message in sample.messages if message.role == "assistant"]
    assert views == [str(recorded.folder / step.frame_file) for step in recorded.steps]
    assert {score.name: score.metrics["accuracy"].value for score in logged.results.scores}["nav"] == 1.0


def test_a_lerobot_dataset_reads_back_as_the_decisions(run, tmp_path):
    lerobot = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="lerobot is not installed")
    out = to_lerobot(run, tmp_path / "dataset")
    dataset = lerobot.LeRobotDataset("humanclaw/run", root=out)
    recorded = load_run(run)[0]
    assert (dataset.num_episodes, dataset.fps) == (2, 2)  # the broken episode is left out
    assert dataset.num_frames == 2 * len(recorded.steps)
    first, last = dataset[0], dataset[len(recorded.steps) - 1]
    assert first["task"] == recorded.record.spec.instruction
    assert np.allclose(first["observation.state"][:3], recorded.motion().root[4], atol=1e-6)
    names = dataset.meta.features["action"]["names"]
    assert last["action"][names.index("stop")] == 1.0
    assert (bool(first["next.done"]), bool(last["next.done"]), bool(last["next.success"])) == (False, True, True)
    assert first["observation.images.ego"].shape == (3, 256, 256)
    with pytest.raises(RecordError, match=r"already exists"):
        to_lerobot(run, out)


class FakeDataset:
    """Takes the place of LeRobotDataset: keeps its features and frames."""

    def __init__(self, features):
        self.features, self.frames = features, []

    def add_frame(self, frame):
        self.frames.append(frame)

    def save_episode(self):
        pass

    finalize = save_episode


def test_a_text_and_each_entry_of_a_list_have_columns(tmp_path, monkeypatch):
    made = []

    def create(features, **_):
        made.append(FakeDataset(features))
        return made[0]

    fake = types.SimpleNamespace(LeRobotDataset=types.SimpleNamespace(create=create))
    monkeypatch.setitem(sys.modules, "lerobot.datasets.lerobot_dataset", fake)
    monkeypatch.setattr(RecordedEpisode, "picture", lambda self, step: np.zeros((4, 4, 3), np.uint8))
    steps = [step("wave", params={"hand": hand, "times": 2, "at": [3, 4.5]}) for hand in ("left", "right")]
    rollout(tmp_path / "run", [*steps, step("stop")])
    to_lerobot(tmp_path / "run", tmp_path / "dataset")
    names = made[0].features["action"]["names"]
    assert names[-5:] == ["wave.at.0", "wave.at.1", "wave.hand=left", "wave.hand=right", "wave.times"]
    actions = [frame["action"][-5:].tolist() for frame in made[0].frames]
    assert actions == [[3, 4.5, 1, 0, 2], [3, 4.5, 0, 1, 2], [0, 0, 0, 0, 0]]
