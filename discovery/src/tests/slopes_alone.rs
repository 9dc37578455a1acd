//! A likelihood that slopes alone raise is no gain of an effect.

use super::*;
use nalgebra::DMatrix;

use crate::hypotheses::hypothesis::Hypothesis;
use crate::hypotheses::refit::Refit;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::prior::PriorDeviations;
use crate::likelihood::reml::RemlEvaluation;
use crate::likelihood::variance_components::fit_from;
use crate::named_effect::EffectSet;

/// A flight of this duration (s) in which nothing is hidden, with joints that are off by 3 degrees.
fn clean_in_wide_joints(duration: f64) -> RecordedFlight {
    let settings = laboratory::Settings {
        duration,
        rate: 120.0,
        joints: Joints::WIDE,
        ..laboratory::Settings::default()
    };
    flown(&[], &settings)
}

/// An added mass lessens what joints matter, and with it the covariance. Nothing is hidden in this flight, but it is more
/// likely with the slopes of the added mass, without it.
#[test]
fn what_slopes_gain_without_an_effect_is_not_its_gain() {
    let track = clean_in_wide_joints(12.0);
    let tolerances = Tolerances::default();
    let problems = [FlightProblem::new(&track, &tolerances)];
    let [problem] = &problems;
    let fit = |from: Option<&LinearFit>, effects: &EffectSet| {
        let point = from.map_or_else(LinearizationPoint::files, |from| from.point_with(effects));
        let fit = problem.fit(&point, from.map(|from| &from.errors), 1, &());
        problem.settled(fit.unwrap().unwrap(), &()).unwrap()
    };
    let (none, acting) = (EffectSet::new(), vec![(Effect::AddedMass, [0.3, 0.0, 0.0])]);
    let bare = problem.converged(fit(None, &none), &()).unwrap();
    let with = fit(Some(&bare), &acting);
    let alone = problem.fit_with_slopes_of(&with, &with.point_with(&none), &());
    let alone = problem.settled(alone.unwrap().unwrap(), &()).unwrap();
    let [bare_likelihood, alone_likelihood] = [&bare, &alone].map(|fit| fit.errors.likelihood);
    assert!(
        alone_likelihood > bare_likelihood + 2.0,
        "{alone_likelihood}, {bare_likelihood}"
    );

    let refit = Refit {
        problems: &problems,
        count: 1,
        tolerances,
        progress: &(),
    };
    let hypothesis = Hypothesis {
        effect: Effect::AddedMass,
        effects: acting.clone(),
        covariance: DMatrix::identity(1, 1),
        tempering: 1.0,
        gain: 0.0,
        gains_held_out: Vec::new(),
        gain_without_refit: None,
    };
    let without = refit.joint_fit(vec![bare], none);
    let with = refit.joint_fit(vec![with], acting);
    let compared = refit.compared(&without, &with, &hypothesis).unwrap();
    let expected = with.likelihood() - alone_likelihood;
    assert!(
        (compared.gain - expected).abs() < 1e-6,
        "{}, expected {expected}",
        compared.gain
    );
}

/// Fits of joints that are off by 3 degrees, from two starts: with slopes of their own they agree, and one that goes on stays
/// where it is.
#[test]
fn fits_with_slopes_of_their_own_agree() {
    let track = clean_in_wide_joints(20.0);
    let problem = FlightProblem::new(&track, &Tolerances::default());
    let bent = vec![(Effect::Drag, [1.3, 1.0, 1.2])];
    let [one, other] = [EffectSet::new(), bent].map(|effects| {
        let files = LinearizationPoint::files_with(&effects);
        let start = problem.fit(&files, None, 1, &()).unwrap().unwrap();
        let point = start.point_with(&EffectSet::new());
        let fit = problem.fit(&point, Some(&start.errors), 1, &()).unwrap();
        problem.converged(fit.unwrap(), &()).unwrap()
    });
    let point = one.point_with(&EffectSet::new());
    let further = problem.fit(&point, Some(&one.errors), 1, &()).unwrap();
    let [one, other, further] = [one, other, further.unwrap()].map(|fit| fit.errors.likelihood);
    assert!((one - other).abs() < 6.0, "{one}, {other}");
    assert!((one - further).abs() < 6.0, "{one}, {further}");
}

/// Both steps to the spread of calibration and bend end at the same place, and the faster gets there in fewer.
#[test]
fn the_spread_of_joint_errors_has_one_estimate() {
    let track = clean_in_wide_joints(20.0);
    let problem = FlightProblem::new(&track, &Tolerances::default());
    let files = LinearizationPoint::files();
    let fitted = problem.fit(&files, None, 1, &()).unwrap().unwrap();
    let (parts, prior) = (&fitted.parts, &problem.prior);
    let first = PriorDeviations::new(&prior.tolerances);
    let after = |times: usize, which: usize| {
        let sizes = &fitted.errors.sizes;
        let step = |now: PriorDeviations, _: usize| {
            let found = RemlEvaluation::new(parts, prior, sizes, &now).unwrap();
            found.prior_deviations(prior)[which]
        };
        (0..times).fold(first, step)
    };
    let apart = |one: PriorDeviations, other: PriorDeviations| {
        let calibration = (one.calibration / other.calibration).ln();
        calibration.abs().max((one.bend / other.bend).ln().abs())
    };
    let [fast, sure] = [0, 1].map(|which| after(200, which));
    assert!(apart(fast, sure) < 1e-3, "{fast:?}, {sure:?}");
    let [near, far] = [0, 1].map(|which| apart(after(3, which), fast));
    assert!(near < 0.8 * far, "{near}, {far}");
}

/// A flight that a fit has weighted gives the next fit every bit that weighting it anew does, whatever the residuals are; with
/// other variances it is weighted anew.
#[test]
fn a_fit_from_a_weighted_flight_is_a_fit_from_its_covariances() {
    let track = track(&[], 1.0);
    let problem = FlightProblem::new(&track, &Tolerances::default());
    let files = LinearizationPoint::files();
    let fitted = problem.fit(&files, None, 1, &()).unwrap().unwrap();
    let mut parts = fitted.parts.clone();
    parts.iter_mut().for_each(|part| part.residual *= 1.5);
    let mut others = fitted.errors.clone();
    others.sizes *= 2.0;
    for errors in [&fitted.errors, &others] {
        let from = |weighed| {
            let start = (Some(errors), weighed);
            let found = fit_from(&parts, &problem.prior, start, 3, &()).unwrap();
            let errors = found.errors;
            (errors.sizes, errors.constants, errors.likelihood.to_bits())
        };
        let known = from(Some(&fitted.whitened.weighed));
        assert_eq!(known, from(None));
    }
}
