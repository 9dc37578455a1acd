//! The header of a recording, before its frames: version, subject, skeleton, sensors.

use nalgebra::Vector3;

use super::number;
use super::scanner::{Element, Scanner, Token, shortened};
use bodyflight_io::diagnostic::{Problem, Result};

/// Most entries of any list in the header; the longest list of MVN has 40 (fingers).
const LIST_LIMIT: usize = 128;
/// Most bytes of an element's text that are kept.
const TEXT_LIMIT: usize = 4096;
/// Highest frame rate accepted (Hz); MVN records at up to 240 Hz.
const FRAME_RATE_LIMIT: f64 = 10_000.0;
/// Lowest frame rate accepted (Hz): one posture per second says nothing about a movement.
const LOWEST_FRAME_RATE: f64 = 1.0;

/// Everything before the frames.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Header {
    /// Version of the format, 3 or 4.
    pub version: u32,
    /// Version of MVN that wrote the file.
    pub mvn_version: Option<String>,
    /// Build of MVN that wrote the file.
    pub mvn_build: Option<String>,
    /// Name of the subject.
    pub subject_label: Option<String>,
    /// Frames per second (Hz).
    pub frame_rate: f64,
    /// Date of the recording as written: local time in the language of the recording computer.
    pub recorded: Option<String>,
    /// Sensor configuration, such as `FullBody`.
    pub configuration: Option<String>,
    /// Name of the recording before export.
    pub original_file_name: Option<String>,
    /// Segments in the order of the numbers in a frame.
    pub segments: Vec<SegmentDefinition>,
    /// Names of the sensors in the order of the numbers in a frame.
    pub sensors: Vec<String>,
    /// Number of sensors in each frame, if declared.
    pub sensor_count: Option<usize>,
    /// Joints in the order of the numbers in a frame.
    pub joints: Vec<JointDefinition>,
    /// Number of joints in each frame, if declared.
    pub joint_count: Option<usize>,
    /// Names of the ergonomic joint angles.
    pub ergonomic_angles: Vec<String>,
    /// Names of the foot contacts.
    pub foot_contacts: Vec<String>,
}

/// A segment and the points that are fixed to it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SegmentDefinition {
    /// Name, such as `RightUpperArm`.
    pub label: String,
    /// Joints and landmarks.
    pub points: Vec<PointDefinition>,
}

impl SegmentDefinition {
    /// Position of a point in the axes of the segment, from its origin (m).
    pub fn point(&self, label: &str) -> Option<&Vector3<f64>> {
        let point = self.points.iter().find(|point| point.label == label);
        point.map(|point| &point.position)
    }
}

/// A point of a segment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointDefinition {
    /// Name, such as `jRightElbow`.
    pub label: String,
    /// Position in the axes of the segment, from its origin (m).
    pub position: Vector3<f64>,
}

/// A joint and the two points that it connects.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JointDefinition {
    /// Name, such as `jRightElbow`.
    pub label: String,
    /// Parent and child as `segment/point`.
    pub connectors: [String; 2],
}

impl Header {
    /// Index of a segment among the numbers of a frame.
    pub fn segment_index(&self, label: &str) -> Option<usize> {
        self.segments
            .iter()
            .position(|segment| segment.label == label)
    }

    /// Reads up to and including the start of `<frames>`.
    pub(super) fn read(scanner: &mut Scanner<'_>) -> Result<Self> {
        let mut header = Self::default();
        read_root(scanner, &mut header)?;
        let mut segment_count = None;
        let mut frame_rate = None;
        let mut in_subject = false;
        loop {
            let depth = scanner.depth();
            let element = match scanner.next()? {
                Token::Start(element) => element,
                Token::EndOfFile => return Err(scanner.cut()),
                Token::End(_) if depth <= 2 => break,
                _ => continue,
            };
            let line = element.line;
            match (depth, element.name()) {
                (1, "mvn") => {
                    header.read_program(&element)?;
                    pass(scanner)?;
                }
                (1, "subject") if !in_subject => {
                    in_subject = true;
                    header.read_subject(&element, &mut frame_rate, &mut segment_count)?;
                }
                (2, "segments") if in_subject => header.segments = segments(scanner)?,
                (2, "joints") if in_subject => header.joints = joints(scanner)?,
                (2, "sensors") if in_subject => {
                    header.sensors = labels(scanner, "sensor")?;
                    header.sensor_count = Some(header.sensors.len());
                }
                (2, "ergonomicJointAngles") if in_subject => {
                    header.ergonomic_angles = labels(scanner, "ergonomicJointAngle")?;
                }
                (2, "footContactDefinition") if in_subject => {
                    header.foot_contacts = labels(scanner, "contactDefinition")?;
                }
                (2, "frames") if in_subject => {
                    let counted = header.read_counts(&element)?;
                    header.check(line, frame_rate, [segment_count, counted])?;
                    return Ok(header);
                }
                _ => pass(scanner)?,
            }
        }
        let problem = scanner.problem("the file has no <frames>, so it holds no recording");
        Err(problem.help("export the recording again, with its frames"))
    }

    fn read_program(&mut self, element: &Element<'_>) -> Result<()> {
        element.attributes(|name, value| {
            match name {
                "version" => self.mvn_version = Some(value.to_owned()),
                "build" => self.mvn_build = Some(value.to_owned()),
                _ => {}
            }
            Ok(())
        })
    }

    /// Reads the declared contents of the frames; returns the number of segments.
    fn read_counts(&mut self, element: &Element<'_>) -> Result<Option<usize>> {
        let [mut segments, mut sensors, mut joints] = [None; 3];
        element.attributes(|name, value| {
            match name {
                "segmentCount" => segments = Some(count(value)?),
                "sensorCount" => sensors = Some(count(value)?),
                "jointCount" => joints = Some(count(value)?),
                _ => {}
            }
            Ok(())
        })?;
        let listed = self.joints.len();
        self.joint_count = joints.or((listed > 0).then_some(listed));
        self.sensor_count = sensors.or(self.sensor_count);
        Ok(segments)
    }

    fn read_subject(
        &mut self,
        element: &Element<'_>,
        frame_rate: &mut Option<f64>,
        segment_count: &mut Option<usize>,
    ) -> Result<()> {
        element.attributes(|name, value| {
            match name {
                "label" => self.subject_label = Some(value.to_owned()),
                "recDate" => self.recorded = Some(value.to_owned()),
                "configuration" => self.configuration = Some(value.to_owned()),
                "originalFilename" => self.original_file_name = Some(value.to_owned()),
                "segmentCount" => *segment_count = Some(count(value)?),
                "frameRate" => *frame_rate = Some(rate(value)?),
                _ => {}
            }
            Ok(())
        })
    }

    /// Checks what must hold before a frame can be read.
    fn check(
        &mut self,
        line: u64,
        frame_rate: Option<f64>,
        segment_counts: [Option<usize>; 2],
    ) -> Result<()> {
        let problem = |message: String| Problem::bad_input(message).at_line(line).at("<frames>");
        self.frame_rate = frame_rate.ok_or_else(|| {
            problem("<subject> gives no frameRate, so the frames have no time".into())
                .help("export the recording again, or add frameRate=\"240\" (in Hz) to <subject>")
        })?;
        if self.segments.is_empty() {
            return Err(problem("no <segments> before the frames".into())
                .help("export the recording again, with its segments"));
        }
        for declared in segment_counts.into_iter().flatten() {
            if declared != self.segments.len() {
                let listed = self.segments.len();
                return Err(problem(format!(
                    "segmentCount is {declared}, but <segments> lists {listed}"
                ))
                .help("export the recording again"));
            }
        }
        for declared in [self.sensor_count, self.joint_count].into_iter().flatten() {
            if declared > LIST_LIMIT {
                return Err(problem(format!(
                    "{declared} sensors or joints declared, expected at most {LIST_LIMIT}"
                )));
            }
        }
        for (place, segment) in self.segments.iter().enumerate() {
            if self.segment_index(&segment.label) != Some(place) {
                let label = shortened(&segment.label);
                return Err(problem(format!("segment `{label}` is listed twice")));
            }
        }
        Ok(())
    }
}

/// Reads the root element and its version.
fn read_root(scanner: &mut Scanner<'_>, header: &mut Header) -> Result<()> {
    const SUPPORTED: &str = "export the recording as MVNX version 3 (v3) or 4 (v4)";
    let mut version = None;
    let element = loop {
        match scanner.next()? {
            Token::Start(element) => break element,
            Token::EndOfFile => return Err(scanner.cut()),
            _ => {}
        }
    };
    if element.name() != "mvnx" {
        let name = shortened(element.name());
        let line = element.line;
        return Err(Problem::bad_input(format!(
            "this is XML, but not a recording: the root element is <{name}>, expected <mvnx>"
        ))
        .at_line(line)
        .help("give a recording exported from MVN as .mvnx"));
    }
    element.attributes(|name, value| {
        if name == "version" {
            version = Some(value.trim().to_owned());
        }
        Ok(())
    })?;
    let line = element.line;
    let problem = |message: String| {
        Problem::bad_input(message)
            .at_line(line)
            .at("<mvnx>")
            .help(SUPPORTED)
    };
    header.version = match version.as_deref() {
        Some("3") => 3,
        Some("4") => 4,
        Some(other) => {
            return Err(problem(format!(
                "MVNX version `{}` is not supported, expected v3 or v4",
                shortened(other)
            )));
        }
        None => return Err(problem("no version given, expected v3 or v4".into())),
    };
    Ok(())
}

fn segments(scanner: &mut Scanner<'_>) -> Result<Vec<SegmentDefinition>> {
    list(scanner, "segment", |scanner, label| {
        let mut points = Vec::new();
        loop {
            match scanner.next()? {
                Token::Start(element) if element.name() == "points" => {
                    points = list(scanner, "point", point)?;
                }
                Token::Start(_) => pass(scanner)?,
                Token::End(_) => break,
                Token::EndOfFile => return Err(scanner.cut()),
                _ => {}
            }
        }
        Ok(SegmentDefinition { label, points })
    })
}

/// Reads a point: `<pos_s>` in version 3, `<pos_b>` in version 4.
fn point(scanner: &mut Scanner<'_>, label: String) -> Result<PointDefinition> {
    let mut position = None;
    loop {
        match scanner.next()? {
            Token::Start(element) if matches!(element.name(), "pos_s" | "pos_b") => {
                let place = format!("point {}", shortened(&label));
                let text = scanner.text(TEXT_LIMIT)?;
                let mut numbers = Vec::with_capacity(3);
                let problem = |message| scanner.problem(message).at(place);
                match number::append(&text, 3, &mut numbers) {
                    Ok(3) => position = Some(Vector3::new(numbers[0], numbers[1], numbers[2])),
                    Ok(found) => {
                        return Err(problem(format!("expected 3 numbers, found {found}")));
                    }
                    Err(message) => return Err(problem(message)),
                }
            }
            Token::Start(_) => pass(scanner)?,
            Token::End(_) => break,
            Token::EndOfFile => return Err(scanner.cut()),
            _ => {}
        }
    }
    match position {
        Some(position) => Ok(PointDefinition { label, position }),
        None => Err(scanner
            .problem("expected <pos_b> or <pos_s>, found neither")
            .at(format!("point {}", shortened(&label)))),
    }
}

fn joints(scanner: &mut Scanner<'_>) -> Result<Vec<JointDefinition>> {
    list(scanner, "joint", |scanner, label| {
        let mut connectors = [String::new(), String::new()];
        loop {
            match scanner.next()? {
                Token::Start(element) => match element.name() {
                    "connector1" => connectors[0] = scanner.text(TEXT_LIMIT)?,
                    "connector2" => connectors[1] = scanner.text(TEXT_LIMIT)?,
                    _ => pass(scanner)?,
                },
                Token::End(_) => break,
                Token::EndOfFile => return Err(scanner.cut()),
                _ => {}
            }
        }
        Ok(JointDefinition { label, connectors })
    })
}

fn labels(scanner: &mut Scanner<'_>, entry: &str) -> Result<Vec<String>> {
    list(scanner, entry, |scanner, label| {
        pass(scanner)?;
        Ok(label)
    })
}

/// The entries named `entry` of the element that just started; `read` reads each up to its end.
fn list<T>(
    scanner: &mut Scanner<'_>,
    entry: &str,
    mut read: impl FnMut(&mut Scanner<'_>, String) -> Result<T>,
) -> Result<Vec<T>> {
    let mut entries = Vec::new();
    loop {
        match scanner.next()? {
            Token::Start(element) if element.name() == entry => {
                let mut label = String::new();
                element.attributes(|name, value| {
                    if name == "label" {
                        value.clone_into(&mut label);
                    }
                    Ok(())
                })?;
                if entries.len() >= LIST_LIMIT {
                    return Err(
                        scanner.problem(format!("more than {LIST_LIMIT} <{entry}> elements"))
                    );
                }
                entries.push(read(scanner, label)?);
            }
            Token::Start(_) => pass(scanner)?,
            Token::End(_) => return Ok(entries),
            Token::EndOfFile => return Err(scanner.cut()),
            _ => {}
        }
    }
}

/// Skips an element in the header.
fn pass(scanner: &mut Scanner<'_>) -> Result<()> {
    if scanner.skip_element()? {
        Ok(())
    } else {
        Err(scanner.cut())
    }
}

fn count(value: &str) -> Result<usize> {
    value.trim().parse().map_err(|_| {
        Problem::bad_input(format!(
            "expected a non-negative whole number, found `{}`",
            shortened(value)
        ))
    })
}

fn rate(value: &str) -> Result<f64> {
    match value.trim().parse::<f64>() {
        Ok(rate) if (LOWEST_FRAME_RATE..=FRAME_RATE_LIMIT).contains(&rate) => Ok(rate),
        _ => Err(Problem::bad_input(format!(
            "expected a frame rate of {LOWEST_FRAME_RATE} to {FRAME_RATE_LIMIT} Hz, found `{}`",
            shortened(value)
        ))
        .help("correct frameRate in <subject>; it is a number in Hz")),
    }
}
