//! Tolerances of suit and subject in a `flight.toml`.
//!
//! ```toml
//! [suit]
//! joint_deg = 2.0          # calibration error of a joint about an axis
//! wander_deg = 1.0         # wander of a joint about an axis
//! wander_limit_deg = 5.0   # joint error, constant or wandering, at which the suit is no explanation
//! bend = 0.03              # joint error proportional to the bend (fraction)
//! segments_deg = { l_thigh = 5.0 }  # errors of segments relative to the pelvis about an axis, which `estimate` uses in
//!                          # place of the joints'; a segment that is not named has that of its parent
//! doubted = ["l_thigh"]    # segments whose sensors an import doubts: no estimate is consistent then
//!
//! [tolerance]
//! mass = 0.03              # body and each segment; this and the next three are fractions
//! inertia = 0.03
//! area = 0.03
//! coefficients = 0.04
//! cg_m = 0.004
//! ```
//! All but the limit are standard deviations. Omitted fields have these values.

use std::collections::BTreeMap;

use bodyflight_core::tolerances::Tolerances;
use bodyflight_core::{Segment, SegmentArray};
use serde::Deserialize;

/// The table `[suit]`.
#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(super) struct SuitTable {
    joint_deg: Option<f64>,
    wander_deg: Option<f64>,
    wander_limit_deg: Option<f64>,
    bend: Option<f64>,
    segments_deg: Option<BTreeMap<String, f64>>,
    #[serde(default)]
    doubted: Vec<String>,
}

/// Largest error of a segment (degrees).
const LARGEST_SEGMENT_DEG: f64 = 90.0;
/// Least error of a segment (degrees): nothing is exact.
const LEAST_SEGMENT_DEG: f64 = 0.1;

impl SuitTable {
    /// The segments whose sensors are doubted; an error is what is wrong with the field.
    pub(super) fn doubted(&self) -> Result<Vec<Segment>, String> {
        let segment = |name: &String| {
            Segment::from_name(name)
                .ok_or_else(|| format!("expected names of segments, found \"{name}\""))
        };
        self.doubted.iter().map(segment).collect()
    }

    /// Standard deviation of each segment relative to the pelvis (rad), if the table gives any; an error is what is wrong
    /// with the field.
    pub(super) fn segment_errors(&self) -> Result<Option<SegmentArray<f64>>, String> {
        let Some(given) = &self.segments_deg else {
            return Ok(None);
        };
        for (name, value) in given {
            let is_limb = Segment::from_name(name).is_some_and(|s| s != Segment::Pelvis);
            if !is_limb {
                return Err(format!(
                    "expected names of segments other than the pelvis, found \"{name}\""
                ));
            }
            if !(LEAST_SEGMENT_DEG..=LARGEST_SEGMENT_DEG).contains(value) {
                return Err(format!(
                    "{name}: expected {LEAST_SEGMENT_DEG} to {LARGEST_SEGMENT_DEG}, found {value}"
                ));
            }
        }
        let mut found = SegmentArray::from_fn(|_| LEAST_SEGMENT_DEG.to_radians());
        for segment in Segment::ALL {
            let own = given.get(segment.name()).map(|value| value.to_radians());
            if let (Some(parent), None) = (segment.parent(), own) {
                found[segment] = found[parent];
            } else if let Some(own) = own {
                found[segment] = own;
            }
        }
        Ok(Some(found))
    }
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

/// Combines both tables; an error is the name of an implausible field and what is wrong with it.
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
    // Nothing is exact, and a standard deviation of zero has no likelihood.
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
