//! Tolerances of suit and subject in a `flight.toml`:
//!
//! ```toml
//! [suit]
//! joint_deg = 2.0          # calibration of a joint about an axis
//! wander_deg = 1.0         # how far it wanders
//! wander_limit_deg = 5.0   # beyond which the suit is no explanation
//! bend = 0.03              # error that grows with the bend, share
//!
//! [tolerance]
//! mass = 0.03              # shares: body and each segment
//! inertia = 0.03
//! area = 0.03
//! coefficients = 0.04
//! cg_m = 0.004
//! ```
//! All are standard deviations; what is not given keeps these values.

use bodyflight_discovery::nuisance::Tolerances;
use serde::Deserialize;

/// The table `[suit]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct SuitTable {
    joint_deg: Option<f64>,
    wander_deg: Option<f64>,
    wander_limit_deg: Option<f64>,
    bend: Option<f64>,
}

/// The table `[tolerance]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct ToleranceTable {
    mass: Option<f64>,
    inertia: Option<f64>,
    area: Option<f64>,
    coefficients: Option<f64>,
    cg_m: Option<f64>,
}

/// Both tables; a field with what is wrong with it where one is not plausible.
pub(super) fn tolerances(
    suit: &SuitTable,
    tolerance: &ToleranceTable,
) -> Result<Tolerances, (&'static str, String)> {
    let mut found = Tolerances::default();
    let fields = [
        ("suit.joint_deg", suit.joint_deg, 30.0, &mut found.joint_deg),
        (
            "suit.wander_deg",
            suit.wander_deg,
            30.0,
            &mut found.wander_deg,
        ),
        (
            "suit.wander_limit_deg",
            suit.wander_limit_deg,
            90.0,
            &mut found.wander_limit_deg,
        ),
        ("suit.bend", suit.bend, 1.0, &mut found.bend),
        ("tolerance.mass", tolerance.mass, 1.0, &mut found.mass),
        (
            "tolerance.inertia",
            tolerance.inertia,
            1.0,
            &mut found.inertia,
        ),
        ("tolerance.area", tolerance.area, 1.0, &mut found.area),
        (
            "tolerance.coefficients",
            tolerance.coefficients,
            1.0,
            &mut found.coefficients,
        ),
        ("tolerance.cg_m", tolerance.cg_m, 0.2, &mut found.cg_m),
    ];
    // Nothing is exact: a standard deviation of zero has no likelihood.
    const LEAST: f64 = 1e-4;
    for (name, given, most, place) in fields {
        if let Some(value) = given {
            if !(LEAST..=most).contains(&value) {
                return Err((name, format!("expected {LEAST} to {most}, found {value}")));
            }
            *place = value;
        }
    }
    Ok(found)
}
