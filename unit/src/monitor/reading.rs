//! The data items of a sensor, named with their units.

use bodyflight_core::xbus::{CoordinateSystem, GnssPvt, Item, Reals, UtcTime};
use serde_json::{Value, json};

/// Names for vectors by coordinate frame: east-north-up, north-east-down, north-west-up.
const QUATERNION: [&str; 3] = [
    "quaternion_wxyz_enu",
    "quaternion_wxyz_ned",
    "quaternion_wxyz_nwu",
];
const ROTATION_MATRIX: [&str; 3] = [
    "rotation_matrix_enu",
    "rotation_matrix_ned",
    "rotation_matrix_nwu",
];
const EULER_ANGLES: [&str; 3] = [
    "roll_pitch_yaw_deg_enu",
    "roll_pitch_yaw_deg_ned",
    "roll_pitch_yaw_deg_nwu",
];
const VELOCITY: [&str; 3] = ["velocity_mps_enu", "velocity_mps_ned", "velocity_mps_nwu"];

/// Name of an item, including the unit, and its value. Items missing from the protocol's table are named `unknown`,
/// with their bytes as the value.
pub fn reading(item: &Item<'_>) -> (&'static str, Value) {
    match item {
        Item::Temperature(r) => ("temperature_degc", one(r)),
        Item::UtcTime(time) => ("utc_time", json!(utc(time))),
        Item::PacketCounter(count) => ("packet_counter", json!(count)),
        Item::SampleTimeFine(ticks) => ("sample_time_fine_0p1ms", json!(ticks)),
        Item::SampleTimeCoarse(seconds) => ("sample_time_coarse_s", json!(seconds)),
        Item::Quaternion(axes, r) => (in_axes(*axes, QUATERNION), many(r)),
        Item::RotationMatrix(axes, r) => (in_axes(*axes, ROTATION_MATRIX), many(r)),
        Item::EulerAngles(axes, r) => (in_axes(*axes, EULER_ANGLES), many(r)),
        Item::BaroPressure(pascals) => ("pressure_pa", json!(pascals)),
        Item::DeltaV(r) => ("delta_v_mps", many(r)),
        Item::Acceleration(r) => ("acceleration_mps2", many(r)),
        Item::FreeAcceleration(r) => ("free_acceleration_mps2", many(r)),
        Item::AccelerationHr(r) => ("acceleration_hr_mps2", many(r)),
        Item::AltitudeEllipsoid(r) => ("altitude_ellipsoid_m", one(r)),
        Item::PositionEcef(r) => ("position_ecef_m", many(r)),
        Item::LatLon(r) => ("latitude_longitude_deg", many(r)),
        Item::GnssPvt(pvt) => ("gnss", gnss(pvt)),
        Item::RateOfTurn(r) => ("rate_of_turn_radps", many(r)),
        Item::DeltaQ(r) => ("delta_q_wxyz", many(r)),
        Item::RateOfTurnHr(r) => ("rate_of_turn_hr_radps", many(r)),
        Item::MagneticField(r) => ("magnetic_field", many(r)),
        Item::VelocityXyz(axes, r) => (in_axes(*axes, VELOCITY), many(r)),
        Item::StatusByte(status) => ("status_byte", json!(status.0)),
        Item::StatusWord(status) => ("status_word", json!(status.0)),
        Item::Unknown(raw) => (
            "unknown",
            json!({"id": format!("{:04x}", raw.id.0), "data": raw.data}),
        ),
    }
}

fn in_axes(axes: CoordinateSystem, [enu, ned, nwu]: [&'static str; 3]) -> &'static str {
    match axes {
        CoordinateSystem::EastNorthUp => enu,
        CoordinateSystem::NorthEastDown => ned,
        CoordinateSystem::NorthWestUp => nwu,
    }
}

/// NaN and infinities become null.
fn one(number: &Reals<'_, 1>) -> Value {
    let [number] = number.to_f64();
    json!(number)
}

fn many<const N: usize>(numbers: &Reals<'_, N>) -> Value {
    json!(numbers.to_f64().to_vec())
}

fn utc(time: &UtcTime) -> String {
    format!(
        "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z",
        time.year,
        time.month,
        time.day,
        time.hour,
        time.minute,
        time.second,
        time.nanosecond / 1_000_000
    )
}

/// Position and speed are given only with a fix: without one the receiver's numbers are meaningless.
fn gnss(pvt: &GnssPvt) -> Value {
    if pvt.fix_type == 0 {
        return json!({"fix_type": 0, "satellites": pvt.satellites});
    }
    let metres = |millimetres: i32| f64::from(millimetres) / 1e3;
    json!({
        "fix_type": pvt.fix_type,
        "satellites": pvt.satellites,
        "latitude_deg": f64::from(pvt.latitude_e7) / 1e7,
        "longitude_deg": f64::from(pvt.longitude_e7) / 1e7,
        "height_m": metres(pvt.height_mm),
        "height_msl_m": metres(pvt.height_msl_mm),
        "horizontal_accuracy_m": f64::from(pvt.horizontal_accuracy_mm) / 1e3,
        "vertical_accuracy_m": f64::from(pvt.vertical_accuracy_mm) / 1e3,
        "velocity_ned_mps": pvt.velocity_ned_mmps.map(metres),
        "speed_accuracy_mps": f64::from(pvt.speed_accuracy_mmps) / 1e3,
    })
}
