//! A skydiver turns by moving the arms: `cargo run -p bodyflight-core --example turn`.
//!
//! The maneuver is a script of postures over time. Only the postures go in; the motion comes out.

use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::trim::trim;
use bodyflight_core::dynamics::{Dynamics, Motion};
use bodyflight_core::frame::{AttitudeAngles, Vector};
use bodyflight_core::maneuver::Maneuver;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = Person::new(1.68, 62.0, Sex::Female).body()?;
    let dynamics = Dynamics::<f32>::paper(body.cast(), 1.0);
    let turns = Maneuver::from_name("rotations").ok_or("no maneuver of that name")?;

    let posture = turns.posture(0.0);
    let fall = trim(&dynamics, &posture, 0.0).map_err(|error| format!("{error:?}"))?;
    let inertial_from_body = turns.start_attitude();
    let start = Motion {
        inertial_from_body,
        position: Vector::zero(),
        velocity: inertial_from_body.inverse() * Vector::new(0.0, 0.0, -fall.terminal_speed),
        angular_velocity: Vector::zero(),
    };

    let rest = PostureRate::zero();
    let mut run = FreeRun::new(&dynamics, Equations::Exact, &start, &posture, &rest);
    println!("time (s)  heading (deg)  turn rate (deg/s)");
    for frame in 1..=240 * 12_u16 {
        let time = f64::from(frame) / 240.0;
        run.advance(
            &dynamics,
            &turns.inputs(time),
            &turns.posture(time),
            1.0 / 240.0,
        );
        if frame % 240 == 0 {
            let motion = run.motion(&dynamics, &rest);
            println!(
                "{time:8.0}  {:13.0}  {:17.0}",
                AttitudeAngles::of(&motion.inertial_from_body)
                    .heading
                    .to_degrees(),
                motion.angular_velocity.y().to_degrees()
            );
        }
    }
    Ok(())
}
