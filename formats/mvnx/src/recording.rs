//! A recorded flight: posture and motion of the pelvis, frame by frame, from an MVNX file.
//!
//! Bad frames are never used silently. A short run is interpolated (marked by [`FlightFrame::bridged`], counted in
//! [`Quality`]); a longer one, or any with [`BadFrames::Refuse`], is an error that names file, line, frame and element.

mod agreement;
mod anatomy;
mod arms;
mod bridge;
mod checks;
mod clock;
mod complete;
mod frame;
mod gyroscope;
mod limbs;
mod mounting;
mod paths;
mod plausibility;
mod spins;
mod warning;
mod watch;

pub use arms::{CLOSURE_LIMIT, arm_frame};
pub use bridge::{BRIDGE_LIMIT, BadFrames, Quality};
pub use checks::Checks;
pub use clock::{LOST, REPEATED};
pub use frame::{FlightFrame, PelvisMotion};
pub use mounting::Mounting;

use std::collections::VecDeque;
use std::io::BufRead;
use std::path::Path;
use std::time::Duration;

use bodyflight_core::SegmentArray;
use bodyflight_core::frame::{Inertial, Vector};
use nalgebra::{Quaternion, UnitQuaternion};

use crate::closure::Skeleton;
use crate::xsens::{self, MvnSegment};
use crate::{ArmFrame, Fault, Field, Fields, Frame, FrameKind, Header, ReadOptions, Reader};
use bodyflight_io::diagnostic::{Problem, Result};
use complete::{Places, check_fields, places};
use limbs::Moving;
use plausibility::{JOINT_LIMIT, OpenJoint};
pub use warning::{Warning, faults};

/// Number of frames, besides those of the calibration, that determine the convention of the arms.
const FRAMES_FOR_ARMS: usize = 8;

/// How to read a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// What to do with a frame whose numbers are unusable.
    pub bad_frames: BadFrames,
    /// Accepts a file that ends too early, up to its last complete frame.
    pub allow_truncated: bool,
    /// Convention of the arms, if known; otherwise the one with which the joints close best.
    pub arm_frame: Option<ArmFrame>,
}

/// A flight read frame by frame; memory does not grow with its length.
pub struct Recording<'a> {
    reader: Reader<'a>,
    /// Frames read ahead to determine the convention of the arms.
    ahead: VecDeque<Frame>,
    frame: Frame,
    places: Places,
    skeleton: Skeleton,
    arm_frame: ArmFrame,
    closure_error: f64,
    began: Option<Duration>,
    bridge: bridge::Bridge,
    watch: watch::Watch,
    mountings: mounting::Mountings,
    /// The frame whose joints are furthest apart, and how far (m), if they are too far.
    open: Option<(Frame, f64)>,
    /// Velocities that replace the suit's.
    velocities: Option<Velocities>,
    finished: bool,
}

/// Velocity of the pelvis (m/s, inertial axes) at a time since frame 0 (s), from another sensor than the suit; `None`
/// where it has none.
pub type Velocities = Box<dyn Fn(f64) -> Option<Vector<f64, Inertial>> + Send>;

impl Recording<'static> {
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

impl<'a> Recording<'a> {
    /// Reads a flight from any input; `path` is used in messages.
    ///
    /// # Errors
    /// Returns an error if the input is not a recording, if it lacks segments, orientation or position, if it has no
    /// joints and the convention of its arms is not given, or if its segments do not meet at their joints.
    pub fn new(input: impl BufRead + Send + 'a, path: &Path, options: Options) -> Result<Self> {
        let reader = Reader::new(input, path, reader_options(options))?;
        Self::from_reader(reader, options)
    }

    fn from_reader(mut reader: Reader<'a>, options: Options) -> Result<Self> {
        let path = reader.path().to_path_buf();
        let named = |problem: Problem| problem.in_file(&path);
        let places = places(reader.header()).map_err(named)?;
        let skeleton = match (Skeleton::of(reader.header()), options.arm_frame) {
            (Some(skeleton), _) => skeleton,
            (None, Some(_)) => Skeleton::without_joints(reader.header()),
            (None, None) => {
                return Err(named(
                    Problem::bad_input(
                        "found no joints with points, so the convention of the arms is unknown",
                    )
                    .help(
                        "export the recording again, with segments, points and joints, or give the \
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
                Problem::bad_input(
                    "found no complete frame of type \"normal\", so there is no flight in it",
                )
                .help("export the recording again, with its frames"),
            ));
        };
        check_fields(first, &ahead).map_err(named)?;
        let (told, closure_error) = arm_frame(&skeleton, reader.calibration(), ahead.iter())
            .unwrap_or((ArmFrame::TPose, 0.0));
        if closure_error > CLOSURE_LIMIT {
            return Err(named(arms::open_joints(
                &skeleton,
                reader.header(),
                &ahead.iter().collect::<Vec<_>>(),
                closure_error,
            )));
        }
        let arm_frame = options.arm_frame.unwrap_or(told);
        let frame_rate = reader.header().frame_rate;
        let bridge = bridge::Bridge::new(frame_rate, options.bad_frames);
        let began = ahead.iter().find_map(|frame| {
            let since = Duration::try_from_secs_f64(bridge.time(frame.index)).ok()?;
            Duration::from_millis(frame.unix_time_ms?).checked_sub(since)
        });
        Ok(Self {
            reader,
            ahead,
            frame,
            places,
            skeleton,
            arm_frame,
            closure_error,
            began,
            bridge,
            watch: watch::Watch::new(frame_rate),
            mountings: mounting::Mountings::default(),
            open: None,
            velocities: None,
            finished: false,
        })
    }

    /// The header of the file.
    pub fn header(&self) -> &Header {
        self.reader.header()
    }

    /// Unix time of frame 0, if the frames have it (to 1 ms).
    pub fn began(&self) -> Option<Duration> {
        self.began
    }

    /// Convention in which the file gives the arms, and the closure error (m) of the convention that fits best. Frames
    /// are always returned in the convention of the T-pose.
    pub fn arm_frame(&self) -> (ArmFrame, f64) {
        (self.arm_frame, self.closure_error)
    }

    /// Counts of good and bad frames so far, and the first fault.
    pub fn quality(&self) -> &Quality {
        &self.bridge.quality
    }

    /// Replaces the suit's velocities from now on by those at the frames' times (s).
    #[must_use]
    pub fn with_velocities(mut self, velocities: Velocities) -> Self {
        self.velocities = Some(velocities);
        self.watch.velocities_of_another_sensor();
        self
    }

    /// Says that the air moves at this velocity (m/s, inertial).
    #[must_use]
    pub fn in_air(mut self, velocity: [f64; 3]) -> Self {
        self.watch.in_air(velocity);
        self
    }

    /// Segments whose attitude is off by a constant angle in the frames read so far, the worst first.
    pub fn mountings(&self) -> Vec<Mounting> {
        self.mountings
            .found(|at| Some(self.header().segments.get(at)?.label.as_str()))
    }

    /// Whatever is implausible for a flight in the frames read so far.
    pub fn warnings(&self) -> Vec<Warning> {
        self.found(watch::JUDGED)
    }

    /// The same of another system's recording, whose mapping may be wrong: postures are judged however short it is.
    pub fn warnings_of_import(&self) -> Vec<Warning> {
        self.found(0.0)
    }

    fn found(&self, postures_from_s: f64) -> Vec<Warning> {
        let mut warnings = self.watch.warnings(postures_from_s);
        warnings.extend(self.mountings().iter().map(Mounting::warning));
        warnings.extend(self.exchanged());
        let props = self.header().segments.iter().map(|segment| &segment.label);
        let props = props.filter(|label| MvnSegment::ALL.iter().all(|own| own.label() != *label));
        for prop in props {
            let message = format!("the segment {prop} is not part of the body and is left out");
            warnings.push(Warning::new(0, message));
        }
        for other in self.reader.other_subjects() {
            let message = format!(
                "the file has a second subject, {other}, which is not read: export each to a file of its own"
            );
            warnings.push(Warning::new(0, message));
        }
        warnings
    }

    /// Sides of a limb that are exchanged where joints are apart: in the first frames, they may have been straight.
    fn exchanged(&self) -> Option<Warning> {
        let (frame, apart) = self.open.as_ref()?;
        let frames = std::iter::once(frame);
        let said = arms::exchanged(&self.skeleton, self.header(), frames, *apart)?;
        let time = self.bridge.time(frame.index);
        Some(Warning::fault(frame.index, [time; 2], said))
    }

    /// Scale of the angular velocities of the pelvis about the axes of the body, where the attitudes show another than one.
    pub fn gyroscope_scale(&self) -> Option<[f64; 3]> {
        self.watch.spins.gyroscope_scale()
    }

    /// The first good calibration frame of a kind, as posture and motion; `None` if there is none.
    pub fn calibration(&self, kind: FrameKind) -> Option<FlightFrame> {
        let mut frame = self
            .reader
            .calibration()
            .iter()
            .find(|frame| frame.kind == kind && frame.fault.is_none())?
            .clone();
        self.flight_frame(&mut frame)
    }

    /// Number of bytes held, to check that memory does not grow.
    pub fn buffered_bytes(&self) -> usize {
        self.reader.buffered_bytes() + self.frame.capacity_bytes() + self.bridge.held_bytes()
    }

    /// Posture and motion of a good frame; `None` if elements are missing.
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
                velocity: match &self.velocities {
                    Some(velocity_at) => velocity_at(time),
                    None => vector(Field::Velocity, pelvis),
                },
                angular_velocity: vector(Field::AngularVelocity, pelvis),
            },
            centre_of_mass: vector(Field::CenterOfMass, 0),
            bridged: false,
        })
    }

    /// How the segments move, by the frame's own numbers.
    fn moving(&self, frame: &Frame) -> SegmentArray<Moving> {
        self.places.map(|_, place| Moving {
            position: frame.vector(Field::Position, *place),
            velocity: frame.vector(Field::Velocity, *place),
            angular_velocity: frame.vector(Field::AngularVelocity, *place),
        })
    }

    /// The joint that closes worst in a frame whose arms have the convention of the T-pose.
    fn worst_joint(&self, frame: &Frame) -> Option<OpenJoint> {
        let [turned, placed] = [Field::Orientation, Field::Position].map(|of| frame.numbers(of));
        let (segment, apart) = (self.skeleton).worst_joint(turned?, placed?, ArmFrame::TPose)?;
        let label = (apart > JOINT_LIMIT).then(|| self.header().segments.get(segment))??;
        Some(OpenJoint {
            segment: label.label.clone(),
            apart,
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
                let joint = self.worst_joint(&frame);
                if let Some(joint) = &joint
                    && self
                        .open
                        .as_ref()
                        .is_none_or(|(_, apart)| joint.apart > *apart)
                {
                    self.open = Some((frame.clone(), joint.apart));
                }
                let moving = self.moving(&frame);
                self.watch.see(&flight, frame.written_time, joint, &moving);
                self.mountings.see_frame(&self.skeleton, &frame);
                self.bridge.good(flight)?;
            } else {
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

impl Iterator for Recording<'_> {
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
