"""Results agree with those of the program, to the bit or to the last digit that it writes."""

import json

import bodyflight
import numpy as np
import pytest


def report(text):
    """Returns a report without measured times and provenance."""
    found = json.loads(text) if isinstance(text, str) else dict(text)
    for own in ("steps_per_second", "filter_s", "made_by"):
        found.pop(own, None)
    return found


def test_a_run_is_the_programs(turn, program, tmp_path):
    run = bodyflight.simulate(bodyflight.Flight(turn))
    table = tmp_path / "run.csv"
    assert report(program("--json", "simulate", turn / "flight.toml", "--out", table)) == report(run.report)
    names = table.read_text().splitlines()[0].split(",")
    written = np.loadtxt(table, delimiter=",", skiprows=1)
    assert names[0] == "time_s"
    assert names[1::2] == [f"measured_{name}" for name in run.channels]
    # The file has six decimals.
    np.testing.assert_allclose(written[:, 0], run.time, rtol=0, atol=5.01e-7)
    np.testing.assert_allclose(written[:, 1::2], run.measured, rtol=0, atol=5.01e-7)
    np.testing.assert_allclose(written[:, 2::2], run.simulated, rtol=0, atol=5.01e-7)


def test_the_real_somersault_is_predicted_as_by_the_program(acrobatics, program):
    exact = bodyflight.simulate(bodyflight.Flight(acrobatics)).report
    published = bodyflight.simulate(bodyflight.Flight(acrobatics, equations="as-published")).report
    assert report(program("--json", "simulate", acrobatics)) == report(exact)
    assert exact["rms"]["angular_velocity_radps"] < published["rms"]["angular_velocity_radps"]


@pytest.mark.parametrize("method", ["filter", "smooth"])
def test_an_estimate_is_the_programs(turn, program, tmp_path, method):
    found = bodyflight.estimate(bodyflight.Flight(turn), method=method)
    ours, theirs = tmp_path / "ours.csv", tmp_path / "theirs.csv"
    found.write_csv(ours)
    printed = program("--json", "estimate", turn, "--method", method, "--out", theirs)
    assert report(printed) == report(found.report)
    assert ours.read_bytes() == theirs.read_bytes()
    assert found.inputs.shape == found.deviation.shape == (len(found.time), len(found.columns))
    assert (found.deviation >= 0.0).all()


def test_a_comparison_is_the_programs(turn, program, tmp_path):
    other = tmp_path / "other"
    bodyflight.synth("rotations", other, seed=7)
    found = bodyflight.compare(bodyflight.Flight(turn), bodyflight.Flight(other), align="start", names=(turn.name, "other"))
    table = tmp_path / "joints.csv"
    printed = program("--json", "compare", turn, other, "--align", "start", "--out", table)
    assert report(printed) == report(found.report)
    written = np.loadtxt(table, delimiter=",", skiprows=1)
    np.testing.assert_allclose(written[:, 1:3], found.time, rtol=0, atol=5.01e-7)
    angles = np.stack([found.a_angles, found.b_angles, found.difference, found.deviation], axis=2)
    assert found.difference.shape == (len(found.time), len(found.joints)) == (len(written), 45)
    np.testing.assert_allclose(written[:, 17:], angles.reshape(len(written), -1), rtol=0, atol=5.01e-7)
    with pytest.raises(bodyflight.Disagreement, match="exit"):
        bodyflight.compare(bodyflight.Flight(turn), bodyflight.Flight(other), align="exit")


def test_a_technique_is_the_programs(turn, program, tmp_path):
    other = tmp_path / "other"
    bodyflight.synth("rotations", other, seed=7)
    found = bodyflight.technique(bodyflight.Flight(other), against=[bodyflight.Flight(turn)], between=(1.0, None))
    times, responses = tmp_path / "times.csv", tmp_path / "responses.csv"
    printed = program("--json", "technique", other, "--against", turn, "--from", "1", "--out", times, "--csv", responses)
    assert report(printed) == report(found.report)
    count = len(found.report["patterns"])
    written = np.loadtxt(times, delimiter=",", skiprows=1)
    np.testing.assert_allclose(written, np.column_stack([found.time, found.amplitude]), rtol=0, atol=5.01e-7)
    assert count > 0 and found.weights.shape == found.told.shape == found.deviation.shape == (count, len(found.joints))
    shape = (count, len(found.outputs), len(found.frequency))
    assert found.gain.shape == found.gain_deviation.shape == found.phase.shape == shape
    written = np.loadtxt(responses, delimiter=",", skiprows=1, usecols=(2, 3, 4, 5)).reshape(*shape, 4)
    for place, ours in enumerate([found.gain, found.gain_deviation, found.phase]):
        np.testing.assert_allclose(written[..., place + 1], ours, rtol=1e-5, atol=5.01e-7)
    with pytest.raises(bodyflight.BadInput, match="joint_error_deg above 0"):
        bodyflight.technique(bodyflight.Flight(other), joint_error_deg=-1.0)
    with pytest.warns(bodyflight.DoubtWarning, match="no movement is above"):
        none = bodyflight.technique(bodyflight.Flight(other), joint_error_deg=30.0)
    assert none.doubt is not None and none.weights.shape == (0, 45) and none.gain.shape == (0, 5, 0)


def test_a_recording_is_read_as_it_was_flown(turn):
    recording = bodyflight.Flight(turn).read()
    frames = len(recording.time)
    assert recording.parent_from_segment.shape == (frames, len(bodyflight.Subject.segments), 4)
    np.testing.assert_allclose(np.linalg.norm(recording.parent_from_segment, axis=2), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.diff(recording.time), 1.0 / 240.0, atol=1e-9)
    # The positions are the integral of the velocities.
    motion = recording.motion
    flown = motion.position[-1] - motion.position[0]
    np.testing.assert_allclose(np.trapezoid(motion.velocity, recording.time, axis=0), flown, atol=0.5)
    assert not recording.bridged.any()
    assert recording.warnings == []


def test_arrays_are_handed_out_without_copies(turn):
    run = bodyflight.simulate(bodyflight.Flight(turn))
    assert run.measured is run.measured
    assert run.measured.flags.c_contiguous


def test_a_sweep_flies_what_single_runs_fly(turn):
    flight = bodyflight.Flight(turn)
    factors = np.array([[1.0, 1.0, 1.0], [1.3, 1.0, 1.0], [1.0, 0.7, 1.1]])
    swept = bodyflight.sweep(flight, factors)
    for row, (drag, lift, moment) in zip(swept, factors):
        subject = flight.subject.scaled(drag=drag, lift=lift, moment=moment)
        single = bodyflight.simulate(flight.with_subject(subject)).report["rms"]
        np.testing.assert_array_equal(row, [single[name] for name in bodyflight.Run.channels])


def test_a_search_is_the_programs(turn, program):
    found = bodyflight.tune([bodyflight.Flight(turn)], draws=6, seed=2)
    assert report(program("--json", "tune", turn, "--draws", "6", "--seed", "2")) == report(found)


def test_trim_is_the_programs(program):
    assert report(program("--json", "trim", "--density", "0.9")) == bodyflight.trim(density=0.9)


def test_no_effect_is_named_if_none_is_missing(turn):
    flight = bodyflight.Flight(turn)
    shares = []
    assert bodyflight.discover([flight], progress=shares.append)["effects"] == []
    assert shares == sorted(shares) and 0.5 < shares[-1] <= 1.0


def test_data_frames_have_the_names_of_the_files(turn):
    pytest.importorskip("pandas")
    frame = bodyflight.run_frame(bodyflight.simulate(bodyflight.Flight(turn)))
    assert frame.index.name == "time_s"
    assert "simulated_vertical_velocity_mps" in frame
