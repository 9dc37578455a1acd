//! The items of an MTData2 packet.

use core::fmt;

use nalgebra::{Quaternion, UnitQuaternion};

use super::gnss::GnssPvt;
use super::number::{NumberFormat, Reals};

/// Identifier of an item: group, type, coordinate system and number format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DataId(pub u16);

#[expect(missing_docs, reason = "the names of the vendor's document")]
impl DataId {
    pub const TEMPERATURE: Self = Self(0x0810);
    pub const UTC_TIME: Self = Self(0x1010);
    pub const PACKET_COUNTER: Self = Self(0x1020);
    pub const SAMPLE_TIME_FINE: Self = Self(0x1060);
    pub const SAMPLE_TIME_COARSE: Self = Self(0x1070);
    pub const QUATERNION: Self = Self(0x2010);
    pub const ROTATION_MATRIX: Self = Self(0x2020);
    pub const EULER_ANGLES: Self = Self(0x2030);
    pub const BARO_PRESSURE: Self = Self(0x3010);
    pub const DELTA_V: Self = Self(0x4010);
    pub const ACCELERATION: Self = Self(0x4020);
    pub const FREE_ACCELERATION: Self = Self(0x4030);
    pub const ACCELERATION_HR: Self = Self(0x4040);
    pub const ALTITUDE_ELLIPSOID: Self = Self(0x5020);
    pub const POSITION_ECEF: Self = Self(0x5030);
    pub const LAT_LON: Self = Self(0x5040);
    pub const GNSS_PVT: Self = Self(0x7010);
    pub const RATE_OF_TURN: Self = Self(0x8020);
    pub const DELTA_Q: Self = Self(0x8030);
    pub const RATE_OF_TURN_HR: Self = Self(0x8040);
    pub const MAGNETIC_FIELD: Self = Self(0xC020);
    pub const VELOCITY_XYZ: Self = Self(0xD010);
    pub const STATUS_BYTE: Self = Self(0xE010);
    pub const STATUS_WORD: Self = Self(0xE020);
}

impl DataId {
    /// Returns the identifier without coordinate system and number format.
    pub const fn kind(self) -> Self {
        Self(self.0 & 0xFFF0)
    }

    /// Returns the coordinate system, or `None` if the identifier has an invalid one.
    pub const fn coordinate_system(self) -> Option<CoordinateSystem> {
        match self.0 & 0xC {
            0x0 => Some(CoordinateSystem::EastNorthUp),
            0x4 => Some(CoordinateSystem::NorthEastDown),
            0x8 => Some(CoordinateSystem::NorthWestUp),
            _ => None,
        }
    }

    /// Returns the same item in another coordinate system and number format.
    #[must_use]
    pub const fn with(self, system: CoordinateSystem, format: NumberFormat) -> Self {
        Self(self.kind().0 | system as u16 | format as u16)
    }
}

/// Axes of the earth-fixed frame that a sensor refers to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u16)]
pub enum CoordinateSystem {
    /// X east, Y north, Z up; the sensor's default.
    EastNorthUp = 0x0,
    /// X north, Y east, Z down.
    NorthEastDown = 0x4,
    /// X north, Y west, Z up, which is the inertial frame of the model.
    NorthWestUp = 0x8,
}

impl CoordinateSystem {
    /// Returns the rotation from these axes to the model's inertial axes.
    pub fn inertial_from_earth(self) -> UnitQuaternion<f32> {
        let half = core::f32::consts::FRAC_1_SQRT_2;
        let [w, x, y, z] = match self {
            Self::EastNorthUp => [half, 0.0, 0.0, -half],
            Self::NorthEastDown => [0.0, 1.0, 0.0, 0.0],
            Self::NorthWestUp => [1.0, 0.0, 0.0, 0.0],
        };
        UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
    }
}

/// UTC time according to the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct UtcTime {
    pub nanosecond: u32,
    pub year: u16,
    pub month: u8,
    pub day: u8,
    pub hour: u8,
    pub minute: u8,
    pub second: u8,
    /// Validity: bit 0 date, 1 time of day, 2 fully resolved.
    pub flags: u8,
}

/// The status word, or the status byte in its lowest bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Status(pub u32);

impl Status {
    /// Returns whether the self-test passed; MTi-600 sensors always report 0.
    pub const fn self_test_passed(self) -> bool {
        self.0 & 1 != 0
    }

    /// Returns whether the orientation filter is valid.
    pub const fn filter_valid(self) -> bool {
        self.0 & 1 << 1 != 0
    }

    /// Returns whether GNSS has a fix.
    pub const fn gnss_fix(self) -> bool {
        self.0 & 1 << 2 != 0
    }

    /// Returns for each of the axes X, Y, Z whether the accelerometer exceeded its range.
    pub const fn accelerometer_clipped(self) -> [bool; 3] {
        self.axes(8)
    }

    /// Returns for each of the axes X, Y, Z whether the gyroscope exceeded its range.
    pub const fn gyroscope_clipped(self) -> [bool; 3] {
        self.axes(11)
    }

    /// Returns for each of the axes X, Y, Z whether the magnetometer exceeded its range.
    pub const fn magnetometer_clipped(self) -> [bool; 3] {
        self.axes(14)
    }

    const fn axes(self, first: u32) -> [bool; 3] {
        [
            self.0 >> first & 1 != 0,
            self.0 >> (first + 1) & 1 != 0,
            self.0 >> (first + 2) & 1 != 0,
        ]
    }
}

/// A decoded item. Vectors are x, y, z; quaternions are w, x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item<'a> {
    /// Temperature inside the sensor (degC).
    Temperature(Reals<'a, 1>),
    /// Time of day.
    UtcTime(UtcTime),
    /// Packet counter, which wraps at 65536.
    PacketCounter(u16),
    /// Sensor time in ticks of 0.1 ms, see [`SampleClock`](super::SampleClock).
    SampleTimeFine(u32),
    /// Sensor time in whole seconds.
    SampleTimeCoarse(u32),
    /// Rotation from sensor axes to earth axes.
    Quaternion(CoordinateSystem, Reals<'a, 4>),
    /// The same rotation as a matrix, row by row.
    RotationMatrix(CoordinateSystem, Reals<'a, 9>),
    /// The same rotation as roll, pitch, yaw (deg).
    EulerAngles(CoordinateSystem, Reals<'a, 3>),
    /// Pressure (Pa).
    BaroPressure(u32),
    /// Velocity increment over the sample in sensor axes, gravity included (m/s).
    DeltaV(Reals<'a, 3>),
    /// Acceleration in sensor axes, gravity included (m/s2).
    Acceleration(Reals<'a, 3>),
    /// Acceleration in earth axes without gravity (m/s2).
    FreeAcceleration(Reals<'a, 3>),
    /// Acceleration at the full rate of the sensor (m/s2).
    AccelerationHr(Reals<'a, 3>),
    /// Height above the ellipsoid (m).
    AltitudeEllipsoid(Reals<'a, 1>),
    /// Position in earth-centred, earth-fixed axes (m).
    PositionEcef(Reals<'a, 3>),
    /// Latitude and longitude (deg).
    LatLon(Reals<'a, 2>),
    /// Navigation solution of the GNSS receiver.
    GnssPvt(GnssPvt),
    /// Angular velocity in sensor axes (rad/s).
    RateOfTurn(Reals<'a, 3>),
    /// Rotation over the sample, as a quaternion.
    DeltaQ(Reals<'a, 4>),
    /// Angular velocity at the full rate of the sensor (rad/s).
    RateOfTurnHr(Reals<'a, 3>),
    /// Magnetic field, normalised to 1 at calibration.
    MagneticField(Reals<'a, 3>),
    /// Velocity in earth axes (m/s).
    VelocityXyz(CoordinateSystem, Reals<'a, 3>),
    /// The lowest eight bits of the status.
    StatusByte(Status),
    /// The whole status.
    StatusWord(Status),
    /// Any other item.
    Unknown(RawItem<'a>),
}

/// Error for an item of known type with invalid data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BadItem {
    /// Identifier of the item.
    pub id: DataId,
    /// Length of the data found (bytes).
    pub found: usize,
}

impl fmt::Display for BadItem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "item {:#06x} has {} bytes of data, which is not its size",
            self.id.0, self.found
        )
    }
}

impl core::error::Error for BadItem {}

/// An undecoded item, borrowed from the packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawItem<'a> {
    /// Identifier of the item.
    pub id: DataId,
    /// Data of the item.
    pub data: &'a [u8],
}

impl<'a> RawItem<'a> {
    /// Decodes the item; returns [`Item::Unknown`] if its identifier is not supported.
    ///
    /// # Errors
    /// Returns an error if the size of the data does not match the identifier, or if the coordinate system is invalid.
    pub fn decode(&self) -> Result<Item<'a>, BadItem> {
        self.understood().ok_or(BadItem {
            id: self.id,
            found: self.data.len(),
        })
    }

    fn understood(&self) -> Option<Item<'a>> {
        Some(match self.id.kind() {
            DataId::TEMPERATURE => Item::Temperature(self.reals()?),
            DataId::UTC_TIME => Item::UtcTime(self.utc_time()?),
            DataId::PACKET_COUNTER => Item::PacketCounter(u16::from_be_bytes(self.array()?)),
            DataId::SAMPLE_TIME_FINE => Item::SampleTimeFine(self.word()?),
            DataId::SAMPLE_TIME_COARSE => Item::SampleTimeCoarse(self.word()?),
            DataId::QUATERNION => Item::Quaternion(self.system()?, self.reals()?),
            DataId::ROTATION_MATRIX => Item::RotationMatrix(self.system()?, self.reals()?),
            DataId::EULER_ANGLES => Item::EulerAngles(self.system()?, self.reals()?),
            // Always whole pascals, whatever the format bits are: sensors do set them.
            DataId::BARO_PRESSURE => Item::BaroPressure(self.word()?),
            DataId::DELTA_V => Item::DeltaV(self.reals()?),
            DataId::ACCELERATION => Item::Acceleration(self.reals()?),
            DataId::FREE_ACCELERATION => Item::FreeAcceleration(self.reals()?),
            DataId::ACCELERATION_HR => Item::AccelerationHr(self.reals()?),
            DataId::ALTITUDE_ELLIPSOID => Item::AltitudeEllipsoid(self.reals()?),
            DataId::POSITION_ECEF => Item::PositionEcef(self.reals()?),
            DataId::LAT_LON => Item::LatLon(self.reals()?),
            DataId::GNSS_PVT => Item::GnssPvt(GnssPvt::read(self.data.try_into().ok()?)),
            DataId::RATE_OF_TURN => Item::RateOfTurn(self.reals()?),
            DataId::DELTA_Q => Item::DeltaQ(self.reals()?),
            DataId::RATE_OF_TURN_HR => Item::RateOfTurnHr(self.reals()?),
            DataId::MAGNETIC_FIELD => Item::MagneticField(self.reals()?),
            DataId::VELOCITY_XYZ => Item::VelocityXyz(self.system()?, self.reals()?),
            DataId::STATUS_BYTE => {
                let [byte] = self.array()?;
                Item::StatusByte(Status(u32::from(byte)))
            }
            DataId::STATUS_WORD => Item::StatusWord(Status(self.word()?)),
            _ => Item::Unknown(*self),
        })
    }

    fn array<const N: usize>(&self) -> Option<[u8; N]> {
        self.data.try_into().ok()
    }

    fn word(&self) -> Option<u32> {
        self.array().map(u32::from_be_bytes)
    }

    fn reals<const N: usize>(&self) -> Option<Reals<'a, N>> {
        Reals::new(self.data, NumberFormat::of(self.id.0))
    }

    fn system(&self) -> Option<CoordinateSystem> {
        self.id.coordinate_system()
    }

    fn utc_time(&self) -> Option<UtcTime> {
        let [
            n0,
            n1,
            n2,
            n3,
            y0,
            y1,
            month,
            day,
            hour,
            minute,
            second,
            flags,
        ] = self.array()?;
        Some(UtcTime {
            nanosecond: u32::from_be_bytes([n0, n1, n2, n3]),
            year: u16::from_be_bytes([y0, y1]),
            month,
            day,
            hour,
            minute,
            second,
            flags,
        })
    }
}

/// Iterator over the items of a packet in the order sent, which is not fixed.
#[derive(Debug, Clone)]
pub struct Items<'a> {
    rest: &'a [u8],
}

impl<'a> Items<'a> {
    pub(super) const fn new(data: &'a [u8]) -> Self {
        Self { rest: data }
    }

    /// Returns whether the items fill `data` exactly.
    pub(super) fn fill(data: &[u8]) -> bool {
        let mut items = Items::new(data);
        while items.next().is_some() {}
        items.rest.is_empty()
    }
}

impl<'a> Iterator for Items<'a> {
    type Item = RawItem<'a>;

    fn next(&mut self) -> Option<RawItem<'a>> {
        let ([high, low, size], rest) = self.rest.split_first_chunk::<3>()?;
        let (data, rest) = rest.split_at_checked(usize::from(*size))?;
        self.rest = rest;
        Some(RawItem {
            id: DataId(u16::from_be_bytes([*high, *low])),
            data,
        })
    }
}
