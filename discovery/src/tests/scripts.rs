//! Flights of the maneuver scripts: fast rotation with inputs that change over time.

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::frame::Vector;
use bodyflight_core::maneuver::Maneuver;

use super::*;

/// The beginning of a script, recorded without errors.
fn exact(name: &str, duration: f64) -> RecordedFlight {
    let maneuver = Maneuver::from_name(name).unwrap();
    let dynamics = Dynamics {
        muscles: maneuver.muscles,
        ..test_subject::dynamics()
    };
    let rate = |time: f64| {
        let [before, after] =
            [time - TIME_STEP, time + TIME_STEP].map(|time| maneuver.posture(time));
        PostureRate::between(&before, &after, 2.0 * TIME_STEP)
    };
    let inertial_from_body = maneuver.start_attitude();
    let start = Motion {
        inertial_from_body,
        position: Vector::new(0.0, 0.0, 4000.0),
        velocity: inertial_from_body.inverse() * Vector::new(0.0, 0.0, -50.0),
        angular_velocity: Vector::zero(),
    };
    let posture = |time: f64| maneuver.posture(time);
    let mut run = FreeRun::new(
        &dynamics,
        Equations::Exact,
        &start,
        &posture(0.0),
        &rate(0.0),
    );
    let mut frames = Vec::new();
    let times = (0..).map(|k| f64::from(k) * TIME_STEP);
    for time in times.take_while(|time: &f64| *time < duration) {
        frames.push(FlightSample {
            time,
            posture: posture(time),
            motion: run.motion(&dynamics, &rate(time)),
        });
        let inputs = maneuver.inputs(time + 0.5 * TIME_STEP);
        run.advance(&dynamics, &inputs, &posture(time + TIME_STEP), TIME_STEP);
    }
    RecordedFlight::new(&frames, dynamics, |time| maneuver.inputs(time))
}

/// With postures or inputs half a frame early, a stretch misses the flight by 0.02 rad/s.
#[test]
fn a_stretch_flies_like_a_free_run() {
    let track = exact("fourteen-transitions", 16.0);
    let plain = plain(&track);
    let (mut squares, mut count) = (0.0, 0.0);
    for mut stretch in stretches(&track) {
        stretch.start = track.samples[stretch.first].motion;
        let residual = residual(&track, &stretch, &plain, &LinearizationPoint::files());
        for row in residual.as_slice().chunks_exact(CHANNELS) {
            squares += row[3..6].iter().map(|rate| rate * rate).sum::<f64>();
            count += 1.0;
        }
    }
    let fastest = track.samples.iter();
    let fastest = fastest.map(|sample| sample.motion.angular_velocity.norm());
    assert!(fastest.fold(0.0, f64::max) > 8.0);
    let error = (squares / count).sqrt();
    assert!(error < 0.005, "{error} rad/s");
}
