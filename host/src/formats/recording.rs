//! A recorded flight: posture and motion of the pelvis, frame by frame, from an MVNX file.
//!
//! Bad frames are never silently used. By default a short run of them is replaced by frames between its good
//! neighbours ([`FlightFrame::bridged`], and counted in [`Quality`]); a longer one ends the reading with a
//! problem that names file, line, frame and element. [`BadFrames::Refuse`] ends it at the first.

mod bridge;
mod frame;
pub mod gnss;
mod watch;

pub use bridge::{BRIDGE_LIMIT, BadFrames, Quality};
pub use frame::{FlightFrame, PelvisMotion};

use std::collections::VecDeque;
use std::io::BufRead;
use std::path::Path;

use bodyflight_core::SegmentArray;
use bodyflight_core::frame::Vector;
use nalgebra::{Quaternion, UnitQuaternion};

use crate::diagnostic::{Problem, Result};
use crate::formats::input::Input;
use crate::formats::mvnx::closure::Skeleton;
use crate::formats::mvnx::{
    ArmFrame, Fault, Field, Fields, Frame, FrameKind, Header, ReadOptions, Reader,
};
use crate::formats::xsens::{self, MvnSegment};
pub use watch::Warning;

/// Largest closure error of a usable recording (m): four times that of a good file with a moving shoulder
/// girdle is 0.01, a wrong convention gives 0.2 and more.
const CLOSURE_LIMIT: f64 = 0.05;
/// Frames that decide the arm frame, besides those of the calibration.
const FRAMES_FOR_ARMS: usize = 8;

/// How to read a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// What to do with a frame whose numbers are not usable.
    pub bad_frames: BadFrames,
    /// Takes a file that ends too early up to its last whole frame.
    pub allow_truncated: bool,
    /// Convention of the arms, where it is known; otherwise it is told by how the joints close.
    pub arm_frame: Option<ArmFrame>,
}

/// A flight read frame by frame; memory does not grow with its length.
pub struct Recording<R: BufRead> {
    reader: Reader<R>,
    /// Frames read ahead to decide on the arms.
    ahead: VecDeque<Frame>,
    frame: Frame,
    places: Places,
    skeleton: Skeleton,
    arm_frame: ArmFrame,
    closure_error: f64,
    bridge: bridge::Bridge,
    watch: watch::Watch,
    /// A receiver's track whose velocities stand in for the suit's.
    gnss: Option<gnss::Aligned>,
    finished: bool,
}

/// Where the segments of the model are in the numbers of a frame.
type Places = SegmentArray<usize>;

impl Recording<Input> {
    /// Opens a flight.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or holds no flight, see [`Recording::new`].
    pub fn open(path: &Path, options: Options) -> Result<Self> {
        let reader = Reader::open(path, reader_options(options))?;
        Self::from_reader(reader, options)
    }
}

fn reader_options(options: Options) -> ReadOptions {
    ReadOptions {
        fields: Fields::FLIGHT,
        allow_truncated: options.allow_truncated,
    }
}

impl<R: BufRead> Recording<R> {
    /// A flight from any input; `path` names it in messages.
    ///
    /// # Errors
    /// Returns an error if the input is no recording, lacks segments, orientation or position, has no joints to tell its
    /// conventions by, or its segments do not meet at their joints.
    pub fn new(input: R, path: &Path, options: Options) -> Result<Self> {
        let reader = Reader::new(input, path, reader_options(options))?;
        Self::from_reader(reader, options)
    }

    fn from_reader(mut reader: Reader<R>, options: Options) -> Result<Self> {
        let path = reader.path().to_path_buf();
        let named = |problem: Problem| problem.in_file(&path);
        let places = places(reader.header()).map_err(named)?;
        let skeleton = match (Skeleton::of(reader.header()), options.arm_frame) {
            (Some(skeleton), _) => skeleton,
            (None, Some(_)) => Skeleton::without_joints(reader.header()),
            (None, None) => {
                return Err(named(
                    Problem::bad_input(
                        "no joints with points, so the convention of its arms cannot be told",
                    )
                    .help(
                        "export the recording again, with segments, points and joints, or say the \
                         convention with --arm-frame t-pose or isb",
                    ),
                ));
            }
        };
        let mut ahead = VecDeque::with_capacity(FRAMES_FOR_ARMS);
        let mut frame = Frame::default();
        while ahead.len() < FRAMES_FOR_ARMS && reader.next_frame(&mut frame)? {
            ahead.push_back(frame.clone());
        }
        let Some(first) = ahead.front() else {
            return Err(named(
                Problem::bad_input("no whole frame of type \"normal\": there is no flight in it")
                    .help("export the recording again, with its frames"),
            ));
        };
        check_fields(first, &ahead).map_err(named)?;
        let (told, closure_error) = arm_frame(&skeleton, reader.calibration(), ahead.iter())
            .unwrap_or((ArmFrame::TPose, 0.0));
        if closure_error > CLOSURE_LIMIT {
            return Err(named(open_joints(&skeleton, &ahead, closure_error)));
        }
        let arm_frame = options.arm_frame.unwrap_or(told);
        let frame_rate = reader.header().frame_rate;
        let bridge = bridge::Bridge::new(frame_rate, options.bad_frames);
        Ok(Self {
            reader,
            ahead,
            frame,
            places,
            skeleton,
            arm_frame,
            closure_error,
            bridge,
            watch: watch::Watch::new(frame_rate),
            gnss: None,
            finished: false,
        })
    }

    /// What the file says before its frames.
    pub fn header(&self) -> &Header {
        self.reader.header()
    }

    /// Convention in which the file gives the arms, and the closure error (m) it was told by. All that is
    /// handed out is in the convention of the T-pose.
    pub fn arm_frame(&self) -> (ArmFrame, f64) {
        (self.arm_frame, self.closure_error)
    }

    /// What reading has met so far.
    pub fn quality(&self) -> &Quality {
        &self.bridge.quality
    }

    /// Takes the velocities of a receiver's track from now on.
    #[must_use]
    pub fn with_track(mut self, track: gnss::Aligned) -> Self {
        self.gnss = Some(track);
        self
    }

    /// How the track was brought to the recording's clock, where there is one.
    pub fn alignment(&self) -> Option<gnss::Alignment> {
        self.gnss.as_ref().map(|track| track.alignment)
    }

    /// What is not as a flight is, in what was read so far.
    pub fn warnings(&self) -> Vec<Warning> {
        self.watch.warnings()
    }

    /// The first calibration frame of a kind, as posture and motion; `None` where there is none or it is bad.
    pub fn calibration(&self, kind: FrameKind) -> Option<FlightFrame> {
        let mut frame = self
            .reader
            .calibration()
            .iter()
            .find(|frame| frame.kind == kind && frame.fault.is_none())?
            .clone();
        self.flight_frame(&mut frame)
    }

    /// Bytes held, for the check that they do not grow.
    pub fn buffered_bytes(&self) -> usize {
        self.reader.buffered_bytes() + self.frame.capacity_bytes() + self.bridge.held_bytes()
    }

    /// Posture and motion of a good frame.
    fn flight_frame(&self, frame: &mut Frame) -> Option<FlightFrame> {
        if self.arm_frame == ArmFrame::Isb && frame.kind != FrameKind::Identity
            || frame.kind == FrameKind::TposeIsb
        {
            self.skeleton
                .convert_to_t_pose(frame.numbers_mut(Field::Orientation)?);
        }
        let orientation = frame.numbers(Field::Orientation)?;
        let mut missing = false;
        let leading = self.places.map(|_, place| {
            let numbers = orientation.get(4 * place..4 * place + 4);
            let [w, x, y, z] = numbers.and_then(|q| q.try_into().ok()).unwrap_or_else(|| {
                missing = true;
                [1.0, 0.0, 0.0, 0.0]
            });
            UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
        });
        if missing {
            return None;
        }
        let (inertial_from_body, posture) = xsens::attitude_and_posture(&leading);
        let pelvis = self.places[bodyflight_core::Segment::Pelvis];
        let vector = |field, place| frame.vector(field, place).map(Vector::from_components);
        let time = self.bridge.time(frame.index);
        Some(FlightFrame {
            index: frame.index,
            time,
            posture,
            pelvis: PelvisMotion {
                inertial_from_body,
                position: vector(Field::Position, pelvis)?,
                velocity: match &self.gnss {
                    Some(track) => track.velocity_at(time),
                    None => vector(Field::Velocity, pelvis),
                },
                angular_velocity: vector(Field::AngularVelocity, pelvis),
            },
            centre_of_mass: vector(Field::CenterOfMass, 0),
            bridged: false,
        })
    }

    /// The next frame, `None` at the end.
    fn advance(&mut self) -> Result<Option<FlightFrame>> {
        loop {
            if let Some(frame) = self.bridge.ready() {
                return Ok(Some(frame));
            }
            if self.finished {
                return Ok(None);
            }
            let mut frame = core::mem::take(&mut self.frame);
            let more = match self.ahead.pop_front() {
                Some(first) => {
                    frame = first;
                    true
                }
                None => self.reader.next_frame(&mut frame)?,
            };
            if !more {
                self.finished = true;
                self.bridge.end()?;
                self.bridge.quality.truncated = self.reader.is_truncated();
            } else if let Some(fault) = frame.fault.take() {
                self.bridge.bad(fault)?;
            } else if let Some(flight) = self.flight_frame(&mut frame) {
                self.watch.see(&flight, frame.written_time);
                self.bridge.good(flight)?;
            } else {
                // Not met: a frame without these elements carries a fault.
                self.bridge.bad(Fault {
                    index: frame.index,
                    line: frame.line,
                    element: Field::Orientation.element(),
                    message: "orientation or position is missing".into(),
                })?;
            }
            self.frame = frame;
        }
    }
}

impl<R: BufRead> Iterator for Recording<R> {
    type Item = Result<FlightFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        let result = self.advance();
        if result.is_err() {
            self.finished = true;
            self.bridge.discard();
        }
        result
            .map_err(|problem| problem.in_file(self.reader.path()))
            .transpose()
    }
}

/// Convention of the arms by which the segments meet best, with the error left (m).
///
/// The calibration frame in ISB axes, which version 4 adds, says nothing about the others. `None` where no
/// good frame has orientation and position.
pub fn arm_frame<'a>(
    skeleton: &Skeleton,
    calibration: &'a [Frame],
    normal: impl Iterator<Item = &'a Frame>,
) -> Option<(ArmFrame, f64)> {
    let calibration = calibration
        .iter()
        .filter(|frame| frame.kind != FrameKind::TposeIsb);
    let mut errors = [f64::NEG_INFINITY; 2];
    for frame in calibration
        .chain(normal)
        .filter(|frame| frame.fault.is_none())
    {
        let numbers = frame.numbers(Field::Orientation);
        if let (Some(orientation), Some(position)) = (numbers, frame.numbers(Field::Position)) {
            for (error, arms) in errors.iter_mut().zip([ArmFrame::TPose, ArmFrame::Isb]) {
                *error = error.max(skeleton.closure_error(orientation, position, arms));
            }
        }
    }
    let [t_pose, isb] = errors;
    (t_pose >= 0.0).then_some(if isb < t_pose {
        (ArmFrame::Isb, isb)
    } else {
        (ArmFrame::TPose, t_pose)
    })
}

/// What is said where the segments do not meet: another order of the quaternions, where they meet with it.
fn open_joints(skeleton: &Skeleton, frames: &VecDeque<Frame>, closure_error: f64) -> Problem {
    let reordered = frames.iter().filter_map(|frame| {
        let orientation = frame.numbers(Field::Orientation)?;
        let position = frame.numbers(Field::Position)?;
        let from_xyzw: Vec<f64> = orientation
            .chunks_exact(4)
            .flat_map(|q| [q[3], q[0], q[1], q[2]])
            .collect();
        let closes = |arms| skeleton.closure_error(&from_xyzw, position, arms);
        Some(closes(ArmFrame::TPose).min(closes(ArmFrame::Isb)))
    });
    let reordered = reordered.fold(f64::NEG_INFINITY, f64::max);
    let first = frames.front().map_or(0, |frame| frame.index);
    let problem = Problem::bad_input(format!(
        "the segments do not meet at their joints: {closure_error:.3} m apart, expected below {CLOSURE_LIMIT} m"
    ))
    .at(format!("frame {first} and after"));
    if (0.0..CLOSURE_LIMIT).contains(&reordered) {
        return problem.help(format!(
            "read as x y z w the quaternions close the joints to {reordered:.4} m: write them as w x y z"
        ));
    }
    problem.help("orientations must be quaternions w x y z of the same subject as the points")
}

/// Finds the segments of the model in a file.
fn places(header: &Header) -> Result<Places> {
    let mut missing = Vec::new();
    let places = SegmentArray::from_fn(|segment| {
        let label = MvnSegment::leading(segment).label();
        header.segment_index(label).unwrap_or_else(|| {
            missing.push(label);
            0
        })
    });
    if missing.is_empty() {
        return Ok(places);
    }
    Err(Problem::bad_input(format!(
        "a flight needs the full body, but the file has no segment {}",
        missing.join(", ")
    ))
    .help("export the recording again with all 23 segments"))
}

/// Orientation and position must be there; a fault of single frames is another matter.
fn check_fields(first: &Frame, frames: &VecDeque<Frame>) -> Result<()> {
    for field in [Field::Orientation, Field::Position] {
        if frames.iter().all(|frame| !frame.present().contains(field)) {
            let element = field.element();
            return Err(
                Problem::bad_input(format!("expected <{element}>, found none"))
                    .at_line(first.line)
                    .at(format!("frame {}", first.index))
                    .help(format!(
                        "export the recording again from MVN with <{element}> included"
                    )),
            );
        }
    }
    Ok(())
}
