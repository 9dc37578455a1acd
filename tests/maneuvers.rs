//! The scripts perform the maneuvers that they are named after, flown by the default subject.

use bodyflight_core::dynamics::muscle_input::{FITTED_LEVER_ARMS, LEVER_ARMS, MuscleForces};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::math::wrap_angle;
use bodyflight_core::observation::Observation;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_laboratory::synthesize::{Request, fly};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;

/// The channels of a maneuver, frame by frame, without noise and sway, flown with the paper's muscle forces.
fn seen(name: &str) -> Vec<(f64, Observation<f64>)> {
    flown(name, MuscleForces::Paper, LEVER_ARMS)
}

/// The channels of a maneuver flown with the paper's forces as they fit its results.
fn seen_as_fitted(name: &str) -> Vec<(f64, Observation<f64>)> {
    flown(name, MuscleForces::Paper, FITTED_LEVER_ARMS)
}

/// The channels of a maneuver flown with moments alone, as by `synth`.
fn seen_of_synth(name: &str) -> Vec<(f64, Observation<f64>)> {
    flown(name, MuscleForces::Moment, LEVER_ARMS)
}

fn flown(name: &str, forces: MuscleForces, arms: [f32; 4]) -> Vec<(f64, Observation<f64>)> {
    let subject = Subject::default();
    let mut flight = Flight::bare(std::path::Path::new(""));
    let maneuver = Maneuver::from_name(name).expect("a known maneuver");
    flight.muscles = maneuver.muscles.with_forces(forces).with_lever_arms(arms);
    let request = Request {
        noise: SensorNoise::NONE,
        sway: 0.0,
        ..Request::new(maneuver, &subject, 0)
    };
    let mut seen = Vec::new();
    let mut each = |frame: FlightFrame| {
        let motion = frame.motion()?;
        seen.push((frame.time, Observation::of(&motion)));
        Ok(())
    };
    fly(&request, &flight.dynamics(4000.0), &mut each, &mut |_| {}).expect("a flight");
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
    let seen = seen_of_synth("exit-and-tracking");
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
    // The paper's skydiver reaches 33 m/s with a pitch input between 1 and 2.
    let tracking = seen.iter().filter(|(time, _)| (12.0..22.0).contains(time));
    let fastest = tracking
        .map(|(_, o)| o.horizontal_speed)
        .fold(0.0, f64::max);
    assert!((28.0..36.0).contains(&fastest), "{fastest} m/s");
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

#[test]
fn the_papers_track_reaches_its_speed_and_rolls_over_and_back() {
    let seen = seen_as_fitted("paper-tracking");
    for (time, belly) in [(20.0, true), (28.0, true), (38.0, false), (52.0, true)] {
        let angles = at(&seen, time).angles;
        assert_eq!(on_belly(at(&seen, time)), belly, "{time} s: {angles:?}");
    }
    // The paper: "its maximum at about 33 m/s" with a pitch input between 1 and 2.
    let tracking = seen.iter().filter(|(time, _)| (10.0..28.0).contains(time));
    let fastest = tracking
        .map(|(_, o)| o.horizontal_speed)
        .fold(0.0, f64::max);
    println!("{fastest} m/s");
    assert!((32.0..34.0).contains(&fastest), "{fastest} m/s");
}

#[test]
fn the_papers_transitions_go_over_at_its_rates() {
    let seen = seen_as_fitted("paper-transitions");
    go_over_fourteen_times(&seen);
    // The paper gives 7 rad/s as the amplitude of its flights.
    let rate = largest(&seen, |o| o.angular_velocity.norm());
    println!("{rate} rad/s");
    assert!((6.0..9.0).contains(&rate), "{rate} rad/s");
}

#[test]
fn fourteen_transitions_go_over_fourteen_times() {
    go_over_fourteen_times(&seen_of_synth("fourteen-transitions"));
}

fn go_over_fourteen_times(seen: &[(f64, Observation<f64>)]) {
    for number in 0..14 {
        let end = 2.0 + 3.2 * f64::from(number + 1) - 0.05;
        let o = at(seen, end);
        let belly = number % 2 == 1;
        assert_eq!(on_belly(o), belly, "{}: {:?}", number + 1, o.angles);
    }
}

#[test]
fn a_tense_novice_rocks_more_and_more_and_a_relaxed_one_less() {
    let seen = seen_of_synth("roll-oscillation");
    let swing = |from: f64, to: f64| {
        let part = seen.iter().filter(|(time, _)| (from..to).contains(time));
        let rolls: Vec<f64> = part.map(|(_, o)| o.angles.roll).collect();
        let high = rolls.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let low = rolls.iter().copied().fold(f64::INFINITY, f64::min);
        high - low
    };
    let [begun, grown, calm] = [(5.0, 6.0), (10.0, 11.0), (19.0, 20.0)].map(|(a, b)| swing(a, b));
    println!("{begun:.4} {grown:.4} {calm:.4} rad");
    assert!(grown > 1.5 * begun && calm < 0.5 * grown);
}

#[test]
fn a_suit_with_booties_turns_both_ways() {
    let seen = seen_of_synth("rw-suit-turns");
    let (right, left) = (
        largest(&seen, |o| -o.yaw_rate),
        largest(&seen, |o| o.yaw_rate),
    );
    assert!(right > 2.0 && left > 2.0, "{right} {left} rad/s");
}
