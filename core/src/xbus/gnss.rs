//! GNSS position, velocity and time as forwarded by the sensor.

use nalgebra::Vector3;

/// The 94 bytes of item 0x7010, as integers in the receiver's units.
///
/// Position, speed and course are meaningless while `fix_type` is 0. The sample time of the packet is that of the GNSS
/// solution, which is older than the inertial packets around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GnssPvt {
    /// GPS time of week (ms).
    pub time_of_week_ms: u32,
    /// UTC year.
    pub year: u16,
    /// UTC month, 1 to 12.
    pub month: u8,
    /// UTC day of month, 1 to 31.
    pub day: u8,
    /// UTC hour.
    pub hour: u8,
    /// UTC minute.
    pub minute: u8,
    /// UTC second, 60 during a leap second.
    pub second: u8,
    /// Validity: bit 0 date, 1 time of day, 2 time fully resolved.
    pub valid: u8,
    /// Time accuracy (ns).
    pub time_accuracy_ns: u32,
    /// Fraction of the second (ns); may be negative.
    pub nanosecond: i32,
    /// Kind of fix: 0 none, 1 dead reckoning, 2 two-dimensional, 3 three-dimensional, 4 with dead reckoning, 5 time
    /// only.
    pub fix_type: u8,
    /// Flags: bit 0 fix within limits, 1 differential, 5 heading of vehicle valid.
    pub flags: u8,
    /// Number of satellites used.
    pub satellites: u8,
    /// Longitude (1e-7 deg).
    pub longitude_e7: i32,
    /// Latitude (1e-7 deg).
    pub latitude_e7: i32,
    /// Height above the ellipsoid (mm).
    pub height_mm: i32,
    /// Height above mean sea level (mm).
    pub height_msl_mm: i32,
    /// Horizontal accuracy (mm).
    pub horizontal_accuracy_mm: u32,
    /// Vertical accuracy (mm).
    pub vertical_accuracy_mm: u32,
    /// Velocity north, east, down (mm/s).
    pub velocity_ned_mmps: [i32; 3],
    /// Speed over the ground (mm/s).
    pub ground_speed_mmps: i32,
    /// Heading of motion (1e-5 deg).
    pub heading_motion_e5: i32,
    /// Speed accuracy (mm/s).
    pub speed_accuracy_mmps: u32,
    /// Heading accuracy (1e-5 deg).
    pub heading_accuracy_e5: u32,
    /// Heading of vehicle (1e-5 deg).
    pub heading_vehicle_e5: i32,
    /// Dilution of precision: geometric, position, time, vertical, horizontal, north, east (0.01).
    pub dilution_e2: [u16; 7],
}

impl GnssPvt {
    /// Length of the item (bytes).
    pub const SIZE: usize = 94;

    pub(super) fn read(bytes: &[u8; Self::SIZE]) -> Self {
        let mut fields = Fields(bytes);
        Self {
            time_of_week_ms: u32::from_be_bytes(fields.take()),
            year: u16::from_be_bytes(fields.take()),
            month: u8::from_be_bytes(fields.take()),
            day: u8::from_be_bytes(fields.take()),
            hour: u8::from_be_bytes(fields.take()),
            minute: u8::from_be_bytes(fields.take()),
            second: u8::from_be_bytes(fields.take()),
            valid: u8::from_be_bytes(fields.take()),
            time_accuracy_ns: u32::from_be_bytes(fields.take()),
            nanosecond: i32::from_be_bytes(fields.take()),
            fix_type: u8::from_be_bytes(fields.take()),
            flags: u8::from_be_bytes(fields.take()),
            satellites: {
                let [satellites, _reserved] = fields.take();
                satellites
            },
            longitude_e7: i32::from_be_bytes(fields.take()),
            latitude_e7: i32::from_be_bytes(fields.take()),
            height_mm: i32::from_be_bytes(fields.take()),
            height_msl_mm: i32::from_be_bytes(fields.take()),
            horizontal_accuracy_mm: u32::from_be_bytes(fields.take()),
            vertical_accuracy_mm: u32::from_be_bytes(fields.take()),
            velocity_ned_mmps: core::array::from_fn(|_| i32::from_be_bytes(fields.take())),
            ground_speed_mmps: i32::from_be_bytes(fields.take()),
            heading_motion_e5: i32::from_be_bytes(fields.take()),
            speed_accuracy_mmps: u32::from_be_bytes(fields.take()),
            heading_accuracy_e5: u32::from_be_bytes(fields.take()),
            heading_vehicle_e5: i32::from_be_bytes(fields.take()),
            dilution_e2: core::array::from_fn(|_| u16::from_be_bytes(fields.take())),
        }
    }

    /// Returns whether there is a three-dimensional fix within the receiver's limits.
    pub const fn has_fix(&self) -> bool {
        self.fix_type >= 3 && self.fix_type <= 4 && self.flags & 1 != 0
    }

    /// Returns the speed over the ground (m/s), or `None` if there is no fix.
    #[expect(clippy::cast_precision_loss, reason = "exact up to 16 km/s")]
    pub fn horizontal_speed(&self) -> Option<f32> {
        self.has_fix()
            .then_some(self.ground_speed_mmps as f32 / 1000.0)
    }

    /// Returns the velocity in the model's inertial axes, north, west and up (m/s), or `None` if there is no fix.
    #[expect(clippy::cast_precision_loss, reason = "exact up to 16 km/s")]
    pub fn velocity(&self) -> Option<Vector3<f32>> {
        let [north, east, down] = self.velocity_ned_mmps.map(|mm| mm as f32 / 1000.0);
        self.has_fix().then(|| Vector3::new(north, -east, -down))
    }

    /// Returns the standard deviation of the velocity that the receiver states (m/s).
    #[expect(clippy::cast_precision_loss, reason = "exact up to 16 km/s")]
    pub fn speed_accuracy(&self) -> f32 {
        self.speed_accuracy_mmps as f32 / 1000.0
    }
}

/// Reads consecutive big-endian fields. The length is known, so no field is ever missing.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> [u8; N] {
        match self.0.split_first_chunk::<N>() {
            Some((field, rest)) => {
                self.0 = rest;
                *field
            }
            None => [0; N],
        }
    }
}
