"""Sweeps on a cluster of two processes, one of which dies."""

import os
import signal
import threading
import time

import bodyflight
import numpy as np
import pytest

distributed = pytest.importorskip("distributed")

from bodyflight import scale  # noqa: E402


@pytest.fixture(scope="module")
def cluster():
    settings = {"distributed.scheduler.allowed-failures": 10, "distributed.admin.tick.limit": "1h"}
    import dask

    with dask.config.set(settings):
        with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
            yield cluster


def factors(count):
    return np.random.default_rng(4).normal(1.0, 0.1, (count, 3))


def test_a_killed_worker_costs_time_only(cluster, turn, tmp_path):
    wanted = factors(24)
    here = bodyflight.sweep(bodyflight.Flight(turn / "flight.toml"), wanted)
    with distributed.Client(cluster) as client:
        client.wait_for_workers(2)
        victim, _ = client.run(os.getpid).values()

        def kill():
            while not list(tmp_path.glob("*.parquet")):
                time.sleep(0.01)
            os.kill(victim, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        there = scale.sweep(client, turn / "flight.toml", wanted, chunk=2, folder=tmp_path)
        killer.join()
    assert there.tobytes() == here.tobytes()
    assert len(list(tmp_path.glob("part-*.parquet"))) == 12


def test_an_interrupted_sweep_continues(turn, tmp_path):
    class Nobody:
        """A client that must not be used."""

        def submit(self, *_arguments, **_options):
            raise AssertionError("a part that is there was flown again")

    wanted = factors(6)
    flight = turn / "flight.toml"
    parts = scale._Parts(tmp_path, str(flight.resolve()), "smoothed")
    rms = bodyflight.sweep(bodyflight.Flight(flight), wanted)
    for first in range(0, 6, 2):
        parts.write(first, wanted[first : first + 2], rms[first : first + 2])
    again = scale.sweep(Nobody(), flight, wanted, chunk=2, folder=tmp_path)
    assert again.tobytes() == rms.tobytes()
    # Other factors belong to other parts.
    assert parts.read(0, wanted[2:4]) is None
