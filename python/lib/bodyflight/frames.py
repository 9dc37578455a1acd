"""Results as pandas data frames. pandas is imported only when one of these functions is called."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ._native import Estimation, Run

if TYPE_CHECKING:
    import pandas


def run_frame(run: Run) -> "pandas.DataFrame":
    """Returns a run indexed by time (s), with columns ``measured_*`` and ``simulated_*`` as in ``bodyflight simulate --out``."""
    import pandas

    columns = {}
    for index, channel in enumerate(Run.channels):
        columns[f"measured_{channel}"] = run.measured[:, index]
        columns[f"simulated_{channel}"] = run.simulated[:, index]
    return pandas.DataFrame(columns, index=pandas.Index(run.time, name="time_s"))


def estimation_frame(estimation: Estimation) -> "pandas.DataFrame":
    """Returns estimates indexed by time (s): coefficients, their standard deviations ``sd_*``, ``nis`` and ``consistency``."""
    import pandas

    columns = {}
    for index, name in enumerate(Estimation.columns):
        columns[name] = estimation.inputs[:, index]
        columns[f"sd_{name}"] = estimation.deviation[:, index]
    columns["nis"] = estimation.nis
    if estimation.consistency:
        columns["consistency"] = estimation.consistency
    return pandas.DataFrame(columns, index=pandas.Index(estimation.time, name="time_s"))
