//! The recorded turn rate against the linear response to the recorded joints.

use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::DVector;

use super::linear::Linear;
use super::report::Recorded;

/// Turn rate (rad/s RMS) from which a correlation below [`EXPLAINED`] is a disagreement.
const TURNS: f64 = 0.2;
const EXPLAINED: f64 = 0.5;

/// Why the recording contradicts the linear response, if it does.
pub(super) fn doubt(found: &Recorded) -> Option<String> {
    let differs = found.turn_rms_radps > TURNS && found.correlation < EXPLAINED;
    differs.then(|| {
        format!(
            "the recorded turn rate is not that of the linear response to the recorded joints (correlation {:.2})",
            found.correlation
        )
    })
}

/// The recorded turn rate against the linear response to the joints; `None` without angular velocities.
pub(super) fn recorded(
    linear: &Linear,
    frames: &[FlightFrame],
    rows: &[DVector<f64>],
) -> Option<Recorded> {
    let timed: Vec<(f64, DVector<f64>)> = frames
        .iter()
        .zip(rows)
        .map(|(frame, row)| (frame.time, row.clone()))
        .collect();
    let expected = linear.driven(&timed);
    let measured = frames
        .iter()
        .skip(1)
        .map(|frame| frame.pelvis.angular_velocity.map(|spin| spin.up()))
        .collect::<Option<Vec<f64>>>()?;
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    let count = measured.len() as f64;
    let centred = |values: &[f64]| -> Vec<f64> {
        let mean = values.iter().sum::<f64>() / count;
        values.iter().map(|value| value - mean).collect()
    };
    let (measured, expected) = (centred(&measured), centred(&expected));
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (own, both, other) = (
        product(&measured, &measured),
        product(&measured, &expected),
        product(&expected, &expected),
    );
    let found = Recorded {
        correlation: both / (own * other).sqrt(),
        slope: both / other,
        slope_of_exact_joints: own / both,
        turn_rms_radps: (own / count).sqrt(),
    };
    (found.correlation.is_finite() && found.slope.is_finite()).then_some(found)
}
