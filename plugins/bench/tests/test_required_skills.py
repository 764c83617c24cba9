"""A run whose tasks nobody can solve with the skills at hand is refused before it is played."""

from importlib.metadata import entry_points
from pathlib import Path

import pytest
from click.testing import CliRunner

import humanclaw_skill_answer
import humanclaw_skill_hands
import humanclaw_skill_say
from humanclaw import Choice, PluginError, Plugins
from humanclaw_bench.cli import bench
from humanclaw_bench.required_skills import require_skills
from humanclaw_bench.splits import load_split

INSTALLED = {entry.value for entry in entry_points(group="humanclaw")}
MODULES = (humanclaw_skill_answer, humanclaw_skill_hands, humanclaw_skill_say)
FILES = [Path(module.__file__) for module in MODULES if module.__name__ not in INSTALLED]
FEW = ("walk", "turn_in_place", "stop")


@pytest.mark.skipif(len(FILES) < len(MODULES), reason="some of the skills are installed here")
@pytest.mark.parametrize(
    ("split", "names", "folders"),
    [
        ("smoke-hands", ("grasp", "release", "answer"), {"hands", "handle", "gaze", "crouch", "answer"}),
        ("self", ("answer",), {"hands", "gaze", "answer"}),
        ("two", ("say", "grasp"), {"hands", "say"}),
    ],
)
def test_one_line_installs_the_skills_that_the_tasks_need(tmp_path, split, names, folders):
    result = CliRunner().invoke(bench, ["run", "--split", split, "--agent", "random", "--out", str(tmp_path / "run")])
    assert isinstance(result.exception, PluginError)
    message, remedy = result.exception.message, result.exception.remedy
    assert message.startswith("these episodes cannot be solved: ")
    assert all(f"skill {name!r}" in message for name in names)
    command = remedy.removeprefix("Run `pip install ").removesuffix("`.").split()
    assert {word.rpartition("/")[2].removeprefix("humanclaw-skill-") for word in command} - {"-e"} >= folders
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("split", "needed"),
    [("hands", "grasp, release, answer"), ("self", "answer"), ("two", "say, reach, grasp, release")],
)
def test_a_choice_of_skills_that_leaves_out_a_needed_one_is_refused(split, needed):
    with pytest.raises(PluginError, match=rf"needs {needed}\. Name that in --skills, too\."):
        require_skills(load_split(split), Plugins.discover(FILES, Choice(skills=FEW)))


def test_a_task_can_be_played_without_what_merely_helps():
    """Of tasks for hands a body can solve some that neither crouches nor pulls; walking tasks need no hand at all."""
    armed = Plugins.discover(FILES, Choice(skills=(*FEW, "reach", "grasp", "release", "answer")))
    for split in ("hands", "self"):
        require_skills(load_split(split), armed)
    require_skills(load_split("mini"), Plugins.discover(choice=Choice(skills=FEW)))


def test_what_a_function_finds_a_success_needs_no_skill():
    specs = [spec.model_copy(update={"success": "mine"}) for spec in load_split("smoke-hands")]
    require_skills(specs, Plugins.discover(choice=Choice(skills=FEW)))
