//! The sensors that trackers have, by the numbers of the protocol, and the fusion that makes orientations of their readings.

/// Names by number.
const NAMES: [&str; 20] = [
    "unknown",
    "MPU9250",
    "MPU6500",
    "BNO080",
    "BNO085",
    "BNO055",
    "MPU6050",
    "BNO086",
    "BMI160",
    "ICM20948",
    "ICM42688",
    "BMI270",
    "LSM6DS3TRC",
    "LSM6DSV",
    "LSM6DSO",
    "LSM6DSR",
    "ICM45686",
    "ICM45605",
    "ADC",
    "ICM55686",
];

/// Name of a type; "unknown" if it is not known.
pub fn name(sensor_type: u8) -> &'static str {
    let known = NAMES.get(usize::from(sensor_type));
    known.copied().unwrap_or("unknown")
}

/// Name of the fusion behind the orientations of a type, as SlimeVR's firmware has it; `None` if it is not known.
pub fn fusion(sensor_type: u8) -> Option<&'static str> {
    match name(sensor_type) {
        "BNO080" | "BNO085" | "BNO086" => Some("BNO08x"),
        "BNO055" => Some("BNO055"),
        // The sensor's own processor.
        "MPU6050" | "MPU6500" | "MPU9250" | "ICM20948" => Some("DMP"),
        "unknown" | "ADC" => None,
        _ => Some("VQF"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_have_names_and_fusions() {
        assert_eq!((name(4), fusion(4)), ("BNO085", Some("BNO08x")));
        assert_eq!((name(13), fusion(13)), ("LSM6DSV", Some("VQF")));
        assert_eq!((name(250), fusion(250)), ("unknown", None));
    }
}
