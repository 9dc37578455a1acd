//! Sensors on the limbs: from the bytes of their line to postures with their errors.
//!
//! Sensors that were never calibrated wait for the poses. Calibrated ones wait until the person stands upright and
//! still, from which postures follow. A sensor that is missing then, fails, or slips leaves its segment to a rule, with
//! the error of that. After half a second without the line postures are unknown, until the person stands upright again.

mod poses;

use bodyflight_core::chain::Decoder;
use bodyflight_core::chain::cycle::{Cycle, Cycles};
use bodyflight_core::link::{
    Calibration, CalibrationStage, CalibrationVerdict, ChainReport, LIMBS, LimbSensor, LimbTable,
    SegmentErrors,
};
use bodyflight_core::suit::set::{Fitted, Suit, pairs_of};
use bodyflight_core::suit::strapdown::{LONGEST_INTERVAL, Reading};
use bodyflight_core::{Body, Lanes, Posture, Segment};
use nalgebra::Vector3;

use poses::{Poses, Seen};

/// Time after which changed errors of the segments are passed on (s): the filter takes them in over about a second.
const ERRORS_EVERY: f32 = 2.0;

/// Time that is assumed to pass while the node on the pelvis restarts (us).
const RESTART: u32 = 1_000_000;

/// As many sensors as a unit has room for.
type LimbSuit = Suit<f32, LIMBS, { pairs_of(LIMBS) }>;

/// Whether this build has sensors on the limbs.
pub const IS_BUILT_IN: bool = true;

/// What the sensors do now.
#[derive(Debug)]
#[expect(
    clippy::large_enum_variant,
    reason = "there is only one, in static memory sized for the larger variant"
)]
enum State {
    Resting(Poses),
    Worn(Worn),
}

/// Sensors whose postures follow.
#[derive(Debug)]
struct Worn {
    /// Made in its place: a unit's stack has no room for several copies.
    suit: Option<LimbSuit>,
    order: heapless::Vec<Segment, LIMBS>,
    /// Calibrated sensors that were not heard when postures began, a bit for each segment.
    missing: u16,
    posture: Posture<f32>,
    errors: SegmentErrors,
    /// Whether the errors were not passed on yet, and time since they were (s).
    is_new: bool,
    age: f32,
}

/// What the node on the pelvis measured, in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PelvisReading {
    /// Number of the cycle.
    pub cycle: u16,
    /// Time in ticks of 0.1 ms; wraps.
    pub fine_time: u32,
    /// Angular velocity (rad/s).
    pub angular_velocity: Vector3<f32>,
    /// Specific force (m/s2).
    pub specific_force: Vector3<f32>,
}

/// The sensors on the limbs.
#[derive(Debug)]
pub struct Limbs {
    decoder: Decoder,
    cycles: Cycles,
    table: LimbTable,
    state: State,
    verdict: CalibrationVerdict,
    about: Segment,
    /// Time of the last cycle (us), and since the first one.
    last: Option<u32>,
    elapsed: u64,
    heard: u16,
    /// The state that was reported last.
    told: Option<Calibration>,
    /// Whether a calibration has ended well and was not stored yet.
    is_to_store: bool,
}

impl Default for Limbs {
    fn default() -> Self {
        Self::new()
    }
}

impl Limbs {
    /// Sensors that were never calibrated.
    pub const fn new() -> Self {
        Self {
            decoder: Decoder::new(),
            cycles: Cycles::new(),
            table: LimbTable::new(),
            state: State::Resting(Poses::new()),
            verdict: CalibrationVerdict::Nothing,
            about: Segment::Pelvis,
            last: None,
            elapsed: 0,
            heard: 0,
            told: None,
            is_to_store: false,
        }
    }

    /// The calibrated sensors.
    pub const fn table(&self) -> &LimbTable {
        &self.table
    }

    /// Takes a calibration that was stored.
    pub fn set_table(&mut self, table: &LimbTable) {
        self.table = *table;
        self.rest();
    }

    /// Takes a row of a calibration; the first one of the pelvis forgets all others.
    pub fn insert(&mut self, sensor: &LimbSensor) {
        if sensor.segment == Segment::Pelvis {
            self.table = LimbTable::new();
        }
        // The host sends no more than there is room for.
        self.table.insert(sensor);
        self.rest();
    }

    /// Forgets the calibration and begins a new one.
    pub fn calibrate(&mut self) {
        self.table = LimbTable::new();
        self.verdict = CalibrationVerdict::Nothing;
        self.about = Segment::Pelvis;
        self.rest();
    }

    /// Waits for poses, or for the person to stand upright.
    fn rest(&mut self) {
        self.state = State::Resting(Poses::of(&self.table));
    }

    /// Returns what the pelvis's node measured in the next cycle, and advances `input` past the bytes used; `None` if more
    /// bytes are needed. Nothing is returned before a calibration.
    pub fn next(&mut self, input: &mut &[u8], body: Option<&Body<f32>>) -> Option<PelvisReading> {
        while let Some(packet) = self.decoder.next(input) {
            let Some(cycle) = self.cycles.push(&packet) else {
                continue;
            };
            let seen = self.follow(&cycle);
            if let (Some(seen), Some(body)) = (seen, body) {
                self.stand(seen, body);
            }
            if let Some(reading) = self.of_pelvis(&cycle) {
                return Some(reading);
            }
        }
        None
    }

    /// Takes a cycle; returns what was seen in the poses.
    fn follow(&mut self, cycle: &Cycle) -> Option<Seen> {
        let is_heard = |segment: Segment| u16::from(cycle.readings[segment].is_some());
        self.heard = Segment::ALL
            .into_iter()
            .fold(0, |mask, segment| mask | is_heard(segment) << segment as u8);
        let step = self.last.map_or(0, |last| cycle.time.wrapping_sub(last));
        self.last = Some(cycle.time);
        let step = step.min(RESTART);
        self.elapsed += u64::from(step);
        // Exact: below 2^24.
        let duration = step as f32 * 1e-6;
        match &mut self.state {
            State::Resting(poses) => poses.take(cycle, duration),
            State::Worn(worn) if duration <= f32::of(LONGEST_INTERVAL) => {
                worn.take(cycle, duration);
                None
            }
            State::Worn(_) => {
                self.rest();
                None
            }
        }
    }

    /// The person stands upright: ends a calibration, and begins postures.
    #[inline(never)]
    fn stand(&mut self, seen: Seen, body: &Body<f32>) {
        let State::Resting(poses) = &self.state else {
            return;
        };
        if seen == Seen::Calibration {
            match poses.fit(body) {
                Ok(table) => {
                    self.table = table;
                    self.verdict = CalibrationVerdict::Good;
                    self.about = Segment::Pelvis;
                    self.is_to_store = true;
                }
                Err((verdict, about)) => {
                    (self.verdict, self.about) = (verdict, about);
                    self.rest();
                    return;
                }
            }
        }
        self.wear(body);
    }

    #[inline(never)]
    fn wear(&mut self, body: &Body<f32>) {
        let mut fitted = heapless::Vec::<Fitted<f32>, LIMBS>::new();
        let mut missing = 0;
        for row in self.table.rows() {
            if self.heard & 1 << row.segment as u8 == 0 {
                missing |= 1 << row.segment as u8;
            } else {
                // As many as the table has.
                let _ = fitted.push(row.fitted());
            }
        }
        // Without the pelvis postures mean nothing.
        if !fitted.iter().any(|one| one.segment == Segment::Pelvis) {
            return;
        }
        self.state = State::Worn(Worn {
            suit: None,
            order: fitted.iter().map(|fitted| fitted.segment).collect(),
            missing,
            posture: Posture::h_pose(),
            errors: SegmentErrors {
                deviation: Default::default(),
                failed: 0,
            },
            is_new: true,
            age: 0.0,
        });
        let is_made = match &mut self.state {
            State::Worn(worn) => worn.make_suit(&fitted, body),
            State::Resting(_) => false,
        };
        if !is_made {
            self.rest();
        }
    }

    /// The pelvis's reading in body axes, once the sensors are calibrated.
    fn of_pelvis(&self, cycle: &Cycle) -> Option<PelvisReading> {
        let reading = cycle.readings[Segment::Pelvis]?;
        let mut rows = self.table.rows();
        let row = rows.find(|row| row.segment == Segment::Pelvis)?.fitted();
        let mounted = row.mounting.segment_from_sensor;
        let rate = row.gyroscope.corrected(&reading.angular_velocity);
        #[expect(clippy::cast_possible_truncation, reason = "wraps")]
        let fine_time = (self.elapsed / 100) as u32;
        Some(PelvisReading {
            cycle: cycle.number,
            fine_time,
            angular_velocity: mounted * rate,
            specific_force: mounted * reading.specific_force,
        })
    }

    /// The posture, if it follows.
    pub fn posture(&self) -> Option<Posture<f32>> {
        match &self.state {
            State::Worn(worn) => Some(worn.posture),
            State::Resting(_) => None,
        }
    }

    /// The errors of the posture, each time that they have changed.
    pub fn new_errors(&mut self) -> Option<SegmentErrors> {
        match &mut self.state {
            State::Worn(worn) => core::mem::take(&mut worn.is_new).then_some(worn.errors),
            State::Resting(_) => None,
        }
    }

    /// The state of the calibration.
    pub fn calibration(&self) -> Calibration {
        let (stage, [rests, turned]) = match &self.state {
            State::Worn(_) => (CalibrationStage::Worn, [0; 2]),
            State::Resting(poses) if self.table.is_empty() => {
                (CalibrationStage::Poses, poses.progress())
            }
            State::Resting(_) => (CalibrationStage::Waiting, [0; 2]),
        };
        Calibration {
            stage,
            verdict: self.verdict,
            segment: self.about,
            rests: u8::try_from(rests).unwrap_or(u8::MAX),
            heard: self.heard,
            turned,
        }
    }

    /// The state of the calibration, if more than the nodes that are heard has changed since the last time.
    pub fn news(&mut self) -> Option<Calibration> {
        let now = self.calibration();
        let is_same = |told: Calibration| {
            Calibration {
                heard: now.heard,
                ..told
            } == now
        };
        if self.last.is_none() || self.told.is_some_and(is_same) {
            return None;
        }
        self.told = Some(now);
        Some(now)
    }

    /// Whether a calibration has ended well since the last call.
    pub fn is_to_store(&mut self) -> bool {
        core::mem::take(&mut self.is_to_store)
    }

    /// Account of the line; `None` before the first packet.
    pub fn report(&self) -> Option<ChainReport> {
        let counters = self.decoder.counters();
        let nodes = self.cycles.nodes();
        (counters.packets > 0).then(|| ChainReport {
            packets: counters.packets,
            skipped: counters.skipped,
            missing: nodes.map(|node| node.missing),
            late: nodes.map(|node| u16::try_from(node.late).unwrap_or(u16::MAX)),
            age: nodes.map(|node| node.age),
        })
    }
}

impl Worn {
    /// Makes the set, and takes its first posture; returns whether the sensors are a set.
    #[inline(never)]
    fn make_suit(&mut self, fitted: &[Fitted<f32>], body: &Body<f32>) -> bool {
        self.suit = Suit::new(fitted, body, &Posture::h_pose()).ok();
        if let Some(suit) = &mut self.suit {
            suit.set_on_ground(false);
        }
        self.see();
        self.suit.is_some()
    }

    fn take(&mut self, cycle: &Cycle, duration: f32) {
        let Some(suit) = &mut self.suit else { return };
        let mut readings = [None::<Reading<f32>>; LIMBS];
        for (reading, segment) in readings.iter_mut().zip(&self.order) {
            *reading = cycle.readings[*segment];
        }
        suit.push(&readings, duration);
        self.age += duration;
        self.see();
    }

    /// Takes posture and errors out of the suit.
    #[inline(never)]
    fn see(&mut self) {
        let Some(suit) = &self.suit else { return };
        let found = suit.posture();
        self.posture = found.posture();
        let failed = suit.faults();
        let failed = failed.fold(self.missing, |mask, (s, _)| mask | 1 << s as u8);
        let is_first = self.age <= 0.0;
        if !is_first && self.age < ERRORS_EVERY && failed == self.errors.failed {
            return;
        }
        let deviations = found.orientations.map(|_, o| o.deviation());
        let errors = SegmentErrors::new(&deviations, failed);
        if is_first || errors.differs_from(&self.errors) {
            (self.errors, self.is_new) = (errors, true);
            self.age = f32::EPSILON;
        }
    }
}

#[cfg(test)]
mod tests;
