"""Skills know themselves; nothing else knows skills: no name of a skill occurs in the core or in a plugin."""

import re
from pathlib import Path

from humanclaw.skills import ROLES

ROOT = Path(__file__).parents[1]
MAY = {
    "core/humanclaw/plugins/distributions.toml": "says which distribution brings what, so that an error can name it",
    "core/humanclaw/motion/weights/fidelity.json": "is a measurement of the shipped skills, read by whatever names it "
    "holds",
}
"""Files that name skills, and why they may."""
KINDS = (".py", ".js", ".jinja", ".j2", ".html", ".toml", ".json")


def test_no_name_of_a_skill_occurs_in_the_core_or_in_a_plugin(plugins):
    """A name that is an English word counts in quotes alone, and `stop` not at all: it is a role too."""
    names = set(plugins.skills) - set(ROLES)
    assert {"walk", "sit_in_place"} <= names
    named = re.compile("|".join(rf"\b{name}\b" if "_" in name else rf"""["']{name}["']""" for name in names))
    files = [path for part in ("core", "plugins") for path in (ROOT / part).rglob("*") if path.suffix in KINDS]
    own = {path.relative_to(ROOT) for path in files if named.search(path.read_text("utf-8"))}
    assert {path.as_posix() for path in own if "tests" not in path.parts} == set(MAY)
