//! What sensors other than a suit measured, in 23 bytes; this module is the only place where they are quantised.

use nalgebra::Vector3;

use super::flags::SensorParts;
use super::message::Sensors;
use super::packed_quaternion::whole;
use super::sample::counts_of;
use crate::air::pressure_height;
use crate::estimator::motion::sensors::{Barometer, ReceiverVelocity, SpecificForce};
use crate::frame::{Body, Inertial, Vector};

const FORCE_COUNTS: f32 = 128.0;
const SPEED_COUNTS: f32 = 256.0;

/// Standard deviation of the specific force (m/s2): vibration of a suit in the airstream, and sensors of this class.
const FORCE_DEVIATION: f32 = 1.5;

/// Standard deviation of the height from the pressure (m): the noise of the sensor and of the flow around the body.
const HEIGHT_DEVIATION: f32 = 1.5;

/// Standard deviation of the error that an orientation keeps for seconds, each axis (rad): that of the sensor's own filter in
/// motion by the data sheets of this class, and of a sensor that was levelled.
const ORIENTATION_ERROR: f32 = 0.02;
const LEVELLED_ERROR: f32 = 0.03;

/// Measurements of one instant; `None` for a quantity that was not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Readings {
    /// Specific force in body axes (m/s2), each component below 256.
    pub specific_force: Option<Vector<f32, Body>>,
    /// Velocity of a receiver (m/s), each component below 128.
    pub receiver_velocity: Option<Vector<f32, Inertial>>,
    /// Standard deviations of its horizontal components and of the vertical one (m/s).
    pub receiver_deviation: [f32; 2],
    /// Time from the instant that the receiver's solution describes to the sample (s).
    pub receiver_age: f32,
    /// Air pressure (Pa).
    pub pressure: Option<u32>,
    /// Whether north has been found, so that attitudes before had another.
    pub north_found: bool,
    /// Whether the attitude is integrated from where the sensor was level.
    pub is_levelled: bool,
    /// Whether the sensor lies or stands still.
    pub is_still: bool,
}

/// Thousandths, as an unsigned number that saturates; the largest for NaN.
fn thousandths(value: f32) -> u16 {
    if !value.is_finite() {
        return u16::MAX;
    }
    u16::try_from(whole(value * 1e3).max(0)).unwrap_or(u16::MAX)
}

impl Sensors {
    /// Quantises measurements. Values that are not finite or out of scale are marked as absent.
    pub fn new(readings: &Readings) -> Self {
        let mut sensors = Self {
            valid: SensorParts::default(),
            specific_force: [0; 3],
            receiver_velocity: [0; 3],
            receiver_horizontal_deviation: 0,
            receiver_vertical_deviation: 0,
            receiver_age: 0,
            pressure: 0,
        };
        let force = readings.specific_force.map(|force| force.components);
        if let Some(counts) = counts_of(force, FORCE_COUNTS) {
            sensors.specific_force = counts;
            sensors.valid |= SensorParts::SPECIFIC_FORCE;
        }
        let velocity = readings.receiver_velocity.map(|v| v.components);
        if let Some(counts) = counts_of(velocity, SPEED_COUNTS) {
            let [horizontal, vertical] = readings.receiver_deviation;
            sensors.receiver_velocity = counts;
            sensors.receiver_horizontal_deviation = thousandths(horizontal);
            sensors.receiver_vertical_deviation = thousandths(vertical);
            sensors.receiver_age = thousandths(readings.receiver_age);
            sensors.valid |= SensorParts::RECEIVER;
        }
        // From 16 km above the sea to below it; anything else is a fault of the sensor.
        if let Some(pressure) = readings.pressure.filter(|p| (10_000..120_000).contains(p)) {
            sensors.pressure = pressure;
            sensors.valid |= SensorParts::PRESSURE;
        }
        sensors
            .valid
            .set(SensorParts::NORTH_FOUND, readings.north_found);
        sensors
            .valid
            .set(SensorParts::LEVELLED, readings.is_levelled);
        sensors.valid.set(SensorParts::STILL, readings.is_still);
        sensors
    }

    /// Returns the specific force with the deviation that this class of sensor has on a body in the airstream.
    pub fn specific_force(&self) -> Option<SpecificForce<f32>> {
        let measured = self.valid.contains(SensorParts::SPECIFIC_FORCE);
        measured.then(|| SpecificForce {
            force: Vector::from_components(
                Vector3::from(self.specific_force).map(|count| f32::from(count) / FORCE_COUNTS),
            ),
            deviation: FORCE_DEVIATION,
            arm: Vector::zero(),
        })
    }

    /// Whether the attitudes before this sample had another north.
    pub const fn finds_north(&self) -> bool {
        self.valid.contains(SensorParts::NORTH_FOUND)
    }

    /// Whether the sensor lies or stands still, so that the body is not in the air.
    pub const fn is_still(&self) -> bool {
        self.valid.contains(SensorParts::STILL)
    }

    /// Standard deviation of the attitude's error that lasts, each axis (rad): a levelled one is used until twice of that
    /// has added up.
    pub const fn attitude_error(&self) -> f32 {
        if self.valid.contains(SensorParts::LEVELLED) {
            LEVELLED_ERROR
        } else {
            ORIENTATION_ERROR
        }
    }

    /// Returns the velocity of the receiver.
    pub fn receiver(&self) -> Option<ReceiverVelocity<f32>> {
        let measured = self.valid.contains(SensorParts::RECEIVER);
        measured.then(|| ReceiverVelocity {
            velocity: Vector::from_components(
                Vector3::from(self.receiver_velocity).map(|count| f32::from(count) / SPEED_COUNTS),
            ),
            horizontal_deviation: f32::from(self.receiver_horizontal_deviation) / 1e3,
            vertical_deviation: f32::from(self.receiver_vertical_deviation) / 1e3,
            age: f32::from(self.receiver_age) / 1e3,
            arm: Vector::zero(),
        })
    }

    /// Returns the height of the standard atmosphere at the measured pressure.
    pub fn barometer(&self) -> Option<Barometer<f32>> {
        let height = self.pressure_height()?;
        Some(Barometer {
            height: Some(height),
            height_deviation: HEIGHT_DEVIATION,
            vertical_velocity: None,
            vertical_velocity_deviation: 0.0,
        })
    }

    /// Returns the height of the standard atmosphere at the measured pressure (m).
    pub fn pressure_height(&self) -> Option<f32> {
        let measured = self.valid.contains(SensorParts::PRESSURE);
        // Exact: pressures are below 2^17.
        measured.then(|| pressure_height(self.pressure as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn measurements_survive_within_half_a_count(
            force in prop::array::uniform3(-250.0_f32..250.0),
            velocity in prop::array::uniform3(-127.0_f32..127.0),
            deviation in 0.0_f32..60.0,
            age in 0.0_f32..2.0,
        ) {
            let sensors = Sensors::new(&Readings {
                specific_force: Some(Vector::from_components(force.into())),
                receiver_velocity: Some(Vector::from_components(velocity.into())),
                receiver_deviation: [deviation, 0.5],
                receiver_age: age,
                pressure: Some(89_875),
                north_found: true,
                is_levelled: true,
                is_still: true,
            });
            prop_assert!(sensors.finds_north() && sensors.attitude_error() > 0.02 && sensors.is_still());
            let found = sensors.specific_force().unwrap().force.components;
            prop_assert!((found - Vector3::from(force)).amax() <= 0.5 / FORCE_COUNTS + 1e-4);
            let receiver = sensors.receiver().unwrap();
            let found = receiver.velocity.components;
            prop_assert!((found - Vector3::from(velocity)).amax() <= 0.5 / SPEED_COUNTS + 1e-5);
            prop_assert!((receiver.horizontal_deviation - deviation).abs() < 6e-4);
            prop_assert!((receiver.age - age).abs() < 6e-4);
            // U.S. Standard Atmosphere 1976: 89 875 Pa at 1000 m.
            prop_assert!((sensors.pressure_height().unwrap() - 1000.0).abs() < 1.0);
        }
    }

    #[test]
    fn values_that_are_no_measurement_are_absent() {
        for bad in [f32::NAN, f32::INFINITY, 400.0] {
            let sensors = Sensors::new(&Readings {
                specific_force: Some(Vector::new(0.0, bad, 0.0)),
                receiver_velocity: Some(Vector::new(bad, 0.0, 0.0)),
                pressure: Some(0),
                ..Readings::default()
            });
            assert_eq!(sensors.valid, SensorParts::empty());
            assert_eq!((sensors.specific_force(), sensors.receiver()), (None, None));
        }
        let unknown = Sensors::new(&Readings {
            receiver_velocity: Some(Vector::zero()),
            receiver_deviation: [f32::NAN, 1e9],
            ..Readings::default()
        });
        assert!(unknown.receiver().unwrap().horizontal_deviation > 60.0);
    }
}
