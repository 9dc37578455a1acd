//! Driver for an ICM-42688-P, an accelerometer and gyroscope on SPI: ranges 16 g and 2000 deg/s, 200 Hz.
//!
//! [`Port`] presents the chip as the line of an MTi that sends rate of turn and acceleration only, so that everything
//! behind it, from the levelling at rest to the log, is the same. Source of the registers: TDK InvenSense DS-000347,
//! ICM-42688-P datasheet. The crate `icm426xx` reads the chip's queue only; one measurement at a time needs less.

use bodyflight_core::xbus::{DataId, MessageId, PacketWriter};
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorKind, ErrorType, Read};

use super::STANDARD_GRAVITY;

/// Registers, and the bit that marks a read.
const DEVICE_CONFIG: u8 = 0x11;
const TEMPERATURE: u8 = 0x1d;
const INTERRUPT_STATUS: u8 = 0x2d;
const POWER: u8 = 0x4e;
const GYROSCOPE_CONFIG: u8 = 0x4f;
const ACCELEROMETER_CONFIG: u8 = 0x50;
const IDENTITY: u8 = 0x75;
const READ: u8 = 0x80;

/// What the chip answers when it is asked who it is.
const ICM_42688_P: u8 = 0x47;

/// Soft reset, and the time that it takes (us).
const RESET: u8 = 0x01;
const RESETTING: u32 = 1_000;

/// Both sensors on, at low noise; no register may be written for 200 us, and the gyroscope starts in 30 ms.
const ON: u8 = 0x0f;
const STARTING: u32 = 45_000;

/// Codes of the widest ranges, 2000 deg/s and 16 g, at 200 Hz.
const WIDEST_AT_200_HZ: u8 = 0x07;

/// Counts of a degree per second and of a g.
const TURN_COUNTS: f32 = 16.4;
const FORCE_COUNTS: f32 = 2048.0;

/// Content of a register of a sensor that has not started.
const INVALID: i16 = i16::MIN;

/// Status bit: there is a new measurement. Interval of looking for one (us), a fifth of that of measurements, and number
/// of looks after which the chip is taken to have lost its settings.
const READY: u8 = 1 << 3;
const LOOKING: u32 = 1_000;
const LOOKS: u32 = 50;

/// Errors of the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ChipError {
    /// The bus or the select pin failed.
    Bus,
    /// It stopped measuring, or another chip answers.
    Silent,
}

impl core::fmt::Display for ChipError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str(match self {
            Self::Bus => "the bus of the inertial sensor failed",
            Self::Silent => "the inertial sensor stopped measuring",
        })
    }
}

impl core::error::Error for ChipError {}

impl embedded_io_async::Error for ChipError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

/// A measurement, in the axes printed on the chip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Specific force (m/s2).
    pub specific_force: [f32; 3],
    /// Angular velocity, not corrected for the bias (rad/s).
    pub angular_velocity: [f32; 3],
}

/// The chip, with its own select pin.
#[derive(Debug)]
pub struct Icm42688<B, P, D> {
    bus: B,
    select: P,
    delay: D,
}

impl<B: SpiBus, P: OutputPin, D: DelayNs> Icm42688<B, P, D> {
    /// A chip that was not set up yet.
    pub const fn new(bus: B, select: P, delay: D) -> Self {
        Self { bus, select, delay }
    }

    /// Finds the chip and sets it up; returns `None` if no such chip answers.
    pub async fn find(bus: B, select: P, delay: D) -> Option<Self> {
        let mut chip = Self::new(bus, select, delay);
        chip.set_up().await.ok()?;
        Some(chip)
    }

    /// Resets the chip and starts both sensors.
    ///
    /// # Errors
    /// Returns an error if the bus fails or no such chip answers.
    pub async fn set_up(&mut self) -> Result<(), ChipError> {
        self.write(DEVICE_CONFIG, RESET)?;
        self.delay.delay_us(RESETTING).await;
        let mut identity = [0];
        self.read(IDENTITY, &mut identity)?;
        if identity != [ICM_42688_P] {
            return Err(ChipError::Silent);
        }
        self.write(GYROSCOPE_CONFIG, WIDEST_AT_200_HZ)?;
        self.write(ACCELEROMETER_CONFIG, WIDEST_AT_200_HZ)?;
        self.write(POWER, ON)?;
        self.delay.delay_us(STARTING).await;
        Ok(())
    }

    /// Waits for the next measurement.
    ///
    /// # Errors
    /// Returns an error if the bus fails, or if there is none for ten intervals.
    pub async fn measure(&mut self) -> Result<Measured, ChipError> {
        for _ in 0..LOOKS {
            if let Some(measured) = self.look()? {
                return Ok(measured);
            }
            self.wait(LOOKING).await;
        }
        Err(ChipError::Silent)
    }

    /// The measurement since the last look, if there is one. Takes up to 16 bytes on the bus.
    ///
    /// # Errors
    /// Returns an error if the bus fails.
    pub fn look(&mut self) -> Result<Option<Measured>, ChipError> {
        let mut status = [0];
        self.read(INTERRUPT_STATUS, &mut status)?;
        if status[0] & READY == 0 {
            return Ok(None);
        }
        self.latest()
    }

    /// Waits (us).
    pub(crate) async fn wait(&mut self, micros: u32) {
        self.delay.delay_us(micros).await;
    }

    /// The latest measurement; `None` if a sensor has not started. All registers are read at once, so that they belong
    /// together.
    fn latest(&mut self) -> Result<Option<Measured>, ChipError> {
        let mut bytes = [0; 14];
        self.read(TEMPERATURE, &mut bytes)?;
        let (words, _) = bytes.as_chunks::<2>();
        let [_temperature, rest @ ..] = words else {
            return Ok(None);
        };
        let mut counts = [0; 6];
        for (count, word) in counts.iter_mut().zip(rest) {
            *count = i16::from_be_bytes(*word);
        }
        if counts.contains(&INVALID) {
            return Ok(None);
        }
        let [fx, fy, fz, tx, ty, tz] = counts.map(f32::from);
        let turn = |count: f32| (count / TURN_COUNTS).to_radians();
        Ok(Some(Measured {
            specific_force: [fx, fy, fz].map(|count| count / FORCE_COUNTS * STANDARD_GRAVITY),
            angular_velocity: [tx, ty, tz].map(turn),
        }))
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), ChipError> {
        self.exchange(&[register, value], &mut [])
    }

    fn read(&mut self, register: u8, values: &mut [u8]) -> Result<(), ChipError> {
        self.exchange(&[register | READ], values)
    }

    fn exchange(&mut self, written: &[u8], read: &mut [u8]) -> Result<(), ChipError> {
        self.select.set_low().map_err(|_| ChipError::Bus)?;
        let done = self
            .bus
            .write(written)
            .and_then(|()| self.bus.read(read))
            .and_then(|()| self.bus.flush());
        self.select.set_high().map_err(|_| ChipError::Bus)?;
        done.map_err(|_| ChipError::Bus)
    }
}

/// Length of a packet (bytes): counter, time, rate of turn and acceleration.
const PACKET: usize = 64;

/// The chip as a sensor's port, which sends a packet with each measurement.
#[derive(Debug)]
pub struct Port<B, P, D> {
    chip: Icm42688<B, P, D>,
    /// The board's time (us). The chip's own clock may be wrong by a percent, and the time of a look by its interval.
    clock: fn() -> u64,
    counter: u16,
    packet: [u8; PACKET],
    /// Part of the packet that was not read yet.
    sent: usize,
    length: usize,
}

impl<B, P, D> Port<B, P, D> {
    /// Creates the port; `clock` is the board's time (us).
    pub const fn new(chip: Icm42688<B, P, D>, clock: fn() -> u64) -> Self {
        Self {
            chip,
            clock,
            counter: 0,
            packet: [0; PACKET],
            sent: 0,
            length: 0,
        }
    }

    /// Writes the packet of a measurement and returns its length.
    fn pack(&mut self, measured: &Measured) -> Option<usize> {
        // In ticks of 0.1 ms, which wrap like those of an MTi.
        #[expect(clippy::cast_possible_truncation, reason = "wraps")]
        let time = ((self.clock)() / 100) as u32;
        let mut writer = PacketWriter::new(&mut self.packet, MessageId::MT_DATA2);
        writer.item(DataId::PACKET_COUNTER, &self.counter.to_be_bytes())?;
        writer.item(DataId::SAMPLE_TIME_FINE, &time.to_be_bytes())?;
        writer.reals(DataId::RATE_OF_TURN, &measured.angular_velocity)?;
        writer.reals(DataId::ACCELERATION, &measured.specific_force)?;
        writer.finish()
    }
}

impl<B, P, D> ErrorType for Port<B, P, D> {
    type Error = ChipError;
}

impl<B: SpiBus, P: OutputPin, D: DelayNs> Read for Port<B, P, D> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ChipError> {
        if self.sent == self.length {
            let measured = match self.chip.measure().await {
                Ok(measured) => measured,
                Err(error) => {
                    // It may have lost its supply for a moment; the error is counted either way.
                    let _ = self.chip.set_up().await;
                    return Err(error);
                }
            };
            self.length = self.pack(&measured).unwrap_or_default();
            self.sent = 0;
            self.counter = self.counter.wrapping_add(1);
        }
        let rest = self.packet.get(self.sent..self.length).unwrap_or_default();
        let count = rest.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(rest) {
            *place = *byte;
        }
        self.sent += count;
        Ok(count)
    }
}

#[cfg(test)]
pub(crate) mod tests;
