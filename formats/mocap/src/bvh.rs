//! BVH (Biovision Hierarchy): a tree of joints with offsets, then one line of channel values per frame.
//!
//! A rotation channel rotates about an axis of the joint.

use nalgebra::Vector3;

use crate::timing;
use crate::tree::{Channel, Joint, Tree};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::text::{self, decimal};

/// Most joints in a file, and most channels of a joint, that are accepted.
const JOINT_LIMIT: usize = 10_000;
const CHANNEL_LIMIT: usize = 6;

/// Reads the text of a file.
///
/// # Errors
/// Returns an error if a line does not follow the format.
pub(crate) fn parse(text: &[u8]) -> Result<Tree> {
    // Some programs write a byte-order mark.
    let mut lines = Lines::new(text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text));
    let (joints, channels) = hierarchy(&mut lines)?;
    let (rate, values) = motion(&mut lines, channels)?;
    Ok(Tree {
        joints,
        rate,
        channels,
        values,
    })
}

/// Longest time from one frame to the next (s).
const LONGEST_FRAME: f64 = 1.0;

/// Lines with their numbers; blank lines are skipped.
struct Lines<'a> {
    rest: &'a [u8],
    number: u64,
}

impl<'a> Lines<'a> {
    fn new(rest: &'a [u8]) -> Self {
        Self { rest, number: 0 }
    }

    /// The next line, `None` at the end.
    fn next(&mut self) -> Result<Option<&'a str>> {
        while !self.rest.is_empty() {
            let end = memchr::memchr(b'\n', self.rest).map_or(self.rest.len(), |at| at + 1);
            let (line, rest) = self.rest.split_at(end);
            (self.rest, self.number) = (rest, self.number + 1);
            let line = core::str::from_utf8(line)
                .map_err(|error| self.problem("not a text file").caused_by(error))?;
            if !line.trim().is_empty() {
                return Ok(Some(line));
            }
        }
        Ok(None)
    }

    /// The words of the next line; at the end of the file, an error that says what was expected.
    fn expect(&mut self, what: &str) -> Result<Vec<String>> {
        let words = self
            .next()?
            .map(|line| line.split_whitespace().map(str::to_owned).collect());
        words.ok_or_else(|| {
            let message = format!("the file ends early: expected {what}");
            Problem::bad_input(message).at_line(self.number)
        })
    }

    fn problem(&self, message: impl Into<String>) -> Problem {
        Problem::bad_input(message).at_line(self.number)
    }
}

fn hierarchy(lines: &mut Lines<'_>) -> Result<(Vec<Joint>, usize)> {
    let first = lines.expect("HIERARCHY")?;
    if first.first().map(String::as_str) != Some("HIERARCHY") {
        return Err(lines
            .problem("expected HIERARCHY at the beginning: this is not a BVH file")
            .help("tables of angles, quaternions or points need a mapping with kind = \"angles\", \"quaternions\" or \"points\""));
    }
    let mut joints: Vec<Joint> = Vec::new();
    let mut channels = 0;
    // The joints that enclose the line, `None` for an end site.
    let mut open: Vec<Option<usize>> = Vec::new();
    loop {
        let words = lines.expect("a joint, or MOTION")?;
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        match words[..] {
            ["ROOT" | "JOINT", ref name @ ..] if !name.is_empty() => {
                let parent = open.last().copied().flatten();
                if (words[0] == "ROOT") != joints.is_empty() || joints.len() >= JOINT_LIMIT {
                    return Err(lines.problem(format!("unexpected {}", words.join(" "))));
                }
                open.push(Some(joints.len()));
                joints.push(Joint {
                    name: name.join(" ").trim_end_matches('{').trim_end().to_owned(),
                    parent,
                    offset: Vector3::zeros(),
                    channels: Vec::new(),
                    first: channels,
                });
            }
            ["End", ..] => open.push(None),
            ["{"] => {}
            ["}"] if open.pop().is_some() => {}
            ["OFFSET", x, y, z] => {
                let offset = Vector3::new(number(lines, x)?, number(lines, y)?, number(lines, z)?);
                if let Some(joint) = innermost(&open, &mut joints) {
                    joint.offset = offset;
                }
            }
            ["CHANNELS", count, ref names @ ..] => {
                let Some(joint) = innermost(&open, &mut joints) else {
                    return Err(lines.problem("unexpected CHANNELS outside a joint"));
                };
                if count.parse() != Ok(names.len()) || names.len() > CHANNEL_LIMIT {
                    return Err(
                        lines.problem(format!("expected {count} channels, found {}", names.len()))
                    );
                }
                joint.first = channels;
                joint.channels = (names.iter())
                    .map(|name| channel(lines, name))
                    .collect::<Result<_>>()?;
                channels += names.len();
            }
            ["MOTION"] if open.is_empty() && channels > 0 => return Ok((joints, channels)),
            _ => {
                return Err(lines.problem(format!(
                    "expected a joint, OFFSET, CHANNELS or MOTION, found \"{}\"",
                    words.join(" ").chars().take(40).collect::<String>()
                )));
            }
        }
    }
}

/// The joint that a line belongs to, `None` in an end site.
fn innermost<'a>(open: &[Option<usize>], joints: &'a mut [Joint]) -> Option<&'a mut Joint> {
    joints.get_mut(open.last().copied().flatten()?)
}

fn channel(lines: &Lines<'_>, name: &str) -> Result<Channel> {
    let axis = ["X", "Y", "Z"]
        .iter()
        .position(|axis| name.starts_with(axis));
    match (axis, name.get(1..)) {
        (Some(axis), Some("position")) => Ok(Channel::Position(axis)),
        (Some(axis), Some("rotation")) => Ok(Channel::Rotation(axis)),
        _ => Err(lines.problem(format!(
            "expected a channel like Xposition or Zrotation, found \"{name}\""
        ))),
    }
}

/// A finite number, also with a decimal comma.
fn parsed(text: &str) -> Option<f64> {
    decimal(text).filter(|number| number.is_finite())
}

fn number(lines: &Lines<'_>, text: &str) -> Result<f64> {
    parsed(text).ok_or_else(|| lines.problem(format!("expected a number, found \"{text}\"")))
}

/// Frames per second (Hz), and the numbers of all frames.
fn motion(lines: &mut Lines<'_>, channels: usize) -> Result<(f64, Vec<f64>)> {
    let words = lines.expect("\"Frames:\" and a number")?;
    let frames: Option<usize> = match &words[..] {
        [word, count] if word == "Frames:" => count.parse().ok(),
        _ => None,
    };
    let frames = frames.ok_or_else(|| lines.problem("expected \"Frames:\" and a number"))?;
    let words = lines.expect("\"Frame Time:\" and a time in seconds")?;
    let (frame_time, written) = match &words[..] {
        [frame, time, seconds] if frame == "Frame" && time == "Time:" => {
            (number(lines, seconds)?, seconds.as_str())
        }
        _ => return Err(lines.problem("expected \"Frame Time:\" and a time in seconds")),
    };
    if frame_time <= 0.0 {
        return Err(lines.problem(format!(
            "expected a frame time above 0 s, found {frame_time}"
        )));
    }
    if frame_time > LONGEST_FRAME {
        return Err(lines
            .problem(format!(
                "expected a frame time of at most {LONGEST_FRAME} s, found {frame_time}"
            ))
            .help("it is in seconds: 0.0083333 for 120 frames per second"));
    }
    // Each number takes two bytes at least, whatever number of frames the file states.
    let most = lines.rest.len() / 2 + 1;
    let mut values = Vec::with_capacity(frames.saturating_mul(channels).min(most));
    let mut read = 0;
    while let Some(line) = lines.next()? {
        let (mut count, before) = (0, values.len());
        for number in text::numbers(line) {
            count += 1;
            values.extend(number.ok().or_else(|| parsed(number.err()?)));
        }
        if values.len() - before != count {
            return Err(lines
                .problem("expected numbers only")
                .at(format!("frame {read}")));
        }
        if count != channels {
            let message = format!("expected {channels} numbers, one per channel, found {count}");
            return Err(lines.problem(message).at(format!("frame {read}")));
        }
        read += 1;
    }
    if read != frames {
        let message = format!("expected {frames} frames as stated in \"Frames:\", found {read}");
        return Err(lines
            .problem(message)
            .help("the file was cut off, or its header belongs to another file"));
    }
    if frames < 2 {
        return Err(lines.problem(format!("expected at least 2 frames, found {frames}")));
    }
    Ok((timing::rate_of_interval(frame_time, written), values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    /// Three joints, with channels in three orders, two of them with positions.
    const FILE: &str = "HIERARCHY\nROOT Hips\n{\n  OFFSET 0 90 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n\
        \u{20} JOINT Left Leg\n  {\n    OFFSET 10 -5 2\n    CHANNELS 3 Xrotation Yrotation Zrotation\n\
        \u{20}   JOINT LeftFoot\n    {\n      OFFSET 0 -40 1\n      CHANNELS 6 Xposition Yposition Zposition Yrotation Zrotation Xrotation\n\
        \u{20}     End Site\n      {\n        OFFSET 0 0 10\n      }\n    }\n  }\n}\nMOTION\nFrames: 2\nFrame Time: 0.008333\n\
        1 2 3 10 20 30 40 -50 60 1 2 3 70 -80 90\n0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n";

    /// Positions and orientations (row by row, relative to the rest posture), computed with bvhio 1.5.4.
    const GOLDEN: [([f64; 3], [f64; 9]); 3] = [
        (
            [1.0, 2.0, 3.0],
            [
                0.823_173, -0.163_176, 0.543_838, 0.318_796, 0.925_416, -0.204_874, -0.469_846,
                0.342_02, 0.813_798,
            ],
        ),
        (
            [11.135_28, 0.151_14, -1.780_97],
            [
                0.658_791, -0.691_914, -0.295_379, 0.314_394, 0.609_893, -0.727_452, 0.683_484,
                0.386_374, 0.619_325,
            ],
        ),
        (
            [9.524_11, -0.497_03, 1.533_24],
            [
                0.768_728, 0.518_035, -0.375_095, -0.463_252, 0.046_63, -0.884_998, -0.440_97,
                0.854_086, 0.275_827,
            ],
        ),
    ];

    #[test]
    fn joints_are_where_another_reader_puts_them() {
        let bvh = parse(FILE.as_bytes()).unwrap();
        assert_eq!((bvh.frames(), bvh.joints.len()), (2, 3));
        assert_eq!(bvh.joints[1].name, "Left Leg");
        let placed = bvh.placed(0);
        for (joint, (position, orientation)) in GOLDEN.iter().enumerate() {
            let position = Vector3::from(*position);
            let orientation = Matrix3::from_row_slice(orientation);
            assert!(
                (placed[joint].position - position).norm() < 1e-4,
                "{joint}: {:?}",
                placed[joint]
            );
            assert!(
                (placed[joint].orientation - orientation).norm() < 1e-5,
                "{joint}: {:?}",
                placed[joint]
            );
        }
    }

    #[test]
    fn broken_files_are_refused_with_the_line() {
        for (text, parts) in [
            ("time_s,x\n0,1\n".to_owned(), ["line 1", "HIERARCHY"]),
            (
                FILE.replace("OFFSET 10 -5 2", "OFFSET 10 -5"),
                ["line 8", "OFFSET 10 -5"],
            ),
            (
                FILE.replace("CHANNELS 3 X", "CHANNELS 2 X"),
                ["line 9", "expected 2 channels"],
            ),
            (
                FILE.replace(
                    "Xrotation Yrotation Zrotation\n",
                    "Xrotation Yrotation Wrotation\n",
                ),
                ["line 9", "Wrotation"],
            ),
            (
                FILE.replace("Frames: 2", "Frames: 3"),
                ["line 25", "expected 3 frames"],
            ),
            (FILE.replace("0.008333", "0"), ["line 23", "above 0 s"]),
            (
                FILE.replace("10 20 30", "10 20"),
                ["line 24", "frame 0: expected 15 numbers"],
            ),
            (
                FILE.replace("10 20 30", "10 nan 30"),
                ["line 24", "numbers only"],
            ),
            (
                FILE.replace(FILE.split("MOTION").nth(1).unwrap(), ""),
                ["line", "ends early"],
            ),
        ] {
            let problem = parse(text.as_bytes()).unwrap_err();
            let said = format!("line {}: {problem}", problem.line.unwrap());
            for part in parts {
                assert!(said.contains(part), "{said}\nlacks {part}");
            }
        }
    }
}
