"""The tutorial and the how-tos, each executed from top to bottom in an empty folder and a new environment.

The how-tos play whole episodes: pytest -m evidence tests/test_pages_whole.py
"""

import re
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from environments import like_this
from snippets import ROOT, Snippet, snippets

from humanclaw import load_run
from humanclaw.body import JOINT_INDEX

HOW_TOS = sorted(f"docs/howto/{path.name}" for path in (ROOT / "docs/howto").glob("*.md"))
SAID = re.compile(r"print\(.*\)  # (.+)$", re.MULTILINE)


@pytest.fixture
def follow(tmp_path):
    """Return a function that executes the blocks of a page in order and returns the folder."""
    environment = like_this(tmp_path / "environment")

    def follow(page: str) -> Path:
        folder = tmp_path / "project"
        folder.mkdir()
        for block in (snippet for snippet in snippets() if snippet.page == page and snippet.way in ("always", "slow")):
            said = _execute(block, folder, environment)
            assert [line for line in SAID.findall(block.code) if _promised(line) not in said] == [], said
        return folder

    return follow


def _execute(block: Snippet, folder: Path, environment: dict[str, str]) -> str:
    """Save a block under the name that the page gives it, or run it; return its output."""
    if block.language == "toml":
        (folder / "pyproject.toml").write_text(block.code)
        return ""
    if block.language == "python":
        command = ["python", block.file or "block.py"]
        (folder / command[1]).write_text(block.code)
    else:
        command = ["bash", "-ec", block.code]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{block}\n{done.stdout}{done.stderr}"
    return done.stdout


def _promised(comment: str) -> str:
    """Return what a comment beside `print` says will be printed, without an explanation after a colon or dots."""
    return re.split(r": [a-z]| \.\.\.", comment)[0]


@pytest.mark.integration
def test_the_tutorial_leads_from_nothing_to_a_skill_that_nods(follow):
    folder = follow("docs/tutorial.md")
    (episode,) = load_run(folder / "runs/nod")
    assert [str(step.call) for step in episode.steps] == ["nod(times=2)"]
    head = np.degrees(episode.motion("generated").rotations[:, JOINT_INDEX["head"], 0])
    assert _peaks(head - head[0]) == pytest.approx([20, 20], abs=1)
    hair = (_frames(episode.folder / "film.mp4").sum(-1) < 90).sum((1, 2))  # A bowed head shows more of its dark top.
    assert len(_peaks(hair - hair[0])) == 2


def _frames(film: Path) -> np.ndarray:
    frames = imageio_ffmpeg.read_frames(str(film))
    width, height = next(frames)["size"]
    return np.array([np.frombuffer(frame, np.uint8).reshape(height, width, 3) for frame in frames], np.int16)


def _peaks(values: np.ndarray) -> np.ndarray:
    """Return the local maxima above half of the greatest value."""
    inner = values[1:-1]
    return inner[(inner >= values[:-2]) & (inner > values[2:]) & (inner > values.max() / 2)]


@pytest.mark.evidence
@pytest.mark.parametrize("page", HOW_TOS)
def test_a_how_to_can_be_followed(follow, page):
    follow(page)
