"""Questions about oneself: an extension of the benchmark, apart from the paper's split. Needs the extra `hands`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

KNOWLEDGE: Final[Mapping[str, str]] = {
    "hand": "whose body a limb belongs to",
    "mirror": "whether an image is of oneself",
    "moved": "whether an action had its effect",
    "turned": "how far the body has turned",
    "touch": "where something touches the body",
    "fit": "what the body's size allows",
}
"""The kinds of questions, and the knowledge that each asks for."""
STAGE: Final = "self_"
"""Begins the name that a kind has among the stages of a score."""
