"""Who brings what, and the lines to type that mend what is missing."""

import ast
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from packaging.requirements import Requirement
from wheels import distributions as folders

from humanclaw.cli import LazyCommand, build
from humanclaw.errors import PluginError
from humanclaw.plugins import Plugins, distributions

PROJECT = tomllib.loads((folders()[0] / "pyproject.toml").read_text())["project"]
WITHOUT_WHEELS = set() if find_spec("pybullet") else {"bullet"}
"""What its distribution does not register on this Python."""
NAMES = {tomllib.loads((folder / "pyproject.toml").read_text())["project"]["name"] for folder in folders()}


def test_the_table_says_what_the_distributions_register():
    plugins = Plugins.discover()
    origins = {info.name: info.origin for info in plugins.infos}
    for kind, table in distributions.table().items():
        if kind == "commands":
            continue
        found = {one.name: origins[one.owner] for one in plugins.registered(kind)}
        installed = {name: of for name, of in table.items() if of in origins.values() and name not in WITHOUT_WHEELS}
        assert {name: of for name, of in found.items() if of in NAMES} == installed, kind


def test_the_table_says_whose_every_command_is():
    commands = build(Plugins.discover)
    names = commands.list_commands(click.Context(commands))
    homes = {name: _home(commands.commands[name]) for name in names}
    found = {name: home.replace("_", "-") for name, home in homes.items() if home != "humanclaw"}
    table = distributions.table()["commands"]
    assert {name: of for name, of in found.items() if of in NAMES} == {n: of for n, of in table.items() if n in found}
    assert set(table.values()) <= NAMES


def _home(command):
    command = command.load() if isinstance(command, LazyCommand) else command
    return command.callback.__module__.partition(".")[0]


def test_a_command_that_is_not_installed_names_what_brings_it():
    done = CliRunner().invoke(build(Plugins), ["bench", "run"])
    assert done.exit_code == 2
    assert "command 'bench' is not installed." in done.output
    assert "pip install humanclaw-bench" in done.output


@pytest.mark.parametrize(
    ("python_version", "sys_platform", "platform_machine", "needed"),
    [
        ("3.11", "linux", "x86_64", True),
        ("3.12", "linux", "x86_64", False),
        ("3.11", "linux", "aarch64", False),
        ("3.11", "darwin", "arm64", False),
        ("3.11", "win32", "AMD64", False),
    ],
)
def test_pybullet_is_needed_only_where_it_has_wheels(python_version, sys_platform, platform_machine, needed):
    (bullet,) = (folder for folder in folders() if folder.name == "bullet")
    requirements = map(Requirement, tomllib.loads((bullet / "pyproject.toml").read_text())["project"]["dependencies"])
    (pybullet,) = (one for one in requirements if one.name == "pybullet")
    here = {
        "python_version": python_version,
        "sys_platform": sys_platform,
        "platform_machine": platform_machine,
    }
    assert pybullet.marker.evaluate(here) is needed


def test_what_an_installed_distribution_cannot_bring_here_is_not_offered_again():
    """As PyBullet, which has no wheel for the newest Pythons."""
    plugins = Plugins()
    plugins.add(object(), "humanclaw-bullet", origin="humanclaw-bullet")
    with pytest.raises(PluginError, match="there is no simulator 'bullet'") as raised:
        plugins.make("simulators", "bullet")
    assert raised.value.remedy.startswith(
        "humanclaw-bullet brings it where what it needs is installed; here it is not."
    )
    assert "mujoco (of humanclaw-mujoco)" in raised.value.remedy


def test_every_distribution_has_the_licence_of_the_whole_and_says_where_it_belongs():
    licence = (folders()[0] / "LICENSE").read_text()
    for folder in folders():
        project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
        assert (folder / "LICENSE").read_text() == licence
        assert project["license"] == "Apache-2.0"
        assert project["requires-python"] == ">=3.11"
        assert project["authors"]
        assert project["classifiers"]
        assert project["urls"]["Homepage"].endswith(f"/{project['name']}/")
        assert (folder / project["readme"]).is_file()


def test_the_extras_name_every_distribution():
    extras = PROJECT["optional-dependencies"]
    named = {Requirement(text).name for texts in extras.values() for text in texts}
    assert named | {"humanclaw"} >= NAMES
    assert not {"torch", "ray"} & {Requirement(text).name for text in PROJECT["dependencies"]}


def test_all_that_is_missing_is_told_at_once_with_one_line_that_mends_it():
    with pytest.raises(PluginError) as refused:
        Plugins().require(("scenes", "house"), ("simulators", "mujoco"), ("renderers", "raster"))
    assert refused.value.message == "scene 'house', simulator 'mujoco' and renderer 'raster' are not installed."
    assert refused.value.remedy == 'Run `pip install "humanclaw[demo]"`.'


def test_what_the_extra_does_not_hold_is_added_to_the_line():
    missing = ("scenes", "house"), ("renderers", "raster"), ("verifiers", "litellm")
    with pytest.raises(PluginError, match=r'pip install "humanclaw\[demo\]" humanclaw-litellm'):
        Plugins().require(*missing)


@pytest.mark.parametrize(
    ("kind", "name", "remedy"),
    [
        ("scenes", "house", "Run `pip install humanclaw-houses`."),
        ("executors", "ray", "Run `pip install humanclaw-ray`."),
        ("simulators", "mujocco", "Did you mean mujoco (of humanclaw-mujoco)?"),
        ("renderers", "unheard-of", "Known: raster (of humanclaw-raster), raster-2x (of humanclaw-raster)."),
    ],
)
def test_a_name_that_is_not_there_is_answered_with_the_distribution_that_brings_it(kind, name, remedy):
    with pytest.raises(PluginError) as refused:
        Plugins().require((kind, name))
    assert refused.value.message.startswith("there is no ")
    assert refused.value.remedy == remedy


IMPORTED_AS = {
    "PIL": "pillow",
    "agents": "openai-agents",
    "google": "google-genai",
    "pydantic_ai": "pydantic-ai-slim",
    "rerun": "rerun-sdk",
    "skimage": "scikit-image",
}
OPTIONAL = {"alktx2", "onnxruntime", "openvino"}
"""Used where somebody has installed them, and told by name where not."""
CARRIED = {"mcp-types"}
"""Modules that come with another distribution of the same authors."""


def _imported(package: Path) -> set[str]:
    """What the modules of a package import, its own and the standard library apart, as distributions are called."""
    nodes = [node for file in package.rglob("*.py") for node in ast.walk(ast.parse(file.read_text()))]
    modules = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    modules += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module and not node.level]
    tops = {module.split(".")[0] for module in modules} - sys.stdlib_module_names - {package.name}
    return {IMPORTED_AS.get(top, top).lower().replace("_", "-") for top in tops}


@pytest.mark.parametrize("folder", folders(), ids=lambda folder: folder.name)
def test_a_distribution_requires_all_that_it_imports(folder):
    content = tomllib.loads((folder / "pyproject.toml").read_text())
    project = content["project"]
    texts = [
        *project["dependencies"],
        *(text for texts in project.get("optional-dependencies", {}).values() for text in texts),
    ]
    required = {Requirement(text).name.lower() for text in texts}
    (package,) = content["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
    assert _imported(folder / package) <= required | OPTIONAL | CARRIED


def test_every_skill_of_the_repository_is_in_the_table():
    skills = Path(__file__).parents[1] / "skills"
    assert {file.parent.name for file in skills.glob("*/*/*/schema.json")} == distributions.table()["skills"].keys()


def test_what_the_newest_python_is_tested_on_imports_what_the_demo_installs_and_no_more():
    line = next(
        line for line in (folders()[0] / ".ci/run").read_text().splitlines() if "-newest/bin/python -m pytest" in line
    )
    named = [folders()[0] / word for word in line.split() if word.startswith("tests/")]
    files = [file for path in named for file in (path.rglob("*.py") if path.is_dir() else [path])]
    demo = {Requirement(text).name.replace("-", "_") for text in PROJECT["optional-dependencies"]["demo"]}
    ours = {name for file in files for name in _at_the_top(file) if name.startswith("humanclaw_")}
    assert files
    assert ours <= demo


def _at_the_top(file: Path) -> set[str]:
    """The packages that a module imports as soon as it is loaded."""
    body = ast.parse(file.read_text("utf-8")).body
    plain = {alias.name for node in body if isinstance(node, ast.Import) for alias in node.names}
    return {name.partition(".")[0] for name in plain | {n.module or "" for n in body if isinstance(n, ast.ImportFrom)}}
