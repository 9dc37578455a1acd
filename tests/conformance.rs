//! Compares the core with an independent implementation, in both precisions.

use bodyflight_core::aerodynamics::compiled::CompiledAerodynamics;
use bodyflight_core::aerodynamics::{
    Aerodynamics, ArchFactor, Coefficients, Flow, damping_rate, expose, total_load,
};
use bodyflight_core::air::Air;
use bodyflight_core::body::mass_properties::{MassMotion, MassProperties};
use bodyflight_core::body::posture::{joint_rotation, pose};
use bodyflight_core::dynamics::equations_of_motion::{MassAcceleration, Wrench, exact};
use bodyflight_core::dynamics::residual::ResidualLoad;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{AxisCoefficients, Posture, Real, Segment};
use bodyflight_tests::{
    assert_close, matrix, numbers, posture_of_angles, quaternion, reference, reference_body, vector,
};
use nalgebra::{Vector1, Vector3};
use serde_json::Value;

/// A floating-point type with the relative tolerance required of it.
trait Precision: Real {
    const TOLERANCE: f64;
}
impl Precision for f64 {
    const TOLERANCE: f64 = 1e-6;
}
impl Precision for f32 {
    const TOLERANCE: f64 = 2e-5;
}

fn cast<T: Real>(v: &Vector3<f64>) -> Vector3<T> {
    v.map(T::of)
}

/// Three numbers as coefficients, in the order pitch, yaw, roll.
fn axis_coefficients<T: Real>(value: &Value) -> AxisCoefficients<T> {
    let [[x, y, z]] = vector(value).data.0;
    AxisCoefficients::new(x, y, z).cast()
}

fn cases<'a>(file: &'a Value, key: &str) -> &'a [Value] {
    let cases = file[key].as_array().expect("an array of cases");
    assert!(!cases.is_empty());
    cases
}

fn check_postures<T: Precision>() {
    let (Some(table), Some(file)) = (reference("segments.json"), reference("postures.json")) else {
        return;
    };
    let body = reference_body(&table).cast::<T>();
    assert_close(
        &Vector1::new(body.mass()),
        &Vector1::new(table["mass"].as_f64().expect("the mass of the person (kg)")),
        1.0,
        T::TOLERANCE,
        "mass",
    );
    for (index, case) in cases(&file, "poses").iter().enumerate() {
        let posture = posture_of_angles(&case["euler_zyx"]);
        for segment in Segment::ALL.into_iter().skip(1) {
            let expected = quaternion(&case["q_parent_from_child"][segment.name()]);
            let angle = posture.parent_from_segment(segment).angle_to(&expected);
            assert!(
                angle < 1e-7,
                "pose {index} {segment:?}: joint off by {angle}"
            );
        }
        let posed = pose(&body, &posture.cast());
        let tolerance = T::TOLERANCE;
        for (segment, placed) in posed.iter() {
            let what = format!("pose {index} {segment:?}");
            let name = segment.name();
            assert_close(
                &placed.joint,
                &vector(&case["joint"][name]),
                1.0,
                tolerance,
                &what,
            );
            assert_close(
                &placed.cg,
                &vector(&case["segment_cg"][name]),
                1.0,
                tolerance,
                &what,
            );
            let axes = quaternion(&case["q_body_from_segment"][name]).to_rotation_matrix();
            assert_close(
                &placed.body_from_segment,
                axes.matrix(),
                1.0,
                tolerance,
                &what,
            );
        }
        let sums = MassProperties::of(&body, &posed);
        let what = format!("pose {index} whole body");
        assert_close(&sums.cg, &vector(&case["cg"]), 0.1, tolerance, &what);
        let about_origin = matrix(&case["inertia_about_origin"]);
        assert_close(
            &sums.inertia_about_origin,
            &about_origin,
            1.0,
            tolerance,
            &what,
        );
        let about_cg = matrix(&case["inertia_about_cg"]);
        assert_close(&sums.inertia_about_cg(), &about_cg, 1.0, tolerance, &what);
    }
}

#[test]
fn masses_and_postures() {
    check_postures::<f64>();
    check_postures::<f32>();
}

fn check_aerodynamics<T: Precision>() {
    let (Some(table), Some(poses), Some(file)) = (
        reference("segments.json"),
        reference("postures.json"),
        reference("aerodynamics.json"),
    ) else {
        return;
    };
    let body = reference_body(&table).cast::<T>();
    let mut segments_checked = 0;
    for (index, case) in cases(&file, "cases").iter().enumerate() {
        let number = |key: &str| case[key].as_f64().expect(key);
        let scalar = |key: &str| T::of(number(key));
        let pose_index = usize::try_from(case["pose"].as_u64().expect("pose")).expect("small");
        let posture = posture_of_angles(&poses["poses"][pose_index]["euler_zyx"]);
        let coefficients = Coefficients {
            drag: scalar("cd"),
            lift: scalar("cl"),
            moment: scalar("cm"),
        };
        let aerodynamics = Aerodynamics::uniform(coefficients, ArchFactor::Fixed(scalar("f_arch")));
        let exposed = expose(&body, &pose(&body, &posture.cast()), &aerodynamics);
        let velocity = vector(&case["velocity"]);
        let flow = Flow::new(&cast::<T>(&velocity), scalar("rho"));
        // The loads of segments nearly cancel in the sums, so rounding errors scale with the individual loads.
        let scale = 0.5 * number("rho") * velocity.norm_squared();
        let tolerance = T::TOLERANCE;
        for row in case["segments"].as_array().into_iter().flatten() {
            segments_checked += 1;
            let segment =
                Segment::from_name(row["segment"].as_str().expect("name")).expect("known");
            let load = exposed[segment].load(&flow.direction);
            let what = format!("case {index} {segment:?}");
            let q = flow.dynamic_pressure;
            assert_close(
                &(load.force * q),
                &vector(&row["force"]),
                scale * 0.1,
                tolerance,
                &what,
            );
            let moment = vector(&row["moment_about_origin"]);
            assert_close(&(load.moment * q), &moment, scale * 0.1, tolerance, &what);
        }
        let spin = vector(&case["angular_velocity"]);
        let damp = axis_coefficients(&case["damp"]);
        let compiled = CompiledAerodynamics::new(exposed).total_load(&flow);
        for (form, loads) in [
            ("plain", total_load(&exposed, &flow)),
            ("compiled", compiled),
        ] {
            let damping = damping_rate(&damp, loads.exposed_area, body.height, &flow);
            let moment = loads.moment - damping.component_mul(&cast(&spin));
            let what = format!("case {index} {form}");
            assert_close(
                &loads.force,
                &vector(&case["force"]),
                scale,
                tolerance,
                &what,
            );
            let expected = vector(&case["moment_about_origin"]);
            assert_close(&moment, &expected, scale, tolerance, &what);
        }
    }
    assert!(segments_checked >= 16, "no case with single segments");
}

#[test]
fn aerodynamic_loads() {
    check_aerodynamics::<f64>();
    check_aerodynamics::<f32>();
}

fn check_equations_of_motion<T: Precision>() {
    let Some(file) = reference("equations_of_motion.json") else {
        return;
    };
    for (index, case) in cases(&file, "cases").iter().enumerate() {
        let v = |key: &str| cast::<T>(&vector(&case[key]));
        let number = |key: &str| case[key].as_f64().expect(key);
        let mass = MassProperties {
            mass: T::of(number("mass")),
            cg: v("cg"),
            inertia_about_origin: matrix(&case["inertia"]).map(T::of),
        };
        let motion = MassMotion {
            cg_rate: v("cg_rate"),
            inertia_rate: matrix(&case["inertia_rate"]).map(T::of),
            relative_angular_momentum: v("relative_angular_momentum"),
        };
        let acceleration = MassAcceleration {
            cg_acceleration: v("cg_acceleration"),
            relative_angular_momentum_rate: v("relative_angular_momentum_rate"),
        };
        let attitude = quaternion(&case["q_inertial_from_body"]);
        let weight = attitude.inverse() * Vector3::new(0.0, 0.0, -number("mass") * number("g"));
        let weight = cast::<T>(&weight);
        let wrench = Wrench {
            force: v("force") + weight,
            moment: v("moment_about_origin") + mass.cg.cross(&weight),
        };
        let (velocity, spin) = (v("velocity"), v("angular_velocity"));
        let rates =
            exact(&mass, &motion, &acceleration, &velocity, &spin, &wrench).expect("regular");
        let what = format!("case {index}");
        let tolerance = T::TOLERANCE;
        let velocity_rate = vector(&case["velocity_rate"]);
        let spin_rate = vector(&case["angular_velocity_rate"]);
        assert_close(
            &rates.velocity_rate,
            &velocity_rate,
            100.0,
            tolerance,
            &what,
        );
        assert_close(
            &rates.angular_velocity_rate,
            &spin_rate,
            100.0,
            tolerance,
            &what,
        );
        // Paper eq. (quat): q' = q (0, W) / 2. The sign is free, since q and -q are the same rotation.
        let expected = numbers(&case["q_rate"]);
        let q_rate = (attitude.into_inner()
            * nalgebra::Quaternion::from_imag(vector(&case["angular_velocity"])))
            * 0.5;
        let sign = if (q_rate.w - expected[0]).abs() < 1e-6 {
            1.0
        } else {
            -1.0
        };
        for (found, expected) in [q_rate.w, q_rate.i, q_rate.j, q_rate.k]
            .iter()
            .zip(&expected)
        {
            assert!((sign * found - expected).abs() < 1e-6, "{what}");
        }
    }
}

#[test]
fn exact_equations_of_motion() {
    check_equations_of_motion::<f64>();
    check_equations_of_motion::<f32>();
}

/// RMS deviations of a free run at 240 Hz from the reference: angular velocity (rad/s), velocity (m/s), attitude (rad).
fn free_run<T: Real>(table: &Value, file: &Value) -> [f64; 3] {
    let number = |key: &str| file[key].as_f64().expect(key);
    let scalar = |key: &str| T::of(number(key));
    let body = reference_body(table).cast::<T>();
    let mut dynamics = Dynamics::paper(body, scalar("rho"));
    dynamics.air = Air::still(scalar("rho"));
    dynamics.gravity = scalar("g");
    let coefficients = Coefficients {
        drag: scalar("cd"),
        lift: scalar("cl"),
        moment: scalar("cm"),
    };
    dynamics.aerodynamics =
        Aerodynamics::uniform(coefficients, ArchFactor::Fixed(scalar("f_arch")));
    let inputs = Inputs {
        muscle: AxisCoefficients::zero(),
        damping: axis_coefficients(&file["damp"]),
        residual: ResidualLoad::none(),
    };
    let base = posture_of_angles(&file["base"]);
    let posture = |time: f64| -> Posture<T> {
        let s = 0.25 * (std::f64::consts::TAU * time / 6.0).sin();
        let quarter = std::f64::consts::FRAC_PI_2;
        base.with(Segment::LeftUpperArm, joint_rotation(0.0, quarter, s))
            .with(Segment::RightUpperArm, joint_rotation(0.0, -quarter, -s))
            .with(Segment::LeftShank, joint_rotation(0.0, 0.0, -1.0 - 0.1 * s))
            .with(Segment::RightShank, joint_rotation(0.0, 0.0, -1.0))
            .cast()
    };
    let row = |key: &str, index: usize| &file[key][index];
    let start = Motion::<f64> {
        inertial_from_body: Rotation::from_quaternion(quaternion(row("q_inertial_from_body", 0))),
        position: Vector::from_components(vector(row("position_inertial", 0))),
        velocity: Vector::from_components(vector(row("velocity_body", 0))),
        angular_velocity: Vector::from_components(vector(row("angular_velocity_body", 0))),
    };
    let at = |time: f64| {
        let (from, to) = (
            posture(time - 0.5 * TIME_STEP),
            posture(time + 0.5 * TIME_STEP),
        );
        dynamics.between(&from, &to, T::of(TIME_STEP))
    };
    let mut state = State::from_motion(&start.cast(), &at(0.0));
    let frames = file["velocity_body"].as_array().expect("frames").len();
    let mut squares = [0.0; 3];
    let steps_each = (number("dt_out") / TIME_STEP).round();
    let mut time = 0.0;
    for index in 1..frames {
        let mut step = 0.0;
        while step < steps_each {
            let sample =
                dynamics.between(&posture(time), &posture(time + TIME_STEP), T::of(TIME_STEP));
            state = dynamics.step(&state, &sample, &inputs, T::of(TIME_STEP));
            time += TIME_STEP;
            step += 1.0;
        }
        let motion = state.motion(&at(time)).cast::<f64>();
        let spin = vector(row("angular_velocity_body", index));
        let velocity = vector(row("velocity_body", index));
        let attitude = quaternion(row("q_inertial_from_body", index));
        squares[0] += (motion.angular_velocity.components - spin).norm_squared();
        squares[1] += (motion.velocity.components - velocity).norm_squared();
        squares[2] += motion
            .inertial_from_body
            .quaternion()
            .angle_to(&attitude)
            .powi(2);
    }
    let count = (frames - 1) as f64;
    squares.map(|sum| (sum / count).sqrt())
}

#[test]
fn free_run_follows_the_reference_trajectory() {
    let (Some(table), Some(file)) = (reference("segments.json"), reference("trajectory.json"))
    else {
        return;
    };
    for (precision, [spin, velocity, attitude]) in [
        ("f64", free_run::<f64>(&table, &file)),
        ("f32", free_run::<f32>(&table, &file)),
    ] {
        println!(
            "{precision}: angular velocity {spin:.5} rad/s, velocity {velocity:.5} m/s, attitude {attitude:.5} rad RMS"
        );
        assert!(
            spin < 0.01,
            "{precision}: angular velocity off by {spin} rad/s"
        );
        assert!(
            velocity < 0.05,
            "{precision}: velocity off by {velocity} m/s"
        );
    }
}
