"""Human body flight: simulate it, estimate what the skydiver does, and find what the model misses.

Functions have the names and defaults of the program's verbs. Results hold numpy arrays, and in ``report`` the dictionary that
the verb prints with ``--json``. Errors are exceptions with ``file``, ``line``, ``place`` and ``help``.

>>> import bodyflight
>>> bodyflight.trim()["terminal_speed_mps"]  # doctest: +ELLIPSIS
4...
"""

import os as _os
from pathlib import Path as _Path

# The wheel contains the library of co-simulation units; the program finds it through this variable too.
for _library in _Path(__file__).parent.glob("*bodyflight_fmu.*"):
    _os.environ.setdefault("BODYFLIGHT_FMU", str(_library))

from ._native import (  # noqa: E402
    BadInput,
    BodyflightError,
    Comparison,
    Disagreement,
    DoubtWarning,
    Estimation,
    Flight,
    Internal,
    Linearization,
    Mechanics,
    MotionArrays,
    Recording,
    Refused,
    Run,
    Skydivers,
    Subject,
    Technique,
    __version__,
    compare,
    discover,
    estimate,
    export,
    fall,
    figures,
    fmu,
    import_recording,
    inspect,
    linearize,
    mechanics,
    posture,
    record,
    simulate,
    sweep,
    synth,
    technique,
    trim,
    tune,
    validate,
    view,
)
from .frames import estimation_frame, run_frame

__all__ = [
    "BadInput",
    "BodyflightError",
    "Comparison",
    "Disagreement",
    "DoubtWarning",
    "Estimation",
    "Flight",
    "Internal",
    "Linearization",
    "Mechanics",
    "MotionArrays",
    "Recording",
    "Refused",
    "Run",
    "Skydivers",
    "Subject",
    "Technique",
    "__version__",
    "compare",
    "discover",
    "estimate",
    "estimation_frame",
    "export",
    "fall",
    "figures",
    "fmu",
    "import_recording",
    "inspect",
    "linearize",
    "mechanics",
    "posture",
    "record",
    "run_frame",
    "simulate",
    "sweep",
    "synth",
    "technique",
    "trim",
    "tune",
    "validate",
    "view",
]
