"""Agent and verifier play in a process of their own: they reach neither body nor records, and their end is named."""

import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toy_world
from click.testing import CliRunner
from PIL import Image
from test_runner import SEED, TOY, Here, digests, rewrite

from humanclaw import HumanclawError, Plugins, RecordedEpisode, load_run
from humanclaw.world import GAZES
from humanclaw_bench.cli import bench
from humanclaw_bench.executors import LocalExecutor
from humanclaw_bench.isolation.transports import ProcessTransport
from humanclaw_bench.runner import run_split
from humanclaw_bench.worker import Job

pytestmark = pytest.mark.integration

HEAD = """
import gc, os, sys, time
from humanclaw import Call, Decision, Episode, ProviderError, Verdict, hookimpl

class Agent:
    name, privileged = "own", False
    def __init__(self, options): self.options = options
    def begin(self, context): self.context = context
    def decide(self, observation, history):
        return Decision((Call("stop") if observation.step == 3 else Call("walk", {"z_cm": 30}),))

@hookimpl
def humanclaw_agents(register): register("own", Mine)
"""


@pytest.fixture
def play(tmp_path):
    """Run toy episodes with an agent whose class is written here; returns the status and the folder."""

    def run(
        written, count=1, name="run", in_process=False, limits=None, workers=0, verifier="",
        backends=TOY, seed=SEED, **options
    ):  # fmt: skip
        file = tmp_path / "own.py"
        file.write_text(HEAD + written)
        files = (toy_world.FILE, str(file))
        job = Job("own", options, verifier, backends, limits or {}, files, in_process=in_process, seed=seed)
        plugins = Plugins.discover([Path(file) for file in files])
        folder = tmp_path / name
        return run_split(
            toy_world.specs(count), job, LocalExecutor(workers) if workers else Here(), folder, plugins=plugins
        ), folder

    return run


PLAIN = "\nclass Mine(Agent): ...\n"
THIEF = """
class Mine(Agent):
    def decide(self, observation, history):
        frame, episodes = sys._getframe(), []
        while frame:
            episodes += [value for value in frame.f_locals.values() if isinstance(value, Episode)]
            frame = frame.f_back
        episodes += [item for item in gc.get_objects() if issubclass(type(item), Episode)]
        spec = self.context.spec
        words = f"{len(episodes)} episodes, scene {spec.scene!r}, {spec.start}, {spec.target_ids}, {self.context.scene}"
        return Decision((Call("stop"),), visible_state=words)
"""


def said(folder):
    return RecordedEpisode(folder / "toy-0").steps[0].decision.visible_state


def test_an_agent_finds_no_episode_on_the_stack_nor_in_memory(play):
    _, folder = play(THIEF)
    assert said(folder) == "0 episodes, scene '', None, (), None"


TELLS_SEED = """
class Mine(Agent):
    def decide(self, observation, history):
        return Decision((Call("stop"),), visible_state=str(self.context.seed))
"""


def test_the_seed_of_an_agent_does_not_tell_its_episode(play):
    # Episodes number their seeds, so a table from seeds to episodes would rebuild the world and play in its shadow.
    _, first = play(TELLS_SEED, 3, name="one", in_process=True, seed=None)
    _, other = play(TELLS_SEED, 3, name="other", in_process=True, seed=None)
    seeds = [int(episode.steps[0].decision.visible_state) for run in (first, other) for episode in load_run(run)]
    assert len({*seeds}) == 6


def test_a_run_that_continues_keeps_its_seed(play):
    _, folder = play(TELLS_SEED, in_process=True, seed=None)
    seed = said(folder)
    shutil.rmtree(folder / "toy-0")
    play(TELLS_SEED, in_process=True, seed=None)
    assert said(folder) == seed


def test_the_order_of_episodes_does_not_tell_which_one_is_played(play):
    def order(name):
        _, folder = play(PLAIN, 9, name=name, in_process=True, seed=None)
        # Records tell whole seconds, and nine of these episodes are played in one.
        played = sorted(folder.glob("*/steps.jsonl"), key=lambda steps: steps.stat().st_mtime_ns)
        assert len(played) == 9
        return [steps.parent.name for steps in played]

    assert order("one") != order("other")


def test_in_one_process_it_finds_it_so_tables_and_board_say_that(play):
    _, folder = play(THIEF, in_process=True)
    assert not said(folder).startswith("0 episodes")
    table = CliRunner().invoke(bench, ["table", str(folder), "--format", "markdown"]).output
    assert "in the body's own process" in table
    assert "own (in process)" in board(folder)


def test_an_agent_is_told_where_the_eyes_look(play):
    """A model's prompt describes its view by it."""
    watcher = """
class Mine(Agent):
    def decide(self, observation, history):
        return Decision((Call("stop"),), visible_state=str(self.context.gaze))
"""
    _, folder = play(watcher, backends=replace(TOY, gaze="far"))
    assert said(folder) == str(GAZES["far"])


# A worker is a child of multiprocessing; neither these tests nor the agent's process are.
PATCH = """
import multiprocessing
if multiprocessing.parent_process():
    Episode._execute = lambda self, call, verdict: 1 / 0
"""
OBSERVER = """
@hookimpl
def humanclaw_step(episode, step, view): ...
"""


def test_an_agent_that_patches_the_episode_patches_its_own_copy(play):
    _, honest = play(PLAIN, name="honest")
    status, folder = play(PLAIN + PATCH, name="patched", workers=1)
    assert (status.done, digests(folder)) == (1, digests(honest))


def test_a_plugin_with_an_agent_and_an_observer_is_loaded(play):
    seen = 'open(os.path.join(os.path.dirname(__file__), "seen"), "w").close()'
    _, folder = play(PLAIN + OBSERVER.replace("...", seen))
    assert (folder.parent / "seen").exists()


def test_a_privileged_agent_plays_beside_the_body(play):
    both = """
class Mine(Agent): privileged = True
class Judge(Agent):
    def verify(self, observation, call, skill, goal): return Verdict(True)
@hookimpl
def humanclaw_verifiers(register): register("judge", Judge)
"""
    status, folder = play(both, verifier="judge")
    settings = RecordedEpisode(folder / "toy-0").record.settings
    assert (status.done, settings["apart"], settings["privileged"]) == (
        1, {"verifier": "process"}, {"agent": True, "verifier": False},
    )  # fmt: skip


def test_of_two_files_of_one_name_the_deciding_one_stays_away(tmp_path):
    for name, text in (("a", HEAD + PLAIN + PATCH), ("b", "from humanclaw import hookimpl\n" + OBSERVER)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "own.py").write_text(text)
    for order in (("a", "b"), ("b", "a")):
        files = (toy_world.FILE, *(str(tmp_path / name / "own.py") for name in order))
        job = Job("own", {}, backends=TOY, files=files)
        plugins = Plugins.discover([Path(file) for file in files])
        folder = tmp_path / "".join(order)
        assert run_split(toy_world.specs(1), job, LocalExecutor(1), folder, plugins=plugins).done == 1
        assert RecordedEpisode(folder / "toy-0").record.outcome == "stopped"


def test_an_agent_in_a_folder_stays_away_from_the_body(tmp_path):
    package = tmp_path / "project" / "humanclaw_own"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(HEAD + PLAIN + PATCH)
    files = (toy_world.FILE, str(package.parent))
    plugins = Plugins.discover([Path(file) for file in files])
    job = Job("own", {}, backends=TOY, files=files)
    assert run_split(toy_world.specs(1), job, LocalExecutor(1), tmp_path / "run", plugins=plugins).done == 1
    assert RecordedEpisode(tmp_path / "run" / "toy-0").record.outcome == "stopped"


def test_records_are_the_same_on_both_sides_of_the_wall(play):
    _, apart = play(PLAIN, 3, name="apart")
    _, beside = play(PLAIN, 3, name="beside", in_process=True)
    steps = [[(s.call, s.end, s.feedback) for s in played.steps] for run in (apart, beside) for played in load_run(run)]
    assert steps[:3] == steps[3:]
    assert RecordedEpisode(apart / "toy-0").record.settings["apart"] == {"agent": "process"}


RECALLS = """
class Mine(Agent):
    def decide(self, observation, history):
        entries = [(e.step, str(e.executed), e.rgb.shape, int(e.rgb.mean())) for e in history]
        call = Call("stop") if observation.step == 3 else Call("walk", {"z_cm": 30})
        return Decision((call,), visible_state=repr(entries))
"""


def test_an_agent_recalls_its_steps_with_their_views(play):
    _, folder = play(RECALLS)
    entries = eval(RecordedEpisode(folder / "toy-0").steps[3].decision.visible_state)
    files = [folder / "toy-0" / step.frame_file for step in RecordedEpisode(folder / "toy-0").steps[:3]]
    frames = [np.asarray(Image.open(file)) for file in files]
    assert [entry[0] for entry in entries] == [0, 1, 2]
    assert entries[1][1] == "walk(x_cm=0, z_cm=30, yaw_deg=0)"
    assert [entry[3] for entry in entries] == [int(frame.mean()) for frame in frames]


def test_an_agent_of_a_resumed_episode_gets_the_views_it_missed(play):
    _, whole = play(RECALLS, name="whole")
    _, folder = play(RECALLS)
    lines = (folder / "toy-0" / "steps.jsonl").read_text().splitlines(keepends=True)
    (folder / "toy-0" / "steps.jsonl").write_text("".join(lines[:2]))
    rewrite(folder / "toy-0", outcome="running", steps=0)
    (folder / "toy-0" / "motion.npz").unlink()
    play(RECALLS)
    assert digests(folder) == digests(whole)


@pytest.mark.parametrize("ends", ["os._exit(7)", "os.kill(os.getpid(), 9)"])
def test_an_agent_whose_process_ends_fails_its_episode_alone(play, ends):
    written = f"""
class Mine(Agent):
    def decide(self, observation, history):
        if observation.step == 2 and not os.path.exists(self.options["once"]):
            open(self.options["once"], "w").close()
            {ends}
        return super().decide(observation, history)
"""
    once = f"{play.__name__}-{ends[:7]}"
    status, folder = play(written, 2, once=str(Path(folder_of(play)) / once))
    failed, other = sorted((episode.record for episode in load_run(folder)), key=lambda record: record.outcome)
    assert (failed.outcome, "process ended with exit code" in failed.error) == ("plugin_error", True)
    assert (status.done, other.outcome) == (2, "stopped")


def test_an_agent_that_hangs_is_ended_by_the_time_limit(play, monkeypatch):
    monkeypatch.setattr("humanclaw_bench.isolation.agents.GRACE", 0.2)
    hangs = "\nclass Mine(Agent):\n    def decide(self, observation, history): time.sleep(600)\n"
    _, folder = play(hangs, limits={"call.seconds": 1.0})
    assert RecordedEpisode(folder / "toy-0").record.outcome == "limit_reached"


def test_the_limit_of_a_call_begins_anew_at_each_question(play):
    slow = """
class Mine(Agent):
    def begin(self, context): self.meter = context.meter
    def decide(self, observation, history):
        assert self.meter.seconds_left() > 0.9
        time.sleep(0.4)
        self.meter.check()
        return super().decide(observation, history)

class Strict:
    name, privileged = "strict", False
    def __init__(self, options): ...
    def begin(self, context): self.meter = context.meter
    def verify(self, observation, call, skill, goal):
        self.meter.check()
        return Verdict(True)

@hookimpl
def humanclaw_verifiers(register): register("strict", Strict)
"""
    _, folder = play(slow, limits={"call.seconds": 1.0}, verifier="strict")
    episode = RecordedEpisode(folder / "toy-0")
    assert (episode.record.outcome, len(episode.steps)) == ("stopped", 4)


def test_an_agent_that_stops_reading_is_ended_by_the_time_limit(play, monkeypatch):
    monkeypatch.setattr("humanclaw_bench.isolation.agents.GRACE", 0.2)
    # It sleeps once it has answered, before it is asked again; a view with its history is more than a pipe holds.
    ask = ProcessTransport.ask

    def later(self, method, params, seconds=None):
        time.sleep(0.3 if method == "decide" else 0.0)
        return ask(self, method, params, seconds)

    monkeypatch.setattr(ProcessTransport, "ask", later)
    deaf = """
import signal, threading
class Mine(Agent):
    def decide(self, observation, history):
        threading.Timer(0.05, lambda: os.kill(os.getpid(), signal.SIGSTOP)).start()
        return Decision((Call("walk", {"z_cm": 30}),), reasoning="word " * 50_000)
"""
    _, folder = play(deaf, limits={"call.seconds": 1.0})
    assert RecordedEpisode(folder / "toy-0").record.outcome == "limit_reached"


@pytest.mark.parametrize("agent", ["5", "{'name': 5}", "{'name': 'x', 'versions': 7}", "{'name': 'x', 'settings': []}"])
def test_who_introduces_itself_wrongly_ends_the_run_by_its_name(play, agent):
    wrong = f"""
import humanclaw_bench.isolation.session as session
class Mine(Agent): ...
if "isolation" in sys.argv[0]:
    session.Session._initialize = lambda self, params: {{"agents": {agent}}}
"""
    with pytest.raises(Exception, match="agent and verifier cannot be made: its answer to initialize is no Introduc"):
        play(wrong)


def test_an_agent_cannot_tell_versions_of_what_plays_beside_the_body(play):
    lies = """
import humanclaw_bench.isolation.session as session
class Mine(Agent): ...
if "isolation" in sys.argv[0]: session.Session._versions = lambda self, kind, name: {"humanclaw": "99", "own": "1"}
"""
    _, folder = play(lies)
    versions = RecordedEpisode(folder / "toy-0").record.versions
    assert (versions["humanclaw"] == "99", versions["own"]) == (False, "1")


def test_what_an_agent_prints_does_not_disturb_the_protocol(play, capfd):
    prints = """
print("at import")
class Mine(Agent):
    def decide(self, observation, history):
        print('{"jsonrpc": "2.0"}')
        os.write(1, b"raw\\n")
        return super().decide(observation, history)
"""
    status, _ = play(prints)
    printed = capfd.readouterr()
    assert (status.done, "raw" in printed.err, "at import" in printed.err) == (1, True, True)


def test_an_error_of_an_agent_has_its_own_name_in_the_record(play):
    bug = "\nclass Mine(Agent):\n    def decide(self, observation, history): {}['key']\n"
    _, folder = play(bug)
    assert RecordedEpisode(folder / "toy-0").record.error.endswith("raised KeyError: 'key'")


def test_a_process_that_cannot_start_ends_the_run(play):
    dies = "\nimport humanclaw_bench.isolation\nif 'isolation' in sys.argv[0]: os._exit(5)\n"
    with pytest.raises(Exception, match="agent and verifier cannot be made: its process ended with exit code 5"):
        play(PLAIN + dies)


def test_an_installed_agent_is_of_this_run_by_its_version(tmp_path, monkeypatch):
    site = tmp_path / "site"
    (site / "own_agents-2.5.dist-info").mkdir(parents=True)
    (site / "own_agents.py").write_text(HEAD + PLAIN)
    (site / "own_agents-2.5.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: own-agents\nVersion: 2.5\n"
    )
    (site / "own_agents-2.5.dist-info" / "entry_points.txt").write_text("[humanclaw]\nown = own_agents\n")
    monkeypatch.syspath_prepend(site)
    job = Job("own", {}, backends=TOY, files=(toy_world.FILE,))
    plugins = Plugins.discover([Path(toy_world.FILE)])
    run_split(toy_world.specs(1), job, Here(), tmp_path / "run", plugins=plugins)
    assert RecordedEpisode(tmp_path / "run" / "toy-0").record.versions["own-agents"] == "2.5"
    answer = CliRunner().invoke(bench, ["verify", str(tmp_path / "run")])
    assert (answer.exit_code, "own-agents" in answer.output) == (0, False), answer.output


def test_a_provider_that_closes_ends_the_run_from_its_own_process(play):
    closes = """
from humanclaw import ProviderClosedError
class Mine(Agent):
    def decide(self, observation, history):
        if observation.step == 2:
            raise ProviderClosedError("no money is left.", "Top it up.")
        return super().decide(observation, history)
"""
    with pytest.raises(HumanclawError, match=r"no money is left\. Top it up\."):
        play(closes)
    (record,) = folder_of(play).glob("*/toy-0")
    assert RecordedEpisode(record).record.outcome == "infra_error"


def folder_of(play):
    """Return the temporary folder of a test's runs."""
    return next(cell.cell_contents for cell in play.__closure__ if isinstance(cell.cell_contents, Path))


def board(folder, *words):
    """Return the leaderboard of a run, which is submitted when the board is made first."""
    place = folder.parent / "board"
    if not place.exists():
        assert CliRunner().invoke(bench, ["submit", str(folder), "--who", "me"]).exit_code == 0
    shutil.copytree(folder, place / "mine", dirs_exist_ok=True)
    assert CliRunner().invoke(bench, ["leaderboard", str(place), *words]).exit_code == 0
    return (place / "index.html").read_text()
