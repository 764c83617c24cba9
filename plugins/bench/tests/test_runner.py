"""Runs continue after any end, play nothing twice, and give the same results with any number of workers."""

import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import rooms
import toy_world
from click.testing import CliRunner
from filelock import FileLock
from here import Here

from humanclaw import Backends, Choice, HumanclawError, PluginError, Plugins, RecordedEpisode, RecordError, load_run
from humanclaw.cli import Console
from humanclaw.records import EpisodeRecord, write_record
from humanclaw_bench.attribution import attribute
from humanclaw_bench.cli import bench
from humanclaw_bench.executors import EpisodeQueue, LocalExecutor
from humanclaw_bench.progress import RunProgress, foresight
from humanclaw_bench.runner import RunStatus, run_split
from humanclaw_bench.scores import score
from humanclaw_bench.worker import Job, Worker, WorkerReport, mark, unpack

TOY = Backends("toy", "toy", "toy")
SEED = 643
"""Of runs whose episodes keep their order, up to five."""


@pytest.fixture(scope="module")
def toys():
    return Plugins.discover([Path(toy_world.FILE)])


@pytest.fixture
def play(toys, tmp_path):
    """Run toy episodes; returns the status, the reports and the folder."""

    def run(specs, workers=0, name="run", agent="walker", limits=None, in_process=True, **options):
        job = Job(agent, options, backends=TOY, limits=limits or {}, files=(toy_world.FILE,), in_process=in_process,
                  seed=SEED)  # fmt: skip
        reports = []
        status = run_split(
            specs, job, LocalExecutor(workers) if workers else Here(), tmp_path / name, plugins=toys,
            watch=lambda status, report: reports.append(report) if report else None,
        )  # fmt: skip
        return status, reports, tmp_path / name

    return run


def digests(folder):
    return {episode.record.spec.id: episode.digest for episode in load_run(folder)}


def rewrite(folder, **changes):
    """Change the record of an episode as if it had never ended, or ended otherwise."""
    record = EpisodeRecord.model_validate_json((folder / "episode.json").read_bytes())
    write_record(folder, record.model_copy(update={"files": {}, **changes}))


# -- foreseen ----------------------------------------------------------------------------------------------------------
def test_after_three_episodes_a_no_to_the_estimate_ends_the_run(toys, tmp_path):
    sentences = []

    def no(forecast):
        sentences.append(foresight(forecast))
        return False

    job = Job("walker", {}, backends=TOY, files=(toy_world.FILE,), in_process=True)
    status = run_split(toy_world.specs(6), job, Here(), tmp_path, plugins=toys, go_on=no)
    assert (status.done, status.stopped, len(sentences)) == (3, True, 1)
    assert re.match(r"Estimate for the remaining 3 episodes: 0:00:\d\d ", sentences[0])
    assert run_split(toy_world.specs(6), job, Here(), tmp_path, plugins=toys).done == 6


class Side:
    """An executor of several workers, by a clock of its own: an episode takes ten seconds and a dollar a step."""

    def __init__(self, workers, steps, broken=()):
        self.workers, self.steps, self.broken, self.stopping = workers, steps, broken, False

    def reports(self, job, queue, out):
        taken = [queue.take() for _ in range(self.workers)]
        under_way = [(self.steps[spec.id], spec) for spec in taken if spec]
        while under_way:
            now, spec = under_way.pop(under_way.index(min(under_way, key=lambda pair: pair[0])))
            steps = self.steps[spec.id]
            outcome = "infra_error" if spec.id in self.broken else "stopped"
            yield WorkerReport(spec.id, outcome, steps=steps, seconds=10.0 * steps, cost=float(steps))
            if not self.stopping and (following := queue.take(spec.scene)):
                under_way.append((now + self.steps[following.id], following))

    def stop(self):
        self.stopping = True


@pytest.fixture
def forecasts(toys, tmp_path):
    def run(workers, steps, broken=()):
        """Return what is foreseen in a run of episodes of so many steps."""
        estimates, specs = [], toy_world.specs(len(steps))
        taking = {spec.id: count for spec, count in zip(specs, steps, strict=True)}
        job = Job("walker", {}, backends=TOY, files=(toy_world.FILE,))
        run_split(
            specs, job, Side(workers, taking, [specs[k].id for k in broken]), tmp_path, plugins=toys,
            go_on=lambda forecast: estimates.append(forecast) or True,
        )  # fmt: skip
        return estimates

    return run


@pytest.mark.parametrize("workers", [1, 2, 4, 8])
def test_a_forecast_is_of_three_episodes_drawn_before_any_ends(forecasts, workers):
    (forecast,) = forecasts(workers, range(1, 31))
    alone = forecasts(1, range(1, 31))[0]
    assert forecast.played == 3
    assert forecast.cost_left / forecast.left == pytest.approx(alone.cost_left / alone.left)
    assert forecast.seconds_left == pytest.approx(10 * forecast.cost_left / min(workers, forecast.left + 1))


def test_a_forecast_does_without_an_episode_that_the_machine_broke(forecasts):
    whole = forecasts(1, [7] * 30)[0]
    broken = [forecasts(1, [7] * 30, broken=[k]) for k in range(30)]
    assert {estimates[0].played for estimates in broken} == {2, 3}
    assert {estimates[0].cost_left / estimates[0].left for estimates in broken} == {whole.cost_left / whole.left}


def test_what_has_fewer_than_four_episodes_is_not_foreseen(forecasts):
    assert forecasts(1, range(1, 4)) == []


def after_three(left, seconds, cost=0.0, tokens=0):
    """The status from which so much is foreseen."""
    return RunStatus(left + 3, 3, played=3, playing=3 * seconds / left, cost=3 * cost / left, tokens=tokens)


@pytest.mark.parametrize(
    ("rest", "asked"),
    [({"seconds": 500}, False), ({"seconds": 700}, True), ({"seconds": 9, "cost": 0.1, "tokens": 5}, True)],
)
def test_on_a_terminal_only_a_costly_or_long_rest_is_asked_about(tmp_path, monkeypatch, rest, asked):
    monkeypatch.setattr("click.confirm", lambda *_, **__: False)
    with RunProgress(Console(force_terminal=True, file=io.StringIO()), tmp_path) as progress:
        assert progress.foresee(after_three(2, **rest), ask=True) is not asked


def test_foresight_tells_time_and_money():
    forecast = after_three(96, seconds=4 * 3600.0, cost=48.0)
    assert foresight(forecast) == "Estimate for the remaining 96 episodes: 4:00:00 and $48.00 (from the first 3)."
    assert (
        foresight(after_three(2, seconds=8.2)) == "Estimate for the remaining 2 episodes: 0:00:08 (from the first 3)."
    )


def test_a_price_that_is_not_known_is_said_to_be_so():
    forecast = after_three(96, seconds=600.0, tokens=12_000)
    assert "The cost is unknown: the 12,000 tokens so far have no known price" in foresight(forecast)
    assert "price" not in foresight(after_three(96, seconds=600.0))


# -- who plays ---------------------------------------------------------------------------------------------------------
@pytest.mark.integration
def test_two_workers_leave_the_same_records_as_one_bit_for_bit(play):
    specs = toy_world.specs(6)
    (here, _, none), (alone, _, first), (pair, _, second) = (play(specs, k, str(k), in_process=False) for k in range(3))
    assert (here.done, alone.done, pair.done) == (6, 6, 6)
    assert digests(none) == digests(first) == digests(second)
    assert len(set(digests(first).values())) == 6


def test_a_house_is_given_to_one_worker_as_long_as_there_are_others():
    queue = EpisodeQueue(toy_world.specs(6, houses=3))
    assert [queue.take("").scene for _ in range(3)] == ["toy:0", "toy:1", "toy:2"]
    assert queue.take("toy:1").id == "toy-4"
    assert queue.take("toy:1").scene in ("toy:0", "toy:2")
    assert len(queue) == 1


# -- going on ----------------------------------------------------------------------------------------------------------
def test_a_finished_run_has_nothing_left_to_do(play):
    play(toy_world.specs(2))
    status, reports, _ = play(toy_world.specs(2))
    assert (status.done, status.played, reports) == (2, 0, [])


def test_an_episode_cut_short_goes_on_without_asking_again(play, tmp_path):
    log = tmp_path / "log"
    _, _, whole = play(toy_world.specs(1), name="whole", log=str(log))
    _, _, folder = play(toy_world.specs(1), log=str(log))
    episode = folder / "toy-0"
    lines = (episode / "steps.jsonl").read_text().splitlines(keepends=True)
    (episode / "steps.jsonl").write_text("".join(lines[:2]) + lines[2][:50])
    rewrite(episode, outcome="running", steps=0)
    (episode / "motion.npz").unlink()
    log.write_text("")
    _, (report,), _ = play(toy_world.specs(1), log=str(log))
    assert log.read_text().split() == ["toy-0", "2", "toy-0", "3"]
    assert report.cost == pytest.approx(0.5)  # two answers of 0.25 each
    assert digests(folder) == digests(whole)
    assert (episode / "steps.jsonl").read_text().splitlines(keepends=True)[:2] == lines[:2]


def test_a_record_that_the_world_no_longer_agrees_with_is_begun_anew(play, tmp_path, capsys):
    log = tmp_path / "log"
    _, _, folder = play(toy_world.specs(1), log=str(log))
    before, episode = digests(folder), folder / "toy-0"
    first, *_ = (episode / "steps.jsonl").read_text().splitlines()
    step = json.loads(first)
    step["end"][0] += 0.5
    (episode / "steps.jsonl").write_text(json.dumps(step) + "\n")
    rewrite(episode, outcome="interrupted", steps=1)
    play(toy_world.specs(1), log=str(log))
    assert digests(folder) == before
    assert "The episode starts again" in capsys.readouterr().out


def test_a_damaged_episode_is_begun_anew_and_the_others_are_kept(play, tmp_path, capsys):
    log = tmp_path / "log"
    _, _, folder = play(toy_world.specs(2), log=str(log))
    before, path = digests(folder), folder / "toy-1" / "motion.npz"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(RecordError, match=r"toy-1/motion\.npz has been changed"):
        load_run(folder)
    answer = CliRunner().invoke(bench, ["verify", str(folder)])
    assert (answer.exit_code, "2 records" in answer.output, "1 damaged" in answer.output) == (1, True, True)
    log.write_text("")
    status, (report,), _ = play(toy_world.specs(2), log=str(log))
    assert (report.episode, status.done, digests(folder)) == ("toy-1", 2, before)
    assert "toy-0" not in log.read_text()
    assert "has been changed since it was written. The episode starts again." in capsys.readouterr().out
    assert CliRunner().invoke(bench, ["verify", str(folder)]).exit_code == 0


def test_an_episode_copied_beside_itself_is_refused(play):
    _, _, folder = play(toy_world.specs(1))
    shutil.copytree(folder / "toy-0", folder / "toy-1")
    with pytest.raises(RecordError, match=r"toy-1 holds the record of 'toy-0'"):
        load_run(folder)
    assert CliRunner().invoke(bench, ["verify", str(folder)]).exit_code == 1


def test_a_run_that_is_there_is_left_alone_by_who_asks_for_a_new_one(tmp_path):
    (tmp_path / "run.json").write_text("{}")
    command = ["run", "--split", "smoke", "--agent", "still", "--no-resume", "--out", str(tmp_path)]
    refused = CliRunner().invoke(bench, command)
    assert isinstance(refused.exception, RecordError)
    assert "already holds a run" in str(refused.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


def test_a_run_offers_the_chosen_skills_and_goes_on_with_them(toys, tmp_path):
    few = Choice(skills=("walk", "stop"))
    job = Job("walker", {}, backends=TOY, files=(toy_world.FILE,), choice=few, in_process=True)
    chosen = Plugins.discover([Path(toy_world.FILE)], few)
    assert run_split(toy_world.specs(1), job, Here(), tmp_path, plugins=chosen).done == 1
    (episode,) = load_run(tmp_path)
    assert set(episode.record.skills) == {"walk", "stop"}
    with pytest.raises(RecordError, match="choice"):
        run_split(toy_world.specs(1), replace(job, choice=Choice()), Here(), tmp_path, plugins=toys)


def test_a_choice_that_names_nothing_is_refused(tmp_path):
    command = ["run", "--split", "smoke", "--agent", "still", "--skills", "hover", "--out", str(tmp_path / "run")]
    assert isinstance(CliRunner().invoke(bench, command).exception, PluginError)
    assert not (tmp_path / "run").exists()


def test_targets_left_out_are_those_of_the_words(play):
    (spec,) = toy_world.specs(1)
    play([spec.model_copy(update={"target_ids": (), "target_category": ""})])
    status, _, _ = play([spec])
    assert status.done == 1  # The folder holds the same split.


def test_other_settings_are_refused_and_named(play):
    play(toy_world.specs(1))
    with pytest.raises(RecordError, match=r"other settings: options pause was null and is now 0\.1"):
        play(toy_world.specs(1), pause=0.1)
    with pytest.raises(RecordError, match="episodes was 1 and is now 2"):
        play(toy_world.specs(2))


def test_run_json_names_the_backends_that_records_name(toys, tmp_path):
    class Nobody(Here):
        def reports(self, job, queue, out):
            yield from ()

    job = Job("walker", backends=Backends("", "toy", "toy", sensors=("touch", "vision")), files=(toy_world.FILE,))
    run_split(toy_world.specs(1), job, Nobody(), tmp_path, plugins=toys)
    backends = json.loads((tmp_path / "run.json").read_text())["backends"]
    first = next(name for name in ("bullet", "mujoco") if name in {item.name for item in toys.registered("simulators")})
    assert (backends["simulator"], backends["sensors"]) == (first, ["vision", "touch"])


def test_other_weights_are_refused_and_named(play, toys, monkeypatch):
    play(toy_world.specs(1))
    monkeypatch.setattr(type(toys.make("motion_generators", "toy")), "digest", "other")
    with pytest.raises(RecordError, match="weights base was toy and is now other"):
        play(toy_world.specs(1))


def test_an_unknown_agent_is_refused_before_any_worker_starts(play, tmp_path):
    with pytest.raises(PluginError, match="Did you mean walker"):
        play(toy_world.specs(1), agent="wlaker")
    assert not (tmp_path / "run" / "logs").exists()


# -- what goes wrong ---------------------------------------------------------------------------------------------------
def test_a_provider_that_fails_is_counted_apart_and_asked_again(play, tmp_path):
    trouble = {"in": "toy-1", "what": "provider", "once": str(tmp_path / "once"), "log": str(tmp_path / "log")}
    status, _, folder = play(toy_world.specs(3), **trouble)
    assert (status.done, status.failed) == (2, 1)
    assert RecordedEpisode(folder / "toy-1").record.outcome == "infra_error"
    again, reports, _ = play(toy_world.specs(3), **trouble)
    assert (again.done, again.failed, again.played) == (3, 0, 1)
    assert [report.episode for report in reports] == ["toy-1"]
    asked = (tmp_path / "log").read_text().splitlines()
    assert len(asked) == len(set(asked)) == 12


@pytest.mark.integration
def test_a_worker_that_crashes_is_named_and_the_others_go_on(play, tmp_path):
    trouble = {"in": "toy-1", "what": "SIGSEGV", "once": str(tmp_path / "once")}
    status, reports, folder = play(toy_world.specs(4), workers=2, **trouble)
    assert (status.done, status.failed) == (3, 1)
    (died,) = [report for report in reports if report.outcome == "infra_error"]
    assert died.episode == "toy-1"
    assert "died with SIGSEGV" in died.error
    assert RecordedEpisode(folder / "toy-1").record.error == died.error
    assert "Segmentation fault" in (folder / "logs" / f"{died.worker or died.error.split()[0]}.log").read_text()
    assert play(toy_world.specs(4), **trouble)[0].done == 4


def test_a_bug_of_an_agent_fails_its_own_episode_alone(play, tmp_path, capfd):
    trouble = {"in": "toy-0", "what": "bug", "once": str(tmp_path / "once")}
    status, _, folder = play(toy_world.specs(3), **trouble)
    assert (status.done, status.failed) == (3, 0)
    recorded = RecordedEpisode(folder / "toy-0")
    assert recorded.record.outcome == "plugin_error"
    assert recorded.record.error.endswith("raised ZeroDivisionError: a bug")
    assert "toy_world" in recorded.record.error
    scores = score(recorded)
    assert (scores.finished, scores.nav) == (True, False)
    assert attribute(recorded) is None
    assert "in befall" in capfd.readouterr().err


def test_a_decision_that_no_record_can_hold_fails_its_own_episode(play):
    status, _, folder = play(toy_world.specs(3), blank="toy-1")
    assert (status.done, status.failed) == (3, 0)
    assert [episode.record.outcome for episode in load_run(folder)] == ["stopped", "plugin_error", "stopped"]
    assert play(toy_world.specs(3), blank="toy-1")[1] == []


def test_an_error_that_no_file_can_hold_is_written_as_far_as_it_can(play):
    _, _, folder = play(toy_world.specs(1))
    mark(folder / "toy-0", "infra_error", "half \ud83d")
    assert RecordedEpisode(folder / "toy-0").record.error == "half \ufffd"


@pytest.mark.integration
def test_what_an_agent_raises_is_its_own_error_and_not_tried_again(play, tmp_path):
    troubles = ("replay", "interrupt", "interrupted as it begins", "record", "another's")
    each = {f"toy-{number}": trouble for number, trouble in enumerate(troubles)}
    status, _, folder = play(toy_world.specs(6), workers=1, in_process=False, each=each, log=str(tmp_path / "log"))
    assert (status.done, status.failed, status.stopped) == (6, 0, False)
    *failed, last = (episode.record for episode in load_run(folder))
    assert {record.outcome for record in failed} == {"plugin_error"}
    assert all(record.error.startswith("humanclaw_plugin_toy_world raised ") for record in failed)
    assert last.outcome == "stopped"
    asked = (tmp_path / "log").read_text().splitlines()
    assert len(asked) == len(set(asked)) == 4 * 2 + 4


def test_an_agent_that_cannot_be_used_ends_the_run_once(play, tmp_path):
    about = {"each": {"toy-1": "plugin"}, "log": str(tmp_path / "log")}
    with pytest.raises(HumanclawError, match=r"toy-1 cannot be run: .* no key\. Set one\."):
        play(toy_world.specs(3, houses=1), **about)
    record = RecordedEpisode(tmp_path / "run" / "toy-1").record
    assert record.outcome == "plugin_error"
    assert record.error == "humanclaw_plugin_toy_world raised PluginError: no key. Set one."
    status, reports, _ = play(toy_world.specs(3, houses=1), **about)
    assert (status.done, [report.episode for report in reports]) == (3, ["toy-2"])


def test_an_agent_made_once_only_fails_other_episodes_by_name(play):
    status, _, folder = play(toy_world.specs(3), agent="late", can=1)
    assert (status.done, status.failed) == (3, 0)
    records = [episode.record for episode in load_run(folder)]
    assert sorted(record.outcome for record in records) == ["plugin_error", "plugin_error", "stopped"]
    assert {record.error for record in records} == {"", "toy_world raised ValueError: no weights"}
    assert {record.agent for record in records} == {"walker"}


def test_an_agent_that_cannot_be_made_is_named_before_playing(play, tmp_path):
    with pytest.raises(PluginError, match="agent 'late' of plugin 'toy_world' gave up: ValueError: no weights"):
        play(toy_world.specs(1), agent="late", can=0)
    assert not (tmp_path / "run" / "toy-0").exists()


@pytest.mark.parametrize("fault", [SystemExit(3), KeyError("x"), MemoryError(), RecursionError(), GeneratorExit()])
def test_a_worker_reports_whatever_breaks_and_plays_on(toys, tmp_path, monkeypatch, fault):
    def broken(*_, **__):
        raise fault

    with Worker(Job("walker", {}, backends=TOY, files=(toy_world.FILE,)), tmp_path, plugins=toys) as worker:
        first, second = toy_world.specs(2)
        with monkeypatch.context() as patch:
            patch.setattr("humanclaw_bench.worker.Body", broken)
            patch.setattr("humanclaw_bench.worker.mark", broken)
            report = worker.play(first)
        assert (report.outcome, report.error.split(":")[0]) == ("infra_error", type(fault).__name__)
        assert worker.play(second).outcome == "stopped"


@pytest.mark.parametrize("name", ["../evil", "/tmp/evil", "frames/../../evil"])
def test_a_record_from_a_worker_cannot_leave_its_folder(tmp_path, name):
    with pytest.raises(RecordError, match="leads out of the folder"):
        unpack(tmp_path / "run" / "toy-0", {"steps.jsonl": b"", name: b"evil"})
    assert not [path for path in (tmp_path / "evil", tmp_path / "run" / "evil", Path("/tmp/evil")) if path.exists()]


@pytest.mark.parametrize(
    ("ids", "message"),
    [
        (["toy-0", "toy-0"], "holds episode 'toy-0' twice"),
        (["toy-0", "TOY-0"], "twice"),  # Some file systems do not tell them apart.
        (["run.json"], "of the run's own files"),
        (["Logs"], "of the run's own files"),
    ],
)
def test_ids_that_would_share_a_folder_are_refused(play, tmp_path, ids, message):
    specs = [spec.model_copy(update={"id": name}) for spec, name in zip(toy_world.specs(2), ids, strict=False)]
    with pytest.raises(HumanclawError, match=message):
        play(specs)
    assert not (tmp_path / "run").exists()


@pytest.mark.integration
def test_workers_that_all_die_at_once_end_the_run(tmp_path):
    job = Job("walker", {}, backends=TOY, files=(str(tmp_path / "missing.py"),))
    with pytest.raises(HumanclawError, match="3 workers died in a row"):
        list(LocalExecutor(1).reports(job, EpisodeQueue(toy_world.specs(9)), tmp_path / "run"))


def test_a_budget_ends_the_run_and_another_sitting_goes_on(play):
    status, _, _ = play(toy_world.specs(4), limits={"run.usd": 1.5})
    assert status.stopped
    assert status.done in (1, 2)  # An episode costs one dollar.
    assert play(toy_world.specs(4), limits={"run.usd": 100})[0].done == 4


def test_two_runs_never_write_to_one_folder(play, tmp_path):
    (tmp_path / "run").mkdir()
    with FileLock(tmp_path / "run" / ".lock"), pytest.raises(RecordError, match="another run is writing"):
        play(toy_world.specs(1))


# -- signals -----------------------------------------------------------------------------------------------------------
SCRIPT = """
import sys
from pathlib import Path
sys.path[:0] = {paths!r}
import toy_world
from humanclaw_bench.executors import LocalExecutor
from humanclaw_bench.runner import run_split
from humanclaw_bench.worker import Job
from humanclaw import Backends, Plugins

if __name__ == "__main__":
    job = Job("walker", {{"pause": {pause}}}, backends=Backends("toy", "toy", "toy"), files=(toy_world.FILE,),
              seed={seed})
    status = run_split(toy_world.specs(6), job, LocalExecutor(2), Path(sys.argv[1]),
                      plugins=Plugins.discover([Path(toy_world.FILE)]), watch=lambda *_: print("told", flush=True))
    print(status)
    sys.exit(130 if status.stopped else 0)
"""


@pytest.fixture
def process(tmp_path):
    """A run in a process of its own, in the middle of its episodes."""

    def start(pause=0.15):
        script = tmp_path / "script.py"
        script.write_text(
            SCRIPT.format(paths=[str(Path(__file__).parent), str(Path(rooms.__file__).parent)], pause=pause, seed=SEED)
        )
        running = subprocess.Popen(
            [sys.executable, str(script), str(tmp_path / "run")],
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        wait_for(lambda: len(list((tmp_path / "run").glob("*/steps.jsonl"))) >= 1)
        return running

    return start


def wait_for(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def outcomes(folder):
    return [json.loads(path.read_text())["outcome"] for path in sorted(folder.glob("*/episode.json"))]


@pytest.mark.integration
def test_ctrl_c_ends_the_steps_under_way_and_the_run_goes_on(process, play, tmp_path):
    running = process()
    os.killpg(running.pid, signal.SIGINT)
    assert running.wait(30) == 130
    assert set(outcomes(tmp_path / "run")) <= {"stopped", "interrupted"}
    assert "interrupted" in outcomes(tmp_path / "run")
    assert play(toy_world.specs(6), in_process=False, pause=0.15)[0].done == 6
    _, _, clean = play(toy_world.specs(6), name="clean", in_process=False, pause=0.15)
    assert digests(tmp_path / "run") == digests(clean)


@pytest.mark.integration
def test_a_second_ctrl_c_ends_it_at_once(process):
    running = process(pause=30.0)
    os.killpg(running.pid, signal.SIGINT)
    time.sleep(0.5)  # Two signals at once would be one.
    os.killpg(running.pid, signal.SIGINT)
    assert running.wait(60) == -signal.SIGINT, "130 says that the steps under way were ended"


@pytest.mark.evidence
def test_a_killed_run_leaves_no_worker_behind_and_goes_on_later(process, play, tmp_path):
    running = process()
    workers = children(running.pid)
    assert len(workers) >= 2
    running.kill()
    running.wait(10)
    wait_for(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 10)
    assert play(toy_world.specs(6), in_process=False, pause=0.15)[0].done == 6
    _, _, clean = play(toy_world.specs(6), name="clean", in_process=False, pause=0.15)
    assert digests(tmp_path / "run") == digests(clean)


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
