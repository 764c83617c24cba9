"""A task of one's own (@task): its function decides success, in tables, rows, `verify` and replays."""

import contextlib
import csv
import io
import json
import shutil
from functools import partial
from unittest.mock import MagicMock

import numpy as np
import pytest
import toy_world
from click.testing import CliRunner

from humanclaw import EpisodeSpec, HumanclawError, Plugins, load_run
from humanclaw.testing import check_target
from humanclaw_bench import task
from humanclaw_bench.cli import bench
from humanclaw_bench.overview import overview
from humanclaw_bench.splits import load_split

pytestmark = pytest.mark.integration

FILE = """
from humanclaw import EpisodeSpec, hookimpl
from humanclaw_bench import task


@task(
    EpisodeSpec(id="near", instruction="Walk a bit.", scene="toy:0", max_steps=4),
    EpisodeSpec(id="late", instruction="Walk on.", scene="toy:1", max_steps=3),
)
def stopped_ahead(episode):
    \"\"\"Stop over 80 cm from the start.\"\"\"
    first, last = episode.steps[0], episode.steps[-1]
    return BODY


@hookimpl(optionalhook=True)
def humanclaw_splits(register):
    register(stopped_ahead)
"""
AHEAD = 'last.status == "stopped" and abs(last.end[2] - first.start[2]) > 0.8'
TOYS = ("--plugin", toy_world.FILE, "--simulator", "toy", "--renderer", "toy", "--generator", "toy")


def call(*words):
    done = CliRunner(env={"COLUMNS": "200"}).invoke(bench, list(map(str, words)))
    assert done.exit_code == 0, done.output
    return done.output


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(FILE.replace("BODY", AHEAD))
    return path


@pytest.fixture
def run(file, tmp_path):
    """Return the folder of a run in which `near` stops with its fourth call, 90 cm ahead, and `late` never stops."""
    out = tmp_path / "run"
    words = ("--split", "stopped_ahead", "--plugin", file, *TOYS, "--agent", "walker", "--out", out, "--in-process")
    assert "solved" in call("run", *words)
    return out


def test_the_function_decides_who_succeeds_and_says_why_not(run, file):
    table = json.loads(call("table", run, "--json", "--plugin", file))["tasks"]
    assert table["rows"][0]["solved"]["value"] == 0.5
    assert "1 not met: Stop over 80 cm from the start." in table["notes"][0]
    assert "No target in 2 episodes: success is the function's alone." in table["notes"][0]
    call("rescore", run, "--plugin", file)
    lines = {line["episode"]: line for line in map(json.loads, (run / "scores.jsonl").read_text().splitlines())}
    assert [lines[name]["success"] for name in ("near", "late")] == [True, False]
    assert lines["late"]["cause"] == "not met: Stop over 80 cm from the start."
    assert "cause" not in lines["near"]


def test_a_plugin_may_be_a_folder_whose_caches_do_not_count(file, tmp_path):
    folder = tmp_path / "project" / "humanclaw_mine"
    folder.mkdir(parents=True)
    shutil.copy(file, folder / "__init__.py")
    digests = []
    for number in range(3):
        out = tmp_path / f"run-{number}"
        words = ("--split", "stopped_ahead", "--plugin", folder.parent, *TOYS, "--agent", "walker", "--out", out)
        call("run", *words, "--in-process")
        digests.append(json.loads((out / "run.json").read_text())["plugin files"]["humanclaw_mine"])
        (folder / "__pycache__").mkdir(exist_ok=True)
        (folder / "__pycache__" / f"{number}.pyc").write_bytes(b"")
        if number == 1:
            (folder / "more.py").write_text("")
    assert digests[0] == digests[1] != digests[2]


def test_a_run_of_an_own_task_is_verified_and_replayed(run):
    output = call("verify", run, "--replay", "--plugin", toy_world.FILE)
    assert "2 of 2 episodes came out the same" in output


def test_two_runs_are_compared_by_the_function(run, file, tmp_path):
    shutil.copytree(run, tmp_path / "again")
    rows = json.loads(call("compare", run, tmp_path / "again", "--json", "--plugin", file))["metrics"]
    assert [(row["a"], row["b"]) for row in rows if row["metric"] == "solved"] == [(0.5, 0.5)]


def test_a_run_is_exported_with_its_successes(run, file):
    call("export", run, "--to", "csv", "--plugin", file)
    lines = csv.DictReader((run / "episodes.csv").open())
    assert {line["episode"]: line["success"] for line in lines} == {"near": "True", "late": "False"}


def test_a_line_of_a_file_may_name_the_function(file, tmp_path):
    line = {"id": "a", "instruction": "Walk.", "scene": "toy:0", "max_steps": 4, "success": "stopped_ahead"}
    (tmp_path / "mine.jsonl").write_text(json.dumps(line) + "\n")
    words = ("--agent", "walker", "--out", tmp_path / "run", "--in-process")
    call("run", "--split", tmp_path / "mine.jsonl", "--plugin", file, *TOYS, *words)
    assert "100.0%" in call("table", tmp_path / "run", "--only", "tasks", "--plugin", file)


def test_a_run_without_the_function_is_refused_before_it_begins(tmp_path):
    line = {"id": "a", "instruction": "Walk.", "scene": "toy:0", "success": "stopped_ahead"}
    (tmp_path / "mine.jsonl").write_text(json.dumps(line) + "\n")
    words = ["run", "--split", tmp_path / "mine.jsonl", *TOYS, "--agent", "walker", "--out", tmp_path / "run"]
    refused = CliRunner().invoke(bench, list(map(str, words))).exception
    assert "success of episode 'a' is decided by 'stopped_ahead', which no plugin here brings" in str(refused)
    assert not (tmp_path / "run").exists()


def test_without_the_function_nothing_is_scored_and_it_is_asked_for(run, caplog):
    assert json.loads(call("table", run, "--json"))["tasks"]["rows"][0]["solved"]["value"] is None
    assert "success of episode 'late' is decided by 'stopped_ahead', which no plugin here brings" in caplog.text
    assert "--plugin FILE" in caplog.text


def test_a_split_is_found_by_the_name_of_its_function(file):
    specs = load_split("stopped_ahead", Plugins.discover([file]))
    assert [(spec.id, spec.success) for spec in specs] == [("near", "stopped_ahead"), ("late", "stopped_ahead")]
    with pytest.raises(HumanclawError, match=r"Name one of .* a task of --plugin FILE, or a file"):
        load_split("stopped_ahead")


def test_a_task_is_still_the_function_that_it_decorates():
    @task(EpisodeSpec(id="a", instruction="b", scene="c"))
    def short(episode):
        """Take few steps."""
        return len(episode) < 3

    assert [short([1]), short([1, 2, 3])] == [True, False]
    assert (short.name, short.description) == ("short", "Take few steps.")


LACKS = "AttributeError: {!r} object has no attribute {!r}; did you mean {}?"


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("5.2", "TypeError: stopped_ahead returned 5.2; return True or False."),
        ("None", "TypeError: stopped_ahead returned None; return True or False."),
        (
            "episode.outcome",
            "AttributeError: 'RecordedEpisode' object has no attribute 'outcome'; did you mean record.outcome? "
            "(FILE, line 13).",
        ),
        (
            "last.statis",
            "AttributeError: 'StepRecord' object has no attribute 'statis'; did you mean status? (FILE, line 13).",
        ),
        ('{}["x"]', "KeyError: 'x' (FILE, line 13)."),
    ],
)
def test_a_function_that_gives_no_answer_is_named_and_not_scored(run, file, body, reason, caplog):
    file.write_text(FILE.replace("BODY", body))
    assert json.loads(call("table", run, "--json", "--plugin", file))["tasks"]["rows"][0]["solved"]["value"] is None
    start = "success function of task 'stopped_ahead' of plugin 'mine' failed on episode near: "
    assert start + reason.replace("FILE", str(file)) + " Mend it, then score the run again." in caplog.text


CHANGED = "{} differs from the plugin file that {} was played with: success is judged anew."


@pytest.mark.parametrize("words", [("table",), ("rescore",), ("export", "--to", "csv")])
def test_a_function_changed_since_the_run_is_told(run, file, words, caplog):
    call(*words, run, "--plugin", file)
    assert "differs" not in caplog.text
    file.write_text(FILE.replace("BODY", "True"))
    call(*words, run, "--plugin", file)
    assert CHANGED.format(file, run) in caplog.text


def test_a_page_judges_each_episode_once(run, file, caplog):
    file.write_text(FILE.replace("BODY", "print(episode.record.spec.id) or True"))
    judged = io.StringIO()
    with contextlib.redirect_stdout(judged):
        overview({run: load_run(run)}, MagicMock(), Plugins.discover([file]))
    assert judged.getvalue().split() == ["late", "near"]
    assert caplog.text.count(CHANGED.format(file, run)) == 1


@pytest.mark.parametrize("yes", [True, np.True_])
def test_true_of_python_and_of_numpy_is_a_success(yes):
    def agreed(episode):
        return yes

    assert task()(agreed)([]) is True


@pytest.mark.parametrize(
    ("body", "fault"), [(AHEAD, None), ("last.nothing", "nothing"), ("5.2", "returned 5.2; return True or False")]
)
def test_check_uses_the_function_of_a_task_once(file, body, fault):
    file.write_text(FILE.replace("BODY", body))
    messages = [fault.message for report in check_target(str(file), Plugins.discover()) for fault in report.faults]
    assert (messages == []) if fault is None else (fault in messages[0])


def test_a_function_that_never_returns_ends_the_table(run, file, monkeypatch):
    monkeypatch.setattr("humanclaw_bench.scoring._SECONDS", 0.3)
    file.write_text(FILE.replace("return BODY", "import time; time.sleep(3)"))
    refused = CliRunner().invoke(bench, ["table", str(run), "--plugin", str(file)]).exception
    assert "task 'stopped_ahead' of plugin 'mine' failed on episode" in str(refused)
    reason = f"it did not return within 0.3 s ({file}, line 13). Mend it, then score the run again."
    assert reason in str(refused)


@pytest.mark.parametrize(
    ("given", "fault"), [("Walk.", "takes EpisodeSpecs; got 'Walk.'"), (lambda episode: True, "stands without parenth")]
)
def test_a_task_of_anything_but_episodes_is_refused(given, fault):
    with pytest.raises(HumanclawError, match=rf"@task {fault}.*Write @task\(EpisodeSpec"):
        task(given)


@pytest.mark.parametrize("nameless", [lambda episode: True, partial(max, default=True), 5])
def test_a_success_function_without_a_name_is_refused(nameless):
    with pytest.raises(HumanclawError, match=r"has a name, by which --split finds it; got .*Write def NAME\("):
        task()(nameless)


def test_an_async_success_function_is_refused():
    async def late(episode):
        return True

    with pytest.raises(HumanclawError, match=r"not awaited; late is async\. Write def late\(episode"):
        task()(late)


@pytest.mark.parametrize("arguments", ["", "self, episode"])
def test_a_function_that_takes_not_one_argument_is_refused(file, arguments):
    file.write_text(FILE.replace("ahead(episode)", f"ahead({arguments})"))
    with pytest.raises(
        HumanclawError, match=r"mine.py, line 6: .* takes one argument, the episode; stopped_ahead"
    ) as no:
        Plugins.discover([file])
    assert no.value.remedy == "Write def stopped_ahead(episode: RecordedEpisode) -> bool."


def test_two_tasks_of_one_name_in_a_file_are_refused_with_their_lines(file):
    start, hook, end = FILE.replace("BODY", "True").partition("@hookimpl")
    more = "first = stopped_ahead\n@task()\ndef stopped_ahead(episode): ...\n"
    file.write_text(start + more + hook + end + "    register(first)\n")
    with pytest.raises(HumanclawError, match=r"two splits named 'stopped_ahead': .* line 17\) and .* line 6\)"):
        Plugins.discover([file])


def test_a_task_named_like_a_shipped_split_is_refused(file):
    file.write_text(FILE.replace("BODY", "True").replace("stopped_ahead", "smoke"))
    with pytest.raises(HumanclawError, match="has the name of the split smoke"):
        load_split("smoke", Plugins.discover([file]))


def test_a_run_of_an_own_task_is_submitted_and_ranked(run, file):
    alone = CliRunner().invoke(bench, ["submit", str(run), "--who", "A"])
    assert "Give its file: --plugin FILE." in str(alone.exception)
    assert not (run / "submission.json").exists()
    call("submit", run, "--who", "A", "--plugin", file)
    call("leaderboard", run.parent, "--any-pace", "--plugin", file)
    page = (run.parent / "index.html").read_text()
    assert "cannot be scored" not in page
    assert "<th scope='col'>agent</th><th scope='col'>solved</th>" in page
    assert "</th><td>50.0% [" in page
    assert "<caption>stopped_ahead, not one of the benchmark&#39;s: 2 episodes" in page


def test_a_run_of_tasks_that_nothing_decides_says_so(tmp_path):
    line = {"id": "a", "instruction": "Jump up and down.", "scene": "toy:0", "max_steps": 2}
    (tmp_path / "mine.jsonl").write_text(json.dumps(line) + "\n")
    words = ("--agent", "walker", "--out", tmp_path / "run", "--in-process")
    assert "Not scored: no episode has a target." in call("run", "--split", tmp_path / "mine.jsonl", *TOYS, *words)
