"""A house is generated once. Afterwards the cache returns the same bytes; a damaged cache entry is generated again."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import humanclaw
import humanclaw_houses
from humanclaw import Scene
from humanclaw_houses import reference
from humanclaw_houses.reference import open_house
from humanclaw_houses.source import house

pytestmark = pytest.mark.integration


@pytest.fixture(scope="module")
def fresh() -> Scene:
    return house("2")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path))
    return tmp_path / "houses"


def refuse() -> Scene:
    raise AssertionError("the house was generated although it is in the cache")


def test_a_house_from_the_cache_has_the_digest_of_a_fresh_one(folder: Path, fresh: Scene) -> None:
    assert reference.kept("2", lambda: fresh) is fresh
    again = reference.kept("2", refuse)
    assert again is not fresh
    assert again.digest == fresh.digest
    assert again.objects == fresh.objects
    assert again.licences == fresh.licences


def test_the_reference_opens_what_the_generator_makes(folder: Path, fresh: Scene) -> None:
    assert open_house("2").digest == fresh.digest
    assert open_house("2").name == "house:2"
    assert len(list(folder.iterdir())) == 1


def test_another_generator_never_gets_a_stale_house(
    folder: Path, fresh: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    reference.kept("2", lambda: fresh)
    monkeypatch.setattr(reference, "generator_version", lambda: "another")
    assert reference.kept("2", lambda: fresh) is fresh


@pytest.fixture
def copies(tmp_path: Path) -> Path:
    """A folder with copies of the core and of this plugin, to be changed."""
    for package in (humanclaw, humanclaw_houses):
        source = Path(package.__file__).parent
        shutil.copytree(source, tmp_path / source.name, ignore=shutil.ignore_patterns("*.safetensors", "__pycache__"))
    return tmp_path


@pytest.mark.parametrize(
    "changed", ["humanclaw_houses/plan.py", "humanclaw/world/navigation/occupancy.py", "humanclaw/world/scene.py"]
)
def test_a_change_of_what_shapes_a_house_is_another_generator(copies: Path, changed: str) -> None:
    before = version_of(copies)
    with (copies / changed).open("a") as stream:
        stream.write("\n# another thought\n")
    assert before == reference.generator_version()
    assert version_of(copies) != before


@pytest.mark.parametrize("changed", ["episodes/loop.py", "plugins/host.py", "motion/generator.py"])
def test_a_change_elsewhere_in_the_core_leaves_houses_in_the_cache(copies: Path, changed: str) -> None:
    with (copies / "humanclaw" / changed).open("a") as stream:
        stream.write("\n# another thought\n")
    assert version_of(copies) == reference.generator_version()


def version_of(copies: Path) -> str:
    code = "from humanclaw_houses import reference; print(reference.generator_version())"
    paths = os.pathsep.join([str(copies), *sys.path])
    return subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(copies)!r}); {code}"],
        capture_output=True, text=True, check=True, env={**os.environ, "PYTHONPATH": paths},
    ).stdout.strip()  # fmt: skip


def test_two_processes_may_fill_the_cache_at_once(folder: Path, fresh: Scene) -> None:
    context = multiprocessing.get_context("fork")
    workers = [context.Process(target=_open_often, args=(fresh,)) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert [worker.exitcode for worker in workers] == [0, 0, 0]
    assert [path.name for path in folder.iterdir() if path.suffix == ".partial"] == []
    assert reference.kept("2", refuse).digest == fresh.digest


def _open_often(fresh: Scene) -> None:
    warnings.simplefilter("error")
    for _ in range(5):
        reference.Cache("houses").put("same", reference.pack_scene(fresh))
        assert reference.kept("2", lambda: fresh).digest == fresh.digest


def test_the_second_time_takes_less_than_half_as_long(folder: Path) -> None:
    """Measure CPU time of a new process, what the house imports included."""
    code = (
        "import time; from humanclaw import Plugins; plugins = Plugins.discover(); began = time.process_time(); "
        "plugins.scene('house:2').digest; print(time.process_time() - began)"
    )
    taken = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(2)
    ]
    assert taken[1] < taken[0] / 2, taken


def test_a_cache_that_cannot_be_written_only_warns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fresh: Scene
) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("HUMANCLAW_CACHE", str(tmp_path / "file"))
    with pytest.warns(UserWarning, match="HUMANCLAW_CACHE"):
        assert reference.kept("2", lambda: fresh) is fresh
