"""The code in the documentation: every fenced block of README and docs, and where it runs.

A comment right before a block names an exception to "in every test session", with the reason:

    <!-- snippet: slow. REASON -->        marked `evidence`
    <!-- snippet: elsewhere. REASON -->   another program runs it; REASON names the program
    <!-- snippet: never. REASON -->       not run; a test checks that its commands and options exist
    <!-- snippet: text. REASON -->        not code
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
WAYS = ("always", "slow", "elsewhere", "never", "text")
RUN_WHOLE = {"docs/tutorial-train.md": "tests/test_tutorial_train.py runs every command of the page"}
_FENCE = re.compile(
    r"(?:^<!-- snippet: (?P<way>\w+)[. ](?P<reason>[^\n]*?)-->\n)?^```(?P<language>\w*)\n(?P<code>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)

_SAVED = re.compile(r"[Ss]ave (?:it )?as `(\w+\.py)`")


@dataclass(frozen=True)
class Snippet:
    """One block. reason: why it does not run in every session."""

    page: str
    line: int
    language: str
    code: str
    way: str = "always"
    reason: str = ""
    file: str = ""
    """The file name under which the page says to save it."""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def pages() -> list[Path]:
    """Return the pages for users and authors of plugins; model cards hold no code."""
    parts = ("plugins", "skills", "harnesses", "examples")
    inside = [path for part in parts for depth in ("README.md", "*/README.md") for path in (ROOT / part).glob(depth)]
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted(inside)]


def snippets() -> Iterator[Snippet]:
    """Yield every fenced block of the pages in order, but for pages that another test runs whole."""
    for path in pages():
        if path.relative_to(ROOT).as_posix() in RUN_WHOLE:
            continue
        text = path.read_text("utf-8")
        for match in _FENCE.finditer(text):
            line = text[: match.start("code")].count("\n")
            way, reason = match["way"] or "always", (match["reason"] or "").strip()
            before = text[max(0, match.start() - 250) : match.start()].rpartition("```")[2]
            file = _SAVED.search(before) if match["language"] == "python" else None
            where = path.relative_to(ROOT).as_posix()
            yield Snippet(where, line, match["language"], match["code"], way, reason, file[1] if file else "")
