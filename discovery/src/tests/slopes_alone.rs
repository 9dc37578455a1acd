//! A likelihood that slopes alone raise is no gain of an effect.

use super::*;
use crate::hypotheses::refit::Refit;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::variance_components::fit_from;
use crate::named_effect::EffectSet;

/// An added mass lessens what joints matter, and with it the covariance. Nothing is hidden in this flight, but it is more
/// likely with the slopes of the added mass, without it.
#[test]
fn what_slopes_gain_without_an_effect_is_not_its_gain() {
    let settings = laboratory::Settings {
        duration: 12.0,
        rate: 120.0,
        joints: Joints::WIDE,
        ..laboratory::Settings::default()
    };
    let track = flown(&[], &settings);
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
    let mut without = refit.joint_fit(vec![bare], none);
    let with = refit.joint_fit(vec![with], acting);
    let gained = refit.refitted_from(&mut without, &with).unwrap();
    assert!((bare_likelihood + gained - without.likelihood()).abs() < 1e-6);
    assert!(without.likelihood() >= alone_likelihood - 1e-6);
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
