"""Results as pandas data frames; pandas is imported only here, and only when asked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._native import Estimation, Run

if TYPE_CHECKING:
    import pandas


def run_frame(run: Run) -> "pandas.DataFrame":
    """A run by time (s): ``measured_*`` and ``simulated_*`` of each channel, as ``bodyflight simulate --out`` names them."""
    import pandas

    columns = {}
    for index, channel in enumerate(Run.channels):
        columns[f"measured_{channel}"] = run.measured[:, index]
        columns[f"simulated_{channel}"] = run.simulated[:, index]
    return pandas.DataFrame(columns, index=pandas.Index(run.time, name="time_s"))


def estimation_frame(estimation: Estimation) -> "pandas.DataFrame":
    """Estimates by time (s): coefficients, ``sd_*`` their deviations, ``nis`` and ``consistency``."""
    import pandas

    columns = {}
    for index, name in enumerate(Estimation.columns):
        columns[name] = estimation.inputs[:, index]
        columns[f"sd_{name}"] = estimation.deviation[:, index]
    columns["nis"] = estimation.nis
    if estimation.consistency:
        columns["consistency"] = estimation.consistency
    return pandas.DataFrame(columns, index=pandas.Index(estimation.time, name="time_s"))
