"""Sweeps on many machines, by Dask.

``client`` is a ``distributed.Client`` of any cluster: processes on one machine (``LocalCluster``), machines by ssh
(``SSHCluster``), SLURM (``dask-jobqueue``), Kubernetes (``dask-kubernetes``). Every worker needs this package and the
flight's files under the same path. A chunk is flown by one worker with the cores that it has; a worker that dies costs the
time of its chunks, which others fly again.

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
    """``bodyflight.sweep`` over a cluster: m by 7, the same bytes as on one machine.

    With a ``folder``, each chunk is kept there as a Parquet file as soon as it is flown, and a sweep that was stopped goes on
    where it was: chunks of the same flight, factors and start are read, not flown again.
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
            # Runs with the same arguments have the same result, but a key of its own lets a sweep be flown twice.
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
    """Chunks of a sweep as files, named after what they were flown from."""

    def __init__(self, folder: "str | os.PathLike[str] | None", flight: str, start: str) -> None:
        self.folder = None if folder is None else Path(folder)
        if self.folder is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        described = Flight(flight)
        self.digest = hashlib.sha256(start.encode())
        # A flight.toml names its files, which lie beside it as a rule; one file too many does no harm.
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
        # Whole or not there: a part that is read again is never half a part.
        os.replace(unfinished, file)
