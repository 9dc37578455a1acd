//! Assembles datagrams into samples, in order: joins the fragments and kinds of a sample, and waits for late ones.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::{Quaternion, Vector3};

use super::counters::Counters;
use super::datagram::{Header, Kind};
use bodyflight_mvnx::xsens::MVN_SEGMENT_COUNT;

/// Number of later samples after which an incomplete sample is no longer waited for.
pub const REORDER_WINDOW: usize = 4;
/// A sample this far behind the last one starts another recording.
pub const RESTART_DISTANCE: i32 = 64;
/// Samples remembered after they were handed out, to recognise repeated and late datagrams and the usual step.
const MEMORY: usize = 32;

/// The fragments of one kind received so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Fragments {
    received: u128,
    last: Option<u8>,
}

impl Fragments {
    fn is_whole(&self) -> bool {
        self.last
            .is_some_and(|last| self.received.count_ones() == u32::from(last) + 1)
    }

    /// Adds a fragment; returns whether it is new.
    fn add(&mut self, header: &Header) -> bool {
        let bit = 1u128 << (header.fragment & 0x7F);
        let new = self.received & bit == 0;
        self.received |= bit;
        if header.last {
            self.last = Some(header.fragment & 0x7F);
        }
        new
    }
}

/// The data received for one instant, in the axes of MVN.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sample {
    pub(super) counter: u32,
    pub(super) time_ms: u32,
    /// Incremented when the sender restarts.
    pub(super) epoch: u32,
    pub(super) orientations: [Option<Quaternion<f64>>; MVN_SEGMENT_COUNT],
    /// Position of the pelvis (m).
    pub(super) position: Option<Vector3<f64>>,
    /// Velocity of the pelvis (m/s).
    pub(super) velocity: Option<Vector3<f64>>,
    /// Angular velocity of the pelvis, in the sender's unit.
    pub(super) angular_velocity: Option<Vector3<f64>>,
    /// Centre of mass (m).
    pub(super) centre_of_mass: Option<Vector3<f64>>,
    fragments: BTreeMap<Kind, Fragments>,
}

/// Samples being assembled.
#[derive(Debug, Default)]
pub(super) struct Assembly {
    /// Samples in order of their counters.
    pending: VecDeque<Sample>,
    /// Samples from before a restart, ready to be handed out.
    done: VecDeque<Sample>,
    /// Samples handed out: counter, distance from the previous one, fragments.
    given: VecDeque<(u32, Option<u32>, BTreeMap<Kind, Fragments>)>,
    epoch: u32,
}

/// Steps from `from` to `to`; the counter may wrap in between.
fn distance(from: u32, to: u32) -> i32 {
    to.wrapping_sub(from).cast_signed()
}

impl Assembly {
    /// The sample that a datagram belongs to; `None` if the datagram is repeated or late.
    pub(super) fn sample(
        &mut self,
        header: &Header,
        counters: &mut Counters,
    ) -> Option<&mut Sample> {
        let reference = match self.given.back() {
            Some((last, ..)) => Some(*last),
            None => self.pending.back().map(|sample| sample.counter),
        };
        if reference.is_some_and(|last| distance(last, header.sample) < -RESTART_DISTANCE) {
            counters.restarts += 1;
            self.done.append(&mut self.pending);
            self.given.clear();
            self.epoch += 1;
        } else if let Some((last, ..)) = self.given.back()
            && distance(*last, header.sample) <= 0
        {
            let known = self
                .given
                .iter_mut()
                .find(|(counter, ..)| *counter == header.sample);
            let new =
                known.is_none_or(|(.., parts)| parts.entry(header.kind).or_default().add(header));
            if new {
                counters.late_datagrams += 1;
            } else {
                counters.repeated_datagrams += 1;
            }
            return None;
        }
        let place = self
            .pending
            .partition_point(|sample| distance(sample.counter, header.sample) > 0);
        if self
            .pending
            .get(place)
            .is_none_or(|sample| sample.counter != header.sample)
        {
            self.pending.insert(
                place,
                Sample::new(header.sample, header.time_ms, self.epoch),
            );
        }
        let sample = self.pending.get_mut(place)?;
        if sample.fragments.entry(header.kind).or_default().add(header) {
            Some(sample)
        } else {
            counters.repeated_datagrams += 1;
            None
        }
    }

    /// The next sample in order, once it is complete or no longer waited for; with `flush`, at once.
    pub(super) fn next(&mut self, flush: bool, counters: &mut Counters) -> Option<Sample> {
        if let Some(sample) = self.done.pop_front() {
            counters.samples += 1;
            return Some(sample);
        }
        let first = self.pending.front()?;
        if !(flush || self.pending.len() > REORDER_WINDOW || self.is_due(first)) {
            return None;
        }
        let sample = self.pending.pop_front()?;
        let step = self
            .given
            .back()
            .map(|(last, ..)| sample.counter.wrapping_sub(*last));
        if let Some(step) = step {
            let usual = self.usual_step().unwrap_or(step).max(1);
            counters.missing_samples += u64::from((step / usual).saturating_sub(1));
        }
        counters.samples += 1;
        self.given
            .push_back((sample.counter, step, sample.fragments.clone()));
        if self.given.len() > MEMORY {
            self.given.pop_front();
        }
        Some(sample)
    }

    /// Distance between neighbours: some senders send only every fourth instant.
    fn usual_step(&self) -> Option<u32> {
        self.given.iter().filter_map(|(_, step, _)| *step).min()
    }

    /// Whether the sample follows the last one and has everything that the previous ones had.
    fn is_due(&self, sample: &Sample) -> bool {
        let follows = self.given.back().is_some_and(|(last, ..)| {
            Some(sample.counter.wrapping_sub(*last)) == self.usual_step()
        });
        let usual = self.given.iter().flat_map(|(.., parts)| parts.keys());
        follows
            && usual
                .into_iter()
                .all(|kind| sample.fragments.get(kind).is_some_and(Fragments::is_whole))
    }
}

impl Sample {
    fn new(counter: u32, time_ms: u32, epoch: u32) -> Self {
        Self {
            counter,
            time_ms,
            epoch,
            orientations: [None; MVN_SEGMENT_COUNT],
            position: None,
            velocity: None,
            angular_velocity: None,
            centre_of_mass: None,
            fragments: BTreeMap::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn header(kind: Kind, sample: u32, fragment: u8, last: bool) -> Header {
        Header {
            kind,
            sample,
            fragment,
            last,
            items: 1,
            time_ms: 0,
            character: 0,
            body_segments: 23,
            props: 0,
            finger_segments: 0,
        }
    }

    /// Counters of the samples handed out while these datagrams arrive, and at the end.
    fn given(headers: &[Header]) -> (Vec<u32>, Counters) {
        let (mut assembly, mut counters) = (Assembly::default(), Counters::default());
        let mut samples = Vec::new();
        for header in headers {
            assembly.sample(header, &mut counters);
            while let Some(sample) = assembly.next(false, &mut counters) {
                samples.push(sample.counter);
            }
            assert!(assembly.pending.len() <= REORDER_WINDOW && assembly.done.is_empty());
        }
        while let Some(sample) = assembly.next(true, &mut counters) {
            samples.push(sample.counter);
        }
        (samples, counters)
    }

    #[test]
    fn a_complete_sample_is_returned_at_once_when_its_kinds_are_known() {
        let (mut assembly, mut counters) = (Assembly::default(), Counters::default());
        let mut delays = Vec::new();
        for sample in 0..20 {
            for kind in [Kind::Pose, Kind::LinearKinematics] {
                for (fragment, last) in [(1, true), (0, false)] {
                    assembly.sample(&header(kind, sample, fragment, last), &mut counters);
                }
            }
            while let Some(given) = assembly.next(false, &mut counters) {
                delays.push(sample - given.counter);
            }
        }
        assert_eq!(delays.len(), 20);
        assert!(delays[10..].iter().all(|delay| *delay == 0), "{delays:?}");
        // Without its second fragment, it has to wait for later samples.
        assembly.sample(&header(Kind::Pose, 20, 0, false), &mut counters);
        assert!(assembly.next(false, &mut counters).is_none());
    }

    #[test]
    fn repeated_late_and_missing_samples_are_told_apart() {
        let pose = |sample| header(Kind::Pose, sample, 0, true);
        let mut order: Vec<Header> = (0..40).map(pose).collect();
        order.remove(30);
        order.insert(20, pose(5));
        order.insert(25, pose(24));
        order.push(pose(30));
        let (samples, counters) = given(&order);
        let expected: Vec<u32> = (0..40).filter(|sample| *sample != 30).collect();
        assert_eq!(samples, expected);
        assert_eq!(counters.missing_samples, 1);
        assert_eq!(counters.repeated_datagrams, 2);
        assert_eq!(counters.late_datagrams, 1);
        assert_eq!(counters.restarts, 0);
    }

    #[test]
    fn a_sender_that_numbers_every_fourth_instant_loses_nothing() {
        let headers: Vec<Header> = (0..50)
            .map(|sample| header(Kind::Pose, sample * 4, 0, true))
            .collect();
        let (samples, counters) = given(&headers);
        assert_eq!(samples.len(), 50);
        assert_eq!(counters.missing_samples, 0);
    }

    #[test]
    fn a_restart_and_the_wrap_of_the_counter_are_not_mixed_up() {
        let headers: Vec<Header> = (0..20)
            .map(|i| header(Kind::Pose, (u32::MAX - 9).wrapping_add(i), 0, true))
            .collect();
        let (samples, counters) = given(&headers);
        assert_eq!((samples.len(), counters.restarts), (20, 0));
        let headers: Vec<Header> = (1000..1010)
            .chain(0..10)
            .map(|sample| header(Kind::Pose, sample, 0, true))
            .collect();
        let (samples, counters) = given(&headers);
        assert_eq!(samples, (1000..1010).chain(0..10).collect::<Vec<_>>());
        assert_eq!((counters.restarts, counters.missing_samples), (1, 0));
    }

    proptest! {
        #[test]
        fn swapped_neighbours_come_out_in_order(swaps in prop::collection::vec(0usize..118, 0..60)) {
            let mut headers: Vec<Header> = (0..60)
                .flat_map(|sample| {
                    [Kind::Pose, Kind::AngularKinematics].map(|kind| header(kind, sample, 0, true))
                })
                .collect();
            // The first samples stay in order, because there is nothing yet to judge them by.
            for swap in swaps {
                if swap > 16 && swap % 2 == 0 {
                    headers.swap(swap, swap + 1);
                }
            }
            let (samples, counters) = given(&headers);
            prop_assert_eq!(samples, (0..60).collect::<Vec<_>>());
            prop_assert_eq!(counters.missing_samples + counters.late_datagrams, 0);
        }

        #[test]
        fn any_order_gives_each_sample_once_and_stays_bounded(
            datagrams in prop::collection::vec((any::<u32>(), 0u8..128, any::<bool>(), any::<bool>()), 0..300),
        ) {
            let headers: Vec<Header> = datagrams
                .into_iter()
                .map(|(sample, fragment, last, near)| {
                    let sample = if near { sample % 200 } else { sample };
                    header(Kind::Pose, sample, fragment, last)
                })
                .collect();
            let (samples, counters) = given(&headers);
            prop_assert_eq!(samples.len() as u64, counters.samples);
            prop_assert!(samples.len() <= headers.len());
        }
    }
}
