//! The unit's twin on the desktop: it receives the same bytes and must give the same answers, bit for bit.

use std::collections::BTreeMap;

use bodyflight_core::link::{
    BlockReader, Estimate, EstimateFlags, Header, MAX_FRAME_LENGTH, Message, PackedQuaternion,
    SegmentTable,
};
use bodyflight_firmware::computer::{Computer, Configuration, Outcome};
use bodyflight_firmware::{Board, Identity, Unit};
use serde::Serialize;

/// A unit without ports or time: samples are processed as they arrive.
pub struct Twin {
    unit: Unit<NoTime>,
    /// Its answers that have not been compared yet, by sample number.
    expected: BTreeMap<u32, Estimate>,
    /// Answers of the real unit that arrived before the twin's.
    early: BTreeMap<u32, Estimate>,
    /// Answers of the real unit already compared: the line may deliver them again.
    compared: BTreeMap<u32, Estimate>,
    agreement: Agreement,
}

/// How the unit's estimates compare with the desktop's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// Estimates of the twin on the desktop.
    pub expected: u64,
    /// Estimates of the unit, each counted once.
    pub received: u64,
    /// Estimates received again, as some lines repeat frames.
    pub repeated: u64,
    /// Estimates equal in every bit.
    pub equal: u64,
    /// Sample of the first difference.
    pub first_difference: Option<u32>,
}

/// Estimates waiting to be compared, on either side: a minute's worth. Older ones were lost on the line.
const WAITING: usize = 4096;

/// Keeps an estimate; the oldest is dropped if there is no room.
fn keep(waiting: &mut BTreeMap<u32, Estimate>, estimate: Estimate) {
    waiting.insert(estimate.sample_sequence, estimate);
    if waiting.len() > WAITING {
        waiting.pop_first();
    }
}

/// A board on which nothing takes time.
struct NoTime;

impl Board for NoTime {
    fn now(&self) -> u64 {
        0
    }
    fn cycles(&self) -> u32 {
        0
    }
    fn stack_free(&self) -> u32 {
        0
    }
    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }
    fn feed_watchdog(&self) {}
    fn note(&self, _: u32) {}
}

impl Default for Twin {
    fn default() -> Self {
        Self::new()
    }
}

impl Twin {
    /// A unit that has just been started.
    pub fn new() -> Self {
        Self {
            unit: Unit::new(NoTime, Identity::default()),
            expected: BTreeMap::new(),
            early: BTreeMap::new(),
            compared: BTreeMap::new(),
            agreement: Agreement::default(),
        }
    }

    /// Receives the bytes sent over the line.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.unit.receive(bytes);
        while self.unit.work() {}
        let mut frame = [0; MAX_FRAME_LENGTH];
        while let Some(length) = self.unit.transmit(&mut frame) {
            if let Ok((_, Message::Estimate(estimate))) = Message::decode(&frame[..length]) {
                self.expect(estimate);
            }
        }
    }

    fn expect(&mut self, estimate: Estimate) {
        self.agreement.expected += 1;
        match self.early.remove(&estimate.sample_sequence) {
            Some(found) => self.compare(&estimate, found),
            None => keep(&mut self.expected, estimate),
        }
    }

    /// Compares an answer of the unit.
    pub fn answer(&mut self, found: &Estimate) {
        let number = found.sample_sequence;
        let before = self.compared.get(&number).or(self.early.get(&number));
        if before.is_some_and(|before| bits(before) == bits(found)) {
            self.agreement.repeated += 1;
            return;
        }
        self.agreement.received += 1;
        match self.expected.remove(&number) {
            Some(expected) => self.compare(&expected, *found),
            None => keep(&mut self.early, *found),
        }
    }

    fn compare(&mut self, expected: &Estimate, found: Estimate) {
        self.agreement.compare(expected, &found);
        keep(&mut self.compared, found);
    }

    /// The comparison so far.
    pub fn agreement(&self) -> Agreement {
        self.agreement
    }
}

impl Agreement {
    fn compare(&mut self, expected: &Estimate, found: &Estimate) {
        if bits(expected) == bits(found) {
            self.equal += 1;
        } else {
            let number = expected.sample_sequence;
            self.first_difference = Some(self.first_difference.map_or(number, |n| n.min(number)));
        }
    }

    /// Whether both gave the same estimates, without exception.
    pub fn holds(&self) -> bool {
        self.equal == self.expected && self.equal == self.received
    }
}

/// Compares the estimates in the blocks of a log with the desktop's for the samples and readings in the same log. It must
/// hold each session from its first sample on.
pub fn in_log(blocks: &[Vec<u8>]) -> Agreement {
    let mut agreement = Agreement::default();
    let mut computer = Computer::new();
    let (mut asked, mut table) = (None, SegmentTable::default());
    let (mut sensors, mut expected) = (None, None);
    let read = blocks.iter().flat_map(|block| BlockReader::new(block));
    for (header, message) in read.flatten() {
        match message {
            Message::Configure(configure) => {
                (asked, table) = (Some(configure), SegmentTable::default());
            }
            Message::SegmentValues(row) => table.insert(row),
            Message::Start(_) => {
                computer = Computer::new();
                let configuration = asked.map(|asked| Configuration::new(&asked, &table));
                if let Some(Ok(configuration)) = configuration {
                    computer.configure(configuration);
                }
            }
            Message::Sensors(readings) => sensors = Some(readings),
            Message::SegmentErrors(errors) => computer.set_segment_errors(&errors),
            Message::Sample(sample) => {
                let Header { sequence, time, .. } = header;
                let readings = sensors.take();
                expected = match computer.sample_with(sequence, time, &sample, readings.as_ref()) {
                    Outcome::Used(estimate) => estimate,
                    Outcome::Rejected => None,
                };
                agreement.expected += u64::from(expected.is_some());
            }
            Message::Estimate(found) => {
                agreement.received += 1;
                if let Some(expected) = expected.take() {
                    agreement.compare(&expected, &found);
                }
            }
            _ => {}
        }
    }
    agreement
}

/// Everything that does not depend on the speed of a machine.
fn bits(estimate: &Estimate) -> ([u32; 20], PackedQuaternion, u16) {
    let Estimate {
        state,
        variance,
        measurement,
        nis,
        flags,
        inertial_from_body,
        velocity,
        ..
    } = estimate;
    let mut numbers = [0; 20];
    let values = state
        .iter()
        .chain(variance)
        .chain(measurement)
        .chain([nis])
        .chain(velocity);
    for (place, value) in numbers.iter_mut().zip(values) {
        *place = value.to_bits();
    }
    (
        numbers,
        *inertial_from_body,
        flags.difference(EstimateFlags::LATE).bits(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(sample_sequence: u32, nis: f32) -> Estimate {
        Estimate {
            sample_sequence,
            flags: EstimateFlags::VALID,
            state: [0.5; 6],
            variance: [0.1; 6],
            measurement: [0.0; 4],
            nis,
            cycles: 0,
            inertial_from_body: PackedQuaternion::default(),
            velocity: [0.0; 3],
        }
    }

    #[test]
    fn repeated_estimates_are_compared_once() {
        let mut twin = Twin::new();
        twin.expect(estimate(1, 4.0));
        for _ in 0..3 {
            twin.answer(&estimate(1, 4.0));
            twin.answer(&estimate(2, 5.0));
        }
        twin.expect(estimate(2, 5.0));
        let agreement = twin.agreement();
        assert_eq!([agreement.received, agreement.repeated], [2, 4]);
        assert!(agreement.holds(), "{agreement:?}");
    }

    #[test]
    fn another_answer_for_the_same_sample_is_a_difference() {
        let mut twin = Twin::new();
        twin.expect(estimate(1, 4.0));
        twin.answer(&estimate(1, 4.0));
        twin.answer(&estimate(1, 4.5));
        assert!(!twin.agreement().holds());
        let mut twin = Twin::new();
        twin.expect(estimate(7, 4.0));
        twin.answer(&estimate(7, 4.5));
        assert_eq!(twin.agreement().first_difference, Some(7));
    }
}
