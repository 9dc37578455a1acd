//! Turns datagrams into flight frames, without a socket or a clock.

use std::collections::VecDeque;
use std::net::IpAddr;

use bodyflight_core::frame::Vector;
use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{Quaternion, UnitQuaternion};

use super::assembly::{Assembly, Sample};
use super::clock::Clock;
use super::counters::Counters;
use super::datagram::{Datagram, Header, Kind};
use super::message::{JointAngles, Message, Scale};
use super::rates::{AngularUnit, Rates};
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::xsens::{self, MvnSegment};

/// Largest difference from 1 of the norm of a usable orientation; samples beyond it count as bad.
const NORM_TOLERANCE: f64 = 0.01;

/// Most segments and points kept of a body; MVN has 67 segments with fingers and props, and about a hundred points.
const MOST_SEGMENTS: usize = 128;
const MOST_POINTS: usize = 1024;

/// How to receive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// The person to follow, from 0; if absent, the first one received.
    pub character: Option<u8>,
    /// Rate of the sample counter (Hz); if absent, time follows the time codes.
    pub rate: Option<f64>,
    /// Unit of the angular velocities; if absent, it is determined by comparison with the orientations.
    pub angular_unit: Option<AngularUnit>,
    /// The sender's machine; if absent, the first one that sends, see [`super::Source`].
    pub sender: Option<IpAddr>,
}

/// What the sender reports besides motion, the latest of each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Information {
    /// Tags and values, including `name`.
    pub metadata: Vec<(String, String)>,
    /// The body in the null pose.
    pub scale: Scale,
    /// Joint angles.
    pub joint_angles: Vec<JointAngles>,
    /// Time of day.
    pub time_code: Option<String>,
}

impl Information {
    /// Name of the person.
    pub fn name(&self) -> Option<&str> {
        self.metadata
            .iter()
            .find(|(tag, _)| tag == "name")
            .map(|(_, name)| name.as_str())
    }
}

/// Turns datagrams into frames. Memory is bounded whatever arrives.
#[derive(Debug)]
pub struct Receiver {
    options: Options,
    character: Option<u8>,
    assembly: Assembly,
    clock: Clock,
    rates: Rates,
    epoch: u32,
    frames: VecDeque<FlightFrame>,
    counters: Counters,
    information: Information,
}

impl Receiver {
    /// Creates a receiver that has received nothing yet.
    pub fn new(options: Options) -> Self {
        Self {
            options,
            character: options.character,
            assembly: Assembly::default(),
            clock: clock(&options),
            rates: Rates::new(options.angular_unit),
            epoch: 0,
            frames: VecDeque::new(),
            counters: Counters::default(),
            information: Information::default(),
        }
    }

    /// Takes one datagram; the frames that it completes are available from [`Receiver::next_frame`].
    pub fn push(&mut self, bytes: &[u8]) {
        self.counters.datagrams += 1;
        let Ok(Datagram { header, payload }) = Datagram::parse(bytes) else {
            self.counters.bad_datagrams += 1;
            return;
        };
        let other_person = self
            .character
            .is_some_and(|number| number != header.character);
        if other_person || matches!(header.kind, Kind::Other(_)) {
            self.counters.ignored_datagrams += 1;
            return;
        }
        let Some(message) = Message::decode(header.kind, header.items, payload) else {
            self.counters.bad_datagrams += 1;
            return;
        };
        self.character = Some(header.character);
        self.take(&header, message);
        self.convert(false);
    }

    /// Counts a datagram from a machine other than the sender's.
    pub(super) fn count_foreign(&mut self) {
        self.counters.foreign_datagrams += 1;
    }

    /// The next frame in order.
    pub fn next_frame(&mut self) -> Option<FlightFrame> {
        self.frames.pop_front()
    }

    /// Stops waiting for missing data, as after a silence.
    pub fn flush(&mut self) {
        self.convert(true);
    }

    /// What has been received so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// What the sender reports besides motion.
    pub fn information(&self) -> &Information {
        &self.information
    }

    /// Rate of the sample counter according to the time codes (Hz).
    pub fn rate(&self) -> Option<f64> {
        self.clock.rate()
    }

    /// Unit of the angular velocities, given or determined; `None` while it is unknown.
    pub fn angular_unit(&self) -> Option<AngularUnit> {
        self.rates.unit()
    }

    /// Whether samples arrive but their time codes do not advance, so that frames have no time.
    pub fn time_stands_still(&self) -> bool {
        self.clock.stands_still()
    }

    fn take(&mut self, header: &Header, message: Message) {
        match message {
            // These apply to more than one sample, so their counter may be anything.
            Message::Metadata(metadata) => self.information.metadata = metadata,
            Message::Scale(scale) => {
                let known = &mut self.information.scale;
                if header.fragment == 0 {
                    *known = Scale::default();
                }
                // Fragments may arrive repeatedly: no more are kept than a body has.
                let free = MOST_SEGMENTS.saturating_sub(known.segments.len());
                known.segments.extend(scale.segments.into_iter().take(free));
                let free = MOST_POINTS.saturating_sub(known.points.len());
                known.points.extend(scale.points.into_iter().take(free));
            }
            Message::JointAngles(angles) => self.information.joint_angles = angles,
            Message::TimeCode(time) => self.information.time_code = Some(time),
            Message::Pose(poses) => {
                let Some(sample) = self.assembly.sample(header, &mut self.counters) else {
                    return;
                };
                // Quaternions take precedence over angles, which repeat them.
                let angles = header.kind == Kind::PoseEuler;
                for pose in poses {
                    let place = (pose.id as usize).wrapping_sub(1);
                    let Some(orientation) = sample.orientations.get_mut(place) else {
                        continue;
                    };
                    if angles && orientation.is_some() {
                        continue;
                    }
                    *orientation = Some(pose.orientation);
                    if place == MvnSegment::Pelvis as usize {
                        sample.position = Some(pose.position);
                    }
                }
            }
            Message::LinearKinematics(segments) => {
                let pelvis = segments.iter().find(|segment| segment.id == 1);
                if let Some(sample) = self.assembly.sample(header, &mut self.counters)
                    && let Some(pelvis) = pelvis
                {
                    sample.velocity = Some(pelvis.velocity);
                }
            }
            Message::AngularKinematics(segments) => {
                let pelvis = segments.iter().find(|segment| segment.id == 1);
                if let Some(sample) = self.assembly.sample(header, &mut self.counters)
                    && let Some(pelvis) = pelvis
                {
                    sample.angular_velocity = Some(pelvis.angular_velocity);
                }
            }
            Message::CentreOfMass(position) => {
                if let Some(sample) = self.assembly.sample(header, &mut self.counters) {
                    sample.centre_of_mass = Some(position);
                }
            }
        }
    }

    fn convert(&mut self, flush: bool) {
        while let Some(sample) = self.assembly.next(flush, &mut self.counters) {
            if sample.epoch != self.epoch {
                self.epoch = sample.epoch;
                self.clock = clock(&self.options);
                self.rates = Rates::new(self.rates.unit());
            }
            if let Some(frame) = self.frame(&sample) {
                self.counters.frames += 1;
                self.frames.push_back(frame);
            }
        }
    }

    fn frame(&mut self, sample: &Sample) -> Option<FlightFrame> {
        let leading = |segment: Segment| sample.orientations[MvnSegment::leading(segment) as usize];
        let whole = Segment::ALL
            .into_iter()
            .all(|segment| leading(segment).is_some());
        let Some(position) = sample.position.filter(|_| whole) else {
            self.counters.incomplete_samples += 1;
            return None;
        };
        let orientations = SegmentArray::from_fn(|segment| leading(segment).unwrap_or_default());
        let usable = Segment::ALL
            .into_iter()
            .all(|segment| (orientations[segment].norm() - 1.0).abs() < NORM_TOLERANCE);
        let vectors = [
            Some(position),
            sample.velocity,
            sample.angular_velocity,
            sample.centre_of_mass,
        ];
        let finite = vectors
            .iter()
            .flatten()
            .all(|vector| vector.iter().all(|component| component.is_finite()));
        if !usable || !finite {
            self.counters.bad_samples += 1;
            return None;
        }
        let unit = |_, orientation: &Quaternion<f64>| UnitQuaternion::new_normalize(*orientation);
        let (inertial_from_body, posture) = xsens::attitude_and_posture(&orientations.map(unit));
        let position = Vector::from_components(position);
        let time = self
            .clock
            .time(sample.counter, sample.time_ms, self.options.rate.is_some());
        let rates = self.rates.push(
            time,
            inertial_from_body,
            position,
            sample.velocity,
            sample.angular_velocity,
        );
        let [velocity, angular_velocity] = rates.differenced.map(u64::from);
        self.counters.differenced_velocities += velocity;
        self.counters.differenced_angular_velocities += angular_velocity;
        Some(FlightFrame {
            index: u64::from(sample.counter),
            time,
            posture,
            pelvis: PelvisMotion {
                inertial_from_body,
                position,
                velocity: rates.velocity,
                angular_velocity: rates.angular_velocity,
            },
            centre_of_mass: sample.centre_of_mass.map(Vector::from_components),
            bridged: false,
        })
    }
}

fn clock(options: &Options) -> Clock {
    match options.rate {
        Some(rate) => Clock::with_rate(rate),
        None => Clock::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LinearKinematics, SegmentPose};
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn bytes(message: &Message, sample: u32, character: u8) -> Vec<u8> {
        let mut payload = Vec::new();
        let (kind, items) = message.encode(&mut payload);
        let header = Header {
            kind,
            sample,
            fragment: 0,
            last: true,
            items,
            time_ms: sample * 4,
            character,
            body_segments: 23,
            props: 0,
            finger_segments: 0,
        };
        let mut bytes = Vec::new();
        let payload = &payload;
        Datagram { header, payload }.encode(&mut bytes).unwrap();
        bytes
    }

    /// The T-pose at some height.
    fn pose(height: f64, scale: f64) -> Message {
        let segment = |id| SegmentPose {
            id,
            position: Vector3::new(0.0, 0.0, height),
            orientation: Quaternion::identity() * scale,
        };
        Message::Pose((1..=23).map(segment).collect())
    }

    fn frames(receiver: &mut Receiver) -> Vec<FlightFrame> {
        receiver.flush();
        core::iter::from_fn(|| receiver.next_frame()).collect()
    }

    #[test]
    fn the_t_pose_comes_out_as_the_t_pose() {
        let mut receiver = Receiver::new(Options::default());
        for sample in 0..10 {
            receiver.push(&bytes(&pose(f64::from(sample), 1.0), sample, 0));
        }
        let frames = frames(&mut receiver);
        assert_eq!(frames.len(), 10);
        let last = frames[9];
        assert_eq!((last.index, last.bridged), (9, false));
        assert_eq!(last.posture, xsens::t_pose());
        assert!((last.pelvis.position.up() - 9.0).abs() < 1e-12);
        // It rises 1 m in 4 ms; the velocity is not sent, so it comes from differences.
        let velocity = last.pelvis.velocity.unwrap().components;
        assert!((velocity.z - 250.0).abs() < 1.0, "{velocity}");
        assert_eq!(receiver.counters().differenced_velocities, 9);
        assert!((receiver.rate().unwrap() - 250.0).abs() < 1e-6);
    }

    #[test]
    fn impossible_values_are_counted_and_not_returned() {
        let mut receiver = Receiver::new(Options::default());
        receiver.push(&bytes(&pose(1.0, 1.0), 0, 3));
        receiver.push(&bytes(&pose(1.0, 0.5), 1, 3));
        receiver.push(&bytes(&pose(f64::NAN, 1.0), 2, 3));
        let Message::Pose(mut half) = pose(1.0, 1.0) else {
            panic!()
        };
        half.truncate(12);
        receiver.push(&bytes(&Message::Pose(half), 3, 3));
        receiver.push(&bytes(&pose(1.0, 1.0), 4, 0));
        receiver.push(b"hello");
        let mut cut = bytes(&pose(1.0, 1.0), 5, 3);
        cut.truncate(700);
        receiver.push(&cut);
        assert_eq!(frames(&mut receiver).len(), 1);
        let counters = receiver.counters();
        assert_eq!(counters.bad_samples, 2);
        assert_eq!(counters.incomplete_samples, 1);
        assert_eq!(counters.ignored_datagrams, 1);
        assert_eq!(counters.bad_datagrams, 2);
        assert_eq!(counters.datagrams, 7);
    }

    #[test]
    fn sent_velocities_come_before_differences() {
        let mut receiver = Receiver::new(Options::default());
        for sample in 0..3 {
            let linear = LinearKinematics {
                id: 1,
                position: Vector3::zeros(),
                velocity: Vector3::new(0.0, 0.0, -50.0),
                acceleration: Vector3::zeros(),
            };
            receiver.push(&bytes(&Message::LinearKinematics(vec![linear]), sample, 0));
            receiver.push(&bytes(&pose(1.0, 1.0), sample, 0));
        }
        for frame in frames(&mut receiver) {
            let velocity = frame.pelvis.velocity.unwrap().components;
            assert!((velocity + Vector3::z() * 50.0).norm() < 1e-12);
        }
        assert_eq!(receiver.counters().differenced_velocities, 0);
    }

    #[test]
    fn the_body_grows_no_larger_than_a_body() {
        let mut receiver = Receiver::new(Options::default());
        let names = |count| (0..count).map(|_| ("x".repeat(20_000), Vector3::zeros()));
        let points = (0..200).map(|_| crate::ScalePoint {
            segment: 1,
            point: 1,
            label: "y".repeat(100),
            flags: 0,
            position: Vector3::zeros(),
        });
        let points: Vec<_> = points.collect();
        for fragment in 0..2000_u32 {
            let message = Message::Scale(Scale {
                segments: names(2).collect(),
                points: points.clone(),
            });
            let mut payload = Vec::new();
            let (kind, items) = message.encode(&mut payload);
            let header = Header {
                kind,
                sample: 0,
                fragment: (fragment % 127) as u8 + 1,
                last: false,
                items,
                time_ms: 0,
                character: 0,
                body_segments: 23,
                props: 0,
                finger_segments: 0,
            };
            let mut bytes = Vec::new();
            Datagram {
                header,
                payload: &payload,
            }
            .encode(&mut bytes)
            .unwrap();
            receiver.push(&bytes);
        }
        let scale = &receiver.information().scale;
        assert_eq!(receiver.counters().bad_datagrams, 0);
        assert_eq!(scale.segments.len(), MOST_SEGMENTS);
        assert_eq!(scale.points.len(), MOST_POINTS);
        let letters: usize = scale.segments.iter().map(|(name, _)| name.len()).sum();
        assert!(letters < 1 << 20, "{letters} bytes of names");
    }

    proptest! {
        #[test]
        fn no_datagram_stops_it(
            datagrams in prop::collection::vec(
                (0usize..10, any::<u32>(), any::<u8>(), any::<u8>(), any::<u32>(),
                 prop::collection::vec(any::<u8>(), 0..900)),
                0..40,
            ),
        ) {
            let mut receiver = Receiver::new(Options::default());
            let count = datagrams.len() as u64;
            for (kind, sample, counter, items, time_ms, payload) in datagrams {
                let number = [1, 2, 12, 13, 20, 21, 22, 24, 25, 77][kind];
                let header = Header {
                    kind: Kind::from_number(number),
                    sample,
                    fragment: counter & 0x7F,
                    last: counter & 0x80 != 0,
                    items,
                    time_ms,
                    character: 0,
                    body_segments: 23,
                    props: 0,
                    finger_segments: 0,
                };
                let mut bytes = Vec::new();
                Datagram { header, payload: &payload }.encode(&mut bytes).unwrap();
                receiver.push(&bytes);
                receiver.push(&payload);
            }
            let frames = frames(&mut receiver);
            prop_assert_eq!(receiver.counters().datagrams, 2 * count);
            prop_assert!(frames.iter().all(|frame| frame.posture.is_valid() && frame.time.is_finite()));
        }
    }
}
