//! Maneuver scripts: posture patterns and conscious inputs over time, as data.
//!
//! A script moves from knot to knot in smooth steps, so joints start and stop without a jerk. The first seven are the
//! paper's basic maneuvers ("Experimental modalities"); the others are flown in other orientations and need muscle
//! input.

mod base;
mod paper;
pub mod scripts;
pub mod skill;
pub mod transitions;

use crate::axis::AxisCoefficients;
use crate::body::pattern::{self, JointAngles};
use crate::body::posture::Posture;
use crate::dynamics::Inputs;
use crate::dynamics::muscle_input::MuscleModel;
use crate::dynamics::residual::ResidualLoad;
use crate::frame::{Body, Inertial, Rotation, facing_north};
use crate::math::{Real, clamp};

/// A value over time, as (time in s, value) with increasing times; constant before the first and after the last knot.
pub type Knots<V> = &'static [(f64, V)];

/// A pattern of joint angles with an amount (rad) that follows the knots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// The pattern that is moved.
    pub pattern: &'static JointAngles,
    /// Amount of the pattern (rad).
    pub amount: Knots<f64>,
}

/// A maneuver, from start to end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Maneuver {
    /// Name used in commands.
    pub name: &'static str,
    /// One-line summary.
    pub summary: &'static str,
    /// Duration (s).
    pub duration: f64,
    /// Posture that the tracks modify.
    pub base: &'static JointAngles,
    /// Initial rotation about the left axis from upright (rad): pi/2 is belly to earth, 0 upright.
    pub start_pitch: f64,
    /// Initial speed as a multiple of that of the trimmed fall.
    pub start_speed: f64,
    /// Initial speed over the ground, towards north (m/s): that of the aircraft.
    pub start_forward: f64,
    /// Movements of the joints.
    pub tracks: &'static [Track],
    /// Muscle input over time.
    pub muscle: Knots<AxisCoefficients<f64>>,
    /// Damping coefficients over time.
    pub damping: Knots<AxisCoefficients<f64>>,
    /// Limbs that produce the muscle input.
    pub muscles: MuscleModel,
}

impl Maneuver {
    /// Returns the posture at `time` (s).
    pub fn posture<T: Real>(&self, time: f64) -> Posture<T> {
        self.tracks
            .iter()
            .fold(pattern::posture(self.base), |posture, track| {
                let [amount] = follow(track.amount, time, |&amount| [amount]);
                pattern::moved(&posture, track.pattern, T::of(amount))
            })
    }

    /// Returns the conscious inputs at `time` (s).
    pub fn inputs<T: Real>(&self, time: f64) -> Inputs<T> {
        let at_time = |knots: Knots<AxisCoefficients<f64>>| {
            follow(knots, time, |value| value.to_array())
                .map(T::of)
                .into()
        };
        Inputs {
            muscle: at_time(self.muscle),
            damping: at_time(self.damping),
            residual: ResidualLoad::none(),
        }
    }

    /// Returns the initial attitude, facing north.
    pub fn start_attitude<T: Real>(&self) -> Rotation<T, Inertial, Body> {
        facing_north(T::of(self.start_pitch))
    }
}

/// Value of the knots at `time`, with smooth steps `3 s^2 - 2 s^3` between them; zero if there are none.
fn follow<V, const N: usize>(
    knots: Knots<V>,
    time: f64,
    components: impl Fn(&V) -> [f64; N],
) -> [f64; N] {
    let Some((_, first)) = knots.first() else {
        return [0.0; N];
    };
    let mut value = components(first);
    for pair in knots.windows(2) {
        if let [(start, _), (end, to)] = pair {
            let share = clamp((time - start) / (end - start), 0.0, 1.0);
            let smooth = share * share * (3.0 - 2.0 * share);
            let to = components(to);
            for (value, to) in value.iter_mut().zip(to) {
                *value += (to - *value) * smooth;
            }
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::scripts::MANEUVERS;
    use super::*;

    #[test]
    fn knots_are_met_and_kept() {
        const KNOTS: Knots<f64> = &[(1.0, 0.0), (2.0, 4.0), (3.0, 4.0), (4.0, -2.0)];
        for (time, value) in [(0.0, 0.0), (1.5, 2.0), (2.5, 4.0), (3.5, 1.0), (9.0, -2.0)] {
            let [found] = follow(KNOTS, time, |&v| [v]);
            assert!((found - value).abs() < 1e-12, "{time}: {found}");
        }
        let none: Knots<f64> = &[];
        assert!(follow(none, 1.0, |&v| [v])[0].abs() < 1e-12);
    }

    #[test]
    fn scripts_are_in_order_and_valid() {
        for maneuver in MANEUVERS {
            assert_eq!(Maneuver::from_name(maneuver.name), Some(maneuver));
            for track in maneuver.tracks {
                assert!(
                    track.amount.windows(2).all(|w| w[0].0 < w[1].0),
                    "{}",
                    maneuver.name
                );
            }
            let mut time = 0.0;
            while time < maneuver.duration {
                assert!(maneuver.posture::<f64>(time).is_valid());
                time += 0.25;
            }
        }
    }
}
