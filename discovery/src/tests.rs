//! The parts of the search, where the answer is known.

use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::effect::{Effect, Model};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use super::check::{self, Finding};
use super::choice::starts;
use super::effect_set::{all_parameters, changed, extended};
use super::fit::{Data, Fit};
use super::flown::Prepared;
use super::gap::{self, missing};
use super::laboratory::{self, Hidden, fly};
use super::linearization::Linearization;
use super::momentum::{self, balance};
use super::normal_equations::{Marginalized, NormalMatrix, NormalVector, NuisanceColumns};
use super::nuisance::Nuisance;
use super::null_distribution::NullDistribution;
use super::regime;
use super::report::Outcome;
use super::search::{Settings, discover};
use super::stretch::{self, CHANNELS, Channels, stretches};
use super::test_subject;
use super::track::Track;

fn model() -> (Dynamics<f64>, Inputs<f64>) {
    (test_subject::dynamics(), Inputs::belly_turn())
}

/// A flight of the laboratory.
fn flown(hidden: &[Hidden], settings: &laboratory::Settings) -> Track {
    let (dynamics, inputs) = model();
    Track::new(&fly(&dynamics, &inputs, hidden, settings), dynamics, inputs)
}

/// A short one.
fn track(hidden: &[Hidden], noise: f64) -> Track {
    let settings = laboratory::Settings {
        seed: 3,
        duration: 6.0,
        noise,
    };
    flown(hidden, &settings)
}

fn residuals(track: &Track, model: &Model<f64>) -> f64 {
    let squares: f64 = stretches(track)
        .iter()
        .map(|stretch| missing(track, stretch, model).norm_squared())
        .sum();
    squares.sqrt()
}

#[test]
fn without_noise_the_model_flies_as_recorded_and_effects_are_felt() {
    let effects = [
        (Effect::Wind, [5.0, -3.0, 0.0]),
        (Effect::GyroBias, [0.05, -0.02, 0.04]),
        (Effect::GnssLatency, [0.1, 0.0, 0.0]),
        (Effect::HeadingDrift, [0.02, 0.0, 0.0]),
    ];
    let plain = |track: &Track| Model::new(track.dynamics, track.start_height());
    let clean = track(&[], 0.0);
    let floor = residuals(&clean, &plain(&clean));
    for (effect, values) in effects {
        let track = track(&[Hidden::Effect(effect, values)], 0.0);
        let without = residuals(&track, &plain(&track));
        let with = residuals(&track, &extended(&plain(&track), &vec![(effect, values)]));
        assert!(
            without > 5.0 * floor,
            "{effect:?}: {without}, floor {floor}"
        );
        assert!(
            with < 0.75 * without,
            "{effect:?}: {without} to {with}, floor {floor}"
        );
    }
}

#[test]
fn errors_of_sensors_show_in_the_data_alone_and_only_they() {
    let settings = laboratory::Settings {
        seed: 5,
        duration: 30.0,
        noise: 1.0,
    };
    let checked = |hidden: &[Hidden]| check::checks(&flown(hidden, &settings));
    let errors = [
        (Effect::GyroBias, [0.03, -0.02, 0.04]),
        (Effect::RateLag, [0.06, 0.0, 0.0]),
        // Belly to earth this is nearly a bias about the dorsal axis.
        (Effect::HeadingDrift, [0.02, 0.0, 0.0]),
        (Effect::GnssLatency, [0.12, 0.0, 0.0]),
    ];
    for (hidden, truth) in errors {
        let checks = checked(&[
            Hidden::Effect(hidden, truth),
            Hidden::Effect(Effect::Drag, [0.7, 1.5, 1.2]),
        ]);
        assert_eq!(checks.len(), errors.len());
        for check in checks {
            let found = check.finding == Finding::Found;
            assert_eq!(found, check.effect == hidden, "{hidden:?}: {check:?}");
            if found {
                for ((value, error), truth) in check.values.iter().zip(check.errors).zip(truth) {
                    assert!((value - truth).abs() <= 4.0 * error, "{check:?}, {truth}");
                }
            }
        }
    }
    for check in checked(&[Hidden::Effect(Effect::Mounting, [0.2, -0.1, 0.1])]) {
        assert_ne!(check.finding, Finding::Found, "{check:?}");
    }
}

#[test]
fn every_parameter_has_a_column_and_every_stretch_its_numbers() {
    let track = track(&[], 1.0);
    let model = Model::new(track.dynamics, track.start_height());
    let stretches = stretches(&track);
    let count = stretches.len();
    let start = (&Vec::new(), &Nuisance::none());
    let linearization =
        Linearization::new(&track, &model, stretches, start, &all_parameters()).parts;
    assert_eq!(linearization.len(), count);
    for (_, block) in &linearization {
        assert_eq!(block.effects.nrows() % CHANNELS, 0);
        assert_eq!(block.effects.ncols(), all_parameters().len());
        assert!(
            block
                .effects
                .iter()
                .chain(block.nuisances.slopes())
                .all(|value| value.is_finite())
        );
    }
    // All but the profile of a tunnel are felt in a fall through still air.
    for (k, id) in all_parameters().iter().enumerate() {
        let felt: f64 = linearization
            .iter()
            .map(|(_, block)| block.effects.column(k).norm_squared())
            .sum();
        let name = id.effect.description().name;
        assert!(
            felt > 1e-6 || id.effect == Effect::TunnelProfile,
            "{name} {}",
            id.index
        );
    }
}

/// Some effects add, some multiply, some take the place of what is there: columns have to be right for all, also
/// where the effect acts already.
#[test]
fn columns_are_slopes_wherever_an_effect_stands() {
    let track = track(&[], 0.0);
    let plain = Model::new(track.dynamics, track.start_height());
    let stretch = &stretches(&track)[2];
    for id in all_parameters() {
        let parameter = &id.effect.description().parameters[id.index];
        let mut values = id.effect.neutral();
        values[id.index] += 0.5 * (parameter.high - parameter.neutral);
        let at = |step: f64| {
            let mut values = values;
            values[id.index] += step;
            let model = extended(&plain, &vec![(id.effect, values)]);
            -missing(&track, stretch, &model)
        };
        let small = 0.02 * (parameter.high - parameter.low);
        let central = (at(small) - at(-small)) / (2.0 * small);
        let (model, size) = changed(&plain, &vec![(id.effect, values)], id);
        let here = Prepared::new(
            &track,
            stretch,
            &extended(&plain, &vec![(id.effect, values)]),
            &Nuisance::none(),
            1,
        );
        let other = Prepared::new(&track, stretch, &model, &Nuisance::none(), 1);
        let none = Channels::zeros();
        let column = other.fly(&none).less(&here.fly(&none)) / size;
        let name = id.effect.description().name;
        // Where a sensor's error is taken off the start, the start moves too.
        let apart = (&column - &central).norm();
        assert!(
            apart < 0.25 * central.norm() + 1e-6,
            "{name} {}: {apart} of {}",
            id.index,
            central.norm()
        );
    }
}

#[test]
fn the_same_seed_gives_the_same_answer() {
    let track = track(&[Hidden::Effect(Effect::GyroBias, [0.1, 0.1, -0.1])], 1.0);
    let answer = || {
        let report = discover(&track, &[], &Settings::default(), &()).unwrap();
        serde_json::to_string(&report).unwrap()
    };
    assert_eq!(answer(), answer());
}

/// Belly to earth in one posture for long: a constant force can be anything.
#[test]
fn a_flight_in_which_nothing_moves_gets_no_name() {
    let settings = laboratory::Settings {
        duration: 15.0,
        noise: 0.0,
        ..laboratory::Settings::default()
    };
    let mut still = flown(&[], &settings);
    assert!(!still.is_still());
    let (posture, motion) = (still.postures[0], still.measured[0]);
    still.postures.fill(posture);
    still.measured.fill(motion);
    assert!(still.is_still());
    let report = discover(&still, &[], &Settings::default(), &()).unwrap();
    assert_eq!(report.verdict, Outcome::Thin);
    assert!(report.effects.is_empty() && report.model.is_empty());
}

#[test]
fn a_flight_of_a_moment_is_refused() {
    let settings = laboratory::Settings {
        duration: 1.0,
        ..laboratory::Settings::default()
    };
    let track = flown(&[], &settings);
    let problem = discover(&track, &[], &Settings::default(), &()).unwrap_err();
    assert!(problem.to_string().contains("4 s"), "{problem}");
}

/// A lift coefficient is also a tolerance: what one takes the other may give back, along a curved valley.
#[test]
fn a_fit_ends_at_the_same_place_from_wherever_it_begins() {
    let truth = [1.9, 0.64, 1.73];
    let track = track(&[Hidden::Effect(Effect::Lift, truth)], 1.0);
    let plain = Model::new(track.dynamics, track.start_height());
    let start = (&Vec::new(), &Nuisance::none());
    let linearization = Linearization::new(&track, &plain, stretches(&track), start, &[]);
    let data = Data::new(&track, &plain, &linearization);
    let fits = [Effect::Lift.neutral(), [2.4, 0.9, 1.0], truth].map(|values| {
        let fit = data.fit(vec![(Effect::Lift, values)], |_| true);
        data.relinearized(fit, f64::INFINITY).0
    });
    let [one, others @ ..] = &fits;
    for other in others {
        assert!((one.misfit - other.misfit).abs() < 1.0, "{fits:?}");
        let values = one.effects[0].1.iter().zip(other.effects[0].1);
        for ((value, other), error) in values.zip(&one.errors) {
            assert!((value - other).abs() < 0.3 * error, "{fits:?}");
        }
    }
}

/// Joints do most of the work of a weak moment: from nothing the way leads into their valley and ends there.
#[test]
fn a_fit_from_halfway_arrives_where_one_from_nothing_does_not() {
    let settings = laboratory::Settings {
        seed: 1,
        ..laboratory::Settings::default()
    };
    let truth = laboratory::strength(Effect::Moment, 1, None);
    let hidden = [Hidden::Effect(Effect::Moment, truth)];
    let track = flown(&hidden, &settings);
    let plain = Model::new(track.dynamics, track.start_height());
    let start = (&Vec::new(), &Nuisance::none());
    let linearization = Linearization::new(&track, &plain, stretches(&track), start, &[]);
    let data = Data::new(&track, &plain, &linearization);
    let fits: Vec<Fit> = starts(Effect::Moment, true)
        .into_iter()
        .map(|start| {
            let sketch = data.sketched(vec![(Effect::Moment, start)]);
            data.relinearized(sketch, f64::INFINITY).0
        })
        .collect();
    let [nothing, halfway, _] = fits.as_slice() else {
        panic!("{fits:?}")
    };
    assert!(nothing.misfit > halfway.misfit + 100.0, "{fits:?}");
    let values = halfway.effects[0].1.iter().zip(&truth);
    for ((value, truth), error) in values.zip(&halfway.errors) {
        assert!((value - truth).abs() < 4.0 * error, "{fits:?}, {truth}");
    }
}

#[test]
fn only_from_afar_and_with_several_parameters_there_are_several_starts() {
    assert_eq!(starts(Effect::Mass, true), [Effect::Mass.neutral()]);
    assert_eq!(starts(Effect::Moment, false), [Effect::Moment.neutral()]);
    let from_afar = starts(Effect::Moment, true);
    assert_eq!(from_afar.len(), 3);
    assert!(from_afar[1][0] < from_afar[0][0] && from_afar[0][0] < from_afar[2][0]);
}

/// Where small errors of joints grow, bodies that are drawn have to be fitted as the flight is.
#[test]
fn what_chance_leaves_does_not_depend_on_the_effects_in_the_model() {
    let track = track(&[], 1.0);
    let plain = Model::new(track.dynamics, track.start_height());
    for values in [
        vec![],
        vec![(Effect::Mounting, [-0.39, -0.31, -0.27])],
        vec![(Effect::Wind, [-17.4, -20.0, 0.0])],
    ] {
        let start = (&values, &Nuisance::none());
        let linearization =
            Linearization::new(&track, &plain, stretches(&track), start, &all_parameters());
        let null = NullDistribution::draw(&track, &linearization, &plain, &values, 1);
        let [misfit, _] = null.misfit;
        assert!(
            (0.8..1.2).contains(&(misfit / null.rows)),
            "{values:?}: {misfit} of {}",
            null.rows
        );
    }
}

proptest! {
    /// Nuisances with unit priors are noise of covariance `I + N N^T`.
    #[test]
    fn nuisances_are_taken_out_as_noise(
        residual in prop::collection::vec(-2.0f64..2.0, 8),
        columns in prop::collection::vec(-1.0f64..1.0, 16),
        nuisances in prop::collection::vec(-3.0f64..3.0, 24),
    ) {
        let residual = DVector::from_vec(residual);
        let columns = DMatrix::from_vec(8, 2, columns);
        let slopes = DMatrix::from_vec(8, 3, nuisances);
        let nuisances = NuisanceColumns::from(slopes.clone());
        let marginalized = Marginalized::of(
            &NormalMatrix::of(&columns, &nuisances),
            &NormalVector::of(&residual, &columns, &nuisances),
            &DVector::zeros(3),
        );
        let covariance = DMatrix::identity(8, 8) + &slopes * slopes.transpose();
        let inverse = covariance.try_inverse().unwrap();
        let misfit = residual.dot(&(&inverse * &residual));
        prop_assert!((marginalized.misfit - misfit).abs() < 1e-9 * (1.0 + misfit));
        let slope = columns.transpose() * &inverse * &residual;
        prop_assert!((marginalized.slope - slope).norm() < 1e-9);
        let curvature = columns.transpose() * &inverse * &columns;
        prop_assert!((marginalized.curvature - curvature).norm() < 1e-9);
    }
}

#[test]
fn the_balance_of_momentum_shows_what_is_missing_and_how_well_it_is_known() {
    let plain = |track: &Track| Model::new(track.dynamics, track.start_height());
    let size = |missing: &[momentum::Missing], of: &dyn Fn(&momentum::Missing) -> f64| {
        (missing.iter().map(|m| of(m).powi(2)).sum::<f64>() / missing.len() as f64).sqrt()
    };
    let force = |m: &momentum::Missing| m.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
    // Nothing is missing where nothing is hidden, and nothing with what is hidden.
    let clean = track(&[], 0.0);
    let floor = size(&balance(&clean, &plain(&clean)), &force);
    let drag = (Effect::Drag, [1.6, 1.6, 1.6]);
    let flown = track(&[Hidden::Effect(drag.0, drag.1)], 0.0);
    let without = size(&balance(&flown, &plain(&flown)), &force);
    let extended = extended(&plain(&flown), &vec![drag]);
    let within = size(&balance(&flown, &extended), &force);
    assert!(
        without > 100.0 && floor < 0.05 * without,
        "{without} N, {floor} N"
    );
    assert!(within < 0.05 * without, "{within} N of {without} N");
    // With noise of sensors, and nothing else wrong, a window is as far off as its errors say.
    let (dynamics, inputs) = model();
    let mut noisy = clean;
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for motion in &mut noisy.measured {
        let noise = Channels::from_fn(|channel, _| {
            random.sample::<f64, _>(StandardNormal) * stretch::SENSOR_NOISE[channel]
        });
        *motion = stretch::moved(motion, &noise);
    }
    let model = Model::new(dynamics, noisy.start_height());
    noisy.inputs = inputs;
    let mean = size(&balance(&noisy, &model), &|m| m.deviations) / 6.0_f64.sqrt();
    assert!((0.7..1.4).contains(&mean), "{mean}");
}

#[test]
fn regimes_and_companions_tell_where_and_with_what() {
    let flown = track(&[Hidden::Effect(Effect::Drag, [1.6, 1.6, 1.6])], 0.0);
    let model = Model::new(flown.dynamics, flown.start_height());
    let missing = balance(&flown, &model);
    let companions = regime::companions(&flown, &missing);
    assert!(companions.len() <= 5 && companions.iter().all(|c| c.correlation.abs() <= 1.0));
    let spot = |time_s: f64, over: f64| gap::Spot {
        time_s,
        over_floor: [over; CHANNELS],
        over_floor_after: [1.0; CHANNELS],
        speed_m_s: 0.0,
        turn_rad_s: 0.0,
        height_m: 0.0,
    };
    // What disagrees late disagrees in the last third of the time.
    let map: Vec<gap::Spot> = (0..9)
        .map(|k| spot(0.6 * f64::from(k), if k < 6 { 1.0 } else { 5.0 }))
        .collect();
    let regimes = regime::regimes(&flown, &map);
    let by_time = regimes.iter().find(|regime| regime.by == "time_s").unwrap();
    for (found, expected) in by_time.over_floor.iter().zip([1.0, 1.0, 5.0]) {
        assert!((found - expected).abs() < 1e-12);
    }
    assert!(
        by_time
            .over_floor_after
            .iter()
            .all(|over| (over - 1.0).abs() < 1e-12)
    );
    assert!(regime::regimes(&flown, &map[..2]).is_empty());
}
