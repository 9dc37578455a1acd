//! Declared ranges: their page, flights within them, and the effect of rounding to their formats.

use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, PostureSample, State};
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::ranges::{
    ANGULAR_MOMENTUM, ANGULAR_VELOCITY, CENTRE, DAMPING, DAMPING_RATE, DYNAMIC_PRESSURE, FORCE,
    INERTIA, INVERSE_INERTIA, LINEAR_MOMENTUM, MOMENT, MUSCLE_INPUT, POSITION, RANGES, Range,
    TABLE_HEAD, VELOCITY, quantised,
};
use bodyflight_core::frame::Vector;
use bodyflight_core::math::wrap_angle;
use bodyflight_tests::estimator_flights::{ANGLE_FLYING, FLIPS_AND_ROLLS, Flight, TURNS};
use bodyflight_tests::transitions::STYLES;
use bodyflight_tests::{reference, reference_body};
use nalgebra::Vector3;

/// The expected content of the page.
fn page() -> String {
    let mut text = String::from(
        "# Ranges\n\n\
        The table lists each number in the dynamics and the filter with its declared range and the 32-bit \
        fixed-point format that holds it with one guard bit. It is generated from \
        `core/src/estimator/ranges.rs` by \
        `BODYFLIGHT_WRITE_DOCS=1 cargo test -p bodyflight-tests --test estimator_ranges`. The test fails if the \
        page is out of date, if a flight leaves a range, or if rounding every state to its format after every \
        step changes a prediction over 0.25 s by more than a tenth of the sensor noise.\n\n",
    );
    text.push_str(TABLE_HEAD);
    text.push('\n');
    for range in RANGES {
        text.push_str(&format!("{range}\n"));
    }
    text
}

#[test]
fn the_page_is_what_the_code_declares() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/ranges.md");
    if std::env::var_os("BODYFLIGHT_WRITE_DOCS").is_some() {
        std::fs::write(path, page()).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), page());
}

/// Flies a script step by step.
fn walk(
    flight: &Flight,
    mut visit: impl FnMut(usize, &Inputs<f64>, &Dynamics<f64>, &State<f64>, &PostureSample<f64>),
) {
    let Some(table) = reference("segments.json") else {
        return;
    };
    let record = flight.fly(&reference_body(&table), BACK_TRACKING);
    let dynamics = record.dynamics;
    let start = dynamics.hold(&record.postures[0]);
    let mut state = State::from_motion(&record.motions[0], &start);
    for (k, ends) in record.postures.windows(2).enumerate() {
        let sample = dynamics.between(&ends[0], &ends[1], TIME_STEP);
        let inputs = record.course.inputs((k as f64 + 0.5) * TIME_STEP);
        visit(k, &inputs, &dynamics, &state, &sample);
        state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
    }
}

#[test]
fn whole_flights_stay_in_range() {
    let mut used: Vec<(Range, f64)> = Vec::new();
    let mut note = |range: &Range, values: &[f64]| {
        let largest = values.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        assert!(
            values.iter().all(|v| range.holds(*v)),
            "{}: {values:?}",
            range.name
        );
        match used.iter_mut().find(|(r, _)| r == range) {
            Some((_, top)) => *top = top.max(largest),
            None => used.push((*range, largest)),
        }
    };
    for flight in [ANGLE_FLYING, FLIPS_AND_ROLLS, STYLES[0].flight(), TURNS] {
        walk(&flight, |_, inputs, dynamics, state, sample| {
            let motion = state.motion(sample);
            let velocity = motion.velocity;
            let (loads, damping) = dynamics.loads(sample, inputs, &velocity, &Vector::zero(), 1.0);
            note(&POSITION, &state.cg_position.to_array());
            note(&VELOCITY, &velocity.to_array());
            note(&ANGULAR_VELOCITY, &motion.angular_velocity.to_array());
            note(&LINEAR_MOMENTUM, &state.linear_momentum.to_array());
            note(&ANGULAR_MOMENTUM, &state.angular_momentum.to_array());
            note(&CENTRE, sample.mass.cg.as_slice());
            note(&INERTIA, sample.inertia.as_slice());
            note(&INVERSE_INERTIA, sample.inverse_inertia.as_slice());
            note(&FORCE, loads.force.as_slice());
            note(&MOMENT, loads.moment.as_slice());
            note(&DAMPING_RATE, damping.as_slice());
            note(&DYNAMIC_PRESSURE, &[0.5 * velocity.norm_squared()]);
            note(&MUSCLE_INPUT, &inputs.muscle.to_array());
            note(&DAMPING, &inputs.damping.to_array());
        });
    }
    for (range, top) in used {
        println!("{:24} reached {top:9.3} of {}", range.name, range.limit);
    }
}

/// A posture sample with everything that a step reads of it rounded to its format.
fn coarse(sample: &PostureSample<f64>) -> PostureSample<f64> {
    let vector = |v: &Vector3<f64>, range: &Range| v.map(|c| range.rounded(c));
    let mut coarse = *sample;
    coarse.mass.cg = vector(&sample.mass.cg, &CENTRE);
    coarse.motion.cg_rate = vector(&sample.motion.cg_rate, &VELOCITY);
    coarse.inertia = sample.inertia.map(|c| INERTIA.rounded(c));
    coarse.inverse_inertia = sample.inverse_inertia.map(|c| INVERSE_INERTIA.rounded(c));
    coarse.relative_angular_momentum = vector(&sample.relative_angular_momentum, &ANGULAR_MOMENTUM);
    coarse
}

#[test]
fn rounding_every_state_to_its_format_does_not_show() {
    // Predictions over successive quarter seconds of flight, exact and with all states and postures rounded.
    for flight in [ANGLE_FLYING, FLIPS_AND_ROLLS, STYLES[0].flight(), TURNS] {
        let mut windows: Vec<(State<f64>, State<f64>)> = Vec::new();
        let mut worst = [0.0f64; 4];
        walk(&flight, |k, inputs, dynamics, state, sample| {
            if k % 60 == 0 {
                for (exact, rounded) in windows.drain(..) {
                    let [a, b] = [exact, rounded].map(|s| Measurement::of(&s.motion(sample)));
                    // Near a pitch of 90 degrees, heading and roll are undefined.
                    if a.pitch.abs() < 1.3 {
                        let differences = [
                            a.horizontal_speed - b.horizontal_speed,
                            wrap_angle(a.heading - b.heading),
                            wrap_angle(a.pitch - b.pitch),
                            wrap_angle(a.roll - b.roll),
                        ];
                        for (worst, difference) in worst.iter_mut().zip(differences) {
                            *worst = worst.max(difference.abs());
                        }
                    }
                }
                windows.push((*state, quantised(state)));
            }
            for (exact, rounded) in &mut windows {
                *exact = dynamics.step(exact, sample, inputs, TIME_STEP);
                *rounded = quantised(&dynamics.step(rounded, &coarse(sample), inputs, TIME_STEP));
            }
        });
        println!(
            "{}: rounding moves a prediction by {worst:?} (V_hor, heading, pitch, roll)",
            flight.name
        );
        for (worst, deviation) in worst.into_iter().zip([0.1, 0.05, 0.01, 0.01]) {
            assert!(worst < deviation / 10.0, "{}: {worst}", flight.name);
        }
    }
}
