"""Skills know themselves; nothing else knows skills: no name of a skill occurs in the core or in a plugin."""

import ast
import re
from pathlib import Path

from humanclaw.skills import ROLES

ROOT = Path(__file__).parents[1]


def _names(plugins) -> set[str]:
    """`stop` is the name of a role as well, and of much else: a comparison with it is one of roles."""
    return set(plugins.skills) - set(ROLES)


def _code(path: Path):
    """The texts and identifiers of a module, but for its docstrings."""
    tree = ast.parse(path.read_text("utf-8"))
    told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told:
            yield node.lineno, node.value
        elif isinstance(node, ast.Name | ast.Attribute | ast.arg | ast.keyword):
            words = (getattr(node, key, None) for key in ("id", "attr", "arg"))
            yield getattr(node, "lineno", 0), next((word for word in words if isinstance(word, str)), "")


def _mentions(text: str, names: set[str]) -> bool:
    """Whole words for names of several words; a name that is an English word counts where it stands alone."""
    return text in names or any("_" in name and re.search(rf"\b{name}\b", text) for name in names)


def test_no_name_of_a_skill_occurs_in_the_core_or_in_a_plugin(plugins):
    names, found = _names(plugins), []
    assert {"walk", "sit_in_place"} <= names
    for folder in (ROOT / "core", ROOT / "plugins"):
        for path in folder.rglob("*.py"):
            inside = path.relative_to(ROOT).as_posix()
            if "/tests/" in inside or "/.venv/" in inside:
                continue
            # `ast.walk`, `chart.walk`: a method is no skill, a text is.
            found += [
                f"{inside}:{line} {text}"
                for line, text in _code(path)
                if _mentions(text, names - {"walk"}) or (text == "walk" and _is_text(path, line))
            ]
    assert found == []


def _is_text(path: Path, line: int) -> bool:
    return bool(re.search(r"""["']walk["']""", path.read_text("utf-8").splitlines()[line - 1]))


def test_no_name_of_a_skill_occurs_in_a_template(plugins):
    """Templates speak to readers, who may walk; a name of several words is a skill's."""
    names = {name for name in _names(plugins) if "_" in name}
    templates = [path for kind in ("jinja", "j2", "html") for path in ROOT.glob(f"[cp]*/**/*.{kind}")]
    assert [path.name for path in templates if any(name in path.read_text("utf-8") for name in names)] == []


TABLES = {
    "core/humanclaw/plugins/distributions.toml": "says which distribution brings what, so that an error can name it",
    "core/humanclaw/motion/weights/fidelity.json": "is a measurement of the shipped skills, read by whatever names it "
    "holds",
}
"""Files of data that name skills, and why they may."""


def _tables() -> set[str]:
    found = {path.relative_to(ROOT) for kind in ("toml", "json") for path in ROOT.glob(f"[cp]*/**/*.{kind}")}
    return {path.as_posix() for path in found if path.parts[0] in ("core", "plugins") and "tests" not in path.parts}


def test_no_name_of_a_skill_occurs_in_a_table_but_those(plugins):
    quoted = re.compile("|".join(rf"""["']{name}["']|^{name}\s*=""" for name in sorted(_names(plugins))), re.MULTILINE)
    names = re.compile("|".join(rf"\b{name}\b" for name in sorted(_names(plugins)) if "_" in name))
    texts = {path: (ROOT / path).read_text("utf-8") for path in _tables()}
    assert {path for path, text in texts.items() if quoted.search(text) or names.search(text)} == set(TABLES)
