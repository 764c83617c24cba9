"""A run on a cluster leaves the same files as a run on one machine, even if nodes die."""

import os
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import pytest

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install humanclaw-ray")
pytest.importorskip("humanclaw_ray", reason="humanclaw-ray is not installed: pip install -e plugins/ray")

import toy_world  # noqa: E402
from ray.cluster_utils import Cluster  # noqa: E402
from ray.exceptions import OutOfMemoryError, RpcError  # noqa: E402

import humanclaw_ray  # noqa: E402
from humanclaw import Backends, Plugins, load_run  # noqa: E402
from humanclaw_bench.runner import run_split  # noqa: E402
from humanclaw_bench.worker import Job  # noqa: E402
from humanclaw_ray.executor import LIVES  # noqa: E402

pytestmark = pytest.mark.integration
TOY = Backends("toy", "toy", "toy")


@pytest.fixture
def cluster(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))  # Actors import the toy world too.
    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 0})
    made.nodes = [made.add_node(num_cpus=1) for _ in range(2)]
    ray.init(address=made.address, log_to_driver=False)
    made.wait_for_nodes()
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture
def play(tmp_path):
    def run(specs, executor, name, watch=lambda *_: None, in_process=False, **options):
        plugins = Plugins.discover([Path(toy_world.FILE)])
        if "ray" not in {offer.name for offer in plugins.registered("executors")}:
            plugins.add(humanclaw_ray, "ray")
        job = Job("walker", options, backends=TOY, files=(toy_world.FILE,), in_process=in_process)
        player = plugins.make("executors", executor, 2)
        return run_split(specs, job, player, tmp_path / name, plugins=plugins, watch=watch)

    return run


def folders():
    return set(Path(tempfile.gettempdir()).glob("humanclaw-*"))


def digests(folder):
    return {episode.record.spec.id: episode.digest for episode in load_run(folder)}


def test_a_node_that_is_killed_half_way_loses_and_doubles_nothing(cluster, play, tmp_path):
    specs, ids = toy_world.specs(8), []

    def watch(status, report):
        if report:
            ids.append(report.episode)
        if len(ids) == 3 and len(cluster.nodes) == 2:
            cluster.remove_node(cluster.nodes.pop(), allow_graceful=False)

    status = play(specs, "ray", "ray", watch, pause=0.3)
    assert len(cluster.nodes) == 1
    assert (status.done, status.failed) == (8, 0)
    assert sorted(ids) == sorted(spec.id for spec in specs)
    play(specs, "local", "local", pause=0.3)
    assert digests(tmp_path / "ray") == digests(tmp_path / "local")


def test_an_actor_stays_in_the_house_that_it_has_built(cluster, play):
    specs, visits = toy_world.specs(12), {}

    def watch(status, report):
        if report:
            visits.setdefault(report.worker, []).append(int(report.episode.removeprefix("toy-")) % 2)

    before = folders()
    play(specs, "ray", "run", watch, pause=0.1)
    end = time.monotonic() + 20
    while folders() - before and time.monotonic() < end:
        time.sleep(0.1)
    assert not folders() - before, "actors leave no folder behind"
    # One change at most after the three episodes of the forecast, and one when a house has no episode left.
    assert all(sum(a != b for a, b in pairwise(houses[2:])) <= 2 for houses in visits.values())


def test_an_episode_that_kills_every_actor_is_marked(cluster, play):
    status = play(toy_world.specs(3), "ray", "run", in_process=True, each={"toy-1": "SIGKILL"})
    assert (status.done, status.failed) == (2, 1)


@pytest.mark.parametrize("fault", [OutOfMemoryError("the memory monitor killed it"), RpcError("unreachable")])
def test_whatever_takes_an_actor_its_episode_has_three_tries(cluster, play, monkeypatch, fault):
    real, tries = ray.get, []

    def get(future):
        report = real(future)
        if report and report.episode == "toy-1":
            tries.append(report)
            raise fault
        return report

    monkeypatch.setattr(ray, "get", get)
    status = play(toy_world.specs(3), "ray", "run")
    assert (status.done, status.failed, len(tries)) == (2, 1, LIVES)


def test_a_stop_breaks_episodes_off_and_their_records_come_home(cluster, play, tmp_path):
    specs, reports = toy_world.specs(4), []

    def watch(status, report):
        reports.append(report)
        if len(reports) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        play(specs, "ray", "run", watch, pause=0.1)
    assert play(specs, "local", "run", pause=0.1).done == 4
    play(specs, "local", "clean", pause=0.1)
    assert digests(tmp_path / "run") == digests(tmp_path / "clean")
