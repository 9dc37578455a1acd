//! Reports errors found in subject, suit and sensors: each with its standard error and the errors it cannot be
//! distinguished from.

use crate::named_effect::EffectSet;
use bodyflight_core::Segment;
use bodyflight_core::effect::Effect;
use serde::Serialize;

use crate::hypotheses::decision::DECISION;
use crate::jacobian::linearization_point::OWN;
use crate::jacobian::subject_error::{SUBJECT, aliased, described, subject_deviations};
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::prior::fixed_by;
use crate::shooting::joint_error::JOINTS;

/// Largest number of adjustments and of joints reported.
const ADJUSTMENTS: usize = 8;
const CALIBRATIONS: usize = 3;

/// A value in the files that the flights contradict.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Adjustment {
    /// The quantity, in words.
    pub what: String,
    /// Estimate from the flights alone.
    pub value: f64,
    /// Standard error of `value`.
    pub standard_error: f64,
    /// Value in the files.
    pub in_files: f64,
    /// Estimate from tolerances and flights combined, as written to a corrected file.
    pub corrected: f64,
    /// Significance: half the square of the correction, in its standard errors.
    pub gain: f64,
    /// Other quantities that these flights cannot separate from this one.
    pub not_told_from: Vec<String>,
}

/// Adjustments of subject and coefficients, most significant first.
pub fn adjustments(flights: &[(&FlightProblem<'_>, LinearFit)]) -> Vec<Adjustment> {
    let Some((problem, first)) = flights.first() else {
        return Vec::new();
    };
    let tolerances = subject_deviations(&problem.prior.tolerances);
    let fixed = fixed_by(&first.point.effects);
    let mut found = Vec::new();
    for k in (0..SUBJECT).filter(|k| !fixed.contains(k)) {
        let Some((what, in_files)) = described(k) else {
            continue;
        };
        let before = tolerances[k].powi(-2);
        let (mut information, mut slope) = (0.0, 0.0);
        for (_, fitted) in flights {
            let errors = &fitted.errors;
            let after = 1.0 / errors.covariance[(OWN + k, OWN + k)];
            information += (after - before).max(0.0);
            slope += errors.constants[OWN + k] * after;
        }
        if information <= 1e-9 * before {
            continue;
        }
        let (value, standard_error) = (slope / information, information.powf(-0.5));
        found.push((
            k,
            Adjustment {
                what,
                value: in_files + value,
                standard_error,
                in_files,
                corrected: in_files + slope / (information + before),
                gain: 0.5 * slope * slope / (information + before),
                not_told_from: Vec::new(),
            },
        ));
    }
    found.sort_by(|(_, a), (_, b)| b.gain.total_cmp(&a.gain));
    found.retain(|(_, a)| (a.value - a.in_files).abs() > DECISION.adjustment_z * a.standard_error);
    found.truncate(ADJUSTMENTS);
    let correlation = |j: usize, k: usize| {
        let covariance = |j: usize, k: usize| first.errors.covariance[(OWN + j, OWN + k)];
        // Of the estimates given tolerances and flight together.
        covariance(j, k) / (covariance(j, j) * covariance(k, k)).sqrt()
    };
    let names: Vec<(usize, String)> = found.iter().map(|(k, a)| (*k, a.what.clone())).collect();
    for (k, adjustment) in &mut found {
        let alike = names.iter().filter(|(other, _)| other != k);
        adjustment.not_told_from = alike
            .filter(|(other, _)| correlation(*k, *other).abs() > DECISION.correlated)
            .map(|(_, name)| name.clone())
            .collect();
    }
    found
        .into_iter()
        .map(|(_, adjustment)| adjustment)
        .collect()
}

/// Mass and coefficients, estimated from tolerances and flights combined, as effects. Sensor errors are left out, since
/// they do not belong to the person.
pub fn corrections(fitted: &LinearFit) -> EffectSet {
    let effects = [
        Effect::CgOffset,
        Effect::Mass,
        Effect::Drag,
        Effect::Lift,
        Effect::Moment,
        Effect::Damping,
    ];
    let of_effect = |effect: Effect| {
        let mut values = effect.neutral();
        for (value, twin) in values.iter_mut().zip(aliased(effect)) {
            *value += fitted.errors.constants[OWN + twin];
        }
        for (value, parameter) in values.iter_mut().zip(effect.description().parameters) {
            *value = value.clamp(parameter.low, parameter.high);
        }
        (effect, values)
    };
    effects.into_iter().map(of_effect).collect()
}

/// A joint with a significant calibration error.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct JointCalibration {
    /// The segment this joint attaches to its parent.
    pub segment: &'static str,
    /// Rotation about x, y and z (degrees).
    pub turn_deg: [f64; 3],
    /// Standard errors (degrees).
    pub standard_errors_deg: [f64; 3],
}

/// Joints with a significant calibration error, most significant first.
pub fn joint_calibrations(fitted: &LinearFit) -> Vec<JointCalibration> {
    let errors = &fitted.errors;
    let mut joints: Vec<(f64, JointCalibration)> = (0..JOINTS / 3)
        .map(|joint| {
            let number = |axis: usize| errors.constants[3 * joint + axis];
            let error =
                |axis: usize| errors.covariance[(3 * joint + axis, 3 * joint + axis)].sqrt();
            let sure = (0..3)
                .map(|axis| (number(axis) / error(axis)).abs())
                .fold(0.0, f64::max);
            let calibration = JointCalibration {
                segment: Segment::ALL[joint + 1].name(),
                turn_deg: [0, 1, 2].map(|axis| number(axis).to_degrees()),
                standard_errors_deg: [0, 1, 2].map(|axis| error(axis).to_degrees()),
            };
            (sure, calibration)
        })
        .collect();
    joints.sort_by(|(a, _), (b, _)| b.total_cmp(a));
    joints
        .into_iter()
        .filter(|(sure, _)| *sure > DECISION.joint_z)
        .take(CALIBRATIONS)
        .map(|(_, joint)| joint)
        .collect()
}
