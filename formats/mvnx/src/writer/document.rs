//! The text of a version 4 file.

use std::io::{self, Write};

use bodyflight_core::Posture;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;

use super::motion::MovingFrame;
use crate::closure::t_pose_from_isb;
use crate::xsens::skeleton::{Layout, Placed};
use crate::xsens::{self, MVN_SEGMENT_COUNT, MvnSegment};

/// Sensors of a full-body suit in MVN's order.
const SENSORS: [MvnSegment; 17] = [
    MvnSegment::Pelvis,
    MvnSegment::T8,
    MvnSegment::Head,
    MvnSegment::RightShoulder,
    MvnSegment::RightUpperArm,
    MvnSegment::RightForeArm,
    MvnSegment::RightHand,
    MvnSegment::LeftShoulder,
    MvnSegment::LeftUpperArm,
    MvnSegment::LeftForeArm,
    MvnSegment::LeftHand,
    MvnSegment::RightUpperLeg,
    MvnSegment::RightLowerLeg,
    MvnSegment::RightFoot,
    MvnSegment::LeftUpperLeg,
    MvnSegment::LeftLowerLeg,
    MvnSegment::LeftFoot,
];

/// What the header says besides the body.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    /// Name of the subject.
    pub subject_label: String,
    /// Frames per second (Hz).
    pub frame_rate: f64,
    /// Time of frame 0 (milliseconds since 1970, UTC).
    pub start_unix_ms: u64,
    /// Free text.
    pub comment: String,
    /// Source of the frames.
    pub origin: Origin,
}

/// Source of the frames of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// The model flew them.
    Simulated,
    /// A unit logged them on board.
    Logged,
    /// They were received live.
    Live,
    /// Another system recorded them.
    Imported {
        /// Whether that system has positions of the body; otherwise there are no velocities and accelerations.
        has_places: bool,
    },
}

impl Origin {
    fn name(self) -> &'static str {
        match self {
            Self::Simulated => "simulated",
            Self::Logged => "logged",
            Self::Live => "live",
            Self::Imported { .. } => "imported",
        }
    }

    fn has_places(self) -> bool {
        self != Self::Imported { has_places: false }
    }
}

/// Everything before the first normal frame.
pub(super) fn header(
    out: &mut impl Write,
    description: &Description,
    layout: &Layout,
) -> io::Result<()> {
    let rate = description.frame_rate;
    let comment = escaped(&description.comment);
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
    writeln!(
        out,
        "<mvnx xmlns=\"http://www.xsens.com/mvn/mvnx\" version=\"4\">"
    )?;
    writeln!(
        out,
        "\t<mvn version=\"bodyflight {0}\" build=\"bodyflight {0}, {1}\"/>",
        env!("CARGO_PKG_VERSION"),
        description.origin.name()
    )?;
    writeln!(out, "\t<comment>{comment}</comment>")?;
    writeln!(
        out,
        "\t<subject label=\"{}\" frameRate=\"{rate}\" segmentCount=\"{MVN_SEGMENT_COUNT}\" \
         configuration=\"FullBody\">",
        escaped(&description.subject_label)
    )?;
    writeln!(out, "\t\t<comment></comment>\n\t\t<segments>")?;
    segments(out, layout)?;
    writeln!(out, "\t\t</segments>\n\t\t<sensors>")?;
    for sensor in SENSORS {
        writeln!(out, "\t\t\t<sensor label=\"{}\"/>", sensor.label())?;
    }
    writeln!(out, "\t\t</sensors>\n\t\t<joints>")?;
    joints(out)?;
    let joints = MVN_SEGMENT_COUNT - 1;
    writeln!(
        out,
        "\t\t</joints>\n\t\t<frames segmentCount=\"{MVN_SEGMENT_COUNT}\" sensorCount=\"{}\" \
         jointCount=\"{joints}\">",
        SENSORS.len()
    )?;
    calibration(out, layout)
}

/// The segments and their points.
fn segments(out: &mut impl Write, layout: &Layout) -> io::Result<()> {
    for (id, segment) in (1..).zip(MvnSegment::ALL) {
        let label = segment.label();
        writeln!(out, "\t\t\t<segment label=\"{label}\" id=\"{id}\">")?;
        writeln!(out, "\t\t\t\t<points>")?;
        for point in layout.points(segment) {
            writeln!(out, "\t\t\t\t\t<point label=\"{}\">", point.label)?;
            write!(out, "\t\t\t\t\t\t<pos_b>")?;
            numbers(out, point.position.iter())?;
            writeln!(out, "</pos_b>\n\t\t\t\t\t</point>")?;
        }
        writeln!(out, "\t\t\t\t</points>\n\t\t\t</segment>")?;
    }
    Ok(())
}

/// The joints and the points that they connect.
fn joints(out: &mut impl Write) -> io::Result<()> {
    for segment in MvnSegment::ALL {
        let (Some(parent), joint) = (segment.parent(), segment.joint()) else {
            continue;
        };
        writeln!(out, "\t\t\t<joint label=\"{joint}\">")?;
        for (number, end) in [(1, parent), (2, segment)] {
            let label = end.label();
            writeln!(
                out,
                "\t\t\t\t<connector{number}>{label}/{joint}</connector{number}>"
            )?;
        }
        writeln!(out, "\t\t\t</joint>")?;
    }
    Ok(())
}

/// The three calibration frames: standing in the T-pose, facing along X.
fn calibration(out: &mut impl Write, layout: &Layout) -> io::Result<()> {
    let height = Vector::new(0.0, 0.0, layout.standing_height());
    let t_pose: Posture<f64> = xsens::t_pose();
    let placed = layout.place(xsens::facing_forward(), height, &t_pose);
    let mut isb = placed;
    for (segment, placed) in MvnSegment::ALL.into_iter().zip(&mut isb) {
        placed.orientation *= t_pose_from_isb(segment.label());
    }
    for (kind, placed) in [
        ("identity", &placed),
        ("tpose", &placed),
        ("tpose-isb", &isb),
    ] {
        writeln!(
            out,
            "\t\t\t<frame time=\"0\" tc=\"00:00:00:000\" ms=\"0\" type=\"{kind}\">"
        )?;
        pose(out, placed)?;
        writeln!(out, "\t\t\t</frame>")?;
    }
    Ok(())
}

/// A frame of the flight.
pub(super) fn frame(
    out: &mut impl Write,
    description: &Description,
    moving: &MovingFrame,
) -> io::Result<()> {
    let index = moving.index;
    let clock = Clock::at(index, description);
    writeln!(
        out,
        "\t\t\t<frame time=\"{}\" index=\"{index}\" tc=\"{}\" ms=\"{}\" type=\"normal\">",
        clock.since_start_ms,
        clock.time_code,
        description
            .start_unix_ms
            .saturating_add(clock.since_start_ms)
    )?;
    pose(out, &moving.placed)?;
    if description.origin.has_places() {
        vectors(out, "velocity", &moving.velocity)?;
        vectors(out, "acceleration", &moving.acceleration)?;
    }
    vectors(out, "angularVelocity", &moving.angular_velocity)?;
    if let Some(motion) = &moving.centre_of_mass {
        vectors(out, "centerOfMass", motion)?;
    }
    writeln!(out, "\t\t\t</frame>")
}

/// The text after the frames.
pub(super) fn tail(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "\t\t</frames>\n\t</subject>\n</mvnx>")
}

fn pose(out: &mut impl Write, placed: &[Placed; MVN_SEGMENT_COUNT]) -> io::Result<()> {
    write!(out, "\t\t\t\t<orientation>")?;
    let wxyz = placed.iter().flat_map(|segment| {
        let q = segment.orientation;
        [q.w, q.i, q.j, q.k]
    });
    numbers(out, wxyz)?;
    writeln!(out, "</orientation>")?;
    vectors(out, "position", &placed.map(|segment| segment.position))
}

fn vectors(out: &mut impl Write, element: &str, values: &[Vector3<f64>]) -> io::Result<()> {
    write!(out, "\t\t\t\t<{element}>")?;
    numbers(out, values.iter().flat_map(|vector| vector.iter()))?;
    writeln!(out, "</{element}>")
}

/// Writes numbers with six decimals, as MVN does.
fn numbers<N: core::fmt::Display>(
    out: &mut impl Write,
    values: impl IntoIterator<Item = N>,
) -> io::Result<()> {
    let mut separator = "";
    for value in values {
        write!(out, "{separator}{value:.6}")?;
        separator = " ";
    }
    Ok(())
}

/// Escapes text for XML; control characters, which XML cannot contain, become spaces.
fn escaped(text: &str) -> String {
    let plain: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    quick_xml::escape::escape(plain).into_owned()
}

/// The times of a frame in MVN's formats.
struct Clock {
    since_start_ms: u64,
    /// Hours, minutes, seconds (UTC) and the number of the frame within the second.
    time_code: String,
}

impl Clock {
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "times are positive and far below 2^53 ms"
    )]
    fn at(index: u64, description: &Description) -> Self {
        let rate = description.frame_rate;
        let since_start_ms = (index as f64 * 1000.0 / rate).round() as u64;
        let exact_ms = description.start_unix_ms as f64 + index as f64 * 1000.0 / rate;
        let second = (exact_ms / 1000.0) as u64;
        let within = ((exact_ms / 1000.0 - second as f64) * rate) as u64;
        Self {
            since_start_ms,
            time_code: format!(
                "{:02}:{:02}:{:02}:{within:03}",
                second / 3600 % 24,
                second / 60 % 60,
                second % 60
            ),
        }
    }
}
