"""Mass, momentum and loads of postures, the linear model, and flights from arrays, against laws that they must obey."""

import bodyflight
import numpy as np
import pytest

NEUTRAL = bodyflight.posture()


def test_a_posture_is_turned_by_named_angles():
    bent = bodyflight.posture("neutral", {"l_shank.bend": 0.3})
    knee = bodyflight.Subject.segments.index("l_shank")
    others = [index for index in range(16) if index != knee]
    np.testing.assert_array_equal(bent[others], NEUTRAL[others])
    assert 2 * np.arccos(abs(bent[knee] @ NEUTRAL[knee])) == pytest.approx(0.3)
    with pytest.raises(bodyflight.BadInput, match="l_shank has no angle"):
        bodyflight.posture(angles={"l_shank.bent": 0.3})


def test_mass_and_inertia_are_those_of_a_body():
    person = bodyflight.Subject()
    found = bodyflight.mechanics(person, [NEUTRAL, bodyflight.posture("track")])
    assert found.mass == person.mass == pytest.approx(person.segment_table()[:, 0].sum())
    # The body is as good as symmetric, and its centre of mass is near the pelvis.
    assert np.abs(found.centre_of_mass[:, 0]).max() < 1e-9
    assert np.abs(found.centre_of_mass).max() < 0.3
    for inertia in found.inertia:
        np.testing.assert_allclose(inertia, inertia.T, atol=1e-12)
        small, middle, large = np.linalg.eigvalsh(inertia)
        assert 0.0 < small and large < small + middle
    assert (found.segment_force == 0.0).all() and (found.linear_momentum == 0.0).all()


def test_momentum_is_mass_times_the_velocity_of_the_centre_of_mass():
    person = bodyflight.Subject()
    velocity, spin = np.array([[3.0, -1.0, -50.0]]), np.array([[0.3, -0.5, 1.0]])
    found = bodyflight.mechanics(person, [NEUTRAL], velocity=velocity, angular_velocity=spin)
    # By default, the axes of the body are those of the ground.
    centre = velocity[0] + np.cross(spin[0], found.centre_of_mass[0])
    np.testing.assert_allclose(found.linear_momentum[0], found.mass * centre, atol=1e-9)
    np.testing.assert_allclose(found.angular_momentum[0], found.inertia[0] @ spin[0], atol=1e-9)


def test_moving_joints_have_angular_momentum():
    time = np.array([0.0, 0.1, 0.2])
    arms = [bodyflight.posture(angles={"l_upperarm.psi": by}) for by in (0.0, 0.2, 0.4)]
    still = bodyflight.mechanics(bodyflight.Subject(), arms)
    moving = bodyflight.mechanics(bodyflight.Subject(), arms, time=time)
    assert np.abs(still.angular_momentum).max() == 0.0
    assert np.abs(moving.angular_momentum[1]).max() > 0.1
    with pytest.raises(bodyflight.BadInput, match="time, row 2"):
        bodyflight.mechanics(bodyflight.Subject(), arms, time=[0.0, 0.1, 0.1])


def test_the_air_carries_a_body_in_its_steady_fall():
    linear = bodyflight.linearize()
    fall = linear.fall
    assert fall["fall_rate_mps"] == pytest.approx(bodyflight.trim()["terminal_speed_mps"])
    half = 0.5 * fall["body_pitch_rad"]
    pitched = [[np.cos(half), np.sin(half), 0.0, 0.0]]
    velocity = [[0.0, 0.0, -fall["fall_rate_mps"]]]
    found = bodyflight.mechanics(bodyflight.Subject(), [linear.posture], velocity=velocity, inertial_from_body=pitched)
    force = found.segment_force[0].sum(axis=0)
    assert np.linalg.norm(force) == pytest.approx(found.mass * 9.81, rel=2e-3)
    # The moment about the centre of mass vanishes.
    moment = found.segment_moment[0].sum(axis=0) - np.cross(found.centre_of_mass[0], force)
    assert np.abs(moment).max() < 0.5


def test_the_linear_model_predicts_small_changes():
    """Shapes, names, and the drag of a faster fall: d(acceleration)/d(velocity) is -2 g / v at terminal speed."""
    linear = bodyflight.linearize()
    states, inputs, outputs = len(linear.states), len(linear.inputs), len(linear.outputs)
    assert (states, inputs, outputs) == (9, 45, 5)
    assert linear.A.shape == (states, states) and linear.C.shape == (outputs, states)
    assert linear.B.shape == linear.B_rate.shape == (states, inputs)
    assert linear.D.shape == linear.D_rate.shape == (outputs, inputs)
    up = linear.states.index("velocity_up_mps")
    assert linear.A[up, up] == pytest.approx(-2 * 9.81 / linear.fall["fall_rate_mps"], rel=0.02)
    # Turning to the left and to the right mirror each other.
    turn = linear.outputs.index("turn_rate_radps")
    spin = linear.states.index("angular_velocity_dorsal_radps")
    assert abs(linear.C[turn, spin]) == pytest.approx(1.0, abs=0.1)


def test_a_flight_from_arrays_is_the_flight_that_they_came_from(turn, tmp_path):
    flight = bodyflight.Flight(turn)
    read = flight.read()
    motion = read.motion
    arrays = dict(
        time=read.time,
        position=motion.position,
        inertial_from_body=motion.inertial_from_body,
        parent_from_segment=read.parent_from_segment,
        velocity=motion.velocity,
        angular_velocity=motion.angular_velocity,
    )
    made = bodyflight.Flight.from_arrays(tmp_path / "made", subject=flight.subject, **arrays)
    again = made.read()
    np.testing.assert_allclose(again.time, read.time, atol=1e-3)
    np.testing.assert_allclose(again.motion.position, motion.position, atol=2e-6)
    np.testing.assert_allclose(again.motion.velocity, motion.velocity, atol=2e-6)
    np.testing.assert_allclose(again.motion.angular_velocity, motion.angular_velocity, atol=1e-4)
    np.testing.assert_allclose(again.parent_from_segment, read.parent_from_segment, atol=1e-5)
    with pytest.raises(bodyflight.BadInput, match="made"):
        bodyflight.Flight.from_arrays(tmp_path / "made", **arrays)
    with pytest.raises(bodyflight.BadInput, match="time, row 5"):
        uneven = {**arrays, "time": np.where(np.arange(len(read.time)) == 5, read.time + 0.002, read.time)}
        bodyflight.Flight.from_arrays(tmp_path / "uneven", **uneven)
    assert not (tmp_path / "uneven").exists()
