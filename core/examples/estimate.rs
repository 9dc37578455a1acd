//! Estimates a skydiver's muscle input with the unit's filter: `cargo run -p bodyflight-core --example estimate`.
//!
//! The same model flies and estimates here, so this shows how the filter is used, not how good it is. The rolls start
//! within 0.2 s, faster than the filter expects of a person: it finds them, but meanwhile reports that it is lost.

use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::{Dynamics, Motion};
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::measurement::MotionMeasurement;
use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_core::estimator::motion::state::MUSCLE;
use bodyflight_core::frame::Vector;
use bodyflight_core::maneuver::Maneuver;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rolls = Maneuver::from_name("barrel-roll").ok_or("no maneuver of that name")?;
    let body = Person::new(1.75, 75.0, Sex::Male).body()?;
    let mut dynamics = Dynamics::<f32>::paper(body.cast(), 1.0);
    dynamics.muscles = rolls.muscles;

    let posture = rolls.posture(0.0);
    let inertial_from_body = rolls.start_attitude();
    let start = Motion {
        inertial_from_body,
        position: Vector::zero(),
        velocity: inertial_from_body.inverse() * Vector::new(0.0, 0.0, -52.0),
        angular_velocity: Vector::zero(),
    };
    let rest = PostureRate::zero();
    let mut run = FreeRun::new(&dynamics, Equations::Exact, &start, &posture, &rest);
    let mut filter = ReducedMotionFilter::new(&MOTION, &dynamics, &start, &posture)
        .map_err(|error| format!("{error:?}"))?;

    println!("time (s)  true roll input  estimated       consistency");
    for frame in 1..=240 * 8_u16 {
        let time = f64::from(frame) / 240.0;
        let (posture, inputs) = (rolls.posture(time), rolls.inputs(time));
        run.advance(&dynamics, &inputs, &posture, 1.0 / 240.0);
        let measured = MotionMeasurement::of(&run.motion(&dynamics, &rest));
        let Some(estimate) = filter.push(&posture, &measured) else {
            continue;
        };
        if frame % 120 == 0 {
            println!(
                "{time:8.1}  {:15.2}  {:5.2} +- {:.2}  {:>12}",
                inputs.muscle.roll,
                estimate.inputs.muscle.roll,
                estimate.deviation[MUSCLE + 2],
                estimate.consistency.name()
            );
        }
    }
    Ok(())
}
