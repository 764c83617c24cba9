"""The distributions of this repository are alike, stand in every list, and are named when one is missing."""

import ast
import importlib.metadata
import json
import re
import shutil
import sys
import tomllib
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import click
import package
import pytest
from click.testing import CliRunner
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from snippets import pages
from wheels import ROOT, distributions as folders

from humanclaw.cli import LazyCommand, build
from humanclaw.cli.new import KINDS, TRAINED, Distribution
from humanclaw.errors import PluginError
from humanclaw.plugins import Plugins, distributions

CONTENT = {folder: tomllib.loads((folder / "pyproject.toml").read_text("utf-8")) for folder in folders()}
PROJECTS = {folder: content["project"] for folder, content in CONTENT.items()}
PROJECT = PROJECTS[ROOT]
PACKAGES = {folder: doc["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"][0] for folder, doc in CONTENT.items()}
NAMES = {project["name"] for project in PROJECTS.values()}
DEMO = {Requirement(text).name for text in PROJECT["optional-dependencies"]["demo"]}
WITHOUT_WHEELS = set() if find_spec("pybullet") else {"bullet"}
"""Simulators that their distribution does not register on this Python."""


HOOKS_APART = {"entry-points": {"humanclaw": {"train": "humanclaw_train.plugin"}}}
DEVIATIONS = {
    "gymnasium": ({"entry-points": None}, "it registers an environment with Gymnasium and nothing with the host"),
    "verifiers": ({"entry-points": None}, "verifiers finds it by its name"),
    "train": (HOOKS_APART, "its other modules run without the core, so the hooks have a module of their own"),
}
"""Fields of [project] that differ from what `humanclaw new` writes, and why."""
SEVERAL_BOUNDS = {
    "anthropic": "who uses humanclaw-frameworks has it already; the core's tests need a version with the types",
    "google-genai": "as anthropic",
    "mcp": "litellm imports it, whatever its version; the server needs version 2",
    "trimesh": "humanclaw-report takes three.js from it",
}
"""Requirements whose bounds differ between distributions, and why."""
NOT_INSTALLED = {
    "plugins/ray": "Ray is large",
    "plugins/rerun": "the Rerun viewer is large",
    "harnesses/openenv": "it brings Gradio",
    "harnesses/verifiers": "it is large, and its mcp is another one",
    **dict.fromkeys(
        ("skills/answer", "skills/crouch", "skills/gaze", "skills/handle", "skills/hands", "skills/say"),
        "the benchmark gives agents the paper's skills",
    ),
}
"""Folders that the requirements files leave out, and why."""

NOT_LOCKED = {
    "torch": "its build and its index depend on the machine",
    "fastapi": "for OpenEnv, which is not installed",
    "xllamacpp": "for one example",
    **dict.fromkeys(("openenv-core", "ray", "rerun-sdk", "verifiers"), "not installed, because it is large"),
    **dict.fromkeys(("langchain-core", "openai-agents", "pydantic-ai-slim", "smolagents"), "the caller has it already"),
    **dict.fromkeys(("dracopy", "inspect-ai", "lerobot", "tensorboard", "wandb"), "an extra that no test needs"),
}
"""Requirements that are not in the lock, and why."""


def _template(folder):
    """What `humanclaw new` would write in the place of a package, with the same description."""
    schemas = [file.parent.name for file in folder.glob("*/*/schema.json")]
    kind = TRAINED if schemas else KINDS["skill" if folder.parent.name == "skills" else "observer"]
    about = PROJECTS[folder]["description"].removeprefix("HumanCLAW skill: ")
    return Distribution.of(kind, folder.name, *schemas[:1], about=about, author=package.AUTHOR)


@pytest.mark.parametrize("folder", folders()[1:], ids=lambda folder: folder.name)
def test_a_distribution_is_what_humanclaw_new_writes(folder):
    made = _template(folder)
    files = made.files()
    expected = tomllib.loads(files["pyproject.toml"].decode())
    own = {key: PROJECTS[folder].get(key) for key in ("description", "dependencies", "optional-dependencies")}
    fields = expected["project"] | own | DEVIATIONS.get(folder.name, ({}, ""))[0]
    expected["project"] = {key: value for key, value in fields.items() if value is not None}
    assert CONTENT[folder] == expected
    assert (folder / "LICENSE").read_bytes() == files["LICENSE"]
    assert (folder / f"humanclaw_{made.entry}/py.typed").is_file()
    assert (folder / "README.md").read_text("utf-8").startswith((f"# {made.project}\n", "# HumanCLAW-Bench\n"))
    assert list(folder.glob("tests/test_*.py"))


ONE_SKILL = [folder for folder in folders() if len(list(folder.glob("humanclaw_skill_*/*/schema.json"))) == 1]


@pytest.mark.parametrize("folder", ONE_SKILL, ids=lambda folder: folder.name)
def test_a_trained_skill_has_what_humanclaw_new_writes(folder):
    files = _template(folder).files()
    for path in ("pyproject.toml", f"humanclaw_skill_{folder.name}/__init__.py", f"tests/test_skill_{folder.name}.py"):
        assert (folder / path).read_bytes() == files[path]


def test_the_core_has_the_terms_of_its_plugins():
    plugin = CONTENT[ROOT / "plugins/bench"]
    for key in ("license", "license-files", "requires-python", "authors", "classifiers", "readme", "dynamic", "urls"):
        assert PROJECT[key] == plugin["project"][key]
    assert CONTENT[ROOT]["build-system"] == plugin["build-system"]


def _requirements(project):
    extras = project.get("optional-dependencies", {}).values()
    return [Requirement(text) for texts in (project["dependencies"], *extras) for text in texts]


def test_a_requirement_has_the_same_bounds_everywhere():
    of_others = [need for p in PROJECTS.values() for need in _requirements(p) if need.name != p["name"]]
    bounds = {(need.name, str(need.specifier)) for need in of_others}
    counts = Counter(name for name, _ in bounds)
    assert {name for name, count in counts.items() if count > 1} == SEVERAL_BOUNDS.keys()
    assert {bound for name, bound in bounds if name in NAMES} == {"<0.2,>=0.1"}


def test_the_lock_holds_a_version_and_a_hash_of_each_requirement():
    text = re.sub(r"^#.*\n", "", (ROOT / "requirements-lock.txt").read_text(), flags=re.MULTILINE)
    line = re.compile(r"([a-z0-9-]+)==(\S+) \\\n    --hash=sha256:[0-9a-f]{64}\n")
    locked = dict(line.findall(text))
    assert line.sub("", text) == "", "nothing else stands in it, such as an index"
    wanted = [need for project in PROJECTS.values() for need in _requirements(project) if need.name not in NAMES]
    assert {name for need in wanted if (name := canonicalize_name(need.name)) not in locked} == NOT_LOCKED.keys()
    versions = [(need, locked.get(canonicalize_name(need.name))) for need in wanted]
    assert [str(need) for need, version in versions if version and version not in need.specifier] == []


def test_the_requirements_files_name_every_distribution():
    files = [(ROOT / f"requirements{of}.txt").read_text() for of in ("-demo", "", "-train")]
    demo, *rest = (set(re.findall(r"^-e (\w+/\w+)$", text, re.MULTILINE)) for text in files)
    assert {PROJECTS[ROOT / path]["name"] for path in demo} == DEMO
    everything = {folder.relative_to(ROOT).as_posix() for folder in folders()[1:]}
    assert demo.union(*rest) == everything - NOT_INSTALLED.keys()


def test_the_import_rules_see_every_package():
    packages = {path.rpartition("/")[2] for path in PACKAGES.values()}
    assert packages == set(CONTENT[ROOT]["tool"]["importlinter"]["root_packages"])


MENTION = r"(?:humanclaw[-_](?:skill[-_])?|-e \w+/|[\[,]){}\b"


@pytest.mark.parametrize(("kind", "neighbour"), [("scene", "habitat"), ("skill", "walk"), ("agent", "human")])
def test_a_new_package_is_listed_wherever_its_neighbour_is(kind, neighbour, tmp_path, monkeypatch):
    monkeypatch.setattr(package, "ROOT", tmp_path)
    (tmp_path / "core").mkdir()
    (table,) = (ROOT / "core").rglob("distributions.toml")
    for path in (*(ROOT / path for path in package.LISTS), table):
        shutil.copy(path, tmp_path / ("core" if path == table else ""))
    assert (package.add([kind, "new_one"]) / "pyproject.toml").is_file()
    for path in package.LISTS:
        text = (tmp_path / path).read_text("utf-8")
        named, beside = (re.findall(MENTION.format(name), text) for name in ("new[-_]one", neighbour))
        assert len(named) == len(beside), path
    assert tomllib.loads((tmp_path / "core/distributions.toml").read_text())[f"{kind}s"]["new_one"].endswith("-new-one")


def test_the_hooks_of_a_commit_are_the_checks_of_lint():
    hooks = re.findall(r"entry: make (\w+)", (ROOT / ".pre-commit-config.yaml").read_text())
    assert re.search(r"^lint: (.*?)  ##", (ROOT / "Makefile").read_text(), re.MULTILINE)[1].split() == hooks


def test_the_table_says_what_the_distributions_register(plugins):
    origins = {info.name: info.origin for info in plugins.infos}
    for kind, table in distributions.table().items():
        if kind in ("commands", "paper"):
            continue
        owners = {offer.name: origins[offer.owner] for offer in plugins.registered(kind)}
        installed = {name: of for name, of in table.items() if of in origins.values() and name not in WITHOUT_WHEELS}
        brought = {name: of for name, of in owners.items() if of in NAMES - {"humanclaw"}}  # The core is always there.
        assert brought == installed, kind


def test_the_papers_skills_are_the_eight_that_need_no_extra():
    papers, skills = distributions.table()["paper"], distributions.table()["skills"]
    assert len(papers) == 8
    assert papers.items() <= skills.items()
    assert not {f"skills/{of.removeprefix('humanclaw-skill-')}" for of in papers.values()} & NOT_INSTALLED.keys()


def test_the_table_says_whose_every_command_is():
    commands = build(Plugins.discover)
    names = commands.list_commands(click.Context(commands))
    homes = {name: _home(commands.commands[name]) for name in names}
    owners = {name: home.replace("_", "-") for name, home in homes.items() if home != "humanclaw"}
    table = distributions.table()["commands"]
    assert {name: of for name, of in owners.items() if of in NAMES} == {n: of for n, of in table.items() if n in owners}
    assert set(table.values()) <= NAMES


def _home(command):
    command = command.load() if isinstance(command, LazyCommand) else command
    return command.callback.__module__.partition(".")[0]


def test_a_command_that_is_not_installed_names_what_brings_it():
    done = CliRunner().invoke(build(Plugins), ["bench", "run"])
    assert done.exit_code == 2
    assert "command 'bench' is not installed." in done.output
    assert "pip install -e " in done.output
    assert "plugins/bench`" in done.output


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
    (pybullet,) = (need for need in _requirements(PROJECTS[ROOT / "plugins/bullet"]) if need.name == "pybullet")
    here = {"python_version": python_version, "sys_platform": sys_platform, "platform_machine": platform_machine}
    assert pybullet.marker.evaluate(here) is needed


def test_what_an_installed_distribution_lacks_is_not_offered_again():
    """As PyBullet, which has no wheel for the newest Pythons."""
    plugins = Plugins()
    plugins.add(object(), "humanclaw-bullet", origin="humanclaw-bullet")
    with pytest.raises(PluginError, match="there is no simulator 'bullet'") as raised:
        plugins.make("simulators", "bullet")
    assert raised.value.remedy.startswith("humanclaw-bullet brings it, but a package that it needs is not installed.")
    assert "mujoco (of humanclaw-mujoco)" in raised.value.remedy


def test_the_extras_name_every_distribution():
    assert {need.name for need in _requirements(PROJECT)} | {"humanclaw"} >= NAMES
    assert not {"torch", "ray"} & {Requirement(text).name for text in PROJECT["dependencies"]}


def test_all_that_is_missing_is_told_with_one_line_that_mends_it():
    with pytest.raises(PluginError) as refused:
        Plugins().require(("scenes", "house"), ("simulators", "mujoco"), ("renderers", "raster"))
    assert refused.value.message == "scene 'house', simulator 'mujoco' and renderer 'raster' are not installed."
    for folder in ("houses", "mujoco", "raster"):
        assert re.search(rf" -e \S*plugins/{folder}\b", refused.value.remedy)


def test_plugins_lists_what_is_missing_with_its_install_line(monkeypatch):
    monkeypatch.setattr(distributions, "own", lambda: frozenset({"humanclaw-report", "humanclaw-ray"}))
    rows = json.loads(CliRunner().invoke(build(Plugins.discover), ["plugins", "--json"]).output)
    (missing,) = (row for row in rows if row["state"].startswith("not installed: pip install -e "))
    assert (missing["plugin"], missing["provides"]) == ("humanclaw-ray", "executor ray")
    assert missing["state"].endswith("/plugins/ray")


@pytest.mark.parametrize(
    ("direct_url", "published", "packages"),
    [
        ('{"dir_info": {"editable": true}, "url": "file:///ROOT"}', False, f"-e {ROOT}/plugins/bench"),
        ('{"dir_info": {"editable": true}, "url": "file:///ROOT"}', True, "humanclaw-bench"),
        ('{"archive_info": {}, "url": "file:///dist/humanclaw.whl"}', False, "--find-links dist humanclaw-bench"),
        (None, False, "--find-links dist humanclaw-bench"),
        (None, True, "humanclaw-bench"),
    ],
)
def test_the_installing_command_suits_how_the_core_was_installed(direct_url, published, packages, monkeypatch):
    class Installed:
        def read_text(self, name):
            return direct_url and direct_url.replace("/ROOT", ROOT.as_posix())

    monkeypatch.setattr(importlib.metadata, "distribution", lambda name: Installed())
    monkeypatch.setattr(distributions, "PUBLISHED", published)
    assert distributions.install(["humanclaw-bench"]) == f"pip install {packages}"


def test_pages_install_from_the_index_only_once_it_has_the_packages():
    """On the day of the release the constant changes, and this test names the pages to change."""
    names = "|".join(sorted(NAMES, key=len, reverse=True))
    early, late = rf'pip install "?(?:{names})(?![\w-])', r"pip install (?:-e \.|--find-links) "
    line = re.compile(late if distributions.PUBLISHED else early)
    assert [str(page) for page in pages() if line.search(page.read_text("utf-8"))] == []


@pytest.mark.parametrize(
    ("kind", "name", "remedy"),
    [
        ("scenes", "house", "plugins/houses`."),
        ("executors", "ray", "plugins/ray`."),
        ("simulators", "mujocco", "Did you mean mujoco (of humanclaw-mujoco)?"),
        ("renderers", "unheard-of", "raster (of humanclaw-raster)."),
    ],
)
def test_a_missing_name_is_answered_with_the_distribution_it_is_in(kind, name, remedy):
    with pytest.raises(PluginError) as refused:
        Plugins().require((kind, name))
    assert refused.value.message.startswith("there is no ")
    assert refused.value.remedy.endswith(remedy)


IMPORTED_AS = {
    "openenv": "openenv-core",
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
    required = {need.name.lower() for need in _requirements(PROJECTS[folder])}
    assert _imported(folder / PACKAGES[folder]) <= required | OPTIONAL | CARRIED


def test_every_skill_of_the_repository_is_in_the_table():
    schemas = ROOT.glob("skills/*/*/*/schema.json")
    assert {file.parent.name for file in schemas} <= distributions.table()["skills"].keys()


def test_the_newest_python_imports_what_the_demo_installs():
    lines = (ROOT / ".ci/run").read_text().splitlines()
    (line,) = (line for line in lines if "-newest/bin/python -m pytest" in line)
    named = [ROOT / word for word in line.split() if word.startswith("tests/")]
    files = [file for path in named for file in (path.rglob("*.py") if path.is_dir() else [path])]
    demo = {name.replace("-", "_") for name in DEMO}
    ours = {name for file in files for name in _at_the_top(file) if name.startswith("humanclaw_")}
    assert files
    assert ours <= demo


def _at_the_top(file: Path) -> set[str]:
    """The packages that a module imports as soon as it is loaded."""
    body = ast.parse(file.read_text("utf-8")).body
    plain = {alias.name for node in body if isinstance(node, ast.Import) for alias in node.names}
    return {name.partition(".")[0] for name in plain | {n.module or "" for n in body if isinstance(n, ast.ImportFrom)}}
