//! Laws that any correct model obeys: momentum without air, the falling cat, stiff damping, invariance.

use bodyflight_core::aerodynamics::{Aerodynamics, ArchFactor, Coefficients};
use bodyflight_core::air::standard_density;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::gear::Gear;
use bodyflight_core::body::mass_properties::{MassProperties, PostureRate};
use bodyflight_core::body::pattern;
use bodyflight_core::body::posture::{joint_rotation, pose};
use bodyflight_core::dynamics::equations_of_motion::AsPublished;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::trim::trim;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::Real;
use bodyflight_core::{AxisCoefficients, Body, Posture, Segment};
use bodyflight_tests::{reference, reference_body};
use nalgebra::{UnitQuaternion, Vector3};

/// The reference body in vacuum without gravity.
fn adrift<T: Real>(body: Body<f64>) -> Dynamics<T> {
    Dynamics {
        gravity: T::zero(),
        ..Dynamics::paper(body.cast(), T::zero())
    }
}

fn body() -> Option<Body<f64>> {
    reference("segments.json").map(|table| reference_body(&table))
}

/// Limbs in constant motion: every joint swings about two axes.
fn busy_posture(time: f64) -> Posture<f64> {
    let mut posture = Posture::h_pose();
    for (index, segment) in (0..16u32).zip(Segment::ALL).skip(1) {
        let phase = f64::from(index);
        let angle = |rate: f64| 0.5 * (rate * time + phase).sin();
        posture = posture.with(segment, joint_rotation(0.0, angle(2.1), angle(3.3)));
    }
    posture
}

/// Linear momentum, and angular momentum about the inertial origin, from the positions of masses at two times, without
/// any formula of the integrator.
fn measured_momentum(
    body: &Body<f64>,
    motions: [&Motion<f64>; 2],
    postures: [&Posture<f64>; 2],
    duration: f64,
) -> (Vector3<f64>, Vector3<f64>) {
    let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
    let posed = postures.map(|posture| pose(body, posture));
    for (segment, parameters) in body.segments.iter() {
        let inertia = parameters.inertia.diagonal();
        for axis in 0..3 {
            // Six points represent the segment's mass and inertia.
            let spread = (3.0 * (0.5 * inertia.sum() - inertia[axis]) / parameters.mass).sqrt();
            for sign in [-1.0, 1.0] {
                let mut local = parameters.cg;
                local[axis] += sign * spread;
                let [p, q] = [0, 1].map(|k| {
                    let placed = &posed[k][segment];
                    let in_body = placed.joint + placed.body_from_segment * local;
                    let turned = motions[k].inertial_from_body.quaternion() * in_body;
                    motions[k].position.components + turned
                });
                let momentum = (q - p) * (parameters.mass / 6.0 / duration);
                linear += momentum;
                angular += ((p + q) * 0.5).cross(&momentum);
            }
        }
    }
    (linear, angular)
}

fn momentum_drift<T: Real>(body: &Body<f64>) -> (f64, f64) {
    let dynamics = adrift::<T>(*body);
    let step = T::of(TIME_STEP);
    let at = |k: i32| busy_posture(f64::from(k) * TIME_STEP).cast::<T>();
    let sample = |k: i32| dynamics.between(&at(k), &at(k + 1), step);
    // Motion at a sample: joint rates by central differences.
    let motion = |state: &State<T>, k: i32| {
        let rate = PostureRate::between(&at(k - 1), &at(k + 1), step * T::of(2.0));
        state.motion(&dynamics.sample(&at(k), &rate)).cast::<f64>()
    };
    let start = Motion::<T> {
        inertial_from_body: Rotation::identity(),
        position: Vector::zero(),
        velocity: Vector::new(T::of(0.3), T::of(-0.2), T::of(0.5)),
        angular_velocity: Vector::new(T::of(1.0), T::of(-0.6), T::of(1.4)),
    };
    let mut state = State::from_motion(&start, &sample(0));
    let inputs = Inputs::belly_turn();
    let (mut first, mut worst) = (None, (0.0f64, 0.0f64));
    let mut previous = motion(&state, 0);
    for k in 0..2400 {
        state = dynamics.step(&state, &sample(k), &inputs, step);
        let present = motion(&state, k + 1);
        let postures = [
            busy_posture(f64::from(k) * TIME_STEP),
            busy_posture(f64::from(k + 1) * TIME_STEP),
        ];
        let now = measured_momentum(
            body,
            [&previous, &present],
            [&postures[0], &postures[1]],
            TIME_STEP,
        );
        let (linear, angular) = *first.get_or_insert(now);
        worst.0 = worst.0.max((now.0 - linear).norm() / linear.norm());
        worst.1 = worst.1.max((now.1 - angular).norm() / angular.norm());
        previous = present;
    }
    worst
}

#[test]
fn moving_limbs_in_vacuum_keep_momentum() {
    let Some(body) = body() else { return };
    let (linear, angular) = momentum_drift::<f64>(&body);
    println!(
        "momentum over 10 s at 240 Hz, relative drift: linear {linear:.1e}, angular {angular:.1e}"
    );
    assert!(linear < 1e-4, "linear momentum drifts by {linear:e}");
    assert!(angular < 1e-4, "angular momentum drifts by {angular:e}");
}

#[test]
fn the_state_keeps_its_momenta_in_single_precision() {
    let Some(body) = body() else { return };
    let dynamics = adrift::<f32>(body);
    let start = Motion::<f32> {
        inertial_from_body: Rotation::identity(),
        position: Vector::zero(),
        velocity: Vector::new(0.0, -55.0, 3.0),
        angular_velocity: Vector::new(1.0, -0.6, 1.4),
    };
    let at = |k: i32| busy_posture(f64::from(k) * TIME_STEP).cast::<f32>();
    let step = TIME_STEP as f32;
    let mut state = State::from_motion(&start, &dynamics.between(&at(0), &at(1), step));
    let (linear, angular) = (state.linear_momentum, state.angular_momentum);
    for k in 0..2400 {
        state = dynamics.step(
            &state,
            &dynamics.between(&at(k), &at(k + 1), step),
            &Inputs::belly_turn(),
            step,
        );
    }
    assert!((state.linear_momentum - linear).norm() < 1e-4 * linear.norm());
    assert!((state.angular_momentum - angular).norm() < 1e-4 * angular.norm());
}

/// Raises the right arm by 170 deg in 0.5 s, in a fall at `velocity` (m/s). Returns the rotation of the pelvis (deg)
/// and its final angular velocity (rad/s).
fn cat_turn(body: &Body<f64>, velocity: Vector3<f64>) -> (f64, f64) {
    let dynamics = adrift::<f64>(*body);
    let angle = |time: f64| {
        let share = (time / 0.5).clamp(0.0, 1.0);
        170f64.to_radians() * share * share * (3.0 - 2.0 * share)
    };
    let at = |k: i32| {
        let theta = -angle(f64::from(k) * TIME_STEP);
        Posture::h_pose().with(Segment::RightUpperArm, joint_rotation(0.0, theta, 0.0))
    };
    let start = Motion {
        inertial_from_body: Rotation::identity(),
        position: Vector::zero(),
        velocity: Vector::from_components(velocity),
        angular_velocity: Vector::zero(),
    };
    let rest = dynamics.hold(&at(0));
    let mut state = State::from_motion(&start, &rest);
    for k in 0..150 {
        let sample = dynamics.between(&at(k), &at(k + 1), TIME_STEP);
        state = dynamics.step(&state, &sample, &Inputs::belly_turn(), TIME_STEP);
    }
    let motion = state.motion(&dynamics.hold(&at(150)));
    let turned = motion.inertial_from_body.quaternion().angle().to_degrees();
    (turned, motion.angular_velocity.norm())
}

#[test]
fn a_raised_arm_turns_the_pelvis_at_any_speed() {
    // The person of notes/biomechanics.md, whose pelvis turns by 6.782 deg with the tables given there.
    let body = Person::new(1.755, 75.5, Sex::Male)
        .body()
        .expect("a valid person");
    let (at_rest, spin) = cat_turn(&body, Vector3::zeros());
    let (falling, _) = cat_turn(&body, Vector3::new(0.0, -55.0, 0.0));
    println!("pelvis turns {at_rest:.3} deg at rest, {falling:.3} deg at 55 m/s");
    assert!(
        (at_rest - falling).abs() < 1e-9,
        "Galilean invariance: {at_rest} and {falling} deg"
    );
    assert!(spin < 1e-9, "ends at rest: {spin} rad/s");
    assert!((at_rest - 6.782).abs() < 0.25, "{at_rest} deg");
}

#[test]
fn the_published_equations_break_galilean_invariance() {
    // This is why the dynamics have the exact form: at 55 m/s the same arm movement makes the published body spin.
    let Some(body) = body() else { return };
    let dynamics = adrift::<f64>(body);
    let at = |k: i32| {
        let theta = -2.9 * (f64::from(k) / 120.0).min(1.0);
        Posture::h_pose().with(Segment::RightUpperArm, joint_rotation(0.0, theta, 0.0))
    };
    let start = Motion {
        inertial_from_body: Rotation::identity(),
        position: Vector::zero(),
        velocity: Vector::new(0.0, -55.0, 0.0),
        angular_velocity: Vector::zero(),
    };
    let mut flight = AsPublished::new(start);
    for k in 0..240 {
        let sample = dynamics.between(&at(k), &at(k + 1), TIME_STEP);
        flight.step(&dynamics, &sample, &Inputs::belly_turn(), TIME_STEP);
    }
    let spin = flight.motion().angular_velocity.norm();
    assert!(spin > 1.0, "expected the known fault, found {spin} rad/s");
}

/// Largest and final angular velocity (rad/s) of a neutral fall that starts with a spin, with the same damping
/// coefficient on all axes.
fn spin_under_damping<T: Real>(body: &Body<f64>, damping: f64, seconds: i32) -> (T, T) {
    let dynamics = Dynamics::<T>::paper(body.cast(), T::of(1.225));
    let sample = dynamics.hold(&pattern::neutral());
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::FRAC_PI_2);
    let start = Motion::<f64> {
        inertial_from_body: Rotation::from_quaternion(quarter),
        position: Vector::new(0.0, 0.0, 4000.0),
        velocity: Vector::new(0.0, -60.0, 0.0),
        angular_velocity: Vector::new(3.0, 5.0, -4.0),
    };
    let inputs = Inputs {
        damping: AxisCoefficients::repeat(T::of(damping)),
        ..Inputs::belly_turn()
    };
    let mut state = State::from_motion(&start.cast(), &sample);
    let mut largest = T::zero();
    for _ in 0..240 * seconds {
        state = dynamics.step(&state, &sample, &inputs, T::of(TIME_STEP));
        largest = largest.max(state.motion(&sample).angular_velocity.norm());
    }
    (largest, state.motion(&sample).angular_velocity.norm())
}

#[test]
fn strong_damping_is_stable_and_weak_negative_damping_bounded() {
    let Some(body) = body() else { return };
    let (largest, last) = spin_under_damping::<f32>(&body, 24.0, 10);
    assert!(
        largest < 7.2 && last < 0.05,
        "Cm_damp = 24: {largest} then {last} rad/s"
    );
    let (largest, last) = spin_under_damping::<f32>(&body, -0.25, 2);
    assert!(
        last.is_finite() && largest < 40.0,
        "Cm_damp = -0.25: {largest} rad/s"
    );
}

#[test]
fn inertia_of_any_posture_is_that_of_a_solid() {
    let Some(body) = body() else { return };
    for k in 0..200 {
        let posed = pose(&body, &busy_posture(f64::from(k) * 0.17));
        let inertia = MassProperties::of(&body, &posed).inertia_about_cg();
        let e = inertia.symmetric_eigenvalues();
        assert!(
            e.min() > 0.0 && e.max() <= e.sum() - e.max() + 1e-9,
            "{e:?}"
        );
    }
}

#[test]
fn terminal_speed_is_plausible_for_many_bodies() {
    // Belly pose with suit, helmet and a rig, halfway down from 4000 m: 45 to 62 m/s for 50 to 85 kg.
    for (sex, height, mass) in [
        (Sex::Female, 1.58, 50.0),
        (Sex::Female, 1.65, 60.0),
        (Sex::Male, 1.70, 65.0),
        (Sex::Male, 1.75, 75.0),
        (Sex::Male, 1.82, 85.0),
    ] {
        let person = Person::new(height, mass, sex)
            .body()
            .expect("a valid person");
        let body = Gear {
            rig: 9.0,
            ..Gear::default()
        }
        .fit(&person)
        .expect("valid gear");
        let dynamics = Dynamics::<f64>::paper(body, standard_density(2000.0));
        let trim = trim(&dynamics, &pattern::neutral(), 0.0).expect("a balance");
        println!(
            "{sex:?} {mass} kg: {:.1} m/s, pitch {:.0} deg, knees {:.0} deg",
            trim.terminal_speed,
            trim.body_pitch.to_degrees(),
            trim.knee.to_degrees()
        );
        assert!(
            (45.0..62.0).contains(&trim.terminal_speed),
            "{mass} kg: {trim:?}"
        );
        assert!(
            (80.0..105.0).contains(&trim.body_pitch.to_degrees()),
            "{mass} kg: {trim:?}"
        );
        assert!(trim.pitch_stiffness < 0.0, "{mass} kg: {trim:?}");
    }
}

#[test]
fn a_spin_in_a_tunnel_equals_one_in_free_fall() {
    // GIVEN the same spin in a fall through still air, and held up by an upward flow
    let Some(body) = body() else { return };
    let sample = |dynamics: &Dynamics<f64>| dynamics.hold(&pattern::neutral());
    let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.5);
    let attitude = Rotation::from_quaternion(belly);
    let motion = |velocity: Vector3<f64>| Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::from_components(velocity),
        angular_velocity: Vector::new(0.5, 1.0, -0.5),
    };
    let fall = Dynamics::<f64>::paper(body, 1.0);
    let mut tunnel = fall;
    tunnel.air.velocity = Vector::new(1.0, -2.0, 48.0);
    let mut falling = State::from_motion(&motion(Vector3::new(-1.0, 2.0, -48.0)), &sample(&fall));
    let mut floating = State::from_motion(&motion(Vector3::zeros()), &sample(&tunnel));
    // WHEN both continue for two seconds
    for _ in 0..480 {
        falling = fall.step(&falling, &sample(&fall), &Inputs::belly_turn(), TIME_STEP);
        floating = tunnel.step(
            &floating,
            &sample(&tunnel),
            &Inputs::belly_turn(),
            TIME_STEP,
        );
    }
    // THEN they rotate equally, and their velocities differ by that of the air
    let (a, b) = (
        falling.motion(&sample(&fall)),
        floating.motion(&sample(&tunnel)),
    );
    assert!(
        a.inertial_from_body
            .quaternion()
            .angle_to(b.inertial_from_body.quaternion())
            < 1e-9
    );
    let difference = b.velocity_inertial() - a.velocity_inertial();
    assert!(
        (difference - Vector::new(1.0, -2.0, 48.0)).norm() < 1e-9,
        "{difference:?}"
    );
}

#[test]
fn damping_never_adds_energy() {
    // Only the damping acts: there is no gravity, and the drag, lift and moment coefficients are zero.
    let Some(body) = body() else { return };
    let none = Coefficients {
        drag: 0.0,
        lift: 0.0,
        moment: 0.0,
    };
    let mut cases = 0;
    for (damping, speed, step, density) in [0.0f32, 0.01, 1.0, 6.0, 24.0, 100.0]
        .into_iter()
        .flat_map(|damping| [0.0f32, 10.0, 60.0, 100.0].map(|speed| (damping, speed)))
        .flat_map(|(damping, speed)| {
            [480.0f32, 240.0, 120.0].map(|rate| (damping, speed, 1.0 / rate, 1.225))
        })
    {
        let dynamics = Dynamics::<f32> {
            gravity: 0.0,
            aerodynamics: Aerodynamics::uniform(none, ArchFactor::Fixed(1.0)),
            ..Dynamics::paper(body.cast(), density)
        };
        let sample = dynamics.hold(&pattern::neutral());
        let energy = |state: &State<f32>| {
            let spin = state.motion(&sample).angular_velocity.components;
            0.5 * spin.dot(&(sample.inertia * spin))
        };
        let start = Motion::<f32> {
            inertial_from_body: Rotation::identity(),
            position: Vector::zero(),
            velocity: Vector::new(0.2 * speed, -0.9 * speed, 0.3 * speed),
            angular_velocity: Vector::new(7.0, -5.0, 9.0),
        };
        let inputs = Inputs {
            damping: AxisCoefficients::repeat(damping),
            ..Inputs::belly_turn()
        };
        let mut state = State::from_motion(&start, &sample);
        let first = energy(&state);
        let mut largest = first;
        for _ in 0..480 {
            state = dynamics.step(&state, &sample, &inputs, step);
            largest = largest.max(energy(&state));
        }
        let (at, last) = (format!("Cm_damp {damping} at {speed} m/s"), energy(&state));
        // The attitude error of each step lets the energy of a free body vary, by 0.5 % at 12 rad/s and 120 Hz.
        assert!(largest <= first * 1.01, "{at}: {first} to {largest} J");
        if damping >= 1.0 && speed >= 10.0 {
            assert!(last < 0.97 * first, "{at}: {first} to {last} J");
        }
        cases += 1;
    }
    assert_eq!(cases, 72);
}
