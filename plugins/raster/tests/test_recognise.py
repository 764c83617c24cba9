"""Recognition: what counts as a hit and as a false box, and that any detector program is asked."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

_PATH = Path(__file__).parents[1] / "recognise" / "recognise.py"
_SPEC = importlib.util.spec_from_file_location("recognise", _PATH)
recognise = importlib.util.module_from_spec(_SPEC)
sys.modules["recognise"] = recognise  # Its dataclasses look themselves up there.
_SPEC.loader.exec_module(recognise)

SEES_A_COUCH = """
import sys
while len(picture := sys.stdin.buffer.read(512 * 512 * 3)) == 512 * 512 * 3:
    print(f'[[0, 0, {picture[0]}, 100, 0.5, "couch"]]', flush=True)
"""


def _target(category: str, box: tuple[float, float, float, float]):
    return recognise.Target(category, box, True, 0.1)


def test_a_box_that_covers_30_percent_of_the_common_area_is_a_hit():
    couch = _target("couch", (0, 0, 100, 100))
    assert recognise.score(couch, [(0, 0, 31, 100, 0.7, "couch"), (0, 0, 29, 100, 0.9, "couch")]) == 0.7
    assert recognise.score(couch, [(0, 0, 100, 100, 0.9, "chair")]) == 0.0


def test_a_sure_box_without_an_object_of_its_class_is_false():
    seen = [_target("potted_plant", (0, 0, 100, 100)), _target("bed", (200, 200, 300, 300))]
    hit, doubtful, other = (0, 0, 90, 90, 0.4, "potted plant"), (300, 0, 400, 90, 0.29, "tv"), (0, 0, 9, 9, 0.9, "cup")
    wrong_class, nowhere = (200, 200, 300, 300, 0.3, "couch"), (400, 400, 500, 500, 0.8, "bed")
    assert recognise.false_boxes(seen, [hit, doubtful, other]) == 0
    assert recognise.false_boxes(seen, [hit, wrong_class, nowhere]) == 2


@pytest.mark.integration
def test_a_detector_is_a_program_that_answers_every_picture():
    pictures = [np.full((512, 512, 3), bright, np.uint8) for bright in (50, 80)]
    boxes = recognise.detected(pictures, [sys.executable, "-c", SEES_A_COUCH])
    assert [[box[2] for box in seen] for seen in boxes] == [[50], [80]]
