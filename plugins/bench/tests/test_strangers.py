"""Folders of strangers: no command touches, shows or waits for anything outside of them.

`make fuzz` tries everything at every path; else each path gets one plant and one command.
"""

import os
import shutil
from contextlib import suppress
from itertools import cycle
from pathlib import Path

import pytest
import toy_world
from click.testing import CliRunner
from fuzzing import thorough, timed
from here import Here
from test_runner import TOY

from humanclaw import HumanclawError, Plugins
from humanclaw.cli import build
from humanclaw_bench.executors import LocalExecutor
from humanclaw_bench.runner import run_split
from humanclaw_bench.worker import Job
from humanclaw_report.watch import Watcher

SECRET = b"the user's own words\n"
SPECS = toy_world.specs(2)
JOB = Job("walker", {}, backends=TOY, files=(toy_world.FILE,))


@pytest.fixture(scope="module")
def plugins():
    return Plugins.discover([Path(toy_world.FILE)])


def call(*words):
    """Give a command; it ends with a message, never with a traceback."""
    done = CliRunner().invoke(build(Plugins.discover), [str(word) for word in words])
    assert done.exception is None or isinstance(done.exception, SystemExit), (words, done.exception)
    return done.output


def resumed(run, plugins):
    try:
        run_split(SPECS, JOB, Here(), run, plugins=plugins)
    except HumanclawError as error:
        return str(error)
    return ""


def watched(run, plugins):
    watcher = Watcher(run, plugins.scene)
    pictures = [watcher.frame("toy-0", f"000{number}.jpg") for number in range(5)]
    page = ""
    with suppress(HumanclawError):  # The server answers it as not found.
        page = watcher.replay("toy-0")
    return f"{watcher.state()} {page} {pictures}"


COMMANDS = {
    "report": lambda run, plugins: call("report", run, "--plugin", toy_world.FILE),
    "rescore": lambda run, plugins: call("bench", "rescore", run, "--plugin", toy_world.FILE),
    "verify": lambda run, plugins: call("bench", "verify", run),
    "submit": lambda run, plugins: call("bench", "submit", run, "--who", "me", "--partial"),
    "leaderboard": lambda run, plugins: call("bench", "leaderboard", run.parent),
    "csv": lambda run, plugins: call("bench", "export", run, "--to", "csv", "--out", run.parent / "run.csv"),
    "resume": resumed,
    "watch": watched,
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory, plugins):
    """The folder of a run with everything that commands write there."""
    shelf = tmp_path_factory.mktemp("shelf")
    run_split(SPECS, JOB, LocalExecutor(1), shelf / "run", plugins=plugins)
    for name in ("report", "rescore", "submit", "leaderboard"):
        COMMANDS[name](shelf / "run", plugins)
    return shelf


def cleared(place):
    shutil.rmtree(place) if place.is_dir() and not place.is_symlink() else place.unlink()


def oversized(place, mine):
    with place.open("wb") as file:
        file.truncate(3 << 30)


def device(place, mine):
    """A device that never ends, where the system lets this user make one, and a link to it elsewhere."""
    try:
        os.mknod(place, 0o666 | 0o020000, os.makedev(1, 5))
    except OSError:
        place.symlink_to("/dev/zero")


PLANTS = {
    "link": lambda place, mine: place.symlink_to(mine / "0000.jpg"),
    "linked folder": lambda place, mine: place.symlink_to(mine),
    "pipe": lambda place, mine: os.mkfifo(place),
    "device": device,
    "folder": lambda place, mine: (place / "inner").mkdir(parents=True),
    "oversized": oversized,
}


def planted(place, whole, name, plant, commands, plugins):
    """Put something in the place of a file or folder of a run, and give commands. Yields what they did wrong."""
    shelf, mine = place / "shelf", place / "mine"
    shutil.copytree(whole, shelf)
    mine.mkdir()
    for file in ("0000.jpg", "episode.json", "steps.jsonl", "three.js", "worker-0.log"):
        (mine / file).write_bytes(SECRET)
    before = state(mine)
    cleared(shelf / "run" / name)
    PLANTS[plant](shelf / "run" / name, mine)
    for command in commands:
        try:
            with timed("REAL", 10):
                told = COMMANDS[command](shelf / "run", plugins)
        except BaseException as error:
            yield f"{command}, a {plant} at {name}: {error!r}"
            continue
        if state(mine) != before:
            yield f"{command}, a {plant} at {name}: what it leads to was changed"
        if any(SECRET.strip() in data for data in (told.encode(), *state(shelf).values())):
            yield f"{command}, a {plant} at {name}: what it leads to was shown"


def state(folder):
    """Path to content of every plain file, but for the oversized one."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink())
    return {str(path): path.read_bytes() for path in files if path.stat().st_size < 1 << 24}


def paths(run):
    """Every file and folder of a real run."""
    return sorted(path.relative_to(run).as_posix() for path in run.rglob("*"))


@pytest.mark.integration
def test_no_command_follows_or_waits_for_what_a_stranger_plants(whole, plugins, tmp_path_factory):
    wrong, plants, commands = [], cycle(PLANTS), cycle(COMMANDS)
    for name in paths(whole / "run"):
        for plant in PLANTS if thorough() else (next(plants),):
            place = tmp_path_factory.mktemp("planted")
            some = COMMANDS if thorough() else (next(commands),)
            wrong += planted(place, whole, name, plant, some, plugins)
            shutil.rmtree(place)
    assert wrong == []
