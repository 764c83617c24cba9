"""The cache of what can be computed again."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import pytest

from humanclaw.storage import Cache, source_digest


def test_what_is_put_under_a_key_is_what_comes_back(tmp_path: Path) -> None:
    cache = Cache("things", root=tmp_path)
    assert cache.get("a") is None
    cache.put("a", b"first")
    cache.put("a", b"second")
    assert Cache("things", root=tmp_path).get("a") == b"second"
    assert Cache("others", root=tmp_path).get("a") is None


def test_the_environment_says_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path))
    assert Cache("things").folder == tmp_path / "things"


def test_a_full_cache_lets_go_of_what_was_not_asked_for_longest(tmp_path: Path) -> None:
    cache = Cache("things", limit=300, root=tmp_path)
    for age, key in ((30, "old"), (20, "asked"), (10, "young")):
        cache.put(key, bytes(50))
        os.utime(cache.folder / key, (1e9 - age, 1e9 - age))
    assert cache.get("asked") is not None
    cache.put("new", bytes(100))
    assert [key for key in ("old", "asked", "young", "new") if cache.get(key)] == ["asked", "young", "new"]


def test_a_thing_larger_than_the_cache_is_kept_alone(tmp_path: Path) -> None:
    cache = Cache("things", limit=100, root=tmp_path)
    cache.put("small", bytes(10))
    cache.put("large", bytes(1000))
    assert cache.get("small") is None
    assert cache.get("large") == bytes(1000)


def test_two_that_make_room_at_once_do_not_warn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = (Cache("things", limit=200, root=tmp_path) for _ in range(2))
    synced = os.fsync

    def meanwhile(descriptor: int) -> None:
        monkeypatch.undo()
        second.put("b", bytes(200))
        synced(descriptor)

    monkeypatch.setattr("humanclaw.storage.files.os.fsync", meanwhile)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        first.put("a", bytes(100))
    assert (first.get("a"), first.get("b")) == (None, bytes(200))


@pytest.mark.parametrize(
    "damage", [lambda data: data[:-1], lambda data: data + b"x", lambda data: b"", lambda data: data[:7]]
)
def test_a_damaged_file_is_named_and_removed(tmp_path: Path, damage) -> None:  # type: ignore[no-untyped-def]
    cache = Cache("things", root=tmp_path)
    cache.put("a", b"something")
    path = cache.folder / "a"
    path.write_bytes(damage(path.read_bytes()))
    with pytest.warns(UserWarning, match=str(path)):
        assert cache.get("a") is None
    assert not path.exists()


@pytest.mark.parametrize("key", ["", "../a", "a/b", "a" * 151])
def test_a_key_cannot_leave_the_folder(tmp_path: Path, key: str) -> None:
    with pytest.raises(ValueError, match="cache key"):
        Cache("things", root=tmp_path).get(key)


def test_code_changed_since_the_process_began_shares_no_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    digests = {}
    for name, changed in (("before", 0.0), ("since", 4e9)):
        source = tmp_path / name / "__init__.py"
        source.parent.mkdir()
        source.touch()
        os.utime(source, (changed, changed))
        digests[name] = [source_digest.__wrapped__((name,)) for _ in range(2)]
    assert len(set(digests["before"])) == 1
    assert len(set(digests["since"])) == 2
