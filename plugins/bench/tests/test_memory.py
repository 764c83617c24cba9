"""A process that plays episodes in many houses frees the memory of each house when it leaves."""

import weakref
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toy_world
from engines import needs_bullet

from humanclaw import Backends, Plugins
from humanclaw.testing import resident
from humanclaw_bench.worker import Job, Worker

BALLAST = np.zeros((1600, 1600, 3), np.uint8)
"""A texture of 7.3 MB, so that a house weighs as much as those of the benchmark."""


@pytest.fixture
def houses(monkeypatch):
    """Plugins whose toy houses are heavy, and what is left of every house that they made."""
    plugins, made = Plugins.discover([Path(toy_world.FILE)]), []
    bare = plugins.scene

    def heavy(reference):
        scene = bare(reference)
        assets = {
            name: replace(asset, mesh=replace(asset.mesh, texture=BALLAST.copy())) if name == "ground" else asset
            for name, asset in scene.assets.items()
        }
        scene = replace(scene, assets=assets)
        made.append(weakref.ref(scene))
        return scene

    monkeypatch.setattr(plugins, "scene", heavy)
    return plugins, made


@needs_bullet
@pytest.mark.parametrize("agent", ["oracle", "still"])
def test_nothing_is_left_of_a_house_when_the_body_has_moved_on(houses, tmp_path, agent):
    """Neither the house itself, which would show at once, nor what an engine keeps of it out of Python's sight."""
    (plugins, made), memory = houses, []
    job = Job(agent, backends=Backends("bullet", "raster", "toy"), files=(toy_world.FILE,))
    with Worker(job, tmp_path, plugins=plugins) as worker:
        for spec in toy_world.specs(14, houses=14, steps=2):
            report = worker.play(spec)
            assert report.outcome in ("stopped", "out_of_steps"), report.error
            assert sum(house() is not None for house in made) == 1
            memory.append(resident())
    assert len(made) == 14
    assert memory[-1] - memory[5] < 30  # Of 8 houses; each has 7 MB, and 10 more in the renderer.
