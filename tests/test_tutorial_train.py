"""Every command of docs/tutorial-train.md, as it stands there: pytest -m evidence tests/test_tutorial_train.py

HUMANCLAW_TUTORIAL_DATA: a `.data` folder of an earlier run, whose training is gone on with.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from environments import like_this

PAGE = Path(__file__).parents[1] / "docs" / "tutorial-train.md"
SKILL = Path("humanclaw-skill-squat/humanclaw_skill_squat/squat")


def commands() -> list[str]:
    blocks = re.findall(r"```console\n(.*?)```", PAGE.read_text("utf-8"), re.S)
    return [line.removeprefix("$ ") for block in blocks for line in block.splitlines()]


def test_the_page_leads_from_a_distribution_to_a_wheel():
    text = " ".join(commands())
    steps = "humanclaw play, humanclaw new, data chunks, train adapter, fidelity, cards, pip wheel, humanclaw skills"
    for step in steps.split(", "):
        assert step in text


@pytest.mark.evidence
def test_every_command_of_the_page_does_what_the_page_says(tmp_path):
    environment = like_this(tmp_path / "environment")
    (tmp_path / "skills").symlink_to(PAGE.parents[1] / "skills")
    folder, output = tmp_path, ""
    for command in commands()[1:]:  # Of the first one this environment is the result.
        if command.startswith("cd "):
            folder = folder / command[3:]
            if earlier := os.environ.get("HUMANCLAW_TUTORIAL_DATA"):
                shutil.copytree(earlier, folder / ".data")
            continue
        done = subprocess.run(command, shell=True, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
        assert done.returncode == 0, f"{command}\n{done.stdout}"
        output = done.stdout
    assert '"squat"' in output
    (row,) = json.loads((tmp_path / SKILL / "fidelity.json").read_text())["rows"]
    assert abs(row["generated"]["mean"] - 1) < 0.05
    assert row["generated"]["std"] < 0.06
    assert row["generated"]["error"] < 3.0
    assert f"{row['generated']['mean']:.3f}" in (tmp_path / SKILL / "README.md").read_text()
