"""Human body flight: simulate it, estimate what the skydiver does, and find what the model misses.

Functions carry the names and defaults of the program's verbs; results carry numpy arrays, and as ``report`` the dictionary
that the verb prints with ``--json``. Problems are exceptions with ``file``, ``line``, ``place`` and ``help``.

>>> import bodyflight
>>> bodyflight.trim()["terminal_speed_mps"]  # doctest: +ELLIPSIS
4...
"""

import os as _os
from pathlib import Path as _Path

# The library of co-simulation units, where it comes with the package; the program looks for it by this name too.
for _library in _Path(__file__).parent.glob("*bodyflight_fmu.*"):
    _os.environ.setdefault("BODYFLIGHT_FMU", str(_library))

from ._native import (  # noqa: E402
    BadInput,
    BodyflightError,
    Disagreement,
    DoubtWarning,
    Estimation,
    Flight,
    Internal,
    Recording,
    Refused,
    Run,
    Skydivers,
    Subject,
    __version__,
    discover,
    estimate,
    export,
    fmu,
    simulate,
    sweep,
    synth,
    trim,
    tune,
)
from .frames import estimation_frame, run_frame

__all__ = [
    "BadInput",
    "BodyflightError",
    "Disagreement",
    "DoubtWarning",
    "Estimation",
    "Flight",
    "Internal",
    "Recording",
    "Refused",
    "Run",
    "Skydivers",
    "Subject",
    "__version__",
    "discover",
    "estimate",
    "estimation_frame",
    "export",
    "fmu",
    "run_frame",
    "simulate",
    "sweep",
    "synth",
    "trim",
    "tune",
]
