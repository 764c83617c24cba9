"""The budget of size.toml: what is counted, and what exceeds it."""

import pytest
import size


@pytest.mark.parametrize(
    ("path", "package", "kind"),
    [
        ("README.md", ".", "words"),
        ("core/humanclaw/errors.py", "core", "code"),
        ("plugins/raster/tests/test_a.py", "plugins/raster", "tests"),
        ("plugins/README.md", "plugins", "words"),
        ("tests/support/size.py", "tests", "tests"),
        ("tests/support/model_servers/replies.toml", "tests", "tests"),
        ("plugins/report/humanclaw_report/scripts/run.js", "plugins/report", "code"),
        ("plugins/raster/pyproject.toml", "plugins/raster", ""),
        ("docs/images/skills.jpg", "docs", ""),
    ],
)
def test_a_file_is_counted_once_in_its_package(path, package, kind):
    assert (size.package(path), size.kind(path)) == (package, kind)


def test_lines_and_words_are_counted_by_package(tmp_path):
    (tmp_path / "core").mkdir()
    (tmp_path / "core/a.py").write_text("a = 1\n\nb = 2\n")
    (tmp_path / "core/A.md").write_text("two words\n")
    assert size.measure(tmp_path, ["core/a.py", "core/A.md"]) == {"core": {"code": 3, "words": 2}}


def test_one_line_more_than_the_budget_is_a_fault():
    budget = {"core": {"code": 3}}
    assert size.faults({"core": {"code": 3}}, budget) == []
    assert size.faults({"core": {"code": 4}}, budget) == ["core: code 4 exceeds the budget of 3."]


def test_a_package_stands_in_the_budget_and_in_the_tree():
    assert size.faults({"core": {}}, {}) == ["core has no budget. Add it to size.toml."]
    assert size.faults({}, {"core": {}}) == ["core of size.toml has no files. Remove it."]
