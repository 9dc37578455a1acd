//! The results of `estimate` in an export.

use bodyflight_core::axis::AXIS_NAMES;
use bodyflight_estimation::report::Point;
use bodyflight_export::columns::quantity::{Of, Unit};

use super::entry::{Entry, Seen};

const BODY: &[&str] = &["left", "dorsal", "cranial"];
const AXES: &[&str] = &AXIS_NAMES;
const ONE: &[&str] = &[];

/// Results of `estimate`; each applies from its time on.
pub(super) fn estimates() -> Vec<Entry> {
    let [coefficients, deviations] = [
        (
            "estimated",
            "coefficient as estimated; missing before the first estimate",
            (|point: &Point| point.inputs.columns()) as fn(&Point) -> [f64; 7],
        ),
        (
            "estimated_sd",
            "standard deviation of the estimated coefficient",
            |point: &Point| point.deviation.columns(),
        ),
    ]
    .map(|(name, meaning, columns)| {
        // The first column is the time.
        let part = |from: usize| {
            move |seen: &Seen<'_>, row: &mut Vec<f64>| {
                let three = |point: &Point| core::array::from_fn(|k| columns(point)[from + k]);
                seen.estimated::<3>(three, row);
            }
        };
        let damping = format!("{name}_damp");
        [
            Entry::new(Of::Body, name, (AXES, Unit::ONE), meaning, part(1)),
            Entry::new(Of::Body, damping, (AXES, Unit::ONE), meaning, part(4)),
        ]
    });
    coefficients
        .into_iter()
        .chain(deviations)
        .chain(estimated_rest())
        .collect()
}

/// The parts of an estimate other than the coefficients.
fn estimated_rest() -> [Entry; 3] {
    [
        Entry::new(
            Of::Body,
            "estimated_residual",
            (BODY, Unit::SQUARE_METRE),
            "force that is not in the model, over dynamic pressure, as estimated",
            |seen, row| {
                let force = |point: &Point| {
                    let row = &point.inputs;
                    [
                        row.residual_left_m2,
                        row.residual_dorsal_m2,
                        row.residual_cranial_m2,
                    ]
                };
                seen.estimated(force, row);
            },
        ),
        Entry::new(
            Of::Body,
            "estimated_residual",
            (AXES, Unit::CUBIC_METRE),
            "moment that is not in the model, over dynamic pressure, as estimated",
            |seen, row| {
                let moment = |point: &Point| {
                    let row = &point.inputs;
                    [
                        row.residual_pitch_m3,
                        row.residual_yaw_m3,
                        row.residual_roll_m3,
                    ]
                };
                seen.estimated(moment, row);
            },
        ),
        Entry::new(
            Of::Body,
            "estimated_nis",
            (ONE, Unit::ONE),
            "normalised innovation squared of the estimate, 1 where model and noise are right",
            |seen, row| seen.estimated(|point| [point.normalised_innovation], row),
        ),
    ]
}
