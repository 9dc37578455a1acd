//! Assumptions about the noise of a whole flight, and their adaptation to the flight.

use bodyflight_core::estimator::motion::settings::MotionPreset;

use crate::size::Sizes;
use crate::smoother::backward::{Score, Scores};

/// Assumptions about the noise.
#[derive(Debug, Clone)]
pub struct Assumed {
    /// Standard deviations of everything that varies during the flight; `joint_error` is the wandering part only.
    pub preset: MotionPreset,
    /// The preset as given.
    first: MotionPreset,
    /// Possible sizes of the constant joint errors.
    pub sizes: Sizes,
    /// Deviations of the constant offsets of muscle input and damping.
    pub offsets: [f64; 6],
}

/// Deviations of muscle input and damping about their constant offsets, as shares of the preset's: initial and least.
const MUSCLE_SHARES: [f32; 2] = [0.67, 0.5];
const DAMPING_SHARES: [f32; 2] = [0.5, 0.3];
/// Wander of the joints (deg), initial and least, and its time constant (s).
const WANDER: [f32; 2] = [0.1, 0.05];
const WANDER_TIME: f32 = 5.0;
const WANDER_TURN_RATE: f32 = 3.0;

impl Assumed {
    /// Starts from the filter's assumptions, but for the joint errors.
    pub fn of(preset: &MotionPreset, sizes: Sizes) -> Self {
        let [muscle, damping] = [preset.muscle, preset.damping_deviation];
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
            sizes,
            offsets: {
                let [a, b, c] = muscle.map(f64::from);
                let [d, e, f] = damping.map(f64::from);
                [a, b, c, d, e, f]
            },
        }
    }

    /// Adapts to the noise seen in the flight.
    pub fn follow(&mut self, scores: &Scores) {
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
    }
}
