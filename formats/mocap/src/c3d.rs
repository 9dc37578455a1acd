//! Points of a C3D file (<https://www.c3d.org>).
//!
//! A file has a header of one 512-byte block, parameters in groups, then frames with points and with other
//! measurements, which are skipped. Numbers are in the format of one of three processor types.

use std::collections::BTreeMap;

use crate::header::Header;
use bodyflight_io::diagnostic::{Problem, Result};

/// Size of a block (bytes).
const BLOCK: usize = 512;
/// Second byte of every file.
const KEY: u8 = 0x50;
/// Largest plausible number of points per frame, and frame rate (Hz).
const MOST_POINTS: usize = 10_000;
const FASTEST: f64 = 1e5;
/// Largest count of 16 bits: a file with more frames repeats it.
const FULL_COUNT: f64 = 65_535.0;

/// Whether the bytes start like a C3D file.
pub fn is_c3d(bytes: &[u8]) -> bool {
    bytes.len() >= BLOCK && bytes.get(1) == Some(&KEY) && bytes.first().is_some_and(|&b| b >= 2)
}

/// Processor types, which determine the number format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Processor {
    Intel,
    Dec,
    Mips,
}

impl Processor {
    fn word(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Intel | Self::Dec => u16::from_le_bytes(bytes),
            Self::Mips => u16::from_be_bytes(bytes),
        }
    }

    fn float(self, bytes: [u8; 4]) -> f64 {
        let [a, b, c, d] = bytes;
        f64::from(match self {
            Self::Intel => f32::from_le_bytes(bytes),
            Self::Mips => f32::from_be_bytes(bytes),
            // The two words are swapped, and the exponent is two higher.
            Self::Dec => f32::from_le_bytes([c, d, a, b]) / 4.0,
        })
    }
}

/// The bytes of a file, with its number format.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    bytes: &'a [u8],
    processor: Processor,
}

impl<'a> Bytes<'a> {
    fn some(&self, at: usize, count: usize) -> Result<&'a [u8]> {
        at.checked_add(count)
            .and_then(|end| self.bytes.get(at..end))
            .ok_or_else(|| {
                Problem::bad_input(format!(
                    "the file ends early: expected byte {}, found {} bytes",
                    at.saturating_add(count),
                    self.bytes.len()
                ))
            })
    }

    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N]> {
        let some = self.some(at, N)?;
        let mut array = [0; N];
        array.copy_from_slice(some);
        Ok(array)
    }

    fn byte(&self, at: usize) -> Result<u8> {
        self.array::<1>(at).map(|[byte]| byte)
    }

    fn word(&self, at: usize) -> Result<u16> {
        Ok(self.processor.word(self.array(at)?))
    }

    fn float(&self, at: usize) -> Result<f64> {
        Ok(self.processor.float(self.array(at)?))
    }

    /// Text without its padding.
    fn text(&self, at: usize, count: usize) -> Result<String> {
        let text = String::from_utf8_lossy(self.some(at, count)?).into_owned();
        Ok(text.trim_matches(['\0', ' ']).to_owned())
    }
}

/// A parameter of the file: the type, dimensions and offset of its values.
#[derive(Debug, Clone)]
struct Parameter {
    /// -1 characters, 1 bytes, 2 words, 4 floats.
    kind: i8,
    sizes: Vec<usize>,
    at: usize,
}

impl Parameter {
    fn count(&self) -> usize {
        self.sizes.iter().product()
    }

    /// One value as a number; words are unsigned, as counts are.
    fn number(&self, bytes: &Bytes<'_>, place: usize) -> Result<Option<f64>> {
        if place >= self.count() {
            return Ok(None);
        }
        Ok(match self.kind {
            2 => Some(f64::from(bytes.word(self.at + 2 * place)?)),
            4 => Some(bytes.float(self.at + 4 * place)?),
            _ => None,
        })
    }

    fn texts(&self, bytes: &Bytes<'_>) -> Result<Vec<String>> {
        let Some((&length, rest)) = self.sizes.split_first().filter(|_| self.kind == -1) else {
            return Ok(Vec::new());
        };
        let count: usize = rest.iter().product();
        (0..count)
            .map(|k| bytes.text(self.at + k * length, length))
            .collect()
    }
}

/// All parameters, by `GROUP:NAME`.
struct Parameters<'a> {
    bytes: Bytes<'a>,
    found: BTreeMap<String, Parameter>,
    /// The first block after the parameters, from 1.
    end_block: f64,
}

impl<'a> Parameters<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self> {
        let first = usize::from(bytes.first().copied().unwrap_or(2));
        let start = first.saturating_sub(1) * BLOCK;
        let of = |processor| Bytes { bytes, processor };
        let processor = match of(Processor::Intel).byte(start + 3)? {
            84 => Processor::Intel,
            85 => Processor::Dec,
            86 => Processor::Mips,
            other => {
                let message = format!("expected a processor of 84, 85 or 86, found {other}");
                return Err(Problem::bad_input(message).at(format!("byte {}", start + 3)));
            }
        };
        let bytes = of(processor);
        let end = start + usize::from(bytes.byte(start + 2)?) * BLOCK;
        let (mut groups, mut rows) = (BTreeMap::new(), Vec::new());
        let mut at = start + 4;
        while at + 2 < end {
            let length = usize::from(i8::from_le_bytes(bytes.array(at)?).unsigned_abs());
            let group = i8::from_le_bytes(bytes.array(at + 1)?);
            if length == 0 || group == 0 {
                break;
            }
            let name = bytes.text(at + 2, length)?.to_uppercase();
            let link = at + 2 + length;
            let next = usize::from(bytes.word(link)?);
            if group < 0 {
                groups.insert(group.unsigned_abs(), name);
            } else {
                let kind = i8::from_le_bytes(bytes.array(link + 2)?);
                let dimensions = usize::from(bytes.byte(link + 3)?);
                let sizes = bytes.some(link + 4, dimensions)?;
                let parameter = Parameter {
                    kind,
                    sizes: sizes.iter().copied().map(usize::from).collect(),
                    at: link + 4 + dimensions,
                };
                rows.push((group.unsigned_abs(), name, parameter));
            }
            if next == 0 {
                break;
            }
            at = link + next;
        }
        let found = rows.into_iter().filter_map(|(group, name, parameter)| {
            let group = groups.get(&group)?;
            // A parameter that claims more values than the file has bytes is invalid, and so are more texts without any byte.
            let most = parameter.sizes.iter().try_fold(1usize, |product, &size| {
                product
                    .checked_mul(size.max(1))
                    .filter(|count| *count <= bytes.bytes.len())
            });
            most.map(|_| (format!("{group}:{name}"), parameter))
        });
        Ok(Self {
            found: found.collect(),
            bytes,
            end_block: 1.0 + (end / BLOCK) as f64,
        })
    }

    fn number(&self, name: &str, place: usize) -> Result<Option<f64>> {
        let parameter = self.found.get(name);
        parameter.map_or(Ok(None), |found| found.number(&self.bytes, place))
    }

    fn texts(&self, name: &str) -> Result<Vec<String>> {
        let parameter = self.found.get(name);
        parameter.map_or_else(|| Ok(Vec::new()), |found| found.texts(&self.bytes))
    }

    /// One name for each point: a file with more than 255 points continues in `LABELS2` and so on.
    fn labels(&self, points: usize) -> Result<Vec<String>> {
        let mut labels = self.texts("POINT:LABELS")?;
        for more in 2.. {
            let next = self.texts(&format!("POINT:LABELS{more}"))?;
            if next.is_empty() || labels.len() >= points {
                break;
            }
            labels.extend(next);
        }
        let mut names: Vec<String> = Vec::new();
        for k in 0..points {
            let label = labels.get(k).filter(|label| !label.is_empty());
            let name = label.map_or_else(|| format!("point {}", k + 1), Clone::clone);
            let again = names.contains(&name);
            names.push(if again {
                format!("{name} ({})", k + 1)
            } else {
                name
            });
        }
        Ok(names)
    }

    /// Name of the unit of length.
    fn unit(&self) -> Result<Option<String>> {
        let Some(found) = self.found.get("POINT:UNITS") else {
            return Ok(None);
        };
        self.bytes.text(found.at, found.count()).map(Some)
    }

    /// Number of frames that the file claims to have. Counts of 16 bits end at 65 535; beyond them it is the number for
    /// which the file has bytes, `whole`, unless a longer count says otherwise.
    fn frames(&self, whole: usize) -> Result<f64> {
        let short = self.short_frames()?;
        let long = self.number("POINT:LONG_FRAMES", 0)?;
        let long = long.filter(|long| *long >= 1.0).or(self.fields()?);
        let whole = whole as f64;
        Ok(match long {
            Some(long) if long > short => long,
            _ if short >= FULL_COUNT => short.max(whole),
            _ => short,
        })
    }

    /// Number of frames from the first and last field of the trial, counts of 32 bits.
    fn fields(&self) -> Result<Option<f64>> {
        let field = |name: &str| {
            let low = self.number(name, 0)?;
            let high = self.number(name, 1)?;
            Ok::<_, Problem>(low.map(|low| low + 65_536.0 * high.unwrap_or(0.0)))
        };
        let (first, last) = (
            field("TRIAL:ACTUAL_START_FIELD")?,
            field("TRIAL:ACTUAL_END_FIELD")?,
        );
        Ok(first.zip(last).map(|(first, last)| last - first + 1.0))
    }

    /// Number of frames in the counts of 16 bits.
    fn short_frames(&self) -> Result<f64> {
        let [first, last] = [self.bytes.word(6)?, self.bytes.word(8)?].map(f64::from);
        Ok(self
            .number("POINT:FRAMES", 0)?
            .unwrap_or(last - first + 1.0))
    }
}

/// Checks that a number of the file is a count from 1 to `most`.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within its range"
)]
fn count(what: &str, value: f64, most: usize) -> Result<usize> {
    #[expect(clippy::cast_precision_loss, reason = "limits are below 2^53")]
    let fits = (1.0..=most as f64).contains(&value);
    if fits {
        return Ok(value as usize);
    }
    let message = format!("expected 1 to {most} {what}, found {value}");
    Err(Problem::bad_input(message))
}

/// The points in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    /// Names of the points.
    pub names: Vec<String>,
    /// Name of the unit of length, if the file states it.
    pub unit: Option<String>,
    /// Frames per second (Hz), if the file states it.
    pub rate: Option<f64>,
    /// What the header says beside the parameters.
    pub(crate) header: Header,
    /// Positions of the points, frame by frame; NaN if a point was not visible.
    pub places: Vec<[f64; 3]>,
}

impl Points {
    /// Reads the points of all frames.
    ///
    /// # Errors
    /// Returns an error if the file has no points, or ends before its last frame.
    pub fn read(bytes: &[u8]) -> Result<Self> {
        let parameters = Parameters::read(bytes)?;
        let file = parameters.bytes;
        let number = |name: &str, header: f64| {
            Ok::<_, Problem>(parameters.number(name, 0)?.unwrap_or(header))
        };
        let points = number("POINT:USED", f64::from(file.word(2)?))?;
        let points = count("points", points, MOST_POINTS)?;
        // Header and parameters repeat each other, and programs leave one of them at zero.
        let rates = [parameters.number("POINT:RATE", 0)?, Some(file.float(20)?)];
        let is_stated = |rate: &f64| *rate != 0.0;
        let rate = rates.into_iter().flatten().find(is_stated);
        let scale = number("POINT:SCALE", file.float(12)?)?;
        for (name, value, right) in [
            (
                "POINT:RATE",
                rate.unwrap_or(0.0),
                rate.is_none_or(|rate| rate > 0.0 && rate < FASTEST),
            ),
            ("POINT:SCALE", scale, scale.is_normal()),
        ] {
            if !right {
                let message = format!("expected a plausible number, found {value}");
                return Err(Problem::bad_input(message).at(name));
            }
        }
        let starts = [
            parameters.number("POINT:DATA_START", 0)?,
            Some(f64::from(file.word(16)?)),
        ];
        let start = starts.into_iter().flatten().find(|start| *start >= 1.0);
        let start = start.unwrap_or(parameters.end_block);
        let start =
            (count("as the first block of data", start, usize::from(u16::MAX))? - 1) * BLOCK;
        // A negative scale means that the values are floats.
        let size = if scale < 0.0 { 4 } else { 2 };
        let frame = size * (4 * points + usize::from(file.word(4)?));
        let whole = bytes.len().saturating_sub(start) / frame;
        let frames = parameters.frames(whole)?;
        #[expect(clippy::cast_precision_loss, reason = "counts are below 2^53")]
        if frames > whole as f64 {
            let message = format!("the file ends early: expected {frames} frames, found {whole}");
            return Err(Problem::bad_input(message));
        }
        let frames = count("frames", frames, whole)?;
        let place = |at: usize| {
            let value = |k: usize| match size {
                4 => file.float(at + 4 * k),
                _ => Ok(f64::from(file.word(at + 2 * k)?.cast_signed())),
            };
            let unit = if size == 4 { 1.0 } else { scale };
            let place = [value(0)? * unit, value(1)? * unit, value(2)? * unit];
            let seen = value(3)? >= 0.0;
            Ok::<_, Problem>(if seen { place } else { [f64::NAN; 3] })
        };
        let places = (0..frames)
            .flat_map(|row| (0..points).map(move |point| start + row * frame + 4 * size * point));
        // The last block is filled up, and some programs add one.
        let spare = whole.saturating_sub(frames) * frame;
        let found = if spare > 2 * BLOCK { whole } else { frames };
        let header = Header {
            contradictions: Vec::new(),
            rate: Some(("the rate in the header", file.float(20)?)),
            frames: Some(frames as u64),
            found: Some(found as u64),
        };
        Ok(Self {
            names: parameters.labels(points)?,
            unit: parameters.unit()?,
            rate,
            header,
            places: places.map(place).collect::<Result<_>>()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Group, name, type, dimensions and values of a parameter.
    type Row<'a> = (i8, &'a str, i8, &'a [u8], Vec<u8>);
    /// A processor type and its encodings.
    type Numbers = (u8, fn(i16) -> [u8; 2], fn(f32) -> [u8; 4]);

    /// A file with a header, one block of parameters from these rows, and data.
    fn file(processor: u8, rows: &[Row<'_>], data: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0; 2 * BLOCK];
        bytes[0] = 2;
        bytes[1] = KEY;
        bytes[BLOCK + 2] = 1;
        bytes[BLOCK + 3] = processor;
        let mut at = BLOCK + 4;
        let mut put = |piece: &[u8]| {
            bytes[at..at + piece.len()].copy_from_slice(piece);
            at += piece.len();
        };
        put(&[5, 255]);
        put(b"POINT");
        let words = |word: u16| match processor {
            86 => word.to_be_bytes(),
            _ => word.to_le_bytes(),
        };
        put(&words(3));
        put(&[0]);
        for (group, name, kind, sizes, values) in rows {
            put(&[u8::try_from(name.len()).unwrap(), group.cast_unsigned()]);
            put(name.as_bytes());
            let link = u16::try_from(5 + sizes.len() + values.len()).unwrap();
            put(&words(link));
            put(&[kind.cast_unsigned(), u8::try_from(sizes.len()).unwrap()]);
            put(sizes);
            put(values);
            put(&[0]);
        }
        bytes.extend_from_slice(data);
        bytes.resize(bytes.len().next_multiple_of(BLOCK), 0);
        bytes
    }

    /// Two points in two frames, in the number format of a processor.
    fn small((processor, word, float): Numbers, scale: f32) -> Vec<u8> {
        let label = b"hip knee".to_vec();
        let rows: [Row<'_>; 7] = [
            (1, "USED", 2, &[], word(2).to_vec()),
            (1, "FRAMES", 2, &[], word(2).to_vec()),
            (1, "SCALE", 4, &[], float(scale).to_vec()),
            (1, "RATE", 4, &[], float(200.0).to_vec()),
            (1, "DATA_START", 2, &[], word(3).to_vec()),
            (1, "UNITS", -1, &[4], b"mm  ".to_vec()),
            (1, "LABELS", -1, &[4, 2], label),
        ];
        let values = [1, 2, 3, 0, -4, 5, 6, 0, 7, 8, 9, 0, 0, 0, 0, -1];
        let data: Vec<u8> = if scale < 0.0 {
            values.iter().flat_map(|v| float(f32::from(*v))).collect()
        } else {
            values.iter().flat_map(|v| word(*v)).collect()
        };
        file(processor, &rows, &data)
    }

    fn dec(value: f32) -> [u8; 4] {
        let [a, b, c, d] = (value * 4.0).to_le_bytes();
        [c, d, a, b]
    }

    #[test]
    fn points_of_every_processor_are_read() {
        let kinds: [Numbers; 3] = [
            (84, i16::to_le_bytes, f32::to_le_bytes),
            (85, i16::to_le_bytes, dec),
            (86, i16::to_be_bytes, f32::to_be_bytes),
        ];
        for numbers in kinds {
            for scale in [-1.0, 0.5] {
                let points = Points::read(&small(numbers, scale)).unwrap();
                assert_eq!(points.names, ["hip", "knee"]);
                assert_eq!(
                    (points.unit.as_deref(), points.rate),
                    (Some("mm"), Some(200.0))
                );
                let unit = if scale < 0.0 { 1.0 } else { f64::from(scale) };
                let near = |place: [f64; 3], right: [f64; 3]| {
                    let mut pairs = place.into_iter().zip(right);
                    pairs.all(|(value, right)| (value - right * unit).abs() < 1e-9)
                };
                assert!(near(points.places[1], [-4.0, 5.0, 6.0]));
                assert!(near(points.places[2], [7.0, 8.0, 9.0]));
                assert!(points.places[3].iter().all(|v| v.is_nan()));
                assert_eq!(points.places.len(), 4);
            }
        }
    }

    #[test]
    fn what_programs_leave_out_is_taken_from_elsewhere() {
        let good = small((84, i16::to_le_bytes, f32::to_le_bytes), -1.0);
        let place = |name: &[u8]| good.windows(name.len()).position(|w| w == name).unwrap();
        let right = Points::read(&good).unwrap();
        // As text, since a point that was not visible is not equal to itself.
        let said = |points: &Points| format!("{points:?}");
        let mut no_start = good.clone();
        no_start[place(b"DATA_START") + 14] = 0;
        assert_eq!(said(&Points::read(&no_start).unwrap()), said(&right));
        let mut no_rate = good.clone();
        no_rate[place(b"RATE") + 8..][..4].fill(0);
        assert_eq!(Points::read(&no_rate).unwrap().rate, None);
        no_rate[20..24].copy_from_slice(&50.0_f32.to_le_bytes());
        assert_eq!(Points::read(&no_rate).unwrap().rate, Some(50.0));
        // More frames than a count of 16 bits can tell: 70 000 of two points.
        let mut long = good.clone();
        long[place(b"FRAMES") + 10..][..2].fill(0xff);
        let data = good[2 * BLOCK..2 * BLOCK + 64].repeat(35_000);
        long.truncate(2 * BLOCK);
        long.extend(&data);
        assert_eq!(Points::read(&long).unwrap().places.len(), 140_000);
    }

    #[test]
    fn broken_files_are_refused_with_the_reason() {
        let good = small((84, i16::to_le_bytes, f32::to_le_bytes), -1.0);
        assert!(is_c3d(&good));
        let changed = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            Points::read(&bytes).unwrap_err().to_string()
        };
        let place = |name: &[u8]| good.windows(name.len()).position(|w| w == name).unwrap();
        assert!(changed(BLOCK + 3, 7).contains("processor of 84, 85 or 86, found 7"));
        assert!(changed(place(b"USED") + 8, 0).contains("expected 1 to 10000 points, found 0"));
        assert!(changed(place(b"FRAMES") + 11, 9).contains("expected 2306 frames"));
        assert!(changed(place(b"RATE") + 11, 0xC3).contains("POINT:RATE"));
        let cut = Points::read(&good[..2 * BLOCK + 40])
            .unwrap_err()
            .to_string();
        assert!(cut.contains("expected 2 frames, found 1"), "{cut}");
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(
            changes in prop::collection::vec((0..1100usize, any::<u8>()), 1..12),
            end in 0..1536usize,
        ) {
            let mut bytes = small((86, i16::to_be_bytes, f32::to_be_bytes), 0.5);
            for (at, byte) in changes {
                bytes[at] = byte;
            }
            let _ = Points::read(&bytes);
            let _ = Points::read(&bytes[..end.min(bytes.len())]);
        }
    }
}
