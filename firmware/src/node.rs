//! A node of the line of sensors on the limbs: it reads one inertial sensor and sends a packet in its slot of each cycle.
//! `docs/link.md` describes the line.
//!
//! A board provides a [`Line`] and the sensor's bus, and calls [`run`]. [`Node`] is the same without ports or clock. The
//! node on the pelvis begins a cycle every [`PERIOD`]; the others count from the end of its packet, so that their clocks
//! matter for 5 ms at most. Nobody sends outside of its slot: who comes too late keeps silent, and counts it.
//!
//! | light | meaning |
//! |---|---|
//! | a short flash every 2 s | in step |
//! | slow, half on and half off | the pelvis's node is not heard |
//! | two times a second | another node has address 0: this one is silent |
//! | five times a second | the sensor does not answer |

use core::cell::RefCell;

use bodyflight_core::Segment;
use bodyflight_core::chain::cycle::skipped;
use bodyflight_core::chain::{
    Decoder, PACKET_LENGTH, PACKET_TIME, Packet, Rounding, SLOT, TOO_OLD,
};
use bodyflight_core::suit::strapdown::Reading;
use embassy_futures::join::join;
use embassy_futures::yield_now;
use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use embedded_hal_async::delay::DelayNs;
use heapless::Vec;
use nalgebra::Vector3;

use crate::light::{FAST, FLASH, SLOW, STEP_MS, STEPS, TWICE};
use crate::log::info;
use crate::sensor::icm42688::{ChipError, Icm42688};

/// Time between the begins of two cycles (us).
pub const PERIOD: u64 = 10_000;

/// How much later than its slot a packet may begin (us). A slot is 50 us longer than a packet; the rest is for the time
/// at which the pelvis's packet was seen.
const LATEST: u64 = 20;
/// Longest time for which a look at the sensor, 16 bytes on its bus, keeps the line waiting (us).
const LOOK: u64 = 60;
/// Time between two looks at the sensor (us), and number of looks after which it has stopped.
const LOOKING: u32 = 250;
const LOOKS: u32 = 200;
/// Pause before a sensor that does not answer is set up again (us).
const PAUSE: u32 = 100_000;
/// Age from which a measurement belongs to an earlier cycle (us).
const OLD: u64 = PERIOD + 2_000;
/// For how long the node on the pelvis listens for another one before it begins (us).
const LISTENING: u64 = 3 * PERIOD;
/// Time without the pelvis's node, or without a measurement, that the light shows (us).
const SILENCE: u64 = 500_000;
/// Interval of the logs (us).
const LOGGING: u64 = 10_000_000;

/// The board of a node, besides its sensor.
pub trait Line {
    /// Time since the start (us).
    fn now(&mut self) -> u64;

    /// The next byte from the line, if there is one.
    fn hear(&mut self) -> Option<u8>;

    /// Drives the line, sends, and lets go of the line when the last bit has left. What is heard meanwhile is dropped.
    fn send(&mut self, packet: &[u8; PACKET_LENGTH]);

    /// Feeds the watchdog.
    fn feed_watchdog(&mut self);

    /// Switches the light.
    fn shine(&mut self, on: bool);
}

/// Counters of a node; all wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Packets sent.
    pub sent: u32,
    /// Cycles whose begin was not heard, by the numbers of those that were; on the pelvis those that did not begin.
    pub missed: u32,
    /// Slots that were not used because it was too late.
    pub late: u32,
    /// Packets without a new measurement.
    pub old: u32,
    /// Number of times that the sensor was set up anew.
    pub sensor_restarts: u32,
}

/// A measurement and its time (us).
type Timed = (u64, Reading<f32>);

/// The state of a node.
#[derive(Debug, Clone)]
pub struct Node {
    address: Segment,
    decoder: Decoder,
    rounding: Rounding,
    /// Measurements since the last packet, oldest first.
    fresh: Vec<Timed, 8>,
    newest: Option<Timed>,
    /// The packet of this cycle that was not sent yet, and the begin of its slot.
    next: Option<(u64, Packet)>,
    /// Begin of the last cycle by this node's clock, and its number.
    cycle: Option<(u64, u16)>,
    /// On the pelvis: when the next cycle begins.
    begins: u64,
    has_rival: bool,
    started: u64,
    logged: u64,
    counters: Counters,
}

impl Node {
    /// A node on a segment, at the time of its start (us).
    pub fn new(address: Segment, now: u64) -> Self {
        Self {
            address,
            decoder: Decoder::new(),
            rounding: Rounding::default(),
            fresh: Vec::new(),
            newest: None,
            next: None,
            cycle: None,
            begins: now + LISTENING,
            has_rival: false,
            started: now,
            logged: now,
            counters: Counters::default(),
        }
    }

    /// The counters.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Bytes heard outside of packets; wraps.
    pub const fn skipped(&self) -> u32 {
        self.decoder.counters().skipped
    }

    /// Takes a measurement of the sensor in its own axes, made at `time` (us).
    pub fn take(&mut self, reading: &Reading<f32>, time: u64) {
        if self.fresh.is_full() {
            self.fresh.remove(0);
        }
        // There is room now.
        let _ = self.fresh.push((time, *reading));
        self.newest = Some((time, *reading));
    }

    /// Notes that the sensor is set up anew.
    pub fn restart_sensor(&mut self) {
        self.counters.sensor_restarts = self.counters.sensor_restarts.wrapping_add(1);
    }

    /// Does what there is to do on the line: to be called again and again, as often as possible.
    pub fn serve(&mut self, line: &mut impl Line) {
        let now = line.now();
        while let Some(byte) = line.hear() {
            if let Some(packet) = self.decoder.next(&mut &[byte][..]) {
                self.heard(&packet, now);
            }
        }
        if self.address == Segment::Pelvis && now >= self.begins && !self.has_rival {
            self.begin(now);
        }
        if let Some((slot, packet)) = self.next
            && now >= slot
        {
            self.next = None;
            if now - slot <= LATEST {
                line.send(&packet.encode());
                self.counters.sent = self.counters.sent.wrapping_add(1);
            } else {
                self.counters.late = self.counters.late.wrapping_add(1);
            }
        }
        line.feed_watchdog();
        line.shine(self.light(now));
        if now.saturating_sub(self.logged) >= LOGGING {
            self.logged = now;
            self.log();
        }
    }

    fn log(&self) {
        let Counters {
            sent,
            missed,
            late,
            old,
            sensor_restarts,
        } = self.counters;
        info!(
            "address {}: {} packets; cycles missed {}, late {}, without measurement {}; bytes skipped {}, sensor restarts {}",
            self.address as u8,
            sent,
            missed,
            late,
            old,
            self.skipped(),
            sensor_restarts
        );
    }

    /// Begins a cycle on the pelvis. After a delay the cycles that should have begun meanwhile are left out.
    fn begin(&mut self, now: u64) {
        let left_out = (now - self.begins) / PERIOD;
        self.begins += (left_out + 1) * PERIOD;
        #[expect(clippy::cast_possible_truncation, reason = "wraps")]
        let number = match self.cycle {
            Some((_, number)) => {
                self.counters.missed = self.counters.missed.wrapping_add(left_out as u32);
                number.wrapping_add(1 + left_out as u16)
            }
            None => 0,
        };
        self.cycle = Some((now, number));
        #[expect(clippy::cast_possible_truncation, reason = "wraps")]
        let packet = self.packet(number, now as u32, now);
        self.next = Some((now, packet));
    }

    /// Takes a packet of another node, whose last byte was seen at `now`.
    fn heard(&mut self, packet: &Packet, now: u64) {
        if packet.segment != Segment::Pelvis {
            return;
        }
        if self.address == Segment::Pelvis {
            self.has_rival = true;
            self.next = None;
            return;
        }
        let begin = now.saturating_sub(PACKET_TIME.into());
        if let Some((_, last)) = self.cycle {
            let skipped = skipped(last, packet.cycle);
            self.counters.missed = self.counters.missed.wrapping_add(skipped.into());
        }
        self.cycle = Some((begin, packet.cycle));
        let slot = begin + u64::from(SLOT) * self.address as u64;
        let own = self.packet(packet.cycle, packet.time, begin);
        self.next = Some((slot, own));
    }

    /// The packet of a cycle that began at `begin` by this node's clock. It has the mean of the measurements since the last
    /// one, so that the sum of what is sent is the turn, and their mean age.
    fn packet(&mut self, cycle: u16, time: u32, begin: u64) -> Packet {
        let is_old = |(at, _): &Timed| begin.saturating_sub(*at) >= OLD;
        self.fresh.retain(|one| !is_old(one));
        let (mut rates, mut forces, mut age, mut count) =
            (Vector3::zeros(), Vector3::zeros(), 0, 0_u8);
        for (at, reading) in &self.fresh {
            rates += reading.angular_velocity;
            forces += reading.specific_force;
            age += begin.saturating_sub(*at);
            count += 1;
        }
        self.fresh.clear();
        let (reading, age) = if count > 0 {
            let share = 1.0 / f32::from(count);
            let mean = Reading {
                angular_velocity: rates * share,
                specific_force: forces * share,
            };
            (Some(mean), age / u64::from(count))
        } else {
            self.counters.old = self.counters.old.wrapping_add(1);
            let age = self
                .newest
                .map_or(u64::MAX, |(at, _)| begin.saturating_sub(at));
            (self.newest.map(|(_, reading)| reading), age)
        };
        let [rates, forces] = match reading {
            Some(reading) => self.rounding.counts(&reading),
            None => [[0; 3]; 2],
        };
        Packet {
            segment: self.address,
            cycle,
            time,
            age: u8::try_from(age / 100).unwrap_or(TOO_OLD),
            rates,
            forces,
        }
    }

    /// Whether there is time for a look at the sensor: neither does a slot of this node begin meanwhile, nor is the end of
    /// the pelvis's packet expected.
    pub fn has_time(&self, now: u64) -> bool {
        if self.address == Segment::Pelvis {
            return self.has_rival || now + LOOK < self.begins;
        }
        let has_slot = self.next.is_some_and(|(slot, _)| now + LOOK >= slot);
        let expected = u64::from(PACKET_TIME);
        let is_expected = self.cycle.is_some_and(|(begin, _)| {
            let since = now.saturating_sub(begin) % PERIOD;
            since + LOOK >= expected && since < expected + LOOK
        });
        !has_slot && !is_expected
    }

    /// Whether the light is on.
    fn light(&self, now: u64) -> bool {
        let is_silent =
            |since: Option<u64>| now.saturating_sub(since.unwrap_or(self.started)) >= SILENCE;
        let pattern = if is_silent(self.newest.map(|(at, _)| at)) {
            FAST
        } else if self.has_rival {
            TWICE
        } else if is_silent(self.cycle.map(|(begin, _)| begin)) {
            SLOW
        } else {
            FLASH
        };
        let step = now / (STEP_MS * 1_000) % u64::from(STEPS);
        pattern >> step & 1 != 0
    }
}

/// Runs a node forever. The line is served in between all that waits.
pub async fn run<B: SpiBus, P: OutputPin, D: DelayNs>(
    address: Segment,
    mut line: impl Line,
    mut chip: Icm42688<B, P, D>,
) {
    let started = line.now();
    let node = RefCell::new(Node::new(address, started));
    let line = RefCell::new(line);
    let serve = async {
        loop {
            node.borrow_mut().serve(&mut *line.borrow_mut());
            yield_now().await;
        }
    };
    let measure = async {
        loop {
            // The error is counted, and shown by the light.
            let _ = measure(&node, || line.borrow_mut().now(), &mut chip).await;
            node.borrow_mut().restart_sensor();
            chip.wait(PAUSE).await;
        }
    };
    join(serve, measure).await;
}

/// Sets the sensor up and takes its measurements, until it stops.
async fn measure<B: SpiBus, P: OutputPin, D: DelayNs>(
    node: &RefCell<Node>,
    mut now: impl FnMut() -> u64,
    chip: &mut Icm42688<B, P, D>,
) -> Result<(), ChipError> {
    chip.set_up().await?;
    let mut looks = 0;
    while looks < LOOKS {
        chip.wait(LOOKING).await;
        while !node.borrow().has_time(now()) {
            yield_now().await;
        }
        looks += 1;
        let time = now();
        if let Some(measured) = chip.look()? {
            looks = 0;
            let reading = Reading {
                angular_velocity: measured.angular_velocity.into(),
                specific_force: measured.specific_force.into(),
            };
            node.borrow_mut().take(&reading, time);
        }
    }
    Err(ChipError::Silent)
}

#[cfg(test)]
mod tests;
