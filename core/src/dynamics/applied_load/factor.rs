//! Factors of a user-defined load; each is dimensionless, a quantity divided by a reference value.

use super::instant::{Axis, Instant};
use crate::body::Segment;
use crate::math::{Real, wrap_angle};

/// Maximum number of factors of a load.
pub const FACTORS: usize = 3;

/// A factor of a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Factor<T> {
    /// Speed through the air.
    Speed {
        /// Speed at which the factor is one (m/s).
        reference: T,
    },
    /// Square of the speed through the air.
    SpeedSquared {
        /// Speed at which the factor is one (m/s).
        reference: T,
    },
    /// Rotation of a joint: one component of its rotation vector in the parent's axes.
    Joint {
        /// Segment at the distal end of the joint.
        segment: Segment,
        /// Component of the rotation vector.
        axis: Axis,
        /// Rotation at which the factor is zero (rad).
        from: T,
        /// Rotation beyond `from` at which the factor is one (rad).
        reference: T,
    },
    /// Angular velocity of the body about one of its axes.
    Turn {
        /// Axis of the component.
        axis: Axis,
        /// Angular velocity at which the factor is one (rad/s).
        reference: T,
    },
    /// Height above the inertial origin.
    Height {
        /// Height at which the factor is zero (m).
        from: T,
        /// Height above `from` at which the factor is one (m).
        reference: T,
    },
    /// Sine of the time since the start of the flight.
    Sine {
        /// Frequency (Hz).
        frequency: T,
        /// Phase at the start (rad).
        phase: T,
    },
    /// One during a pulse, zero otherwise.
    Pulse {
        /// Time at which the pulse begins (s after the start of the flight).
        start: T,
        /// Duration of the pulse (s).
        duration: T,
        /// Time from the start of one pulse to the start of the next (s); zero for a single pulse.
        period: T,
    },
}

impl<T: Real> Factor<T> {
    /// Returns the value of the factor at this instant (dimensionless).
    pub fn at(&self, now: &Instant<'_, T>) -> T {
        match *self {
            Self::Speed { reference } => now.through_air.norm_squared().root() / reference,
            Self::SpeedSquared { reference } => {
                now.through_air.norm_squared() / (reference * reference)
            }
            Self::Joint {
                segment,
                axis,
                from,
                reference,
            } => {
                let joint = now.posture.parent_from_segment(segment);
                let imaginary = joint.imag();
                let sine = imaginary.norm_squared().root();
                // The rotation vector is twice the half angle along the axis; for a small rotation it is twice the
                // imaginary part.
                let stretch = if sine > T::of(1e-6) {
                    wrap_angle(sine.arctangent2(joint.w) * T::of(2.0)) / sine
                } else {
                    T::of(2.0)
                };
                (axis.of(&imaginary) * stretch - from) / reference
            }
            Self::Turn { axis, reference } => {
                axis.of(&now.motion.angular_velocity.components) / reference
            }
            Self::Height { from, reference } => (now.motion.position.up() - from) / reference,
            Self::Sine { frequency, phase } => {
                let turns = frequency * now.time;
                (turns * T::of(core::f64::consts::TAU) + phase)
                    .sine_cosine()
                    .0
            }
            Self::Pulse {
                start,
                duration,
                period,
            } => {
                let mut since = now.time - start;
                if period > T::zero() && since >= T::zero() {
                    since -= period * whole(since / period);
                }
                if since >= T::zero() && since < duration {
                    T::one()
                } else {
                    T::zero()
                }
            }
        }
    }

    /// Converts the factor to another precision.
    pub fn cast<U: Real>(&self) -> Factor<U> {
        let scalar = |value: T| U::of(value.to_f64());
        match *self {
            Self::Speed { reference } => Factor::Speed {
                reference: scalar(reference),
            },
            Self::SpeedSquared { reference } => Factor::SpeedSquared {
                reference: scalar(reference),
            },
            Self::Joint {
                segment,
                axis,
                from,
                reference,
            } => Factor::Joint {
                segment,
                axis,
                from: scalar(from),
                reference: scalar(reference),
            },
            Self::Turn { axis, reference } => Factor::Turn {
                axis,
                reference: scalar(reference),
            },
            Self::Height { from, reference } => Factor::Height {
                from: scalar(from),
                reference: scalar(reference),
            },
            Self::Sine { frequency, phase } => Factor::Sine {
                frequency: scalar(frequency),
                phase: scalar(phase),
            },
            Self::Pulse {
                start,
                duration,
                period,
            } => Factor::Pulse {
                start: scalar(start),
                duration: scalar(duration),
                period: scalar(period),
            },
        }
    }
}

/// Integer part of a number that is not negative.
fn whole<T: Real>(value: T) -> T {
    let near = value.nearest();
    if near > value { near - T::one() } else { near }
}
