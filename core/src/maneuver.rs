//! Scripts of maneuvers: posture patterns and conscious inputs over time, as data.
//!
//! A script moves from knot to knot along smooth steps, so joints start and stop without a jerk. The first
//! seven are the paper's basic maneuvers ("Experimental modalities"); the others fly in other orientations
//! and need muscle input.

mod base;
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

/// A value over time: (time in s, value), rising in time; constant before the first and after the last knot.
pub type Knots<V> = &'static [(f64, V)];

/// A pattern of joint angles whose amount (rad) follows the knots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Track {
    /// What moves.
    pub pattern: &'static JointAngles,
    /// By how much (rad of the pattern).
    pub amount: Knots<f64>,
}

/// A maneuver from its first to its last second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Maneuver {
    /// Name in commands.
    pub name: &'static str,
    /// What happens, in a line.
    pub summary: &'static str,
    /// Length (s).
    pub duration: f64,
    /// Posture on which the tracks act.
    pub base: &'static JointAngles,
    /// Turn about the left axis at the start (rad): pi/2 belly to earth, 0 upright.
    pub start_pitch: f64,
    /// Speed at the start over that of the trimmed fall.
    pub start_speed: f64,
    /// Speed over ground to the north at the start (m/s): that of an aircraft.
    pub start_forward: f64,
    /// Movements.
    pub tracks: &'static [Track],
    /// Muscle input.
    pub muscle: Knots<AxisCoefficients<f64>>,
    /// Damping coefficients.
    pub damping: Knots<AxisCoefficients<f64>>,
    /// Limbs that act on the muscle input.
    pub muscles: MuscleModel,
}

impl Maneuver {
    /// Posture at `time` (s).
    pub fn posture<T: Real>(&self, time: f64) -> Posture<T> {
        self.tracks
            .iter()
            .fold(pattern::posture(self.base), |posture, track| {
                let [amount] = follow(track.amount, time, |&amount| [amount]);
                pattern::moved(&posture, track.pattern, T::of(amount))
            })
    }

    /// Conscious inputs at `time` (s).
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

    /// Attitude at the start, facing north.
    pub fn start_attitude<T: Real>(&self) -> Rotation<T, Inertial, Body> {
        facing_north(T::of(self.start_pitch))
    }
}

/// Value of knots at `time`: smooth steps `3 s^2 - 2 s^3` between them; zero where there are none.
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
