//! The content of a sensor's packet that the unit uses.

use bodyflight_core::math::{Lanes, normalized};
use bodyflight_core::xbus::{CoordinateSystem, Item, Packet, Reals};
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

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
    /// Magnetic field in sensor axes, in the sensor's unit.
    pub(super) magnetic_field: Option<Vector3<f32>>,
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

/// The rotation about X by the roll, then Y by the pitch, then Z by the yaw (deg).
pub(super) fn from_angles(roll_pitch_yaw: [f32; 3]) -> UnitQuaternion<f32> {
    let turn = |degrees: f32| (degrees.to_radians() * 0.5).sine_cosine();
    let [(i, u), (j, v), (k, w)] = roll_pitch_yaw.map(turn);
    let roll = Quaternion::new(u, i, 0.0, 0.0);
    let pitch = Quaternion::new(v, 0.0, j, 0.0);
    let yaw = Quaternion::new(w, 0.0, 0.0, k);
    normalized(yaw * pitch * roll)
}

/// The rotation of a matrix given row by row, unless its columns are not unit vectors at right angles.
fn from_rows(rows: &[f32; 9]) -> Option<UnitQuaternion<f32>> {
    let matrix = Matrix3::from_row_slice(rows);
    let error = matrix.transpose() * matrix - Matrix3::identity();
    let is_rotation = error.iter().all(|part| part.abs() < 0.02) && matrix.determinant() > 0.0;
    is_rotation
        .then(|| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix)))
}

impl Reading {
    /// Whether it has rates and forces but no orientation.
    pub(super) fn is_raw(&self) -> bool {
        self.inertial_from_sensor.is_none()
            && self.angular_velocity.is_some()
            && self.specific_force.is_some()
    }

    /// Decodes the items of an Xbus packet.
    pub(super) fn of(packet: &Packet<'_>) -> Self {
        let mut reading = Self::default();
        for item in packet.items() {
            match item.decode() {
                Ok(Item::PacketCounter(counter)) => reading.counter = Some(counter),
                Ok(Item::SampleTimeFine(time)) => reading.fine_time = Some(time),
                Ok(Item::Quaternion(system, values)) => {
                    reading.orient(system, rotation(values.to_f32()));
                }
                Ok(Item::EulerAngles(system, values)) => {
                    let angles = finite(&values).map(|_| from_angles(values.to_f32()));
                    reading.orient(system, angles);
                }
                Ok(Item::RotationMatrix(system, values)) => {
                    reading.orient(system, from_rows(&values.to_f32()));
                }
                Ok(Item::RateOfTurn(values)) => reading.angular_velocity = finite(&values),
                Ok(Item::Acceleration(values)) => reading.specific_force = finite(&values),
                Ok(Item::MagneticField(values)) => reading.magnetic_field = finite(&values),
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

    /// Takes an orientation, unless the packet already had a valid one.
    fn orient(&mut self, system: CoordinateSystem, earth_from_sensor: Option<UnitQuaternion<f32>>) {
        let turned = earth_from_sensor.map(|turn| system.inertial_from_earth() * turn);
        self.inertial_from_sensor = self.inertial_from_sensor.or(turned);
    }
}
