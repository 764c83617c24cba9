"""`humanclaw new` writes packages that work as they stand. test_distributions.py compares ours with them."""

import ast
import importlib
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from environments import like_this

from humanclaw import EpisodeContext, EpisodeSpec, HumanclawError, Observation
from humanclaw.cli.new import KINDS, TRAINED, Distribution, new, write

ROOT = Path(__file__).parents[1]
MADE = {kind: f"my_{kind}" for kind in KINDS} | {"trained": "bow"}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("made")
    for kind, name in MADE.items():
        what = ("skill", name, "--trained") if kind == "trained" else (kind, name)
        done = CliRunner().invoke(new, [*what, "--out", str(folder / kind)])
        assert done.exit_code == 0, done.output
    return {kind: folder / kind for kind in MADE}


def _as_installed(folder: Path) -> None:
    """Write the metadata of an editable installation: name, version and entry points."""
    project = tomllib.loads((folder / "pyproject.toml").read_text("utf-8"))["project"]
    info = folder / f"{project['name'].replace('-', '_')}-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0.1.0\n")
    points = "".join(f"{key} = {value}\n" for key, value in project["entry-points"]["humanclaw"].items())
    (info / "entry_points.txt").write_text(f"[humanclaw]\n{points}")


@pytest.mark.integration
def test_the_tests_of_every_kind_pass_once_it_is_installed(made):
    for folder in made.values():
        _as_installed(folder)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, made.values()))}
    command = [sys.executable, "-m", "pytest", "-q", "--import-mode=importlib", *(f"{f}/tests" for f in made.values())]
    done = subprocess.run(
        command, cwd=made["skill"].parent, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_agent_that_it_writes_makes_legal_calls(made, plugins, monkeypatch):
    monkeypatch.syspath_prepend(made["agent"])
    agent = importlib.import_module("humanclaw_my_agent.agent").MyAgentAgent()
    spec = EpisodeSpec(id="one", instruction="find a couch", scene="house:0")
    agent.begin(EpisodeContext(spec, plugins.skills, seed=0))
    (call,) = agent.decide(Observation(0, spec.instruction, np.zeros((512, 512, 3), np.uint8)), ()).calls
    assert plugins.skill(call.skill).check(call.params) == {"x_cm": 0, "z_cm": 40, "yaw_deg": 0}


@pytest.mark.integration
def test_what_it_writes_is_tidy(made):
    for check in ("check", "format --check"):
        command = [sys.executable, "-m", "ruff", *check.split(), "--config", str(ROOT / "pyproject.toml")]
        done = subprocess.run([*command, *map(str, made.values())], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.evidence
@pytest.mark.parametrize("kind", MADE)
def test_what_it_writes_is_typed(made, kind):
    (package,) = (path for path in made[kind].glob("humanclaw_*") if path.suffix != ".dist-info")
    command = [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), str(package)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("kind", MADE)
def test_nothing_of_the_template_is_left(made, kind):
    for file in made[kind].rglob("*"):
        if file.is_file() and file.name != "LICENSE" and not re.search(r"\.dist-info|__pycache__", str(file)):
            text = f"{file.name} {file.read_text('utf-8')}"
            assert not re.findall("[Ee]xample|DESCRIPTION|AUTHOR|INSTALL|ABOUT", text), file


@pytest.mark.parametrize("kind", MADE)
def test_it_is_complete(made, kind):
    assert (made[kind] / "LICENSE").read_text() == (ROOT / "LICENSE").read_text()
    assert {".github", ".gitignore", "README.md", "tests"} <= {path.name for path in made[kind].iterdir()}
    assert list(made[kind].glob("humanclaw_*/py.typed"))


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path):
    (tmp_path / "work").write_text("of days")
    done = CliRunner().invoke(new, ["skill", "nod", "--out", str(tmp_path)])
    assert "already exists" in str(done.exception)
    assert [file.name for file in tmp_path.iterdir()] == ["work"]


@pytest.mark.parametrize("words", [["walk"], ["stride", "--call", "walk"]])
def test_the_name_of_a_skill_that_is_there_is_refused(tmp_path, words):
    done = CliRunner().invoke(new, ["skill", *words, "--out", str(tmp_path / "mine")])
    assert "'walk' is already a skill of humanclaw-skill-walk" in str(done.exception)


@pytest.mark.parametrize("name", ["Nod", "2steps", "a b", "../nod", "nod/"])
def test_a_name_that_no_package_can_have_is_refused(tmp_path, name):
    done = CliRunner().invoke(new, ["skill", name, "--out", str(tmp_path / "nod")])
    assert "is not a valid name" in str(done.exception)
    assert not (tmp_path / "nod").exists()


@pytest.mark.evidence
@pytest.mark.parametrize("kind", MADE)
def test_it_installs_and_its_wheel_holds_all_of_it(made, kind, tmp_path):
    environment = like_this(tmp_path / "environment")
    subprocess.run(["pip", "install", "-q", "--no-deps", str(made[kind])], env=environment, check=True)
    done = subprocess.run(["pytest", "-q", "tests"], cwd=made[kind], env=environment, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize("words", [["class"], ["x" * 300], ["bow", "--call", "lambda"], ["bow", "--call", "b" * 65],
                                   ["bow", "--about", "a\nb"], ["bow", "--author", "A\x1b[2K"], ["bow\n"]])  # fmt: skip
def test_a_name_or_text_that_no_file_can_hold_is_refused(tmp_path, words):
    done = CliRunner().invoke(new, ["skill", *words, "--out", str(tmp_path / "made")])
    assert isinstance(done.exception, HumanclawError)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("kind", MADE)
def test_quotes_in_description_and_author_stay_quoted(tmp_path, kind):
    about, author = '"""; import os; os.abort() #\\', "Ada \"x\", { name = 'y' }\\"
    made = Distribution.of(TRAINED if kind == "trained" else KINDS[kind], "bow", about=about, author=author)
    write(made, tmp_path)
    project = tomllib.loads((tmp_path / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["description"] == made.description
    assert project["authors"] == [{"name": author}]
    module = ast.parse((tmp_path / f"humanclaw_{made.entry}/__init__.py").read_text("utf-8"))
    assert ast.get_docstring(module) == made.description
    assert about in (tmp_path / "README.md").read_text("utf-8")
