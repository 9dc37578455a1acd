//! The network stream of Xsens MVN: MXTP datagrams over UDP, as a live source of frames and as a sink.
//!
//! A sample is one datagram of each kind that MVN was told to send: [`datagram::POSE`] with the orientation of all
//! segments, and beside it the velocities. Datagrams may be lost, repeated or overtaken: a sample goes out when
//! all kinds that were seen before are there, or when the next sample begins.

pub mod datagram;

use std::collections::BTreeMap;
use std::net::{ToSocketAddrs, UdpSocket};
use std::time::{Duration, Instant};

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::Serialize;

use bodyflight_core::SegmentArray;

use crate::diagnostic::{Kind, Problem, Result};
use crate::interrupt;
use crate::recording::{FlightFrame, PelvisMotion};
use crate::xsens::{self, MVN_SEGMENT_COUNT, MvnSegment};
use datagram::{ANGULAR, Header, LINEAR, POSE, numbers, words};

/// The port that MVN sends to unless told otherwise.
pub const DEFAULT_PORT: u16 = 9763;

/// A stream that was silent for this long has ended.
pub const SILENCE: Duration = Duration::from_secs(5);

/// What a source has met. Nothing of it stops the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Counters {
    /// Datagrams received.
    pub datagrams: u64,
    /// Datagrams that are none of MVN.
    pub foreign: u64,
    /// Datagrams of a kind that is not used here.
    pub unused: u64,
    /// Datagrams whose content does not fit their kind.
    pub malformed: u64,
    /// Samples given out.
    pub samples: u64,
    /// Samples missing by their counter.
    pub missing: u64,
    /// Datagrams of samples that were given out already.
    pub late: u64,
    /// Samples without a pose.
    pub incomplete: u64,
}

/// What has come of one sample.
#[derive(Debug, Clone, Default)]
struct Sample {
    time_ms: u32,
    pose: Option<Pose>,
    /// Velocity of the pelvis (m/s), axes of MVN.
    velocity: Option<Vector3<f64>>,
    /// Angular velocity of the pelvis (rad/s), axes of MVN.
    angular_velocity: Option<Vector3<f64>>,
    kinds: u8,
}

#[derive(Debug, Clone)]
struct Pose {
    position: Vector3<f64>,
    orientations: [UnitQuaternion<f64>; MVN_SEGMENT_COUNT],
}

/// Datagrams to frames, without a socket.
#[derive(Debug, Default)]
pub struct Assembler {
    waiting: BTreeMap<u32, Sample>,
    /// Kinds of datagrams that this stream has.
    kinds: u8,
    /// Counter and time of the first sample, and the counter given out last.
    first: Option<(u32, u32)>,
    last: Option<u32>,
    counters: Counters,
}

impl Assembler {
    /// Nothing received yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// What was met so far.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Takes a datagram; the frames that it completes.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<FlightFrame> {
        self.counters.datagrams += 1;
        let Some((header, payload)) = Header::read(bytes) else {
            self.counters.foreign += 1;
            return Vec::new();
        };
        let bit = match header.kind {
            POSE => 1,
            LINEAR => 2,
            ANGULAR => 4,
            _ => {
                self.counters.unused += 1;
                return Vec::new();
            }
        };
        // Even a late one tells what to wait for.
        self.kinds |= bit;
        if self.last.is_some_and(|last| header.sample <= last) {
            self.counters.late += 1;
            return Vec::new();
        }
        let sample = self.waiting.entry(header.sample).or_default();
        sample.time_ms = header.time_ms;
        if !sample.take(header.kind, payload) {
            self.counters.malformed += 1;
            return Vec::new();
        }
        sample.kinds |= bit;
        self.release(header.sample)
    }

    /// Gives out what is complete, and all before the newest sample.
    fn release(&mut self, newest: u32) -> Vec<FlightFrame> {
        let mut frames = Vec::new();
        while let Some((&number, sample)) = self.waiting.first_key_value() {
            let complete = sample.kinds == self.kinds;
            if !complete && number >= newest {
                break;
            }
            let sample = self.waiting.remove(&number).unwrap_or_default();
            let gap = self.last.map_or(0, |last| number - last - 1);
            self.counters.missing += u64::from(gap);
            self.last = Some(number);
            match self.frame(number, &sample) {
                Some(frame) => {
                    self.counters.samples += 1;
                    frames.push(frame);
                }
                None => self.counters.incomplete += 1,
            }
        }
        frames
    }

    fn frame(&mut self, number: u32, sample: &Sample) -> Option<FlightFrame> {
        let pose = sample.pose.as_ref()?;
        let (first, begin) = *self.first.get_or_insert((number, sample.time_ms));
        let leading = SegmentArray::from_fn(|segment| {
            let place = MvnSegment::leading(segment) as usize;
            pose.orientations.get(place).copied().unwrap_or_default()
        });
        let (inertial_from_body, posture) = xsens::attitude_and_posture(&leading);
        Some(FlightFrame {
            index: u64::from(number - first),
            time: f64::from(sample.time_ms.saturating_sub(begin)) * 1e-3,
            posture,
            pelvis: PelvisMotion {
                inertial_from_body,
                position: xsens::inertial_vector(pose.position),
                velocity: sample.velocity.map(xsens::inertial_vector),
                angular_velocity: sample.angular_velocity.map(xsens::inertial_vector),
            },
            centre_of_mass: None,
            bridged: false,
        })
    }
}

impl Sample {
    /// Whether the content fits the kind.
    fn take(&mut self, kind: u8, payload: &[u8]) -> bool {
        match kind {
            POSE => {
                let mut pose = Pose {
                    position: Vector3::zeros(),
                    orientations: [UnitQuaternion::identity(); MVN_SEGMENT_COUNT],
                };
                let items = payload.as_chunks::<32>().0;
                for (place, item) in items.iter().take(MVN_SEGMENT_COUNT).enumerate() {
                    let [x, y, z, w, i, j, k] = numbers::<7>(&item[4..]);
                    let sent = Quaternion::new(w, i, j, k);
                    // Not a number fails the comparison.
                    let is_rotation = (sent.norm_squared() - 1.0).abs() < 0.05;
                    if words(item) as usize != place + 1 || !is_rotation {
                        return false;
                    }
                    pose.orientations[place] = UnitQuaternion::new_normalize(sent);
                    if place == 0 {
                        pose.position = Vector3::new(x, y, z);
                    }
                }
                let whole = items.len() >= MVN_SEGMENT_COUNT && finite(&pose.position);
                self.pose = whole.then_some(pose);
                whole
            }
            LINEAR => {
                let Some(item) = pelvis::<40>(payload) else {
                    return false;
                };
                let [.., vx, vy, vz, _, _, _] = numbers::<9>(&item[4..]);
                self.velocity = Some(Vector3::new(vx, vy, vz)).filter(finite);
                self.velocity.is_some()
            }
            _ => {
                let Some(item) = pelvis::<44>(payload) else {
                    return false;
                };
                let [.., wx, wy, wz, _, _, _] = numbers::<10>(&item[4..]);
                self.angular_velocity = Some(Vector3::new(wx, wy, wz)).filter(finite);
                self.angular_velocity.is_some()
            }
        }
    }
}

fn finite(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|value| value.is_finite())
}

/// The item of the pelvis, which comes first.
fn pelvis<const SIZE: usize>(payload: &[u8]) -> Option<&[u8; SIZE]> {
    let item = payload.first_chunk::<SIZE>()?;
    (words(item) == 1).then_some(item)
}

/// Frames as they come over the network, until the sender falls silent.
pub struct Source {
    socket: UdpSocket,
    assembler: Assembler,
    ready: std::collections::VecDeque<FlightFrame>,
}

impl Source {
    /// Listens at `address`, `HOST:PORT` or `:PORT`.
    ///
    /// # Errors
    /// Where the address is none, or somebody else listens there.
    pub fn bind(address: &str) -> Result<Self> {
        let full = if address.starts_with(':') {
            format!("0.0.0.0{address}")
        } else {
            address.to_owned()
        };
        let socket =
            UdpSocket::bind(&full).map_err(|error| refused("listen at", address, &error))?;
        let wait = Some(Duration::from_millis(100));
        socket
            .set_read_timeout(wait)
            .map_err(|error| refused("listen at", address, &error))?;
        Ok(Self {
            socket,
            assembler: Assembler::new(),
            ready: std::collections::VecDeque::new(),
        })
    }

    /// Where it listens.
    pub fn address(&self) -> String {
        let address = self.socket.local_addr();
        address.map_or_else(|_| String::new(), |address| address.to_string())
    }

    /// What was met so far.
    pub fn counters(&self) -> &Counters {
        self.assembler.counters()
    }
}

impl Iterator for Source {
    type Item = Result<FlightFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut bytes = [0; 65_536];
        let begin = Instant::now();
        loop {
            if let Some(frame) = self.ready.pop_front() {
                return Some(Ok(frame));
            }
            if let Err(problem) = interrupt::check() {
                return Some(Err(problem));
            }
            // Before the first datagram it waits for as long as it takes.
            if self.counters().datagrams > 0 && begin.elapsed() > SILENCE {
                return None;
            }
            // A timeout, or a message that an earlier datagram was refused: nothing to do but go on.
            if let Ok(count) = self.socket.recv(&mut bytes) {
                self.ready.extend(self.assembler.push(&bytes[..count]));
            }
        }
    }
}

/// Sends frames as MVN does.
pub struct Sink {
    socket: UdpSocket,
    sample: u32,
}

impl Sink {
    /// Sends to `address`, `HOST:PORT`.
    ///
    /// # Errors
    /// Where the address is none.
    pub fn connect(address: &str) -> Result<Self> {
        let error = |error: std::io::Error| refused("send to", address, &error);
        let target = address
            .to_socket_addrs()
            .map_err(error)?
            .next()
            .ok_or_else(|| Problem::bad_input(format!("no address: {address}")))?;
        let local = if target.is_ipv6() {
            "[::]:0"
        } else {
            "0.0.0.0:0"
        };
        let socket = UdpSocket::bind(local).map_err(error)?;
        socket.connect(target).map_err(error)?;
        Ok(Self { socket, sample: 0 })
    }

    /// Sends one frame; a receiver that is not there is no failure.
    pub fn send(&mut self, frame: &FlightFrame) {
        for datagram in datagram::of_frame(frame, self.sample) {
            let _ = self.socket.send(&datagram);
        }
        self.sample = self.sample.wrapping_add(1);
    }
}

fn refused(action: &str, address: &str, error: &std::io::Error) -> Problem {
    Problem {
        kind: Kind::System,
        ..Problem::bad_input(format!("cannot {action} {address}: {error}"))
    }
    .help(format!(
        "expected HOST:PORT or :PORT; MVN sends to port {DEFAULT_PORT}"
    ))
}

#[cfg(test)]
mod tests;
