//! Sends a recording as MVN sends a live one, for other tools.

use std::net::UdpSocket;
use std::str::FromStr;
use std::thread::sleep;
use std::time::{Duration, Instant};

use bodyflight_core::Body;
use serde::Serialize;

use super::datagram::{Datagram, Header, Kind};
use super::message::{
    AngularKinematics, LinearKinematics, Message, Scale, ScalePoint, SegmentPose,
};
use super::source::ADVICE;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_mvnx::xsens::skeleton::Layout;
use bodyflight_mvnx::xsens::{self, MVN_SEGMENT_COUNT, MvnSegment};
use bodyflight_mvnx::{Differences, MovingFrame};

/// Interval at which static information is repeated (s), for receivers that join late.
const INTRODUCTION_PERIOD: f64 = 1.0;
/// Points of the skeleton per datagram: with their names, it stays below 1500 bytes.
const POINTS_PER_DATAGRAM: usize = 24;
/// Longest wait between checks for Ctrl-C.
const NAP: Duration = Duration::from_millis(100);

/// Sending speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// This many times as fast as recorded.
    Times(f64),
    /// As fast as the network allows.
    Max,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> core::result::Result<Self, String> {
        if text == "max" {
            return Ok(Self::Max);
        }
        text.parse()
            .ok()
            .filter(|times: &f64| (0.01..=1000.0).contains(times))
            .map(Self::Times)
            .ok_or_else(|| format!("expected a factor of 0.01 to 1000, or max, found \"{text}\""))
    }
}

/// What was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Sent {
    /// Frames.
    pub frames: u64,
    /// Datagrams.
    pub datagrams: u64,
    /// Bytes of datagrams.
    pub bytes: u64,
    /// Datagrams refused by the other machine because nothing was listening there.
    pub refused_datagrams: u64,
}

/// Sends frames: pose, linear and angular kinematics and centre of mass for each, and name, skeleton and time of day
/// once a second.
#[derive(Debug)]
pub struct Sink {
    socket: UdpSocket,
    layout: Layout,
    subject_label: String,
    differences: Differences,
    introduced: Option<f64>,
    sent: Sent,
    payload: Vec<u8>,
    bytes: Vec<u8>,
}

impl Sink {
    /// Prepares to send a flight of `body` to `address`, given as `host:port`.
    ///
    /// # Errors
    /// Returns an error if the address is invalid or cannot be reached.
    pub fn connect(address: &str, body: &Body<f64>, subject_label: &str) -> Result<Self> {
        let socket = UdpSocket::bind("0.0.0.0:0")
            .and_then(|socket| socket.connect(address).map(|()| socket))
            .map_err(|error| ADVICE.problem(&format!("cannot send to {address}"), error))?;
        Ok(Self {
            socket,
            layout: Layout::new(body),
            subject_label: subject_label.to_owned(),
            differences: Differences::default(),
            introduced: None,
            sent: Sent::default(),
            payload: Vec::new(),
            bytes: Vec::new(),
        })
    }

    /// Takes a frame and sends the previous one, whose accelerations are now known.
    ///
    /// # Errors
    /// Returns an error if the network fails.
    pub fn send(&mut self, frame: &FlightFrame) -> Result<()> {
        let pelvis = &frame.pelvis;
        let placed = self
            .layout
            .place(pelvis.inertial_from_body, pelvis.position, &frame.posture);
        match self.differences.push(frame, frame.time, placed) {
            Some(moving) => self.put(&moving),
            None => Ok(()),
        }
    }

    /// Sends the last frame.
    ///
    /// # Errors
    /// Returns an error if the network fails.
    pub fn finish(mut self) -> Result<Sent> {
        if let Some(moving) = self.differences.last() {
            self.put(&moving)?;
        }
        Ok(self.sent)
    }

    /// What has been sent so far.
    pub fn sent(&self) -> &Sent {
        &self.sent
    }

    fn put(&mut self, frame: &MovingFrame) -> Result<()> {
        let due = self
            .introduced
            .is_none_or(|last| frame.time - last >= INTRODUCTION_PERIOD);
        if due {
            self.introduced = Some(frame.time);
            self.introduce(frame)?;
        }
        let segments = (1..).zip(0..MVN_SEGMENT_COUNT);
        let pose = Message::Pose(
            segments
                .clone()
                .map(|(id, at)| SegmentPose {
                    id,
                    position: frame.placed[at].position,
                    orientation: *frame.placed[at].orientation.quaternion(),
                })
                .collect(),
        );
        let linear = Message::LinearKinematics(
            segments
                .clone()
                .map(|(id, at)| LinearKinematics {
                    id,
                    position: frame.placed[at].position,
                    velocity: frame.velocity[at],
                    acceleration: frame.acceleration[at],
                })
                .collect(),
        );
        let angular = Message::AngularKinematics(
            segments
                .map(|(id, at)| AngularKinematics {
                    id,
                    orientation: *frame.placed[at].orientation.quaternion(),
                    angular_velocity: frame.angular_velocity[at],
                    angular_acceleration: frame.angular_acceleration[at],
                })
                .collect(),
        );
        self.transmit(frame, &pose, 0, true)?;
        self.transmit(frame, &linear, 0, true)?;
        self.transmit(frame, &angular, 0, true)?;
        if let Some([position, ..]) = frame.centre_of_mass {
            self.transmit(frame, &Message::CentreOfMass(position), 0, true)?;
        }
        self.sent.frames += 1;
        Ok(())
    }

    /// Sends name, skeleton and time of day.
    fn introduce(&mut self, frame: &MovingFrame) -> Result<()> {
        let metadata = [
            ("name", self.subject_label.clone()),
            ("count", "1".to_owned()),
        ];
        let metadata = metadata
            .map(|(tag, value)| (tag.to_owned(), value))
            .to_vec();
        self.transmit(frame, &Message::Metadata(metadata), 0, true)?;
        let mut parts = skeleton(&self.layout).into_iter().peekable();
        let mut fragment = 0;
        while let Some(part) = parts.next() {
            let last = parts.peek().is_none();
            self.transmit(frame, &Message::Scale(part), fragment, last)?;
            fragment += 1;
        }
        self.transmit(frame, &Message::TimeCode(time_of_day(frame.time)), 0, true)
    }

    fn transmit(
        &mut self,
        frame: &MovingFrame,
        message: &Message,
        fragment: u8,
        last: bool,
    ) -> Result<()> {
        self.payload.clear();
        let (kind, items) = message.encode(&mut self.payload);
        let header = Header {
            kind,
            sample: counter(frame.index),
            fragment,
            last,
            items,
            time_ms: milliseconds(frame.time),
            character: 0,
            body_segments: 23,
            props: 0,
            finger_segments: 0,
        };
        let payload = &self.payload;
        let encoded = Datagram { header, payload }.encode(&mut self.bytes);
        encoded.ok_or_else(|| {
            Problem::bad_input(format!(
                "{} bytes of kind {} do not fit in a datagram",
                self.payload.len(),
                Kind::number(kind)
            ))
        })?;
        match self.socket.send(&self.bytes) {
            Ok(length) => {
                self.sent.datagrams += 1;
                self.sent.bytes += length as u64;
                Ok(())
            }
            Err(error) if error.kind() == std::io::ErrorKind::ConnectionRefused => {
                self.sent.refused_datagrams += 1;
                Ok(())
            }
            Err(error) => Err(ADVICE.problem("cannot send", error)),
        }
    }
}

/// Segments first, then their points in datagrams of moderate size.
fn skeleton(layout: &Layout) -> Vec<Scale> {
    let height = bodyflight_core::frame::Vector::new(0.0, 0.0, layout.standing_height());
    let standing = layout.place(xsens::facing_forward(), height, &xsens::t_pose());
    let segments = MvnSegment::ALL
        .into_iter()
        .zip(standing)
        .map(|(segment, placed)| (segment.label().to_owned(), placed.position))
        .collect();
    let mut points = Vec::new();
    for (number, segment) in (1..).zip(MvnSegment::ALL) {
        for (point, place) in (1..).zip(layout.points(segment)) {
            points.push(ScalePoint {
                segment: number,
                point,
                label: place.label,
                flags: 0,
                position: place.position,
            });
        }
    }
    let first = Scale {
        segments,
        points: Vec::new(),
    };
    let rest = points.chunks(POINTS_PER_DATAGRAM).map(|points| Scale {
        segments: Vec::new(),
        points: points.to_vec(),
    });
    core::iter::once(first).chain(rest).collect()
}

/// Wraps, as MVN's counter does.
#[expect(
    clippy::cast_possible_truncation,
    reason = "only the low 32 bits are sent"
)]
fn counter(index: u64) -> u32 {
    index as u32
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "enough for 49 days; the conversion saturates"
)]
fn milliseconds(time: f64) -> u32 {
    (time * 1000.0).round() as u32
}

fn time_of_day(time: f64) -> String {
    let ms = milliseconds(time);
    let (seconds, minutes, hours) = (ms / 1000, ms / 60_000, ms / 3_600_000);
    format!(
        "{:02}:{:02}:{:02}.{:03}",
        hours % 24,
        minutes % 60,
        seconds % 60,
        ms % 1000
    )
}

/// Sends a whole flight at the given speed, and reports the progress after each frame.
///
/// # Errors
/// Returns an error if a frame cannot be read or sent, or Ctrl-C was pressed.
pub fn replay(
    frames: impl Iterator<Item = Result<FlightFrame>>,
    mut sink: Sink,
    speed: Speed,
    mut progress: impl FnMut(&Sent),
) -> Result<Sent> {
    let begin = Instant::now();
    let mut first = None;
    for frame in frames {
        let frame = frame?;
        interrupt::check()?;
        if let Speed::Times(times) = speed {
            let since = frame.time - *first.get_or_insert(frame.time);
            wait_until(begin + Duration::try_from_secs_f64(since / times).unwrap_or_default())?;
        }
        sink.send(&frame)?;
        progress(sink.sent());
    }
    sink.finish()
}

fn wait_until(instant: Instant) -> Result<()> {
    loop {
        let left = instant.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(());
        }
        sleep(left.min(NAP));
        interrupt::check()?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_factors_or_max() {
        assert_eq!("max".parse(), Ok(Speed::Max));
        assert_eq!("2.5".parse(), Ok(Speed::Times(2.5)));
        for bad in ["0", "-1", "fast", "NaN", "1e9"] {
            assert!(bad.parse::<Speed>().unwrap_err().contains("0.01 to 1000"));
        }
    }

    #[test]
    fn the_time_of_day_has_three_decimals() {
        assert_eq!(time_of_day(3_723.004), "01:02:03.004");
        assert_eq!(time_of_day(0.0), "00:00:00.000");
    }
}
