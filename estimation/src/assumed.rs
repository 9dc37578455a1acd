//! Assumptions about the noise of a whole flight, and their adaptation to the flight.

use bodyflight_core::estimator::motion::settings::MotionPreset;

use crate::joints::{DIRECTIONS, Directions};
use crate::smoother::{Constants, Found, Score, Scores};

/// Assumptions about the noise.
#[derive(Debug, Clone, Copy)]
pub struct Assumed {
    /// Standard deviations of everything that varies during the flight; `joint_error` is the wandering part only.
    pub preset: MotionPreset,
    /// The preset as given.
    first: MotionPreset,
    /// Standard deviation of the constant joint errors (rad); a larger one lets them explain more of the measurements.
    calibration: f64,
    /// Bounds of `calibration`.
    calibrations: [f64; 2],
    /// Deviations of the constant offsets of muscle input and damping.
    offsets: [f64; 6],
}

/// Deviations of muscle input and damping about their constant offsets, as shares of the preset's: initial and least.
const MUSCLE_SHARES: [f32; 2] = [0.67, 0.5];
const DAMPING_SHARES: [f32; 2] = [0.6, 0.6];
/// Wander of the joints (deg), initial and least, and its time constant (s).
const WANDER: [f32; 2] = [0.1, 0.05];
const WANDER_TIME: f32 = 5.0;
const WANDER_TURN_RATE: f32 = 3.0;
/// Bounds, as shares of the preset's joint error, within which it adapts to the flight.
const CALIBRATIONS: [f64; 2] = [0.5, 1.5];

impl Assumed {
    /// Starts from the filter's assumptions.
    pub fn of(preset: &MotionPreset) -> Self {
        let [muscle, damping] = [preset.muscle, preset.damping_deviation];
        let calibration = f64::from(preset.joint_error);
        Self {
            preset: MotionPreset {
                muscle: muscle.map(|deviation| deviation * MUSCLE_SHARES[0]),
                damping_deviation: damping.map(|deviation| deviation * DAMPING_SHARES[0]),
                joint_error: WANDER[0].to_radians(),
                joint_error_time: WANDER_TIME,
                turn_rate: WANDER_TURN_RATE,
                ..*preset
            },
            first: *preset,
            calibration,
            calibrations: CALIBRATIONS.map(|share| share * calibration),
            offsets: {
                let [a, b, c] = muscle.map(f64::from);
                let [d, e, f] = damping.map(f64::from);
                [a, b, c, d, e, f]
            },
        }
    }

    /// Deviations of the constants.
    pub fn deviations(&self) -> Constants {
        Constants::from_fn(|k, _| {
            let offset = k.checked_sub(DIRECTIONS).and_then(|k| self.offsets.get(k));
            offset.copied().unwrap_or(self.calibration)
        })
    }

    /// Adapts to the noise seen in the flight.
    pub fn follow(&mut self, found: &Found, scores: &Scores, errors: &Directions) {
        #[expect(clippy::cast_possible_truncation, reason = "a factor")]
        let followed = |deviation: f32, score: &Score, least: f32, most: f32| {
            let factor = score.factor().sqrt().clamp(0.1, 4.0) as f32;
            (deviation * factor).clamp(least, most)
        };
        let (preset, first) = (&mut self.preset, &self.first);
        for axis in 0..3 {
            let (muscle, damping) = (first.muscle[axis], first.damping_deviation[axis]);
            preset.muscle[axis] = followed(
                preset.muscle[axis],
                &scores.quiet[axis],
                MUSCLE_SHARES[1] * muscle,
                6.0 * muscle,
            );
            preset.damping_deviation[axis] = followed(
                preset.damping_deviation[axis],
                &scores.quiet[3 + axis],
                DAMPING_SHARES[1] * damping,
                2.0 * damping,
            );
        }
        preset.joint_error = followed(
            preset.joint_error,
            &scores.residual,
            WANDER[1].to_radians(),
            2.0 * first.joint_error,
        );
        let known: f64 = found.covariance.diagonal().rows(0, DIRECTIONS).sum();
        #[expect(clippy::cast_precision_loss, reason = "there are two dozen")]
        let told = DIRECTIONS as f64 - known / (self.calibration * self.calibration);
        let [least, most] = self.calibrations;
        self.calibration = (errors.norm_squared() / told.max(0.5))
            .sqrt()
            .clamp(least, most);
    }
}
