//! The scripts do what their names say, flown by the default subject.

use bodyflight::formats::flight::Flight;
use bodyflight::formats::recording::FlightFrame;
use bodyflight::formats::subject::Subject;
use bodyflight::verbs::synthesize::{JointError, Request, fly};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::math::wrap_angle;
use bodyflight_core::observation::Observation;
use bodyflight_core::sensor_noise::SensorNoise;

/// What is seen of a maneuver, frame by frame, without noise and sway.
fn seen(name: &str) -> Vec<(f64, Observation<f64>)> {
    let subject = Subject::default();
    let mut flight = Flight::bare(std::path::Path::new(""));
    let maneuver = Maneuver::from_name(name).expect("a known maneuver");
    flight.muscles = maneuver.muscles;
    let request = Request {
        maneuver,
        subject: &subject,
        density: 1.0,
        seed: 0,
        noise: SensorNoise::NONE,
        joint_error: JointError::default(),
        sway: 0.0,
        tunnel: false,
    };
    let mut seen = Vec::new();
    let each = |frame: FlightFrame| {
        let motion = frame.motion()?;
        seen.push((frame.time, Observation::of(&motion)));
        Ok(())
    };
    fly(&request, &flight.dynamics(4000.0), each, |_| {}).expect("a flight");
    seen
}

fn at(seen: &[(f64, Observation<f64>)], time: f64) -> &Observation<f64> {
    let found = seen
        .iter()
        .find(|(t, _)| *t >= time)
        .expect("a time of the flight");
    &found.1
}

fn largest(seen: &[(f64, Observation<f64>)], value: impl Fn(&Observation<f64>) -> f64) -> f64 {
    seen.iter()
        .map(|(_, observation)| value(observation))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Whether the belly faces the earth: roll within 45 deg of level.
fn on_belly(observation: &Observation<f64>) -> bool {
    observation.angles.roll.abs() < 0.8
}

#[test]
fn rotations_are_full_circles_both_ways() {
    let seen = seen("rotations");
    let heading = |pair: &[(f64, Observation<f64>)]| {
        wrap_angle(pair[1].1.angles.heading - pair[0].1.angles.heading)
    };
    let (mut left, mut right) = (0.0, 0.0);
    for turn in seen.windows(2).map(heading) {
        if turn > 0.0 {
            left += turn
        } else {
            right -= turn
        }
    }
    let circle = core::f64::consts::TAU;
    assert!(
        left > 2.0 * circle && right > 2.0 * circle,
        "{left} {right} rad"
    );
    assert!((2.0..7.5).contains(&largest(&seen, |o| o.yaw_rate.abs())));
}

#[test]
fn a_slide_and_a_longitudinal_move_gain_ground() {
    for name in ["side-slides", "longitudinal"] {
        let speed = largest(&seen(name), |o| o.horizontal_speed);
        assert!((1.5..12.0).contains(&speed), "{name}: {speed} m/s");
    }
}

#[test]
fn arching_falls_faster_and_dearching_slower() {
    let seen = seen("vertical");
    let arched = -at(&seen, 5.0).vertical_velocity;
    let dearched = -at(&seen, 11.0).vertical_velocity;
    assert!(arched > dearched + 3.0, "{arched} {dearched} m/s");
}

#[test]
fn rolls_and_loops_go_over_the_back_and_return() {
    for (name, over, end) in [
        ("barrel-roll", 2.0..4.0, 7.5),
        ("back-loop", 1.5..3.5, 10.0),
    ] {
        let seen = seen(name);
        let passes = seen
            .iter()
            .any(|(t, o)| over.contains(t) && o.angles.roll.abs() > 2.3);
        assert!(passes, "{name} never shows its back");
        assert!(
            on_belly(at(&seen, end)),
            "{name} ends as {:?}",
            at(&seen, end).angles
        );
    }
}

#[test]
fn transitions_alternate_between_belly_and_back() {
    let seen = seen("transitions");
    for (time, belly) in [
        (1.0, true),
        (7.0, false),
        (14.0, true),
        (21.0, false),
        (29.0, true),
    ] {
        assert_eq!(
            on_belly(at(&seen, time)),
            belly,
            "{time} s: {:?}",
            at(&seen, time).angles
        );
    }
}

#[test]
fn a_track_from_the_aircraft_goes_over_the_back_and_returns() {
    let seen = seen("exit-and-tracking");
    for second in 0..55 {
        let o = at(&seen, f64::from(second));
        println!(
            "{second}: roll {:.2} pitch {:.2} speed {:.1} fall {:.1}",
            o.angles.roll, o.angles.pitch, o.horizontal_speed, o.vertical_velocity
        );
    }
    for (time, belly) in [(20.0, true), (38.0, false), (52.0, true)] {
        let angles = at(&seen, time).angles;
        assert_eq!(on_belly(at(&seen, time)), belly, "{time} s: {angles:?}");
    }
    assert!((12.0..30.0).contains(&at(&seen, 25.0).horizontal_speed));
}

#[test]
fn aggressive_turns_are_fast_and_tilt_the_body() {
    let seen = seen("aggressive-turns");
    let rate = largest(&seen, |o| o.yaw_rate.abs());
    let tilt = largest(&seen, |o| o.angles.roll.abs().max(o.angles.pitch.abs()));
    println!("{rate} rad/s, {tilt} rad");
    assert!((4.0..14.0).contains(&rate) && tilt < 1.5);
}

#[test]
fn a_layout_ends_on_the_back_and_a_track_covers_ground() {
    assert!(!on_belly(at(&seen("layouts"), 10.0)));
    let track = seen("tracking");
    let speed = largest(&track, |o| o.horizontal_speed);
    assert!((10.0..30.0).contains(&speed), "{speed} m/s");
}
