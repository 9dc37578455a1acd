"""The skydiver as a unit of FMI 2.0 and 3.0, validated and simulated by FMPy."""

import shutil

import bodyflight
import numpy as np
import pytest

fmpy = pytest.importorskip("fmpy")

from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.fmi3 import FMU3Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def unit(request, turn, tmp_path_factory):
    """A unit with the person and the air of the flight with turns."""
    path = tmp_path_factory.mktemp("unit") / "skydiver.fmu"
    report = bodyflight.fmu(turn / "flight.toml", path, fmi=request.param)
    assert report["bytes"] == path.stat().st_size and report["standard"] == request.param
    return path


class Unit:
    """A running unit whose variables are accessed by name."""

    def __init__(self, path):
        description = fmpy.read_model_description(path)
        self.references = {one.name: one.valueReference for one in description.modelVariables}
        self.folder = fmpy.extract(path)
        self.is_new = description.fmiVersion == "3.0"
        self.slave = (FMU3Slave if self.is_new else FMU2Slave)(
            guid=description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="skydiver",
        )
        self.slave.instantiate(loggingOn=True)
        if self.is_new:
            self.slave.enterInitializationMode(startTime=0.0)
        else:
            self.slave.setupExperiment(startTime=0.0)
            self.slave.enterInitializationMode()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.slave.terminate()
        self.slave.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def set(self, values):
        put = self.slave.setFloat64 if self.is_new else self.slave.setReal
        put([self.references[name] for name in values], list(map(float, values.values())))

    def get(self, *names):
        read = self.slave.getFloat64 if self.is_new else self.slave.getReal
        return np.array(read([self.references[name] for name in names]))

    def save(self):
        return self.slave.getFMUState() if self.is_new else self.slave.getFMUstate()

    def restore(self, state):
        (self.slave.setFMUState if self.is_new else self.slave.setFMUstate)(state)

    def forget(self, state):
        (self.slave.freeFMUState if self.is_new else self.slave.freeFMUstate)(state)


def test_it_conforms_to_the_standard(unit):
    assert validate_fmu(str(unit)) == []
    description = fmpy.read_model_description(unit, validate=True)
    assert description.fmiVersion in ("2.0", "3.0") and description.coSimulation is not None
    assert description.unitDefinitions and all(one.unit for one in description.modelVariables)


def test_it_falls_at_the_trimmed_speed_in_simulation(unit):
    result = fmpy.simulate_fmu(
        unit, stop_time=12.0, step_size=1 / 240, output_interval=1 / 60, output=["velocity.up", "seen.pitch_rad"]
    )
    assert result["time"][-1] == pytest.approx(12.0, abs=0.02)
    assert -result["velocity.up"][-1] == pytest.approx(bodyflight.trim()["terminal_speed_mps"], rel=0.05)


def joints(rows, frame):
    names = [(segment, part) for segment in bodyflight.Subject.segments for part in ["psi", "theta", "phi"]]
    angles = rows["segment_joint_rad"][frame].reshape(-1)
    return {f"joint.{segment}.{part}": angle for (segment, part), angle in zip(names, angles) if segment != "pelvis"}


def test_its_trace_is_the_simulations(unit, turn, tmp_path):
    """With the recorded joint angles and the inputs of the flight, it moves as in `simulate`."""
    bodyflight.export(bodyflight.Flight(turn), tmp_path / "run.npz")
    rows = np.load(tmp_path / "run.npz")
    world, axes, rotation = ["north", "west", "up"], ["pitch", "yaw", "roll"], ["w", "x", "y", "z"]

    def named(group, parts, values):
        return {f"{group}.{part}": value for part, value in zip(parts, values)}

    seen = ["roll_rad", "pitch_rad", "heading_rad"]
    with Unit(unit) as skydiver:
        skydiver.set(
            named("start.position", world, rows["simulated_position_m"][0])
            | named("start.velocity", world, rows["simulated_velocity_mps"][0])
            | named("start.attitude", rotation, rows["simulated_attitude"][0])
            | named("start.body_rate", axes, rows["simulated_body_rate_radps"][0])
            | joints(rows, 0)
        )
        skydiver.slave.exitInitializationMode()
        time = rows["time_s"]
        for frame in range(1, 1500):
            skydiver.set(
                joints(rows, frame)
                | named("muscle", axes, rows["muscle"][frame])
                | named("damping", axes, rows["damping"][frame])
            )
            skydiver.slave.doStep(time[frame - 1], time[frame] - time[frame - 1])
            place = skydiver.get(*(f"position.{part}" for part in world))
            np.testing.assert_allclose(place, rows["simulated_position_m"][frame], rtol=0, atol=1e-6)
            attitude = skydiver.get(*(f"attitude.{part}" for part in rotation))
            np.testing.assert_allclose(attitude, rows["simulated_attitude"][frame], rtol=0, atol=1e-6)
            angles = skydiver.get(*(f"seen.{name}" for name in seen))
            wanted = [rows[f"simulated_{name}"][frame] for name in seen]
            np.testing.assert_allclose(angles, wanted, rtol=0, atol=1e-6)
    turned = np.ptp(np.unwrap(rows["simulated_heading_rad"][:1500]))
    assert turned > 0.5


def test_a_saved_state_is_restored(unit):
    with Unit(unit) as skydiver:
        skydiver.slave.exitInitializationMode()
        skydiver.slave.doStep(0.0, 0.1)
        kept = skydiver.save()
        skydiver.slave.doStep(0.1, 0.1)
        first = skydiver.get("position.up", "velocity.up", "time")
        skydiver.restore(kept)
        skydiver.slave.doStep(0.1, 0.1)
        np.testing.assert_array_equal(skydiver.get("position.up", "velocity.up", "time"), first)
        skydiver.forget(kept)


def test_an_unknown_version_is_refused(turn, tmp_path):
    with pytest.raises(bodyflight.BadInput, match="version of FMI"):
        bodyflight.fmu(turn / "flight.toml", tmp_path / "skydiver.fmu", fmi="1.0")


def test_impossible_values_are_refused(unit):
    with Unit(unit) as skydiver:
        skydiver.slave.exitInitializationMode()
        with pytest.raises(Exception, match="3"):
            skydiver.set({"position.up": 1.0})
        with pytest.raises(Exception, match="3"):
            skydiver.slave.doStep(0.0, 5.0)
