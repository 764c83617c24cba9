"""Check what links and lists the pages of the repository: `make lint`. It imports nothing of ours."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
LETTERS = 60
"""Most letters of the sentence after `test_`."""


def contents() -> Iterator[str]:
    """Yield pages of the site that mkdocs.yml does not list."""
    listed = (ROOT / "mkdocs.yml").read_text("utf-8")
    for path in sorted((ROOT / "docs").rglob("*.md")):
        if (page := path.relative_to(ROOT / "docs").as_posix()) not in listed:
            yield f"docs/{page} is not in mkdocs.yml. Add it."


def links() -> Iterator[str]:
    """Yield links between pages that lead nowhere."""
    pages = [ROOT / "README.md", *ROOT.glob("*/README.md"), *ROOT.glob("[phs]*/*/README.md")]
    for page in [*pages, *sorted((ROOT / "docs").rglob("*.md"))]:
        for target in re.findall(r"\]\((?!https?://|#)([^)#\s]+)", page.read_text("utf-8")):
            if not (page.parent / target).exists():
                yield f"{page.relative_to(ROOT)} links to {target}, which is not there."


def readme() -> Iterator[str]:
    """Yield a fault if README has 900 words or more, comments not counted."""
    text = re.sub(r"<!--.*?-->", "", (ROOT / "README.md").read_text("utf-8"), flags=re.DOTALL)
    if (words := len(text.split())) >= 900:
        yield f"README.md has {words} words; at most 899. Move some to docs/."


def paper() -> Iterator[str]:
    """Yield items of the paper without a place in the code or a check, and sections that one page alone tells of."""
    text = (ROOT / "docs/paper-items.md").read_text("utf-8")
    items = re.findall(r"^\* ([\d., AB]+): (.*): (`.*)$", text, re.MULTILINE)
    for _, item, places in items:
        files = [word for word in re.findall(r"`([^`]+)`", places) if not word.startswith("humanclaw ")]
        if not files:
            yield f"docs/paper-items.md: {item} names no file."
        yield from (f"docs/paper-items.md: there is no {file}." for file in files if not (ROOT / file).is_file())
    rows = re.findall(r"^[|*] ([\d., AB]+)(?: \||:)", (ROOT / "docs/paper.md").read_text("utf-8"), re.MULTILINE)
    written = {section for row in rows for section in row.split(", ")}
    for section in sorted({section for section, item, *_ in items if re.search(r"\*\*(differs|open)", item)} - written):
        yield f"docs/paper.md lacks section {section}, which docs/paper-items.md calls different or open."
    for section in sorted(written - {section for section, *_ in items}):
        yield f"docs/paper-items.md lacks section {section} of docs/paper.md."


def tests() -> list[Path]:
    """Return the files of tests, the conformance suites of `humanclaw.testing` among them."""
    tests, of_packages = ROOT.glob("tests/**/test_*.py"), ROOT.glob("[phs]*/*/tests/**/test_*.py")
    return [*tests, *of_packages, *ROOT.glob("core/humanclaw/testing/*.py")]


def libraries() -> Iterator[str]:
    """Yield libraries without which a test is skipped, and which neither the lock nor the Makefile names."""
    installed = "".join((ROOT / name).read_text("utf-8").lower() for name in ("requirements-lock.txt", "Makefile"))
    skip = re.compile(r"^(?=.*skip).*(?:importorskip|find_spec)\(\"(?:humanclaw_)?(\w+)", re.MULTILINE)
    for file in [*tests(), *ROOT.glob("tests/support/*.py")]:
        for name in skip.findall(file.read_text("utf-8")):
            if not re.search(rf"\b{name.lower().replace('_', '.')}\b", installed):
                yield f"{file.relative_to(ROOT)}: `make optional` does not install {name}, so no command runs the test."


def names() -> Iterator[str]:
    """Yield names of tests that are too long to be read at a glance."""
    for file in tests():
        for name in re.findall(r"^ *(?:async )?def test_(\w+)", file.read_text("utf-8"), re.M):
            if len(name) > LETTERS:
                yield f"{file.relative_to(ROOT)}: {name} has {len(name)} letters; at most {LETTERS}."


def main() -> int:
    faults = [fault for check in (contents, links, readme, paper, libraries, names) for fault in check()]
    print(*faults, sep="\n", end="\n" if faults else "")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
