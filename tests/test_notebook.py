"""What a record shows of itself in a notebook."""

from __future__ import annotations

import base64
import re
from pathlib import Path
from typing import Any

import pytest
from made import picture, record_episode

from humanclaw import RecordedEpisode, load_run
from humanclaw.text.notebook import ROWS, card, spread


def test_a_record_shows_its_task_its_end_and_its_views(tmp_path: Path) -> None:
    record_episode(tmp_path, instruction="<b>find</b> a couch")
    shown = RecordedEpisode(tmp_path)._repr_html_()
    assert "&lt;b&gt;find&lt;/b&gt; a couch" in shown
    assert f"stopped after {len(RecordedEpisode(tmp_path).steps)} steps" in shown
    assert base64.b64encode(picture(0)).decode() in shown
    assert shown.count("<img") == 8


def test_a_strip_has_the_first_and_the_last_picture() -> None:
    assert spread(3, 8) == [0, 1, 2]
    assert spread(15, 8) == [0, 2, 4, 6, 8, 10, 12, 14]


def test_a_card_without_pictures_is_words_alone() -> None:
    assert card("Body", ["one", ""]) == "<div><strong>Body</strong><div>one</div></div>"


def test_a_run_shows_how_its_episodes_ended_and_a_line_for_each(tmp_path: Path) -> None:
    for name in ("couch-0", "couch-1"):
        record_episode(tmp_path / name, name=name, instruction="<b>find</b> a couch")
    run = load_run(tmp_path)
    shown = run._repr_html_()
    assert "<strong>2 episodes: 2 stopped</strong>" in shown
    assert "&lt;b&gt;find&lt;/b&gt; a couch" in shown
    last = run[1].steps[-1].target_distance
    assert last is not None
    for cell in ("couch-0", "couch-1", str(len(run[0].steps)), f"{last:.2f} m"):
        assert f">{cell}</td>" in shown
    assert shown.count("<tr>") == 3
    run *= 20
    assert run._repr_html_().count("<tr>") == ROWS + 1
    assert "and 20 more" in run._repr_html_()


def test_a_run_of_one_episode_is_told_in_the_singular(tmp_path: Path) -> None:
    record_episode(tmp_path / "couch-0")
    assert "1 episode: 1 stopped" in load_run(tmp_path)._repr_html_()


def outputs(notebook: Any) -> list[str]:
    """What each cell with an output shows, without its pictures and numbers: those are of a platform."""
    shown = [out.data["text/html"] for cell in notebook.cells for out in cell.get("outputs", ())]
    return [re.sub(r"[\d.]+", "0", re.sub(r"base64,[^\"]+", "", html)) for html in shown]


@pytest.mark.integration
def test_the_notebook_of_the_examples_shows_what_executing_it_shows() -> None:
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel")
    notebook = pytest.importorskip("notebook", reason="nbclient is not installed")
    kept = nbformat.read(notebook.NOTEBOOK, as_version=4)
    assert outputs(kept) == outputs(notebook.executed())
    assert [html.partition("</strong>")[0] for html in outputs(kept)] == [
        "<div><strong>Body in house:0, step 0",
        "<div><strong>Body in house:0, step 0",
        "<div><strong>0 episodes: 0 out of steps",
        "<div><strong>Episode free-0",
    ]


def test_the_notebook_of_the_examples_is_small_and_names_no_folder() -> None:
    text = (Path(__file__).parents[1] / "examples" / "notebook.ipynb").read_text("utf-8")
    assert len(text) < 700_000
    words = re.sub(r"base64,[A-Za-z0-9+/=]+", "", text)
    assert not re.findall(r"/(?:tmp|home|root|work|Users)/", words)
