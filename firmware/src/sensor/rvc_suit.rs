//! Sensors on the limbs without nodes: BNO08x in their UART-RVC mode, each on a line of its own to the unit's board.
//!
//! What they send becomes the packets of a chain of nodes, so that everything behind it is the same. Their clocks are
//! their own: an attitude is taken between two packets of a sensor at the instants of the unit's cycles. The mode has no angular
//! velocity, so that of a packet is the mean by which the attitude turned since the cycle before: no turn is lost, but the
//! corrections of the sensor's fusion are in it, which takes the force of the air for gravity and whose bias and noise are not
//! those of a gyroscope.

use bodyflight_core::Segment;
use bodyflight_core::chain::{PACKET_LENGTH, Packet, Rounding};
use bodyflight_core::math::rotation_by;
use bodyflight_core::suit::placement::of_size;
use bodyflight_core::suit::strapdown::Reading;
use embassy_futures::select::{Either, select};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{ErrorType, Read};
use heapless::Deque;
use nalgebra::{UnitQuaternion, Vector3};

use super::rvc::Decoder;
use crate::node::PERIOD;

/// Number of lines.
pub const LINES: usize = 10;

/// How long after an instant its packets are made (us): in time for the next packet of each sensor, and for one more if that
/// is damaged.
const DELAY: u64 = 25_000;
/// Longest time between two packets with an attitude in between (us): two are lost.
const LONGEST: u64 = 35_000;
/// What a sensor's clock may be slow by, in a packet (us): 1 %.
const DRIFT: u64 = 100;
/// Difference from the expected time (us) by which a sensor has restarted.
const RESTARTED: u64 = 150_000;
/// How often the lines are looked at (ms): as fast as an attitude is dated.
const LOOK: u32 = 1;

/// The segment of the sensor on a line; the pelvis is on the first.
pub fn segment(line: usize) -> Option<Segment> {
    of_size(LINES)?.get(line).copied()
}

/// What a sensor sent.
#[derive(Debug, Clone, Copy)]
struct Sent {
    /// When it arrived, or would have without waiting (us).
    time: u64,
    attitude: UnitQuaternion<f32>,
    force: Vector3<f32>,
}

/// One sensor.
#[derive(Debug)]
struct Line {
    decoder: Decoder,
    /// Time by the sensor's counter (0.1 ms) of the last packet, and by our clock (us).
    last: Option<(u32, u64)>,
    sent: Deque<Sent, 6>,
    /// Attitude in the cycle before.
    before: Option<UnitQuaternion<f32>>,
    rounding: Rounding,
}

impl Line {
    fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            last: None,
            sent: Deque::new(),
            before: None,
            rounding: Rounding::default(),
        }
    }

    /// Takes a byte that was there at `now` (us).
    fn take(&mut self, byte: u8, now: u64) {
        let Some(reading) = self.decoder.next(&mut &[byte][..]) else {
            return;
        };
        let (Some(fine), Some(attitude), Some(force)) = (
            reading.fine_time,
            reading.inertial_from_sensor,
            reading.specific_force,
        ) else {
            return;
        };
        // A packet may wait for us, but is never early: the earliest ones tell the time.
        let expected = self.last.map(|(before, time)| {
            let step = fine.wrapping_sub(before);
            time + 100 * u64::from(step)
        });
        let expected = expected.filter(|expected| expected.abs_diff(now) < RESTARTED);
        let time = expected.map_or(now, |expected| now.min(expected + DRIFT));
        self.last = Some((fine, time));
        // After a restart the attitude has nothing to do with that before.
        if expected.is_none() || self.sent.back().is_some_and(|sent| sent.time >= time) {
            self.sent.clear();
        }
        if self.sent.is_full() {
            self.sent.pop_front();
        }
        let sent = Sent {
            time,
            attitude,
            force,
        };
        // There is room now.
        let _ = self.sent.push_back(sent);
    }

    /// Attitude and force at an instant (us).
    fn at(&mut self, instant: u64) -> Option<(UnitQuaternion<f32>, Vector3<f32>)> {
        while self.sent.get(1).is_some_and(|sent| sent.time <= instant) {
            self.sent.pop_front();
        }
        let (before, after) = (self.sent.front()?, self.sent.get(1)?);
        let gap = after.time - before.time;
        if before.time > instant || gap > LONGEST {
            return None;
        }
        // Exact: both are short.
        #[expect(clippy::cast_precision_loss, reason = "below 2^16")]
        let share = (instant - before.time) as f32 / gap as f32;
        let turn = (before.attitude.inverse() * after.attitude).scaled_axis();
        Some((
            before.attitude * rotation_by(&(turn * share)),
            before.force.lerp(&after.force, share),
        ))
    }

    /// Counts of rates and forces in the cycle at an instant (us), if the cycle before had an attitude too.
    fn counts(&mut self, instant: u64) -> Option<[[i16; 3]; 2]> {
        let found = self.at(instant);
        let before = core::mem::replace(&mut self.before, found.map(|(attitude, _)| attitude));
        let ((attitude, specific_force), before) = found.zip(before)?;
        #[expect(clippy::cast_precision_loss, reason = "10 000")]
        let period = PERIOD as f32 * 1e-6;
        let angular_velocity = (before.inverse() * attitude).scaled_axis() / period;
        Some(self.rounding.counts(&Reading {
            angular_velocity,
            specific_force,
        }))
    }
}

/// The sensors of a suit.
#[derive(Debug)]
pub struct RvcSuit {
    lines: [Line; LINES],
    /// Instant (us) and number of the cycle whose packets are made, and the line that is next.
    cycle: Option<(u64, u16)>,
    next: usize,
}

impl Default for RvcSuit {
    fn default() -> Self {
        Self::new()
    }
}

impl RvcSuit {
    /// Sensors that were not heard yet.
    pub fn new() -> Self {
        Self {
            lines: core::array::from_fn(|_| Line::new()),
            cycle: None,
            next: 0,
        }
    }

    /// Whether a sensor was heard.
    pub const fn is_heard(&self) -> bool {
        self.cycle.is_some()
    }

    /// Whether a line's bytes should be taken now: those that waited for long are taken as the cycles need them.
    pub fn has_room(&self, line: usize) -> bool {
        self.lines
            .get(line)
            .is_some_and(|line| !line.sent.is_full())
    }

    /// Takes a byte of a line, at a time (us).
    pub fn take(&mut self, line: usize, byte: u8, now: u64) {
        let Some(line) = self.lines.get_mut(line) else {
            return;
        };
        line.take(byte, now);
        if line.last.is_some() {
            self.cycle.get_or_insert((now, 0));
        }
    }

    /// The next packet that is due at a time (us).
    pub fn packet(&mut self, now: u64) -> Option<[u8; PACKET_LENGTH]> {
        loop {
            let (instant, number) = self.cycle.filter(|(instant, _)| instant + DELAY <= now)?;
            while let Some(line) = self.lines.get_mut(self.next) {
                let segment = segment(self.next)?;
                self.next += 1;
                let Some([rates, forces]) = line.counts(instant) else {
                    continue;
                };
                #[expect(clippy::cast_possible_truncation, reason = "wraps")]
                let time = instant as u32;
                let packet = Packet {
                    segment,
                    cycle: number,
                    time,
                    age: 0,
                    rates,
                    forces,
                };
                return Some(packet.encode());
            }
            self.next = 0;
            self.cycle = Some((instant + PERIOD, number.wrapping_add(1)));
        }
    }
}

/// The lines of a board.
pub trait Lines {
    /// The next byte of a line, if there is one.
    fn next(&mut self, line: usize) -> Option<u8>;
}

/// A port for sensors: as soon as one of a suit is heard, the packets of the suit, and until then what another receiver has.
#[derive(Debug)]
pub struct Port<L, R, D> {
    suit: RvcSuit,
    lines: L,
    other: R,
    delay: D,
    /// The board's time (us).
    clock: fn() -> u64,
    packet: [u8; PACKET_LENGTH],
    read: usize,
}

impl<L, R, D> Port<L, R, D> {
    /// Creates the port; `clock` is the board's time (us).
    pub fn new(lines: L, other: R, delay: D, clock: fn() -> u64) -> Self {
        Self {
            suit: RvcSuit::new(),
            lines,
            other,
            delay,
            clock,
            packet: [0; PACKET_LENGTH],
            read: PACKET_LENGTH,
        }
    }
}

impl<L, R: ErrorType, D> ErrorType for Port<L, R, D> {
    type Error = R::Error;
}

impl<L: Lines, R: Read, D: DelayNs> Read for Port<L, R, D> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, R::Error> {
        loop {
            let rest = self.packet.get(self.read..).unwrap_or_default();
            if !rest.is_empty() {
                let count = rest.len().min(bytes.len());
                for (place, byte) in bytes.iter_mut().zip(rest) {
                    *place = *byte;
                }
                self.read += count;
                return Ok(count);
            }
            let now = (self.clock)();
            for line in 0..LINES {
                while self.suit.has_room(line)
                    && let Some(byte) = self.lines.next(line)
                {
                    self.suit.take(line, byte, now);
                }
            }
            if let Some(packet) = self.suit.packet(now) {
                (self.packet, self.read) = (packet, 0);
            } else if self.suit.is_heard() {
                self.delay.delay_ms(LOOK).await;
            } else if let Either::First(read) =
                select(self.other.read(bytes), self.delay.delay_ms(LOOK)).await
            {
                return read;
            }
        }
    }
}

#[cfg(test)]
mod tests;
