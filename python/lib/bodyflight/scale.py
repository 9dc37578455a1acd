"""Sweeps on many machines, with Dask.

``client`` is a ``distributed.Client`` of any cluster: processes on one machine (``LocalCluster``), machines by ssh
(``SSHCluster``), SLURM (``dask-jobqueue``), Kubernetes (``dask-kubernetes``). Every worker needs this package and the
flight's files under the same path. Each chunk is simulated by one worker on all its cores. If a worker dies, other workers
repeat its chunks.

>>> from dask.distributed import Client, LocalCluster        # doctest: +SKIP
>>> with LocalCluster(n_workers=2, threads_per_worker=1) as cluster, Client(cluster) as client:
...     rms = sweep(client, "turns/flight.toml", factors, folder="swept")
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ._native import Flight, Run
from ._native import sweep as sweep_here

if TYPE_CHECKING:
    from distributed import Client

#: Columns of the parts before the channels.
FACTORS = ["drag", "lift", "moment"]


def sweep(
    client: "Client",
    flight: "str | os.PathLike[str]",
    factors: np.ndarray,
    *,
    start: str = "smoothed",
    chunk: int = 64,
    folder: "str | os.PathLike[str] | None" = None,
) -> np.ndarray:
    """Runs ``bodyflight.sweep`` on a cluster. Returns an array of m by 7, with the same bits as on one machine.

    ``factors`` is m by 3: factors on the drag, lift and moment coefficients. If ``folder`` is given, each chunk is saved there
    as a Parquet file as soon as it is done. A sweep that was stopped can then be resumed: saved chunks of the same flight,
    factors and start are read instead of simulated.
    """
    from distributed import as_completed

    factors = np.ascontiguousarray(factors, dtype=np.float64)
    if factors.ndim != 2 or factors.shape[1] != len(FACTORS):
        raise ValueError(f"expected factors of {len(FACTORS)} columns, found an array of shape {factors.shape}")
    path = str(Path(flight).resolve())
    result = np.full((len(factors), len(Run.channels)), np.nan)
    parts = _Parts(folder, path, start)
    waiting = {}
    for first in range(0, len(factors), chunk):
        rows = factors[first : first + chunk]
        kept = parts.read(first, rows)
        if kept is None:
            # With pure=True, Dask would answer a second sweep with the results of the first.
            waiting[client.submit(_fly, path, rows, start, pure=False)] = first
        else:
            result[first : first + len(rows)] = kept
    for future, rms in as_completed(waiting, with_results=True) if waiting else ():
        first = waiting.pop(future)
        result[first : first + len(rms)] = rms
        parts.write(first, factors[first : first + len(rms)], rms)
    return result


def _fly(path: str, factors: np.ndarray, start: str) -> np.ndarray:
    return sweep_here(Flight(path), factors, start=start)


class _Parts:
    """Chunks of a sweep as files, whose names contain a digest of flight, factors and start."""

    def __init__(self, folder: "str | os.PathLike[str] | None", flight: str, start: str) -> None:
        self.folder = None if folder is None else Path(folder)
        if self.folder is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        described = Flight(flight)
        self.digest = hashlib.sha256(start.encode())
        # The files that a flight.toml names are usually in its folder. Unrelated files there do no harm.
        beside = [file for file in Path(flight).parent.iterdir() if file.is_file()]
        for content in sorted({*beside, Path(described.path).resolve()}):
            self.digest.update(content.read_bytes())
        self.digest.update(described.subject.to_toml().encode())

    def _file(self, first: int, factors: np.ndarray) -> Path:
        digest = self.digest.copy()
        digest.update(factors.tobytes())
        assert self.folder is not None
        return self.folder / f"part-{first:08}-{digest.hexdigest()[:16]}.parquet"

    def read(self, first: int, factors: np.ndarray) -> "np.ndarray | None":
        if self.folder is None or not (file := self._file(first, factors)).is_file():
            return None
        import pandas

        return pandas.read_parquet(file)[Run.channels].to_numpy()

    def write(self, first: int, factors: np.ndarray, rms: np.ndarray) -> None:
        if self.folder is None:
            return
        import pandas

        columns = np.concatenate([factors, rms], axis=1)
        table = pandas.DataFrame(columns, columns=[*FACTORS, *Run.channels])
        file = self._file(first, factors)
        unfinished = file.with_suffix(".tmp")
        table.to_parquet(unfinished, index=False)
        # Renamed when complete, so that an interrupted sweep leaves no partial file.
        os.replace(unfinished, file)
