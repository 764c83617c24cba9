"""What a record shows of itself in a notebook."""

from __future__ import annotations

import base64
from pathlib import Path

from made import picture, record_episode

from humanclaw import RecordedEpisode
from humanclaw._notebook import card, spread


def test_a_record_shows_its_task_its_end_and_its_views(tmp_path: Path) -> None:
    record_episode(tmp_path, instruction="<b>find</b> a couch")
    shown = RecordedEpisode(tmp_path)._repr_html_()
    assert "&lt;b&gt;find&lt;/b&gt; a couch" in shown
    assert f"stopped after {len(RecordedEpisode(tmp_path).steps)} steps" in shown
    assert base64.b64encode(picture(0)).decode() in shown
    assert shown.count("<img") == 8


def test_a_strip_has_the_first_and_the_last_picture_and_no_more_than_asked() -> None:
    assert spread(3, 8) == [0, 1, 2]
    assert spread(15, 8) == [0, 2, 4, 6, 8, 10, 12, 14]


def test_a_card_without_pictures_is_words_alone() -> None:
    assert card("Body", ["one", ""]) == "<div><strong>Body</strong><div>one</div></div>"
