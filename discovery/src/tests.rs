//! Tests of the parts of the search, with known answers.

mod limits;
mod neighbours;
mod scripts;
mod short_flights;
mod slopes;
mod slopes_alone;
mod strengths;

use crate::named_effect::Outcome;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::effect::{Effect, Model, extended};
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::tolerances::Tolerances;
use bodyflight_laboratory::{self as laboratory, Hidden, JointErrors as Joints, fly};

use crate::hypotheses::decision::DECISION;
use crate::input::flight::RecordedFlight;
use crate::input::sensor_noise::recorded_noise;
use crate::jacobian::effect_parameters::{all_parameters, changed};
use crate::jacobian::finite_difference::{linearized, residual};
use crate::jacobian::layout::{Components, WANDER};
use crate::jacobian::linearization_point::LinearizationPoint;
use crate::jacobian::subject_error::{SUBJECT, Subject, aliased, described};
use crate::likelihood::factor::StretchFactor;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::variance_components::fit;
use crate::progress::Progress;
use crate::shooting::joint_error::{JOINTS, JointErrors};
use crate::shooting::simulator::{Simulator, Steps};
use crate::shooting::stretch::{CHANNELS, Channels, Stretch};
use crate::{Settings, discover, test_subject};

fn model() -> (Dynamics<f64>, Inputs<f64>) {
    (test_subject::dynamics(), Inputs::belly_turn())
}

/// A flight of the laboratory.
fn flown(hidden: &[Hidden], settings: &laboratory::Settings) -> RecordedFlight {
    let (dynamics, inputs) = model();
    RecordedFlight::new(&fly(&dynamics, &inputs, hidden, settings), dynamics, |_| {
        inputs
    })
}

/// A short flight.
fn track(hidden: &[Hidden], noise: f64) -> RecordedFlight {
    lasting(6.0, hidden, noise)
}

/// A flight of this duration (s).
fn lasting(duration: f64, hidden: &[Hidden], noise: f64) -> RecordedFlight {
    let settings = laboratory::Settings {
        seed: 3,
        duration,
        noise,
        ..laboratory::Settings::default()
    };
    flown(hidden, &settings)
}

/// The stretches of a flight, as the search cuts them.
fn stretches(track: &RecordedFlight) -> Vec<Stretch> {
    FlightProblem::new(track, &Tolerances::default()).stretches
}

fn plain(track: &RecordedFlight) -> Model<f64> {
    Model::new(track.dynamics, track.start_height())
}

fn believed(effects: &[(Effect, [f64; 3])]) -> LinearizationPoint {
    LinearizationPoint {
        effects: effects.to_vec(),
        ..LinearizationPoint::files()
    }
}

fn residuals(track: &RecordedFlight, point: &LinearizationPoint) -> f64 {
    let plain = plain(track);
    let squares: f64 = stretches(track)
        .iter()
        .map(|stretch| residual(track, stretch, &plain, point).norm_squared())
        .sum();
    squares.sqrt()
}

#[test]
fn without_noise_the_model_flies_as_recorded_and_effects_are_felt() {
    let effects = [
        (Effect::Wind, [5.0, -3.0, 0.0]),
        (Effect::Updraft, [4.0, 0.0, 0.0]),
        (Effect::ForearmDrag, [2.0, 1.0, 0.0]),
        (Effect::GyroBias, [0.05, -0.02, 0.04]),
        (Effect::GnssLatency, [0.1, 0.0, 0.0]),
        (Effect::RateLag, [0.05, 0.0, 0.0]),
        (Effect::HeadingDrift, [0.02, 0.0, 0.0]),
    ];
    let floor = residuals(&track(&[], 0.0), &LinearizationPoint::files());
    for (effect, values) in effects {
        let track = track(&[Hidden::Effect(effect, values)], 0.0);
        let without = residuals(&track, &LinearizationPoint::files());
        let with = residuals(&track, &believed(&[(effect, values)]));
        assert!(
            without > 5.0 * floor,
            "{effect:?}: {without}, floor {floor}"
        );
        assert!(
            with < 0.5 * without,
            "{effect:?}: {without} to {with}, floor {floor}"
        );
    }
}

/// Where the rotation changes faster than a parabola does, fewer frames are averaged.
#[test]
fn the_start_of_a_stretch_follows_a_rotation_that_changes_fast() {
    let mut track = track(&[], 1.0);
    let frequency = 18.0;
    let truth = |time: f64| 4.0 * (frequency * time).sin();
    for sample in &mut track.samples {
        sample.motion.angular_velocity.components.x += truth(sample.time);
    }
    let mut squares = 0.0;
    let still = self::track(&[], 1.0);
    let starts = stretches(&track);
    for (stretch, before) in starts.iter().zip(stretches(&still)) {
        let rate = |motion: &Motion<f64>| motion.angular_velocity.components.x;
        let added = rate(&stretch.start) - rate(&before.start);
        squares += (added - truth(track.samples[stretch.first].time)).powi(2);
    }
    let error = (squares / starts.len() as f64).sqrt();
    // The noise of a frame is 0.034 rad/s; a parabola of 0.2 s is wrong by more.
    assert!(error < 0.04, "{error}");
}

#[test]
fn joint_errors_are_removed() {
    let exact = track(&[], 0.0);
    let mut wrong = exact.clone();
    let mut errors = JointErrors::none();
    errors.course[0][4] = 0.05;
    errors.bend[31] = 0.1;
    let mut back = JointErrors::none();
    back.course[0][4] = -0.05;
    for sample in &mut wrong.samples {
        sample.posture = back.correct(&sample.posture, 0.0);
    }
    let mut calibration = JointErrors::none();
    calibration.course[0][4] = 0.05;
    let point = LinearizationPoint {
        joints: calibration,
        ..LinearizationPoint::files()
    };
    let (before, after) = (
        residuals(&wrong, &LinearizationPoint::files()),
        residuals(&wrong, &point),
    );
    let floor = residuals(&exact, &LinearizationPoint::files());
    assert!(before > 3.0 * floor, "{before}, floor {floor}");
    assert!(
        (after - floor).abs() < 0.05 * before,
        "{before} to {after}, floor {floor}"
    );
    // The error includes a part proportional to the bend.
    let corrected = errors.correct(&exact.samples[100].posture, 0.3);
    assert_ne!(corrected, exact.samples[100].posture);
}

#[test]
fn the_noise_of_sensors_is_read_from_the_recording() {
    for (rate, sensor_noise) in [(240.0, 1.0), (120.0, 0.5)] {
        let settings = laboratory::Settings {
            rate,
            sensor_noise,
            duration: 12.0,
            ..laboratory::Settings::default()
        };
        let noise = recorded_noise(&flown(&[], &settings));
        for (found, paper) in noise.iter().zip([0.01, 0.03, 0.1, 1.0]) {
            let expected = paper * sensor_noise;
            assert!(
                (found / expected - 1.0).abs() < 0.08,
                "{found}, expected {expected}"
            );
        }
    }
}

#[test]
fn the_wander_of_joints_is_found_and_leaves_the_misfit_at_one() {
    for (wander_deg, gain, sensor_noise, rate) in [
        (0.0, 0.0, 1.0, 240.0),
        (1.5, 0.0, 0.5, 120.0),
        (1.0, 0.05, 0.7, 120.0),
    ] {
        let settings = laboratory::Settings {
            seed: 5,
            duration: 24.0,
            rate,
            sensor_noise,
            joints: Joints {
                constant_deg: 1.1,
                wander_deg,
                wander_hz: 0.3,
                gain,
            },
            ..laboratory::Settings::default()
        };
        let track = flown(&[], &settings);
        let problem = FlightProblem::new(&track, &Tolerances::default());
        let fitted = problem
            .fit(&LinearizationPoint::files(), None, 2, &())
            .unwrap()
            .unwrap();
        let misfit = fitted.errors.misfit();
        assert!((0.9..1.1).contains(&misfit), "{misfit}");
        let found = fitted.errors.wander().to_degrees();
        if wander_deg == 0.0 {
            assert!(found < 0.5, "{found}");
        } else {
            assert!(
                (0.5..1.6).contains(&(found / wander_deg)),
                "{found} of {wander_deg}"
            );
        }
    }
}

/// The analytic slopes agree with the likelihood.
#[test]
fn the_fit_of_errors_is_at_a_maximum() {
    let track = track(&[], 1.0);
    let problem = FlightProblem::new(&track, &Tolerances::default());
    let point = LinearizationPoint::files();
    let parts: Vec<StretchFactor> = problem
        .stretches
        .iter()
        .map(|stretch| {
            let found = residual(&track, stretch, &problem.plain, &point);
            let columns = linearized(&track, stretch, &problem.plain, &point, &found).unwrap();
            StretchFactor::new(stretch, columns, &point)
        })
        .collect();
    let best = fit(&parts, &problem.prior, None, 40, &()).unwrap().errors;
    for k in [0, 1, 3, WANDER[0]] {
        for factor in [0.8, 1.25] {
            let mut other = best.clone();
            other.sizes =
                Components::from_fn(|j, _| best.sizes[j] * if j == k { factor } else { 1.0 });
            let there = fit(&parts, &problem.prior, Some(&other), 0, &())
                .unwrap()
                .errors;
            assert!(there.likelihood < best.likelihood + 0.1, "{k} {factor}");
        }
    }
}

#[test]
fn a_hidden_effect_is_named_with_its_value() {
    let truth = [1.9, 0.6, 0.0];
    let settings = |seed| laboratory::Settings {
        seed,
        duration: 15.0,
        rate: 120.0,
        joints: Joints {
            wander_deg: 0.8,
            ..Joints::default()
        },
        ..laboratory::Settings::default()
    };
    let hidden = [Hidden::Effect(Effect::ShankDrag, truth)];
    let [one, other] = [7, 8].map(|seed| flown(&hidden, &settings(seed)));
    let report = discover(&[one], &[other], &Settings::default(), &()).unwrap();
    assert_eq!(report.verdict, Outcome::Named, "{report:?}");
    let named = &report.effects[0];
    assert_eq!(named.name, "shank-drag", "{named:?}");
    for (k, truth) in truth.iter().take(2).enumerate() {
        let (value, error) = (named.parameters[k].1, named.standard_errors[k].1);
        assert!((value - truth).abs() < 4.0 * error, "{named:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_answer() {
    let track = track(&[Hidden::Effect(Effect::GyroBias, [0.1, 0.1, -0.1])], 1.0);
    let answer = || {
        let report =
            discover(std::slice::from_ref(&track), &[], &Settings::default(), &()).unwrap();
        serde_json::to_string(&report).unwrap()
    };
    assert_eq!(answer(), answer());
}

/// Belly to earth in one posture throughout: a constant force can have any cause.
#[test]
fn no_effect_is_named_in_a_flight_without_movement() {
    let settings = laboratory::Settings {
        duration: 15.0,
        noise: 0.0,
        ..laboratory::Settings::default()
    };
    let mut still = flown(&[], &settings);
    assert!(!still.is_still(DECISION.still_rad));
    let FlightSample {
        posture, motion, ..
    } = still.samples[0];
    for sample in &mut still.samples {
        (sample.posture, sample.motion) = (posture, motion);
    }
    assert!(still.is_still(DECISION.still_rad));
    let report = discover(&[still], &[], &Settings::default(), &()).unwrap();
    assert_eq!(report.verdict, Outcome::Thin);
    assert!(report.effects.is_empty() && report.model.is_empty());
}

#[test]
fn a_flight_that_is_too_short_is_refused() {
    let settings = laboratory::Settings {
        duration: 0.25,
        ..laboratory::Settings::default()
    };
    let track = flown(&[], &settings);
    let problem = discover(&[track], &[], &Settings::default(), &()).unwrap_err();
    assert!(problem.to_string().contains("0.3 s"), "{problem}");
}

/// Cancels after a number of stages.
struct Impatient(std::sync::atomic::AtomicUsize);

impl Progress for Impatient {
    fn stage(&self, _name: &str) {
        self.0.fetch_sub(1, std::sync::atomic::Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.0.load(std::sync::atomic::Ordering::Relaxed) == 0
    }
}

#[test]
fn a_search_can_be_cancelled() {
    let track = track(&[], 1.0);
    for stages in 1..3 {
        let impatient = Impatient(stages.into());
        let problem = discover(
            std::slice::from_ref(&track),
            &[],
            &Settings::default(),
            &impatient,
        )
        .unwrap_err();
        assert_eq!(problem, super::error::Error::Cancelled);
    }
}

#[test]
fn zero_errors_leave_the_model_unchanged_and_each_parameter_changes_it() {
    let model = plain(&track(&[], 0.0));
    assert_eq!(Subject::as_in_file().of(&model), model);
    for k in 0..SUBJECT {
        let mut subject = Subject::as_in_file();
        subject.0[k] = 0.003;
        let changes = subject.possible().of(&model) != model;
        assert_eq!(changes, described(k).is_some(), "{k}");
    }
    assert_eq!(aliased(Effect::Mass), [0]);
    assert!(aliased(Effect::Wind).is_empty());
}

#[test]
fn errors_of_joints_are_read_from_words() {
    let errors = Joints::parse("constant:2,wander:1.5@0.2,gain:0.05").unwrap();
    let expected = Joints {
        constant_deg: 2.0,
        wander_deg: 1.5,
        wander_hz: 0.2,
        gain: 0.05,
    };
    assert_eq!(errors, expected);
    for wrong in [
        "constant",
        "drift:2",
        "wander:x",
        "gain:2",
        "wander:1@9",
        "constant:-1",
    ] {
        assert!(Joints::parse(wrong).is_err(), "{wrong}");
    }
}
