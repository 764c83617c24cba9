"""The command line, as a person uses it."""

import datetime
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hosting import write_distribution

from humanclaw import HumanclawError, PluginError
from humanclaw.cli import check_options, main
from humanclaw.plugins.host import Modules

KEYLESS = {name: value for name, value in os.environ.items() if name != "OPENAI_API_KEY"}
EXAMPLES = Path(__file__).parent.parent / "examples"
AGENT = """
from humanclaw import Call, Decision, PluginError, hookimpl
class Mine:
    name, privileged, settings = "mine", False, {{}}
    def begin(self, context): {begin}
    def decide(self, observation, history): {decide}
@hookimpl
def humanclaw_agents(register): register("mine", lambda options: Mine(), "an agent of a test")
"""


@pytest.fixture
def cli(tmp_path, monkeypatch, capsys):
    """Return a function that runs a command line in this process, in an empty folder."""

    def run(*args, **env):
        for name, value in env.items():
            monkeypatch.setenv(name, value)
        with pytest.raises(SystemExit) as ended:
            main(list(map(str, args)))
        stdout, stderr = capsys.readouterr()
        return SimpleNamespace(returncode=ended.value.code, stdout=stdout, stderr=stderr)

    capsys.readouterr()
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    monkeypatch.setenv("PYTHONSAFEPATH", "1")  # `main` sets it for as long as the process lives.
    return run


@pytest.fixture
def process(tmp_path):
    """Return a function that runs a command line in a process of its own."""

    def run(*args, **env):
        command = [sys.executable, "-m", "humanclaw", *map(str, args)]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=KEYLESS | env, check=False)

    return run


def test_skills_lists_every_skill_with_owner_and_state(cli, plugins):
    rows = {row["skill"]: row for row in json.loads(cli("skills", "--json").stdout)}
    assert rows.keys() == plugins.skills.keys()
    assert rows["walk"]["from"] == "humanclaw-skill-walk 0.1.0"
    assert "z_cm 0..80" in rows["walk"]["parameters"]
    assert rows["walk"]["state"] == "ready (adapter)"


def test_skills_lists_the_choices_of_a_parameter(cli):
    (row,) = json.loads(cli("skills", "--json", "--plugin", EXAMPLES / "stroll.py", "--skills", "stroll").stdout)
    assert row["parameters"] == "pace slow|easy|brisk"


def test_plugins_says_what_each_provides(cli):
    rows = {row["plugin"]: row for row in json.loads(cli("plugins", "--json").stdout)}
    assert "simulator mujoco" in rows["humanclaw-mujoco"]["provides"]
    assert "renderer raster" in rows["humanclaw-raster"]["provides"]
    assert all(row["state"] == "in use" for row in rows.values() if row["version"])


@pytest.mark.parametrize("command", ["skills", "plugins"])
def test_a_table_fits_80_columns_in_a_pipe_and_breaks_no_name(cli, command):
    shown = cli(command, COLUMNS="80").stdout.splitlines()
    assert max(map(len, shown)) <= 80
    assert any("humanclaw-skill-side-step" in line for line in shown)


@pytest.mark.integration
def test_a_run_leaves_a_record_a_film_and_a_report(cli, tmp_path):
    done = cli("run", "--agent", "random", "--max-steps", "2", "--out", "r", "--film", "gif")
    assert done.returncode == 0, done.stderr
    assert "out of steps after 2 steps" in done.stdout or "stopped after" in done.stdout
    assert len((tmp_path / "r/house-0-0/steps.jsonl").read_text().splitlines()) in (1, 2)
    assert (tmp_path / "r/house-0-0/film.gif").read_bytes()[:4] == b"GIF8"
    page = (tmp_path / "r/report.html").read_text()
    assert not re.search(r'(src|href)="https?:', page)


@pytest.mark.integration
def test_a_run_with_two_bodies_names_both_and_leaves_two_records(cli, tmp_path):
    done = cli("run", "--agent", "random", "--with", "random", "--max-steps", "2", "--out", "r", "--film", "none")
    assert done.returncode == 0, done.stderr
    for body in ("random 1", "random 2"):
        assert {f"{body} in", f"{body}: out"} <= {" ".join(line.split()[:3]) for line in done.stdout.splitlines()}
        assert done.stdout.count(f"  {body}: ") >= 2
    both = [json.loads((tmp_path / f"r/house-0-{k}/episode.json").read_text()) for k in (0, 1)]
    assert [record["company"] for record in both] == [["house-0-0", "house-0-1"]] * 2
    assert both[0]["start"] != both[1]["start"]


def test_an_instruction_for_a_second_body_without_one_is_refused(cli):
    done = cli("run", "--agent", "random", "--with-instruction", "wait")
    assert (done.returncode, "Add --with NAME." in done.stderr) == (2, True)


@pytest.mark.parametrize("command", [["run"], ["play", "stop"]])
def test_a_seed_below_zero_is_refused_in_words(cli, command):
    done = cli(*command, "--seed", "-3")
    assert done.returncode == 2
    assert "-3 is not in the range x>=0" in done.stderr


@pytest.mark.parametrize(("option", "bounds"), [("--seed", "at least 0"), ("--calls", "at least 1, at most 100")])
def test_a_word_for_a_number_is_refused_with_the_bounds(cli, option, bounds):
    assert f"'x' is not a valid integer: {bounds}." in cli("play", "stop", option, "x").stderr


def test_a_missing_argument_is_named(cli):
    assert "Missing argument 'FILE|FOLDER|NAME'." in cli("play").stderr


def test_the_usage_of_a_skill_lists_its_choices(cli):
    assert (
        "Call nod with {times: integer 1|2|3}."
        in cli("play", str(Path(__file__).parents[1] / "examples/nod.py"), "times=5").stderr
    )


@pytest.mark.parametrize(
    ("args", "message", "remedy"),
    [
        (["run", "--scene", "hause:0"], "there is no scene 'hause'", "Did you mean house?"),
        (["check", "missing/folder"], "there is no file or folder missing/folder", "Name one, or a skill"),
        (["bench", "run", "--max-steps", "3"], "bench run takes no --max-steps", "play --split smoke"),
        (["run", "--scene", "house:900"], "900", "house:"),
        (["run", "--instruction", " "], "the instruction is empty", "find a couch"),
        (["run", "--model", ""], "--model is empty", "Name one"),
        (["mcp", "--scene", "hous:1"], "there is no scene 'hous'", "Did you mean house"),
        (["film", "run", "--out", "film.webm"], "a film ends in .mp4 or .gif; got film.webm", "film.mp4"),
        (["run", "--agent", "oracel"], "there is no agent 'oracel'", "Did you mean oracle?"),
        (["run", "find a couch"], "run takes options alone; got 'find a couch'", "--instruction 'find a couch'?"),
        (["run", "nod.py"], "run takes options alone; got 'nod.py'", "Did you mean --plugin 'nod.py'?"),
        pytest.param(
            ["run", "--model", "openai/gpt-5"],
            "needs a key and OPENAI_API_KEY is not set",
            "Set OPENAI_API_KEY",
            marks=pytest.mark.integration,
        ),
        pytest.param(
            ["run", "--model", "nonsense"],
            "no provider is known for model 'nonsense'",
            "Write provider/name",
            marks=pytest.mark.integration,
        ),
        (["run", "--renderer", "rastr"], "there is no renderer 'rastr'", "Did you mean raster?"),
        (["run", "--agent", "still", "--option", "scene=house:1"], "scene", "Write --scene without --option."),
        (["run", "--prior", "nope"], "there is no prior 'nope'", "Known: lite"),
        (
            ["run", "--instruction", "find a giraffe"],
            "expected an instruction with one of chair, couch",
            "--model NAME",
        ),
        (["run", "--option", "api_key=1"], "looks like a secret", "environment"),
        (["run", "--scene", "hssd:https://me:hunter2@example.org/x"], "--scene holds", "environment"),
        (["play", "walk", "--scene", "hssd:x?token=hunter2"], "--scene holds", "environment"),
        (["mcp", "--scene", "house:0", "--scene", "hssd:https://hunter2@example.org"], "--scene holds", "environment"),
        (["run", "--plugin", "none.py"], "there is no plugin file none.py", "path of a Python file"),
        (["report", "nowhere"], "there is no folder nowhere", "humanclaw bench run"),
        (["report", "x", "y", "--out", "pair"], "a report ends in .html; got pair", "Name pair.html"),
    ],
)
def test_what_the_user_can_mend_is_one_sentence_and_a_remedy(cli, tmp_path, args, message, remedy):
    done = cli(*args)
    assert done.returncode == 2
    assert message in done.stderr
    assert remedy in done.stderr
    assert "Traceback" not in done.stderr
    assert "hunter2" not in done.stdout + done.stderr
    assert done.stdout == ""  # No head of an episode that never begins, and nothing is left.
    assert list(tmp_path.iterdir()) == []
    assert len(done.stderr.strip().splitlines()) <= 2


@pytest.mark.parametrize("out", ["bench", "bench/more"])
def test_no_record_is_added_to_the_run_of_a_benchmark(cli, tmp_path, out):
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench/run.json").write_text("{}")
    done = cli("run", "--agent", "still", "--out", out, "--film", "none")
    assert done.returncode == 2
    assert "would change its numbers. Name another folder" in " ".join(done.stderr.split())
    assert [path.name for path in tmp_path.rglob("*")] == ["bench", "run.json"]


def test_an_unwritable_output_folder_is_said_before_the_run(cli, tmp_path):
    (tmp_path / "file").write_text("in the way")
    done = cli("run", "--agent", "still", "--out", "file/run", "--film", "none")
    assert done.returncode == 2
    assert "cannot write the record to file/run" in done.stderr
    assert "--out" in done.stderr


@pytest.mark.integration
def test_a_provider_that_cannot_be_reached_exits_with_1(cli, tmp_path):
    options = ["api_base=http://127.0.0.1:9/v1", "num_retries=1", "backoff=0.01"]
    pairs = [part for option in options for part in ("--option", option)]
    done = cli("run", "--model", "openai/nobody", *pairs, "--out", "r", "--film", "gif")
    assert done.returncode == 1
    assert "the provider failed" in done.stderr
    assert json.loads((tmp_path / "r/house-0-0/episode.json").read_text())["outcome"] == "infra_error"


def test_an_agent_that_raises_is_a_plugin_error_and_exits_with_1(cli, tmp_path):
    (tmp_path / "mine.py").write_text(AGENT.format(begin="pass", decide="raise ZeroDivisionError('of its own')"))
    done = cli("run", "--plugin", "mine.py", "--agent", "mine", "--out", "r", "--film", "none")
    assert done.returncode == 1
    assert "a plugin failed: " in done.stderr
    assert "ZeroDivisionError: of its own" in done.stderr
    assert json.loads((tmp_path / "r/house-0-0/episode.json").read_text())["outcome"] == "plugin_error"


def test_a_record_is_never_overwritten(cli, tmp_path):
    folder = tmp_path / "r/house-0-0"
    folder.mkdir(parents=True)
    (folder / "episode.json").write_text("precious")
    done = cli("run", "--out", "r", "--max-steps", "1")
    assert done.returncode == 2
    assert "already holds a record" in done.stderr
    assert (folder / "episode.json").read_text() == "precious"


def test_two_runs_that_begin_in_one_second_have_a_folder_each(cli, tmp_path):
    now = datetime.datetime.now()
    for second in range(120):
        moment = now + datetime.timedelta(seconds=second)
        (tmp_path / "runs" / f"{moment:%Y%m%d-%H%M%S}-still").mkdir(parents=True)
    done = cli("run", "--agent", "still", "--max-steps", "1", "--film", "none")
    assert done.returncode == 0, done.stderr
    (report,) = tmp_path.glob("runs/*-still-2/report.html")
    assert f"report: {report.relative_to(tmp_path)}" in done.stdout


def test_a_run_says_how_it_understood_the_instruction(cli):
    done = cli("run", "--instruction", "finde ein Sofa und setz dich darauf", "--film", "none", "--max-steps", "1")
    assert "Scored: reaching a couch, not sitting on it." in done.stdout
    assert done.returncode == 0


def test_an_agent_that_cannot_begin_leaves_nothing(cli, tmp_path):
    closed = "raise PluginError('closed on Sundays.', 'Come back tomorrow.')"
    (tmp_path / "mine.py").write_text(AGENT.format(begin=closed, decide="pass"))
    done = cli("run", "--plugin", "mine.py", "--agent", "mine")
    assert (done.returncode, done.stdout) == (2, "")
    assert "closed on Sundays" in done.stderr
    assert not (tmp_path / "runs").exists()


@pytest.mark.integration
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_gets_a_signal_leaves_a_record_and_a_report(tmp_path, number):
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("what started this process ignores the signal, and its children inherit that")
    command = [sys.executable, "-m", "humanclaw", "run", "--agent", "wanderer", "--film", "none", "--out", "r"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1
    ) as run:
        assert run.stdout.readline() == 'wanderer in house:0: "find a couch and sit on it"\n'
        assert run.stdout.readline() == "Scored: reaching a couch, sitting on it.\n"
        assert run.stdout.readline().split() == ["call", "to", "target", "time"]
        assert run.stdout.readline().split()[0] == "0"  # the first step is over
        run.send_signal(number)
        output, _ = run.communicate(timeout=120)
    assert run.returncode == 130
    assert "interrupted after" in output
    assert "record: r/house-0-0" in output
    assert "report: r/report.html" in output
    assert json.loads((tmp_path / "r/house-0-0/episode.json").read_text())["outcome"] == "interrupted"
    assert (tmp_path / "r/report.html").is_file()


def test_ctrl_c_while_the_report_is_written_leaves_the_record(cli, tmp_path):
    (tmp_path / "hasty.py").write_text(
        "from humanclaw import hookimpl\n"
        "class Hasty:\n"
        "    def write(self, *about): raise KeyboardInterrupt\n"
        "@hookimpl\n"
        "def humanclaw_reports(register): register('hasty', lambda **options: Hasty(), 'nobody waits for it')\n"
    )
    done = cli("run", "--plugin", "hasty.py", "--agent", "still", "--max-steps", "1", "--film", "none", "--out", "r")
    assert done.returncode == 130
    assert "`humanclaw report r`" in done.stdout
    assert "Traceback" not in done.stderr
    assert (tmp_path / "r/house-0-0/episode.json").is_file()


@pytest.mark.integration
def test_ctrl_c_that_python_drops_in_a_finalizer_stops_the_run(process, tmp_path):
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        pytest.skip("what started this process ignores the signal, and its children inherit that")
    turns = "Dropping(); return Decision((Call('turn_in_place', {'yaw_deg': 30}),), reasoning='I turn.')"
    (tmp_path / "mine.py").write_text(
        "import os, signal\n"
        "class Dropping:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        sum(range(1000))\n" + AGENT.format(begin="pass", decide=turns)
    )
    done = process("run", "--plugin", "mine.py", "--agent", "mine", "--max-steps", "4", "--film", "none", "--out", "r")
    assert "Exception ignored" in done.stderr
    assert done.returncode == 130
    assert "interrupted after 1 " in done.stdout


@pytest.mark.integration
def test_ctrl_c_again_while_a_record_is_closed_says_where_it_is(cli, tmp_path):
    (tmp_path / "hasty.py").write_text(
        "from humanclaw import hookimpl\n"
        "from humanclaw_mujoco.world import mujoco\n"
        "def hasty(profile):\n"
        "    def execute(motion):\n"
        "        if len(motion) < 15: return stand(motion)\n"
        "        one.close = raised\n"
        "        raise KeyboardInterrupt\n"
        "    def raised(): raise KeyboardInterrupt\n"
        "    one = mujoco(profile)\n"
        "    stand, one.execute = one.execute, execute\n"
        "    return one\n"
        "@hookimpl\n"
        "def humanclaw_simulators(register): register('hasty', hasty, 'nobody waits for it')\n"
    )
    done = cli("run", "--plugin", "hasty.py", "--simulator", "hasty", "--film", "none", "--out", "r")
    assert done.returncode == 130
    assert "interrupted after" in done.stdout
    assert "record: r/house-0-0" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.integration
def test_a_run_answers_before_anything_is_loaded_that_takes_time():
    probe = (
        "import sys, humanclaw.cli as cli; cli.build(None).commands['run'].make_context('run', []); print(*sys.modules)"
    )
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    assert "humanclaw.cli.options" in loaded
    slow = {"numpy", "pydantic", "jsonschema", "importlib.metadata", "packaging.requirements"}
    slow |= {"humanclaw.plugins.host", "humanclaw.records.decisions"}
    assert not slow & set(loaded)


@pytest.mark.integration
def test_listing_the_commands_loads_nothing_that_running_needs():
    probe = (
        "import atexit, sys; atexit.register(lambda: print(*sys.modules)); import humanclaw.cli as c; c.main(['-h'])"
    )
    loaded = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True).stdout.split()
    assert "humanclaw_bench" in loaded
    assert not {"numpy", "pydantic", "jsonschema"} & set(loaded)
    assert not {"scipy", "torch", "litellm", "pandas", "numba", "pybullet", "mujoco", "filelock"} & set(loaded)


def test_help_begins_with_run_play_report_and_ends_with_developers(cli):
    listed = cli("--help", COLUMNS="80").stdout.partition("Commands:")[2]
    first, _, developers = listed.partition("For developers:")
    assert [line.split()[0] for line in first.splitlines() if line][:3] == ["run", "play", "report"]
    assert {"train", "physics"} <= {line.split()[0] for line in developers.splitlines() if line}


@pytest.mark.parametrize("group", ["", "bench", "habitat"])
def test_what_a_command_does_is_said_to_the_end_at_80_columns(cli, group):
    commands = cli(*group.split(), "--help", COLUMNS="80").stdout.partition("Commands:")[2]
    assert commands
    assert [line for line in commands.splitlines() if line.endswith("...")] == []


def test_what_is_printed_is_what_was_said(cli):
    said = "go to [bold]that[/bold] :cat:"
    done = cli(
        "run", "--instruction", said, "--agent", "still", "--max-steps", "1", "--film", "none", "--out", "[a] :cat:"
    )
    assert f'still in house:0: "{said}"' in done.stdout
    assert "report: [a] :cat:/report.html" in done.stdout


def test_the_table_of_plugins_tells_what_is_wrong_with_one(cli, tmp_path, monkeypatch):
    write_distribution(tmp_path, "odd", "odd", "raise RuntimeError('it needs odd[all]')")
    monkeypatch.syspath_prepend(tmp_path)
    shown = cli("plugins", COLUMNS="200").stdout
    assert "disabled: RuntimeError: it needs odd[all]" in shown


@pytest.mark.integration
@pytest.mark.parametrize(
    ("encoding", "command", "shown"),
    [
        ("cp1252", ("physics", "free-space"), "| free space | contacts meanwhile | 0 | \\u2264 0 | yes |"),
        (
            "ascii",
            ("run", "--instruction", "h\u00fcpf \u2713", "--agent", "still", "--max-steps", "1", "--film", "none"),
            "h\\xfcpf \\u2713",
        ),
    ],
)
def test_an_output_that_has_no_such_letter_is_given_its_number(process, encoding, command, shown):
    """Such as a pipe on Windows, whose encoding is the system's."""
    done = process(*command, PYTHONIOENCODING=encoding)
    assert (done.returncode, done.stderr) == (0, "")
    assert shown in done.stdout


def test_the_short_form_of_an_option_is_answered_with_the_whole_one(cli):
    done = cli("bench", "table", "x", "--latex")
    assert done.returncode == 2
    assert "Did you mean '--format latex'?" in done.stderr


def test_a_misspelt_command_is_answered_with_the_nearest_one(cli):
    done = cli("phisics")
    assert done.returncode == 2
    assert done.stderr == "error: there is no command 'phisics'.\nDid you mean physics?\n"


def test_a_traceback_does_not_control_the_terminal(monkeypatch, capsys):
    def fails(self, hook, **event):
        raise ValueError("a\x1b[2Jb\u202ec")

    monkeypatch.setattr(Modules, "tell", fails)
    with pytest.raises(SystemExit) as ended:
        main(["bench"])
    errors = capsys.readouterr().err
    assert (ended.value.code, "ValueError: a\\u001b[2Jb\\u202ec" in errors, "\x1b" in errors) == (1, True, False)


def test_a_misspelt_command_of_an_absent_distribution_is_answered(monkeypatch, capsys):
    monkeypatch.setattr(Modules, "tell", lambda self, hook, **event: None)
    with pytest.raises(SystemExit) as ended:
        main(["bnech"])
    assert ended.value.code == 2
    assert "Did you mean bench (of humanclaw-bench)?" in capsys.readouterr().err


def part(**settings):
    return SimpleNamespace(settings=settings)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"hstory": 5}, "there is no option 'hstory' for agent deep and its verifier. Did you mean history?"),
        ({"verifier_hstory": 5}, "Did you mean verifier_history?"),
        ({"frobnicate": 1}, "The options are history, images, miss, profile, verifier_history"),
    ],
)
def test_an_option_that_concerns_nobody_is_told_with_the_nearest(options, words):
    with pytest.raises(HumanclawError, match=re.escape(words)):
        check_options(options, "deep", part(history=1, images=1), part(miss=0.0))


def test_options_of_the_agent_and_of_its_verifier_are_taken():
    options = {"history": 5, "profile": "paper", "verifier_model": "x"}
    check_options(options, "deep", part(history=1, model=""), None)
    check_options({**options, "miss": 0.5}, "deep", part(history=1, model=""), part(miss=0.0))
    check_options({"anything": 1}, "of somebody else", object(), None)


def test_an_agent_that_breaks_when_asked_for_settings_is_named():
    broken = type("Broken", (), {"settings": property(lambda self: 1 / 0)})()
    with pytest.raises(PluginError, match=rf"^{__name__.partition('.')[0]} raised ZeroDivisionError: .*its settings"):
        check_options({}, "broken", broken, None)
