//! Cycles of the line: the readings of all nodes at one instant, and what is missing.

use super::{Packet, TOO_OLD};
use crate::body::{SEGMENT_COUNT, Segment, SegmentArray};
use crate::suit::strapdown::Reading;

/// Age beyond which a measurement counts as lost (0.1 ms): until then the errors are small beside those of the poses.
const OLDEST: u8 = 200;
/// Cycles that may be skipped.
const LONGEST_GAP: u16 = 2000;

/// Number of cycles between two that were heard one after the other; 0 after a longer gap, since the pelvis's node has
/// restarted then, and counts anew.
pub const fn skipped(last: u16, next: u16) -> u16 {
    let skipped = next.wrapping_sub(last).saturating_sub(1);
    if skipped < LONGEST_GAP { skipped } else { 0 }
}

/// Account of one node; counters wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NodeCounters {
    /// Packets received.
    pub heard: u32,
    /// Cycles without a packet since it was heard first.
    pub missing: u32,
    /// Packets whose measurement was too old, or that came twice or after their cycle.
    pub late: u32,
    /// Age of the last measurement at the begin of its cycle (0.1 ms).
    pub age: u8,
}

/// The readings of one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cycle {
    /// Its number; wraps.
    pub number: u16,
    /// Its begin by the clock of the pelvis's node (us); wraps.
    pub time: u32,
    /// The readings, sensor axes; `None` where one is missing.
    pub readings: SegmentArray<Option<Reading<f32>>>,
}

/// Sorts packets into cycles.
///
/// A cycle is complete when all nodes of the last one have sent, or else when the next one begins.
#[derive(Debug, Clone)]
pub struct Cycles {
    open: Option<Cycle>,
    /// The last complete cycle's number.
    closed: Option<u16>,
    /// Nodes heard in the present cycle and in the last one, a bit for each address.
    heard: u16,
    expected: u16,
    nodes: [NodeCounters; SEGMENT_COUNT],
}

impl Default for Cycles {
    fn default() -> Self {
        Self::new()
    }
}

impl Cycles {
    /// Before the first packet.
    pub const fn new() -> Self {
        Self {
            open: None,
            closed: None,
            heard: 0,
            expected: 0,
            nodes: [NodeCounters {
                heard: 0,
                missing: 0,
                late: 0,
                age: 0,
            }; SEGMENT_COUNT],
        }
    }

    /// Accounts by address.
    pub const fn nodes(&self) -> &[NodeCounters; SEGMENT_COUNT] {
        &self.nodes
    }

    /// Takes a packet. Returns a cycle that it completed: its own, or the one before.
    pub fn push(&mut self, packet: &Packet) -> Option<Cycle> {
        let bit = 1_u16 << (packet.segment as u8);
        let index = packet.segment as usize;
        let is_old = packet.age > OLDEST || packet.age == TOO_OLD;
        if let Some(node) = self.nodes.get_mut(index) {
            node.heard = node.heard.wrapping_add(1);
            node.age = packet.age;
            node.late = node.late.wrapping_add(u32::from(is_old));
        }
        if self.open.is_none() && self.closed == Some(packet.cycle) {
            // A node that is new, or that was missing in the last cycle: expected from the next one on.
            self.count_late(index);
            self.expected |= bit;
            return None;
        }
        let before = match &self.open {
            Some(open) if open.number != packet.cycle => self.close(),
            _ => None,
        };
        let open = self.open.get_or_insert_with(|| Cycle {
            number: packet.cycle,
            time: packet.time,
            readings: SegmentArray::from_fn(|_| None),
        });
        if self.heard & bit != 0 {
            self.count_late(index);
            return before;
        }
        self.heard |= bit;
        if !is_old {
            open.readings[packet.segment] = Some(packet.reading());
        }
        let is_whole = self.expected != 0 && self.heard & self.expected == self.expected;
        if before.is_none() && is_whole {
            return self.close();
        }
        before
    }

    fn count_late(&mut self, index: usize) {
        if let Some(node) = self.nodes.get_mut(index) {
            node.late = node.late.wrapping_add(1);
        }
    }

    /// Completes the present cycle.
    fn close(&mut self) -> Option<Cycle> {
        let cycle = self.open.take()?;
        let skipped = self.closed.map_or(0, |last| skipped(last, cycle.number));
        for segment in Segment::ALL {
            let is_heard = self.heard & (1 << (segment as u8)) != 0;
            if let Some(node) = self.nodes.get_mut(segment as usize)
                && node.heard > 0
            {
                let missing = u32::from(skipped) + u32::from(!is_heard);
                // A node that is heard for the first time was not missing before.
                let is_first = is_heard && node.heard == 1;
                node.missing = node
                    .missing
                    .wrapping_add(if is_first { 0 } else { missing });
            }
        }
        self.closed = Some(cycle.number);
        self.expected = core::mem::take(&mut self.heard);
        Some(cycle)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use proptest::prelude::*;
    use std::vec::Vec;

    use super::*;

    fn packet(segment: Segment, cycle: u16) -> Packet {
        Packet {
            segment,
            cycle,
            time: u32::from(cycle) * 10_000,
            age: 3,
            rates: [segment as i16, 0, 0],
            forces: [0; 3],
        }
    }

    const NODES: [Segment; 3] = [Segment::Pelvis, Segment::Thorax, Segment::LeftShank];

    #[test]
    fn a_cycle_is_complete_with_its_last_node_and_without_one_with_the_next() {
        let mut cycles = Cycles::new();
        let mut send = |segment, cycle| cycles.push(&packet(segment, cycle));
        for segment in NODES {
            assert_eq!(send(segment, 65_535), None, "who belongs to it is unknown");
        }
        let first = send(Segment::Pelvis, 0).unwrap();
        assert_eq!(first.number, 65_535);
        assert_eq!(
            first.readings.iter().filter(|(_, r)| r.is_some()).count(),
            3
        );
        assert_eq!(send(Segment::Thorax, 0), None);
        assert_eq!(send(Segment::LeftShank, 0).unwrap().number, 0);
        // The thorax is missing, then the pelvis.
        assert_eq!(send(Segment::Pelvis, 1), None);
        assert_eq!(send(Segment::LeftShank, 1), None);
        let without = send(Segment::Thorax, 2).unwrap();
        assert_eq!((without.number, without.time), (1, 10_000));
        assert_eq!(without.readings[Segment::Thorax], None);
        assert_eq!(send(Segment::LeftShank, 2), None);
        assert_eq!(send(Segment::Pelvis, 5).unwrap().number, 2);
        let missing = NODES.map(|segment| cycles.nodes()[segment as usize].missing);
        assert_eq!(missing, [1, 1, 0]);
    }

    #[test]
    fn old_measurements_and_repeated_packets_are_no_readings() {
        let mut cycles = Cycles::new();
        let old = Packet {
            age: TOO_OLD,
            ..packet(Segment::Thorax, 0)
        };
        cycles.push(&packet(Segment::Pelvis, 0));
        cycles.push(&old);
        cycles.push(&packet(Segment::Thorax, 0));
        let found = cycles.push(&packet(Segment::Pelvis, 1)).unwrap();
        assert_eq!(found.readings[Segment::Thorax], None);
        let node = cycles.nodes()[Segment::Thorax as usize];
        assert_eq!((node.heard, node.late, node.missing), (2, 2, 0));
    }

    proptest! {
        /// Nothing is lost uncounted: what a node sent is a reading, late or missing.
        #[test]
        fn every_packet_of_every_node_is_accounted_for(
            lost in prop::collection::vec(any::<[bool; 3]>(), 3..80),
        ) {
            let mut cycles = Cycles::new();
            let mut found = [0_u32; 3];
            let take = |cycle: Option<Cycle>, found: &mut [u32; 3]| {
                for (count, segment) in found.iter_mut().zip(NODES) {
                    *count += u32::from(cycle.is_some_and(|c| c.readings[segment].is_some()));
                }
            };
            let mut number = 65_500_u16;
            for lost in [[false; 3]].iter().chain(&lost) {
                for (segment, is_lost) in NODES.into_iter().zip(lost) {
                    if !is_lost {
                        let cycle = cycles.push(&packet(segment, number));
                        take(cycle, &mut found);
                    }
                }
                number = number.wrapping_add(1);
            }
            for _ in 0..2 {
                for segment in NODES {
                    let cycle = cycles.push(&packet(segment, number));
                    take(cycle, &mut found);
                }
                number = number.wrapping_add(1);
            }
            let sent: Vec<u32> = NODES.map(|s| cycles.nodes()[s as usize].heard).into();
            let cycles_sent = u32::try_from(lost.len()).unwrap() + 3;
            for ((segment, sent), found) in NODES.into_iter().zip(sent).zip(found) {
                let node = cycles.nodes()[segment as usize];
                prop_assert_eq!(sent, found + node.late, "{:?}", segment);
                prop_assert!(sent + node.missing >= cycles_sent, "{:?} {:?}", segment, node);
            }
        }
    }
}
