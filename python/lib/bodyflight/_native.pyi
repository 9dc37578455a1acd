from os import PathLike
from typing import Any, Callable, ClassVar, Literal, Sequence

import numpy as np
from numpy.typing import NDArray

__version__: str

_Path = str | PathLike[str]
_Progress = Callable[[float], object] | None
_Floats = NDArray[np.float64]

class BodyflightError(Exception):
    message: str
    file: _Path | None
    line: int | None
    place: str | None
    help: str | None

class BadInput(BodyflightError): ...
class Refused(BodyflightError): ...
class Disagreement(BodyflightError): ...
class Internal(BodyflightError): ...
class DoubtWarning(UserWarning): ...

class Subject:
    segments: ClassVar[list[str]]
    def __init__(self, path: _Path | None = None) -> None: ...
    @staticmethod
    def from_toml(text: str) -> Subject: ...
    def to_toml(self) -> str: ...
    @property
    def mass(self) -> float: ...
    def segment_table(self) -> _Floats: ...
    def scaled(self, *, drag: float = 1.0, lift: float = 1.0, moment: float = 1.0) -> Subject: ...

class Flight:
    def __init__(
        self,
        path: _Path,
        *,
        model: _Path | None = None,
        equations: Literal["exact", "as-published"] | None = None,
        subject: Subject | None = None,
        strict: bool = False,
        allow_truncated: bool = False,
        arm_frame: Literal["t-pose", "isb"] | None = None,
    ) -> None: ...
    @property
    def path(self) -> PathLike[str]: ...
    @property
    def subject(self) -> Subject: ...
    def with_subject(self, subject: Subject) -> Flight: ...
    def read(self, *, progress: _Progress = None) -> Recording: ...

class MotionArrays:
    @property
    def position(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def inertial_from_body(self) -> _Floats: ...
    @property
    def angular_velocity(self) -> _Floats: ...

class Recording:
    @property
    def time(self) -> _Floats: ...
    @property
    def motion(self) -> MotionArrays: ...
    @property
    def parent_from_segment(self) -> _Floats: ...
    @property
    def bridged(self) -> NDArray[np.bool_]: ...
    @property
    def warnings(self) -> list[str]: ...

class Run:
    channels: ClassVar[list[str]]
    @property
    def time(self) -> _Floats: ...
    @property
    def measured(self) -> _Floats: ...
    @property
    def simulated(self) -> _Floats: ...
    @property
    def motion(self) -> MotionArrays: ...
    @property
    def report(self) -> dict[str, Any]: ...

class Estimation:
    columns: ClassVar[list[str]]
    @property
    def time(self) -> _Floats: ...
    @property
    def inputs(self) -> _Floats: ...
    @property
    def deviation(self) -> _Floats: ...
    @property
    def nis(self) -> _Floats: ...
    @property
    def consistency(self) -> list[str]: ...
    @property
    def doubt(self) -> str | None: ...
    @property
    def report(self) -> dict[str, Any]: ...
    def write_csv(self, path: _Path) -> None: ...

class Comparison:
    channels: ClassVar[list[str]]
    @property
    def time(self) -> _Floats: ...
    @property
    def a(self) -> _Floats: ...
    @property
    def b(self) -> _Floats: ...
    @property
    def joints(self) -> list[str]: ...
    @property
    def a_angles(self) -> _Floats: ...
    @property
    def b_angles(self) -> _Floats: ...
    @property
    def difference(self) -> _Floats: ...
    @property
    def deviation(self) -> _Floats: ...
    @property
    def first(self) -> str: ...
    @property
    def doubt(self) -> str | None: ...
    @property
    def report(self) -> dict[str, Any]: ...

class Skydivers:
    controls: ClassVar[list[str]]
    observed: ClassVar[list[str]]
    starts: ClassVar[list[str]]
    def __init__(
        self,
        count: int,
        *,
        start: str = "neutral",
        subject: Subject | None = None,
        density: float = 1.0,
        substeps: int = 8,
    ) -> None: ...
    @property
    def time_step(self) -> float: ...
    def __len__(self) -> int: ...
    def reset(self, which: NDArray[np.bool_] | None = None) -> NDArray[np.float32]: ...
    def step(self, actions: NDArray[np.float32]) -> NDArray[np.float32]: ...
    def observe(self) -> NDArray[np.float32]: ...

class Environments:
    """n environments with one body and one task; ``bodyflight.gym`` wraps them."""

    observed: ClassVar[list[str]]
    limit: ClassVar[float]
    def __init__(
        self,
        count: int,
        *,
        up: tuple[float, float, float],
        faces: bool,
        docks: bool,
        seconds: float,
        start: str = "neutral",
        subject: Subject | None = None,
        density: float = 1.0,
        substeps: int = 8,
    ) -> None: ...
    @property
    def episode_steps(self) -> int: ...
    def __len__(self) -> int: ...
    def begin(
        self, which: NDArray[np.bool_], headings: NDArray[np.float32], targets: NDArray[np.float32]
    ) -> None:
        """Begins episodes where ``which`` (n) is true. ``headings``: n (rad); ``targets``: n by 2, north and west (m)."""

    def observe(self) -> NDArray[np.float32]:
        """Returns the scaled observations, n by 17."""

    def step(
        self, actions: NDArray[np.float32], resting: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]:
        """Flies ``actions`` (n by 8). Returns observations (n by 17), rewards, terminated and truncated (n each)."""

def simulate(
    flight: Flight,
    *,
    start: Literal["smoothed", "first"] = "smoothed",
    precision: Literal["double", "single"] = "double",
    progress: _Progress = None,
) -> Run: ...
def estimate(
    flight: Flight,
    *,
    preset: str = "auto",
    method: Literal["filter", "smooth"] = "filter",
    filter: Literal["paper", "reduced"] | None = None,
    precision: Literal["double", "single"] = "double",
    progress: _Progress = None,
) -> Estimation: ...
def compare(
    a: Flight,
    b: Flight,
    *,
    align: str = "auto",
    between: tuple[float | None, float | None] = (None, None),
    names: tuple[str, str] = ("A", "B"),
    progress: _Progress = None,
) -> Comparison: ...
def export(
    flight: Flight,
    out: _Path,
    *,
    format: Literal["parquet", "csv", "mcap", "npz"] | None = None,
    estimates: Literal["filter", "smooth"] | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def fmu(subject: _Path, out: _Path, *, library: _Path | None = None, force: bool = False) -> dict[str, Any]: ...
def record(
    actions: NDArray[np.float32],
    out: _Path,
    *,
    start: str = "neutral",
    subject: Subject | None = None,
    density: float = 1.0,
    substeps: int = 8,
    force: bool = False,
) -> int: ...
def program(arguments: Sequence[str]) -> int: ...
def discover(
    flights: Sequence[Flight], *, hold_out: Sequence[Flight] = (), max_effects: int = 3, seed: int = 1
) -> dict[str, Any]: ...
def sweep(flight: Flight, factors: _Floats, *, start: Literal["smoothed", "first"] = "smoothed") -> _Floats: ...
def tune(
    flights: Sequence[Flight],
    *,
    hold_out: Sequence[Flight] = (),
    draws: int = 200,
    spread: float = 0.3,
    seed: int = 0,
    per_segment: bool = False,
) -> dict[str, Any]: ...
def trim(subject: Subject | None = None, *, density: float = 1.0) -> dict[str, Any]: ...
def synth(
    maneuver: str,
    out: _Path,
    *,
    subject: Subject | None = None,
    density: float = 1.0,
    seed: int = 0,
    noise: float = 1.0,
    joint_error_deg: float = 0.0,
    joint_wander_deg: float = 0.0,
    tunnel: bool = False,
    progress: _Progress = None,
) -> dict[str, Any]: ...
