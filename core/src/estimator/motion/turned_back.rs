//! An attitude sensor that jumped, and whether it has jumped back.
//!
//! A heading that was wrong for a while turns back about the vertical, and a sensor that slipped about an axis of the body.
//! In the meantime the body has turned, so that channel by channel neither looks like a jump back.

use nalgebra::UnitQuaternion;

use super::state::turned_by;
use crate::math::Real;

/// Share of a jump by which the jump back may differ, and noise besides (rad).
const BACK: (f32, f32) = (0.2, 0.1);
/// Time for which the channels of the sensor follow each other (s).
const TOGETHER: f32 = 1.0;

/// The last jump of the attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TurnedBack<T: Real> {
    /// None that matters.
    Nowhere,
    /// The sensor turned by this in inertial axes and in body axes, so long ago (s).
    Away([UnitQuaternion<T>; 2], T),
    /// It turned back so long ago (s).
    Back(T),
}

impl<T: Real> TurnedBack<T> {
    /// Passes an interval of `duration` (s).
    pub(super) fn pass(&mut self, duration: T) {
        match self {
            Self::Nowhere => {}
            Self::Away(_, age) => {
                // Bounded, so that it stays exact.
                if *age < T::of(100.0) {
                    *age += duration;
                }
            }
            Self::Back(age) => {
                *age += duration;
                if *age > T::single(TOGETHER) {
                    *self = Self::Nowhere;
                }
            }
        }
    }

    /// Takes a jump from the attitude that is `predicted` to the one that is `measured`. Returns whether the sensor is back
    /// where it was.
    pub(super) fn jump(
        &mut self,
        predicted: &UnitQuaternion<T>,
        measured: &UnitQuaternion<T>,
    ) -> bool {
        let inverse = predicted.inverse();
        let turns = [measured * inverse, inverse * measured];
        match self {
            Self::Back(_) => return true,
            // Another channel of the same jump.
            Self::Away(_, age) if *age < T::single(TOGETHER) => return false,
            Self::Away(before, _) => {
                let (share, noise) = BACK;
                let pairs = before.iter().zip(&turns);
                let is_back = pairs.into_iter().any(|(before, turn)| {
                    let allowed = angle(before) * T::single(share) + T::single(noise);
                    angle(&(turn * before)) <= allowed
                });
                if is_back {
                    *self = Self::Back(T::zero());
                    return true;
                }
            }
            Self::Nowhere => {}
        }
        *self = Self::Away(turns, T::zero());
        false
    }
}

/// Angle of a rotation (rad), too small for large ones.
fn angle<T: Real>(turn: &UnitQuaternion<T>) -> T {
    turned_by(turn).norm_squared().root()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn about(x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
    }

    #[test]
    fn a_sensor_is_back_in_either_frame_and_nowhere_else() {
        let (first, later) = (about(1.2, 0.3, -0.4), about(-0.2, 1.0, 2.0));
        let wrong = about(0.1, 0.4, 0.9);
        for (away, back, expected) in [
            (wrong * first, (wrong * later, later), true),
            (first * wrong, (later * wrong, later), true),
            (
                wrong * first,
                (wrong * later, about(1.0, 0.0, 0.0) * later),
                false,
            ),
        ] {
            let mut turned = TurnedBack::Nowhere;
            assert!(!turned.jump(&first, &away));
            assert!(!turned.jump(&first, &away), "the next channel");
            for _ in 0..200 {
                turned.pass(0.01);
            }
            assert_eq!(turned.jump(&back.0, &back.1), expected);
            assert_eq!(turned.jump(&back.0, &back.1), expected, "the next channel");
        }
    }
}
