//! The content of a sensor's packet that the unit uses.

use bodyflight_core::math::normalized;
use bodyflight_core::xbus::{Item, Packet, Reals};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The content of a packet. Values that are not finite are left out: some sensors send NaN until they have settled.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reading {
    pub(super) counter: Option<u16>,
    /// Sensor time in ticks of 0.1 ms.
    pub(super) fine_time: Option<u32>,
    pub(super) inertial_from_sensor: Option<UnitQuaternion<f32>>,
    /// In sensor axes (rad/s).
    pub(super) angular_velocity: Option<Vector3<f32>>,
    /// In sensor axes (m/s2).
    pub(super) specific_force: Option<Vector3<f32>>,
    /// In inertial axes (m/s).
    pub(super) velocity: Option<Vector3<f32>>,
    /// Velocity in inertial axes, ground speed and standard deviation of a receiver (m/s).
    pub(super) solution: Option<(Vector3<f32>, f32, f32)>,
    /// Air pressure (Pa).
    pub(super) pressure: Option<u32>,
}

fn finite(values: &Reals<'_, 3>) -> Option<Vector3<f32>> {
    let vector = Vector3::from(values.to_f32());
    vector
        .iter()
        .all(|value| value.is_finite())
        .then_some(vector)
}

/// The rotation, unless the norm is not one: sensors send it to a few digits.
pub(super) fn rotation([w, x, y, z]: [f32; 4]) -> Option<UnitQuaternion<f32>> {
    let sent = Quaternion::new(w, x, y, z);
    ((sent.norm_squared() - 1.0).abs() < 0.02).then(|| normalized(sent))
}

impl Reading {
    /// Decodes the items of an Xbus packet.
    pub(super) fn of(packet: &Packet<'_>) -> Self {
        let mut reading = Self::default();
        for item in packet.items() {
            match item.decode() {
                Ok(Item::PacketCounter(counter)) => reading.counter = Some(counter),
                Ok(Item::SampleTimeFine(time)) => reading.fine_time = Some(time),
                Ok(Item::Quaternion(system, values)) => {
                    let sent = rotation(values.to_f32());
                    reading.inertial_from_sensor =
                        sent.map(|sent| system.inertial_from_earth() * sent);
                }
                Ok(Item::RateOfTurn(values)) => reading.angular_velocity = finite(&values),
                Ok(Item::Acceleration(values)) => reading.specific_force = finite(&values),
                Ok(Item::VelocityXyz(system, values)) => {
                    let velocity = finite(&values);
                    reading.velocity = velocity.map(|v| system.inertial_from_earth() * v);
                }
                Ok(Item::BaroPressure(pressure)) => reading.pressure = Some(pressure),
                Ok(Item::GnssPvt(solution)) => {
                    let speed = solution.horizontal_speed().unwrap_or_default();
                    let velocity = solution.velocity();
                    reading.solution = velocity.map(|v| (v, speed, solution.speed_accuracy()));
                }
                _ => {}
            }
        }
        reading
    }
}
