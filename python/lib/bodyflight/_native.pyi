from os import PathLike
from typing import Any, Callable, ClassVar, Literal, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

_Path = str | PathLike[str]
_Progress = Callable[[float], object] | None
_Floats = NDArray[np.float64]
_Start = Literal["neutral", "sit", "head-down", "track", "back", "novice"]

class BodyflightError(Exception):
    message: str
    file: _Path | None
    line: int | None
    place: str | None
    help: str | None

class BadInput(BodyflightError, ValueError): ...
class Refused(BodyflightError): ...
class Disagreement(BodyflightError):
    report: dict[str, Any]
    """What `fall` and `validate` would have returned."""
class Internal(BodyflightError): ...
class DoubtWarning(UserWarning): ...

class Subject:
    segments: ClassVar[list[str]]
    def __init__(self, path: _Path | None = None) -> None: ...
    @staticmethod
    def from_toml(text: str, segments: str | None = None) -> Subject: ...
    def to_toml(self) -> str: ...
    @property
    def segments_json(self) -> str | None: ...
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
    @staticmethod
    def from_arrays(
        out: _Path,
        *,
        time: ArrayLike,
        position: ArrayLike,
        inertial_from_body: ArrayLike,
        parent_from_segment: ArrayLike,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
        subject: Subject | None = None,
        density: float = 1.0,
        force: bool = False,
        progress: _Progress = None,
    ) -> Flight: ...
    @property
    def path(self) -> PathLike[str]: ...
    @property
    def subject(self) -> Subject: ...
    def with_subject(self, subject: Subject) -> Flight: ...
    def read(self, *, progress: _Progress = None) -> Recording: ...

class MotionArrays:
    def __init__(
        self, position: _Floats, velocity: _Floats, inertial_from_body: _Floats, angular_velocity: _Floats
    ) -> None: ...
    @property
    def position(self) -> _Floats: ...
    @property
    def velocity(self) -> _Floats: ...
    @property
    def inertial_from_body(self) -> _Floats: ...
    @property
    def angular_velocity(self) -> _Floats: ...

class Recording:
    def __init__(
        self,
        time: _Floats,
        motion: MotionArrays,
        parent_from_segment: _Floats,
        bridged: NDArray[np.bool_],
        warnings: list[str],
    ) -> None: ...
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
    def __init__(
        self, time: _Floats, measured: _Floats, simulated: _Floats, motion: MotionArrays, report: dict[str, Any]
    ) -> None: ...
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
    def __init__(
        self,
        time: _Floats,
        inputs: _Floats,
        deviation: _Floats,
        nis: _Floats,
        consistency: list[str],
        doubt: str | None,
        report: dict[str, Any],
        table: str,
    ) -> None: ...
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
    def write_csv(self, path: _Path, *, force: bool = False) -> None: ...

class Comparison:
    channels: ClassVar[list[str]]
    def __init__(
        self,
        time: _Floats,
        a: _Floats,
        b: _Floats,
        joints: list[str],
        a_angles: _Floats,
        b_angles: _Floats,
        difference: _Floats,
        deviation: _Floats,
        first: str,
        doubt: str | None,
        report: dict[str, Any],
    ) -> None: ...
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

class Technique:
    outputs: ClassVar[list[str]]
    def __init__(
        self,
        time: _Floats,
        joints: list[str],
        weights: _Floats,
        deviation: _Floats,
        told: _Floats,
        amplitude: _Floats,
        frequency: _Floats,
        gain: _Floats,
        gain_deviation: _Floats,
        phase: _Floats,
        doubt: str | None,
        report: dict[str, Any],
    ) -> None: ...
    @property
    def time(self) -> _Floats: ...
    @property
    def joints(self) -> list[str]: ...
    @property
    def weights(self) -> _Floats: ...
    @property
    def deviation(self) -> _Floats: ...
    @property
    def told(self) -> _Floats: ...
    @property
    def amplitude(self) -> _Floats: ...
    @property
    def frequency(self) -> _Floats: ...
    @property
    def gain(self) -> _Floats: ...
    @property
    def gain_deviation(self) -> _Floats: ...
    @property
    def phase(self) -> _Floats: ...
    @property
    def doubt(self) -> str | None: ...
    @property
    def report(self) -> dict[str, Any]: ...

class Skydivers:
    controls: ClassVar[list[str]]
    observed: ClassVar[list[str]]
    starts: ClassVar[list[str]]
    state_names: ClassVar[list[str]]
    def __init__(
        self,
        count: int,
        *,
        start: _Start = "neutral",
        subject: Subject | None = None,
        density: float = 1.0,
        substeps: int = 8,
    ) -> None: ...
    @property
    def time_step(self) -> float: ...
    def __len__(self) -> int: ...
    def reset(self, which: ArrayLike | None = None) -> NDArray[np.float32]: ...
    def step(
        self, actions: ArrayLike, *, force: ArrayLike | None = None, moment: ArrayLike | None = None
    ) -> NDArray[np.float32]:
        """Flies ``actions`` (n by 8), under a force (N) and a moment (N m) if given (n by 3: north, west, up)."""

    def observe(self) -> NDArray[np.float32]: ...
    @property
    def motion(self) -> MotionArrays: ...
    def get_state(self) -> NDArray[np.float32]:
        """Returns everything that the flights consist of, n by 30."""

    def set_state(self, state: ArrayLike) -> None: ...
    def set_motion(
        self,
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        inertial_from_body: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
        controls: ArrayLike | None = None,
    ) -> None: ...

class Environments:
    """n environments with one body and one task; ``bodyflight.gym`` wraps them."""

    observed: ClassVar[list[str]]
    limit: ClassVar[float]
    reward_terms: ClassVar[list[str]]
    state_names: ClassVar[list[str]]
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
    def begin(self, which: ArrayLike, headings: ArrayLike, targets: ArrayLike) -> None:
        """Begins episodes where ``which`` (n) is true. ``headings``: n (rad); ``targets``: n by 2, north and west (m)."""

    def observe(self) -> NDArray[np.float32]:
        """Returns the scaled observations, n by 17."""

    def step(
        self, actions: ArrayLike, resting: ArrayLike
    ) -> tuple[
        NDArray[np.float32],
        NDArray[np.float32],
        NDArray[np.bool_],
        NDArray[np.bool_],
        NDArray[np.float32],
        NDArray[np.bool_],
    ]:
        """Flies ``actions`` (n by 8). Returns observations (n by 17), rewards, terminated and truncated (n each), the terms of
        the rewards (n by 5) and success (n)."""

    def render(self, index: int, width: int, height: int) -> NDArray[np.uint8]:
        """Draws one environment, height by width by 3."""

    def get_state(self) -> NDArray[np.float32]:
        """Returns everything that the environments consist of, n by 35."""

    def set_state(self, state: ArrayLike) -> None: ...

class Mechanics:
    @property
    def mass(self) -> float: ...
    @property
    def centre_of_mass(self) -> _Floats: ...
    @property
    def inertia(self) -> _Floats: ...
    @property
    def linear_momentum(self) -> _Floats: ...
    @property
    def angular_momentum(self) -> _Floats: ...
    @property
    def segment_force(self) -> _Floats: ...
    @property
    def segment_moment(self) -> _Floats: ...

class Linearization:
    states: ClassVar[list[str]]
    inputs: ClassVar[list[str]]
    outputs: ClassVar[list[str]]
    @property
    def A(self) -> _Floats: ...
    @property
    def B(self) -> _Floats: ...
    @property
    def B_rate(self) -> _Floats: ...
    @property
    def C(self) -> _Floats: ...
    @property
    def D(self) -> _Floats: ...
    @property
    def D_rate(self) -> _Floats: ...
    @property
    def posture(self) -> _Floats: ...
    @property
    def fall(self) -> dict[str, float | None]: ...

def mechanics(
    subject: Subject,
    parent_from_segment: ArrayLike,
    *,
    velocity: ArrayLike | None = None,
    inertial_from_body: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
    time: ArrayLike | None = None,
    density: float = 1.0,
) -> Mechanics: ...
def posture(start: _Start = "neutral", angles: Mapping[str, float] | None = None) -> _Floats: ...
def linearize(subject: Subject | None = None, *, density: float = 1.0) -> Linearization: ...
def inspect(
    file: _Path, *, mapping: _Path | None = None, subject: Subject | None = None, progress: _Progress = None
) -> dict[str, Any]: ...
def import_recording(
    file: _Path,
    out: _Path,
    *,
    mapping: _Path | None = None,
    subject: Subject | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def fall(
    track: _Path,
    *,
    mass: float = 80.0,
    ground_pressure_hpa: float | None = None,
    ground_temperature_celsius: float | None = None,
    reference_height_m: float | None = None,
    beside: _Path | None = None,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def validate(paths: Sequence[_Path] = (), *, progress: _Progress = None) -> dict[str, Any]: ...
def figures(
    flights: Flight | Sequence[Flight],
    out: _Path,
    *,
    preset: str = "auto",
    method: Literal["filter", "smooth"] = "filter",
    filter: Literal["paper", "reduced"] | None = None,
    between: tuple[float | None, float | None] = (None, None),
    snapshots: int = 6,
    views: Literal["front", "side", "top"] | Sequence[Literal["front", "side", "top"]] = "side",
    formats: Literal["svg", "pdf", "png"] | Sequence[Literal["svg", "pdf", "png"]] = "svg",
    title: str | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> list[PathLike[str]]: ...
def view(
    flights: Flight | Sequence[Flight],
    out: _Path,
    *,
    model: _Path | None = None,
    estimates: Literal["filter", "smooth"] | None = None,
    discovery: Mapping[str, Any] | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> dict[str, Any]: ...

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
def technique(
    flight: Flight,
    *,
    against: Sequence[Flight] = (),
    between: tuple[float | None, float | None] = (None, None),
    turns: bool = False,
    joint_error_deg: float | None = None,
) -> Technique: ...
def export(
    flight: Flight,
    out: _Path,
    *,
    format: Literal["parquet", "csv", "mcap", "npz"] | None = None,
    estimates: Literal["filter", "smooth"] | None = None,
    force: bool = False,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def fmu(
    subject: _Path,
    out: _Path,
    *,
    fmi: Literal["2.0", "3.0"] = "3.0",
    library: _Path | None = None,
    force: bool = False,
) -> dict[str, Any]: ...
def record(
    actions: ArrayLike,
    out: _Path,
    *,
    start: _Start = "neutral",
    subject: Subject | None = None,
    density: float = 1.0,
    substeps: int = 8,
    force: bool = False,
    progress: _Progress = None,
) -> int: ...
def program(arguments: Sequence[str]) -> int: ...
def discover(
    flights: Sequence[Flight],
    *,
    hold_out: Sequence[Flight] = (),
    max_effects: int = 3,
    progress: _Progress = None,
) -> dict[str, Any]: ...
def sweep(
    flight: Flight,
    factors: ArrayLike,
    *,
    start: Literal["smoothed", "first"] = "smoothed",
    progress: _Progress = None,
) -> _Floats: ...
def tune(
    flights: Sequence[Flight],
    *,
    hold_out: Sequence[Flight] = (),
    draws: int = 200,
    spread: float = 0.3,
    seed: int = 0,
    per_segment: bool = False,
    progress: _Progress = None,
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
