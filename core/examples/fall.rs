//! A person leaves an aircraft and falls to terminal speed: `cargo run -p bodyflight-core --example fall`.

use bodyflight_core::air::Density;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::trim::{trim, with_knees};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::frame::{Vector, facing_north};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = Person::new(1.75, 75.0, Sex::Male).body()?;
    let mut dynamics = Dynamics::<f64>::paper(body, 1.0);

    // Find the bend of the knees at which the neutral posture falls straight down.
    let fall = trim(&dynamics, &pattern::neutral(), 0.0).map_err(|error| format!("{error:?}"))?;
    let posture = with_knees(&pattern::neutral(), fall.knee);
    println!(
        "trimmed at 1 kg/m3: {:.1} m/s, knees bent by {:.0} deg",
        fall.terminal_speed,
        fall.knee.to_degrees()
    );

    // The fall starts at 4000 m, so the air grows denser on the way down.
    dynamics.air.density = Density::StandardAtmosphere {
        origin_altitude: 4000.0,
    };
    let exit = Motion {
        inertial_from_body: facing_north(fall.body_pitch),
        position: Vector::zero(),
        velocity: Vector::zero(),
        angular_velocity: Vector::zero(),
    };
    let rest = PostureRate::zero();
    let mut run = FreeRun::new(&dynamics, Equations::Exact, &exit, &posture, &rest);
    println!("time (s)  fall rate (m/s)  height lost (m)");
    for second in 1..=20 {
        for _ in 0..240 {
            run.advance(&dynamics, &Inputs::belly_turn(), &posture, TIME_STEP);
        }
        let motion = run.motion(&dynamics, &rest);
        println!(
            "{second:8}  {:15.1}  {:15.0}",
            -motion.velocity_inertial().up(),
            -motion.position.up()
        );
    }
    Ok(())
}
