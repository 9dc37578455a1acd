//! Datagrams in, flight frames out; no socket, no clock of its own.

use std::collections::VecDeque;

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{Quaternion, UnitQuaternion};
use serde::Serialize;

use super::assembly::{Assembly, Sample};
use super::clock::Clock;
use super::datagram::{Datagram, Header, Kind};
use super::message::{JointAngles, Message, Scale};
use super::rates::{AngularUnit, Rates};
use crate::recording::{FlightFrame, PelvisMotion};
use crate::xsens::{self, MvnSegment};

/// Largest error of the norm of a usable orientation.
const NORM_TOLERANCE: f64 = 0.01;

/// How to receive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Options {
    /// The person to follow, from 0; otherwise whoever comes first.
    pub character: Option<u8>,
    /// Rate of the sample counter (Hz); otherwise time follows the time codes.
    pub rate: Option<f64>,
    /// Unit of the angular velocities; otherwise told by comparison with the orientations.
    pub angular_unit: Option<AngularUnit>,
}

/// What has come in so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Counters {
    /// Datagrams of any kind.
    pub datagrams: u64,
    /// Datagrams that are none of MVN or hold less than they say.
    pub bad_datagrams: u64,
    /// Datagrams of other persons and of kinds that a flight does not need.
    pub ignored_datagrams: u64,
    /// Datagrams that had come before.
    pub repeated_datagrams: u64,
    /// Datagrams whose sample was given already.
    pub late_datagrams: u64,
    /// Samples given on, good or not.
    pub samples: u64,
    /// Samples of which nothing came.
    pub missing_samples: u64,
    /// Samples without the pose of the whole body.
    pub incomplete_samples: u64,
    /// Samples with numbers that cannot be.
    pub bad_samples: u64,
    /// Frames handed out.
    pub frames: u64,
    /// Frames whose velocity is from differences.
    pub differenced_velocities: u64,
    /// Frames whose angular velocity is from differences.
    pub differenced_angular_velocities: u64,
    /// Times the sender started anew.
    pub restarts: u64,
}

/// What the sender says besides motion, the latest of each.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Information {
    /// Tags and values, `name` among them.
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

/// Turns datagrams into frames. Memory is bounded whatever comes in.
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
    /// Nothing received yet.
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

    /// Takes one datagram; [`Receiver::next_frame`] has the frames it completes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.counters.datagrams += 1;
        let Ok(Datagram { header, payload }) = Datagram::parse(bytes) else {
            self.counters.bad_datagrams += 1;
            return;
        };
        let other_person = self.character.is_some_and(|number| number != header.character);
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

    /// The next frame in order.
    pub fn next_frame(&mut self) -> Option<FlightFrame> {
        self.frames.pop_front()
    }

    /// Gives up waiting for what is missing, as after silence.
    pub fn flush(&mut self) {
        self.convert(true);
    }

    /// What has come in so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// What the sender says besides motion.
    pub fn information(&self) -> &Information {
        &self.information
    }

    /// Rate of the sample counter by the time codes (Hz).
    pub fn rate(&self) -> Option<f64> {
        self.clock.rate()
    }

    /// Unit of the angular velocities, as given or found; `None` while it is not known.
    pub fn angular_unit(&self) -> Option<AngularUnit> {
        self.rates.unit()
    }

    /// Whether samples come in but their time codes stand still, so that frames have no time.
    pub fn time_stands_still(&self) -> bool {
        self.clock.stands_still()
    }

    fn take(&mut self, header: &Header, message: Message) {
        match message {
            // These stand for more than one sample: their counter may be anything.
            Message::Metadata(metadata) => self.information.metadata = metadata,
            Message::Scale(mut scale) => {
                let known = &mut self.information.scale;
                if header.fragment == 0 {
                    *known = scale;
                } else if known.points.len() < 4096 {
                    known.segments.append(&mut scale.segments);
                    known.points.append(&mut scale.points);
                }
            }
            Message::JointAngles(angles) => self.information.joint_angles = angles,
            Message::TimeCode(time) => self.information.time_code = Some(time),
            Message::Pose(poses) => {
                let Some(sample) = self.assembly.sample(header, &mut self.counters) else {
                    return;
                };
                // Quaternions come before angles, which repeat them.
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
        let leading =
            |segment: Segment| sample.orientations[MvnSegment::leading(segment) as usize];
        let whole = Segment::ALL.into_iter().all(|segment| leading(segment).is_some());
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
        let (inertial_from_body, posture) =
            xsens::attitude_and_posture(&orientations.map(unit));
        let position = xsens::inertial_vector(position);
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
            centre_of_mass: sample.centre_of_mass.map(xsens::inertial_vector),
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
