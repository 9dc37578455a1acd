//! The range of every number in the dynamics and the filter, and the 32-bit fixed-point format it fits.
//!
//! This table defines what "fixed-point-safe" means here: the formats follow from the ranges, tests fly whole flights
//! against them, and [`quantised`] rounds a state as a fixed-point unit would.

use core::fmt;

use nalgebra::Quaternion;

use crate::dynamics::State;
use crate::frame::{Inertial, Rotation, Vector};
use crate::math::{Real, normalized};

/// The range of a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Name of the number.
    pub name: &'static str,
    /// Unit of the number.
    pub unit: &'static str,
    /// Largest magnitude allowed, for either sign.
    pub limit: f64,
    /// Standard deviation of the sensor that measures the number, in the same unit; 0 if none does.
    pub sensor_noise: f64,
}

impl Range {
    /// Number of fractional bits: what remains of 32 after the sign, the range and one guard bit.
    pub const fn fraction_bits(&self) -> u32 {
        let mut whole = 0;
        let mut reach = 1.0;
        while reach < self.limit && whole < 29 {
            reach *= 2.0;
            whole += 1;
        }
        30 - whole
    }

    /// Value of the least significant bit.
    pub fn last_bit(&self) -> f64 {
        let mut bit = 1.0;
        for _ in 0..self.fraction_bits() {
            bit *= 0.5;
        }
        bit
    }

    /// Returns whether `value` is finite and in range.
    pub fn holds<T: Real>(&self, value: T) -> bool {
        value.abs() <= T::of(self.limit)
    }

    /// Rounds `value` to the least significant bit.
    pub fn rounded<T: Real>(&self, value: T) -> T {
        let bit = T::of(self.last_bit());
        (value / bit).nearest() * bit
    }
}

/// A row of the table: name, format, range, last bit, and the sensor noise in units of the last bit.
impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let fraction = self.fraction_bits();
        write!(
            f,
            "| {} | {} | ±{} | Q{}.{} | {:.1e} |",
            self.name,
            self.unit,
            self.limit,
            31 - fraction,
            fraction,
            self.last_bit()
        )?;
        if self.sensor_noise > 0.0 {
            write!(f, " {:.0} |", self.sensor_noise / self.last_bit())
        } else {
            write!(f, " |")
        }
    }
}

const fn range(name: &'static str, unit: &'static str, limit: f64, sensor_noise: f64) -> Range {
    Range {
        name,
        unit,
        limit,
        sensor_noise,
    }
}

/// Component of the attitude quaternion.
pub const ATTITUDE: Range = range("attitude quaternion", "1", 1.0, 0.005);
/// Position of the centre of gravity.
pub const POSITION: Range = range("position", "m", 8192.0, 1.0);
/// Velocity of the pelvic joint or of the air.
pub const VELOCITY: Range = range("velocity", "m/s", 128.0, 0.1);
/// Angular velocity of the body frame.
pub const ANGULAR_VELOCITY: Range = range("angular velocity", "rad/s", 35.0, 0.01);
/// Linear momentum.
pub const LINEAR_MOMENTUM: Range = range("linear momentum", "kg m/s", 16_000.0, 7.5);
/// Angular momentum about the centre of gravity.
pub const ANGULAR_MOMENTUM: Range = range("angular momentum", "kg m2/s", 1024.0, 0.1);
/// Centre of gravity in body axes.
pub const CENTRE: Range = range("centre of gravity", "m", 1.0, 0.0);
/// Element of the inertia about the centre of gravity.
pub const INERTIA: Range = range("inertia", "kg m2", 64.0, 0.0);
/// Element of the inverse inertia about the centre of gravity.
pub const INVERSE_INERTIA: Range = range("inverse inertia", "1/(kg m2)", 8.0, 0.0);
/// Force.
pub const FORCE: Range = range("force", "N", 16_000.0, 0.0);
/// Moment.
pub const MOMENT: Range = range("moment", "N m", 8000.0, 0.0);
/// Muscle input coefficient.
pub const MUSCLE_INPUT: Range = range("muscle input", "1", 10.5, 0.0);
/// Damping coefficient.
pub const DAMPING: Range = range("damping", "1", 24.0, 0.0);
/// Coefficient of the damping moment.
pub const DAMPING_RATE: Range = range("damping rate", "N m s", 4096.0, 0.0);
/// Dynamic pressure.
pub const DYNAMIC_PRESSURE: Range = range("dynamic pressure", "Pa", 12_000.0, 0.0);
/// Attitude angle of a measurement.
pub const ANGLE: Range = range("measured angle", "rad", 64.0, 0.01);
/// Horizontal speed of a measurement.
pub const HORIZONTAL_SPEED: Range = range("measured speed", "m/s", 128.0, 0.1);

/// Component of the vertical in body axes.
pub const VERTICAL: Range = range("measured vertical", "1", 1.5, 0.01);

/// The table of all ranges.
pub const RANGES: [Range; 18] = [
    ATTITUDE,
    POSITION,
    VELOCITY,
    ANGULAR_VELOCITY,
    LINEAR_MOMENTUM,
    ANGULAR_MOMENTUM,
    CENTRE,
    INERTIA,
    INVERSE_INERTIA,
    FORCE,
    MOMENT,
    MUSCLE_INPUT,
    DAMPING,
    DAMPING_RATE,
    DYNAMIC_PRESSURE,
    ANGLE,
    HORIZONTAL_SPEED,
    VERTICAL,
];

/// Head of the table in Markdown; the rows are the text of the [`Range`]s.
pub const TABLE_HEAD: &str = "\
| number | unit | range | format | last bit | sensor noise in last bits |
|---|---|---|---|---|---|";

/// Returns a state rounded to the formats of the table, as fixed-point memory would hold it.
pub fn quantised<T: Real>(state: &State<T>) -> State<T> {
    let vector = |v: &Vector<T, Inertial>, range: &Range| v.map(|c| range.rounded(c));
    let [w, x, y, z] = state.inertial_from_body.wxyz().map(|c| ATTITUDE.rounded(c));
    State {
        inertial_from_body: Rotation::from_quaternion(normalized(Quaternion::new(w, x, y, z))),
        cg_position: vector(&state.cg_position, &POSITION),
        linear_momentum: vector(&state.linear_momentum, &LINEAR_MOMENTUM),
        angular_momentum: vector(&state.angular_momentum, &ANGULAR_MOMENTUM),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_resolves_its_sensor_and_keeps_a_guard_bit() {
        for range in RANGES {
            let largest = f64::from(i32::MAX) * range.last_bit();
            assert!(largest >= 1.99 * range.limit, "{}: {largest}", range.name);
            if range.sensor_noise > 0.0 {
                assert!(
                    range.last_bit() <= range.sensor_noise / 16.0,
                    "{}",
                    range.name
                );
            }
        }
        assert_eq!(ATTITUDE.fraction_bits(), 30);
        assert_eq!(VELOCITY.fraction_bits(), 23);
    }

    #[test]
    fn values_out_of_range_or_not_finite_are_not_held() {
        assert!(VELOCITY.holds(-128.0f32));
        for value in [129.0, f32::NAN, f32::INFINITY] {
            assert!(!VELOCITY.holds(value));
        }
    }
}
