//! The range of every number in the dynamics and the filter, and the 32-bit fixed-point format it fits.
//!
//! This table defines what "fixed-point-safe" means here: the formats follow from the ranges, tests fly whole flights
//! against them, search them at random up to the edges of what the link lets a unit be told, and [`quantised`] rounds a
//! state as a fixed-point unit would.
//!
//! A number is [bounded](Bound) either by construction, because something clamps it or it follows from what is clamped, or
//! only by what the search has found, with a reserve of a guard bit.

use core::fmt;

use nalgebra::Quaternion;

use crate::dynamics::State;
use crate::estimator::motion::state::STATES;
use crate::frame::{Inertial, Rotation, Vector};
use crate::math::{Real, normalized};
use Bound::{Construction, Search, Time};

/// Why a number stays in its range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// By construction: it is normalised or clamped, or follows from numbers that are.
    Construction,
    /// Found by random search over allowed people, densities, winds, motions and inputs.
    Search,
    /// Only for a time: it grows, and nothing resets it.
    Time,
}

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
    /// Why it holds.
    pub bound: Bound,
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
            write!(f, " {:.0} |", self.sensor_noise / self.last_bit())?;
        } else {
            write!(f, " |")?;
        }
        f.write_str(match self.bound {
            Construction => " construction |",
            Search => " search |",
            Time => " time |",
        })
    }
}

const fn range(
    name: &'static str,
    unit: &'static str,
    limit: f64,
    sensor_noise: f64,
    bound: Bound,
) -> Range {
    Range {
        name,
        unit,
        limit,
        sensor_noise,
        bound,
    }
}

/// Component of the attitude quaternion.
pub const ATTITUDE: Range = range("attitude quaternion", "1", 1.0, 0.005, Construction);
/// Position of the centre of gravity: holds for 80 s at the largest speed. A filter in fixed point would have to move its
/// origin along.
pub const POSITION: Range = range("position", "m", 8192.0, 1.0, Time);
/// Velocity of the pelvic joint or of the air; its magnitude is clamped to 100 m/s.
pub const VELOCITY: Range = range("velocity", "m/s", 128.0, 0.1, Construction);
/// Angular velocity of the body frame; its magnitude is clamped.
pub const ANGULAR_VELOCITY: Range = range("angular velocity", "rad/s", 35.0, 0.01, Construction);
/// Linear momentum.
pub const LINEAR_MOMENTUM: Range = range("linear momentum", "kg m/s", 32_000.0, 7.5, Search);
/// Angular momentum about the centre of gravity.
pub const ANGULAR_MOMENTUM: Range = range("angular momentum", "kg m2/s", 8192.0, 0.1, Search);
/// Centre of gravity in body axes.
pub const CENTRE: Range = range("centre of gravity", "m", 1.0, 0.0, Search);
/// Element of the inertia about the centre of gravity.
pub const INERTIA: Range = range("inertia", "kg m2", 128.0, 0.0, Search);
/// Element of the inverse inertia about the centre of gravity.
pub const INVERSE_INERTIA: Range = range("inverse inertia", "1/(kg m2)", 16.0, 0.0, Search);
/// Force.
pub const FORCE: Range = range("force", "N", 2_097_152.0, 0.0, Search);
/// Moment.
pub const MOMENT: Range = range("moment", "N m", 1_048_576.0, 0.0, Search);
/// Muscle input coefficient; the filter clamps it.
pub const MUSCLE_INPUT: Range = range("muscle input", "1", 12.0, 0.0, Construction);
/// Damping coefficient; the filter clamps it.
pub const DAMPING: Range = range("damping", "1", 30.0, 0.0, Construction);
/// Coefficient of the damping moment.
pub const DAMPING_RATE: Range = range("damping rate", "N m s", 131_072.0, 0.0, Search);
/// Dynamic pressure: half of 2 kg/m3 times the square of a clamped speed and a wind of up to 100 m/s along each axis.
pub const DYNAMIC_PRESSURE: Range = range("dynamic pressure", "Pa", 131_072.0, 0.0, Construction);
/// Residual force, divided by the dynamic pressure; the filter clamps it.
pub const RESIDUAL_FORCE: Range = range("residual force", "m2", 2.0, 0.0, Construction);
/// Residual moment, divided by the dynamic pressure; the filter clamps it.
pub const RESIDUAL_MOMENT: Range = range("residual moment", "m3", 1.0, 0.0, Construction);
/// Attitude angle of a measurement.
pub const ANGLE: Range = range("measured angle", "rad", 64.0, 0.01, Construction);
/// Horizontal speed of a measurement; the link holds no larger one.
pub const HORIZONTAL_SPEED: Range = range("measured speed", "m/s", 128.0, 0.1, Construction);

/// Component of the vertical in body axes.
pub const VERTICAL: Range = range("measured vertical", "1", 1.5, 0.01, Construction);

/// Powers of two of which an error coordinate of the motion filter is a multiple in fixed point, by quantity: attitude
/// (rad), velocity (m/s), angular velocity (rad/s), muscle input, damping, residual force (m2) and moment (m3). With them
/// coordinates of very different size have factors of about the same, and scaling changes no bit of a mantissa.
const SCALES: [f64; STATES / 3] = [2.0, 64.0, 32.0, 4.0, 8.0, 0.25, 0.0625];

/// Scale of an error coordinate of the motion filter.
pub const fn scale(coordinate: usize) -> f64 {
    SCALES[coordinate / 3]
}

/// Element of the diagonal factor `D` of the covariance, of scaled coordinates; its elements are clamped to 2^20.
pub const PIVOT: Range = range("factor D", "1", 268_435_456.0, 0.0, Construction);
/// Element of the factor `U` of the covariance, of scaled coordinates.
pub const UNIT: Range = range("factor U", "1", 4096.0, 0.0, Search);
/// Gain: scaled coordinate per unit of a channel.
pub const GAIN: Range = range("gain", "1", 16_384.0, 0.0, Search);
/// Difference of a measurement and its prediction (rad, m/s, rad/s or m/s2) that was fused.
pub const INNOVATION: Range = range("innovation", "channel", 2_097_152.0, 0.0, Search);
/// Standard deviation of such a difference.
pub const INNOVATION_DEVIATION: Range =
    range("innovation deviation", "channel", 2_097_152.0, 0.0, Search);
/// Derivative of the motion at the end of an interval, of scaled coordinates; intervals in which one is larger are not used.
pub const SLOPE: Range = range("transition", "1", 1_048_576.0, 0.0, Construction);

/// The table of all ranges.
pub const RANGES: [Range; 26] = [
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
    RESIDUAL_FORCE,
    RESIDUAL_MOMENT,
    ANGLE,
    HORIZONTAL_SPEED,
    VERTICAL,
    PIVOT,
    UNIT,
    GAIN,
    INNOVATION,
    INNOVATION_DEVIATION,
    SLOPE,
];

/// Head of the table in Markdown; the rows are the text of the [`Range`]s.
pub const TABLE_HEAD: &str = "\
| number | unit | range | format | last bit | sensor noise in last bits | bounded by |
|---|---|---|---|---|---|---|";

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
