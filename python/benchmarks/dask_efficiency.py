"""Parallel efficiency of a sweep with two processes of a Dask cluster.

    python benchmarks/dask_efficiency.py [--flights 400]

Simulates the same runs with one and with two processes of one thread each, in chunks, on a local cluster.
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ["RAYON_NUM_THREADS"] = "1"

import bodyflight
import numpy as np
from bodyflight import scale
from distributed import Client, LocalCluster


def seconds(workers, flight, factors, chunk):
    """Returns the time of a sweep with this number of processes (s), without their start, and its result."""
    with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        client.wait_for_workers(workers)
        scale.sweep(client, flight, factors[: 2 * workers], chunk=1)
        begin = time.perf_counter()
        result = scale.sweep(client, flight, factors, chunk=chunk)
        return time.perf_counter() - begin, result


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=400)
    parser.add_argument("--chunk", type=int, default=10)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        bodyflight.synth("aggressive-turns", folder, seed=3)
        flight = Path(folder) / "flight.toml"
        factors = np.random.default_rng(1).normal(1.0, 0.1, (arguments.flights, 3))
        alone, wanted = seconds(1, flight, factors, arguments.chunk)
        together, found = seconds(2, flight, factors, arguments.chunk)
    assert found.tobytes() == wanted.tobytes()
    print("| flights of 30 s | one process (s) | two (s) | efficiency | flights a second and process | core hours of 10^6 |")
    print("|---|---|---|---|---|---|")
    share, rate = alone / (2 * together), arguments.flights / alone
    print(f"| {arguments.flights} | {alone:.1f} | {together:.1f} | {100 * share:.0f} % | {rate:.0f} | {1e6 / rate / 3600:.1f} |")


if __name__ == "__main__":
    main()
