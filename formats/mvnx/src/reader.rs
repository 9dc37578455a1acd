//! The streaming reader: header and calibration first, then frame by frame.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use super::field::{Field, Fields, ReadOptions};
use super::frame::{Frame, FrameKind};
use super::header::Header;
use super::number;
use super::scanner::{Scanner, Token, shortened};
use super::source::{self, Bytes};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

/// Most calibration frames kept; MVN writes two or three.
const CALIBRATION_LIMIT: usize = 16;
/// Most names of unknown elements that are kept.
const UNKNOWN_LIMIT: usize = 64;
/// Longest name of a marker (bytes).
const MARKER_LIMIT: usize = 256;
/// Highest frame index: integers up to it are exact in double precision.
const INDEX_LIMIT: u64 = 1 << 53;
/// Longest gap without frames (s): what follows is not part of the same flight.
const LONGEST_GAP: f64 = 3600.0;

/// Reads a recording frame by frame, in constant memory.
pub struct Reader<'a> {
    scanner: Scanner<'a>,
    path: PathBuf,
    options: ReadOptions,
    header: Header,
    calibration: Vec<Frame>,
    /// The first normal frame, read while looking for calibration frames.
    first: Option<Frame>,
    /// Selected fields of the first good frame, and their counts: later frames must match.
    expected: Option<(Fields, [usize; Field::ALL.len()])>,
    seen: Fields,
    unknown: Vec<String>,
    other_subjects: Vec<String>,
    last_index: Option<u64>,
    good_frames: u64,
    other_frames: u64,
    state: State,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    InFrames,
    Done { truncated: bool },
}

/// How a frame ended.
enum FrameEnd {
    Whole,
    Cut,
}

impl Reader<'static> {
    /// Opens a recording, which may be compressed with gzip or xz, and reads its header and calibration.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or is not a recording of version 3 or 4.
    pub fn open(path: &Path, options: ReadOptions) -> Result<Self> {
        Self::new(input::open(path)?, path, options)
    }
}

impl<'a> Reader<'a> {
    /// Reads header and calibration from any input; `path` names it in messages.
    ///
    /// # Errors
    /// Returns an error if the input cannot be read or is not a recording of version 3 or 4.
    pub fn new(input: impl BufRead + Send + 'a, path: &Path, options: ReadOptions) -> Result<Self> {
        Self::of_bytes(Box::new(input), path, options)
    }

    fn of_bytes(input: Bytes<'a>, path: &Path, options: ReadOptions) -> Result<Self> {
        let is_container = path
            .extension()
            .is_some_and(|extension| extension.eq_ignore_ascii_case("mvn"));
        let input = source::sniff(input, is_container)
            .map_err(|error| Problem::system("read", path, error))?
            .map_err(|problem| problem.in_file(path))?;
        let mut scanner = Scanner::new(input);
        let header = Header::read(&mut scanner).map_err(|problem| problem.in_file(path))?;
        let mut reader = Self {
            scanner,
            path: path.to_path_buf(),
            options,
            header,
            calibration: Vec::new(),
            first: None,
            expected: None,
            seen: Fields::NONE,
            unknown: Vec::new(),
            other_subjects: Vec::new(),
            last_index: None,
            good_frames: 0,
            other_frames: 0,
            state: State::InFrames,
        };
        let mut frame = Frame::default();
        reader.first = reader.advance(&mut frame)?.then_some(frame);
        Ok(reader)
    }

    /// The header before the frames.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The input's name in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Calibration frames read so far; those before the first normal frame are available from the start.
    pub fn calibration(&self) -> &[Frame] {
        &self.calibration
    }

    /// Names of the elements seen in normal frames so far, selected or not.
    pub fn elements(&self) -> Vec<String> {
        let known = self.seen.iter().map(|field| field.element().to_owned());
        known.chain(self.unknown.iter().cloned()).collect()
    }

    /// Frames that were neither normal nor for calibration.
    pub fn other_frames(&self) -> u64 {
        self.other_frames
    }

    /// Names of further subjects in the file, known at its end; only the first is read.
    pub fn other_subjects(&self) -> &[String] {
        &self.other_subjects
    }

    /// Whether the file ended too early (known at the end, with [`ReadOptions::allow_truncated`]).
    pub fn is_truncated(&self) -> bool {
        self.state == State::Done { truncated: true }
    }

    /// Bytes held for parsing, to check that they do not grow.
    pub fn buffered_bytes(&self) -> usize {
        self.scanner.buffered_bytes()
    }

    /// Reads the next normal frame into `frame`; false at the end.
    ///
    /// A frame with unusable numbers is returned with its [`Frame::fault`]: the caller decides whether to continue.
    ///
    /// # Errors
    /// Returns an error if the file is not well-formed, ends too early, or its frames are out of order.
    pub fn next_frame(&mut self, frame: &mut Frame) -> Result<bool> {
        if let Some(first) = self.first.take() {
            *frame = first;
            return Ok(true);
        }
        self.advance(frame)
    }

    fn advance(&mut self, frame: &mut Frame) -> Result<bool> {
        if self.state != State::InFrames {
            return Ok(false);
        }
        let result = self.advance_in_frames(frame);
        if result.is_err() {
            self.state = State::Done { truncated: false };
        }
        result.map_err(|problem| problem.in_file(&self.path))
    }

    fn advance_in_frames(&mut self, frame: &mut Frame) -> Result<bool> {
        loop {
            match self.scanner.next()? {
                Token::Start(element) if element.name() == "frame" => {
                    frame.clear();
                    frame.line = element.line;
                    let (mut index, mut kind) = (None, None);
                    element.attributes(|name, value| {
                        match name {
                            "index" => index = Some(value.trim().to_owned()),
                            "time" => frame.written_time = value.trim().parse().ok(),
                            "ms" => frame.unix_time_ms = value.trim().parse().ok(),
                            "type" => kind = Some(FrameKind::from_name(value)),
                            _ => {}
                        }
                        Ok(())
                    })?;
                    frame.kind = kind.ok_or_else(|| {
                        Problem::bad_input("a frame without `type`: it may be a calibration frame")
                            .at_line(frame.line)
                            .help("mark the frames of the recording with type=\"normal\"")
                    })?;
                    if frame.kind == FrameKind::Normal {
                        self.place(frame, index.as_deref())?;
                    }
                    if let FrameEnd::Cut = self.read_fields(frame)? {
                        return self.cut();
                    }
                    match frame.kind {
                        FrameKind::Normal => {
                            self.last_index = Some(frame.index);
                            self.good_frames += u64::from(frame.fault.is_none());
                            return Ok(true);
                        }
                        FrameKind::Other => self.other_frames += 1,
                        _ if self.calibration.len() < CALIBRATION_LIMIT => {
                            self.calibration.push(frame.clone());
                        }
                        _ => self.other_frames += 1,
                    }
                }
                Token::Start(_) => {
                    let whole = self.scanner.skip_element()?;
                    if !whole {
                        return self.cut();
                    }
                }
                Token::End(_) => {
                    return self.read_tail();
                }
                Token::EndOfFile => return self.cut(),
                _ => {}
            }
        }
    }

    /// Sets the index of a normal frame; a missing index is the next one.
    fn place(&self, frame: &mut Frame, index: Option<&str>) -> Result<()> {
        let next = self.last_index.map_or(0, |last| last + 1);
        frame.index = next;
        let Some(text) = index else {
            return Ok(());
        };
        match text.parse::<u64>() {
            Ok(index) if index < INDEX_LIMIT => frame.index = index,
            _ => {
                let found = shortened(text);
                let message = format!("expected a non-negative index, found `{found}`");
                frame.blame(frame.line, "index", message);
            }
        }
        #[expect(clippy::cast_precision_loss, reason = "indices are below 2^53")]
        let missing_s = frame.index.saturating_sub(next) as f64 / self.header.frame_rate;
        let wrong = if frame.index < next {
            "frames must be in chronological order"
        } else if self.last_index.is_some() && missing_s > LONGEST_GAP {
            "expected at most an hour between frames"
        } else {
            return Ok(());
        };
        let found = frame.index;
        Err(
            Problem::bad_input(format!("frame index {found} follows {}: {wrong}", next - 1))
                .at_line(frame.line)
                .at(format!("frame {found}"))
                .help("export the recording again; files joined by hand need new indices"),
        )
    }

    /// Reads the elements of a frame up to its end.
    fn read_fields(&mut self, frame: &mut Frame) -> Result<FrameEnd> {
        let is_normal = frame.kind == FrameKind::Normal;
        loop {
            let element = match self.scanner.next()? {
                Token::Start(element) => element,
                Token::End(_) => break,
                Token::EndOfFile => return Ok(FrameEnd::Cut),
                _ => continue,
            };
            let name = element.name();
            let field = Field::from_element(name);
            let is_marker = is_normal && name == "marker";
            match field {
                Some(field) if is_normal => self.seen = self.seen.with(field),
                None if is_normal
                    && self.unknown.len() < UNKNOWN_LIMIT
                    && !self.unknown.iter().any(|known| known == name) =>
                {
                    self.unknown.push(shortened(name));
                }
                _ => {}
            }
            let whole = match field {
                Some(field) if self.options.fields.contains(field) => {
                    self.read_numbers(field, frame)?
                }
                None if is_marker => {
                    frame.marker = Some(self.scanner.text(MARKER_LIMIT)?);
                    true
                }
                _ => self.scanner.skip_element()?,
            };
            if !whole {
                return Ok(FrameEnd::Cut);
            }
        }
        if is_normal {
            self.compare_to_first(frame);
        }
        Ok(FrameEnd::Whole)
    }

    /// Reads the numbers of a field up to its end; false if the file ends first.
    fn read_numbers(&mut self, field: Field, frame: &mut Frame) -> Result<bool> {
        /// More numbers than any field has.
        const CAPACITY: usize = 4 * 128;
        let element = field.element();
        let line = self.scanner.line();
        let mut found = 0;
        let mut numbers = core::mem::take(&mut frame.numbers[field as usize]);
        numbers.clear();
        let whole = loop {
            match self.scanner.next()? {
                Token::Text(text) => match number::append(&text, CAPACITY, &mut numbers) {
                    Ok(count) => found += count,
                    Err(message) => frame.blame(line, element, message),
                },
                Token::Reference => {
                    frame.blame(line, element, "a character reference among numbers".into());
                }
                Token::Start(_) => {
                    frame.blame(line, element, "an element among numbers".into());
                    if !self.scanner.skip_element()? {
                        break false;
                    }
                }
                Token::End(_) => break true,
                Token::EndOfFile => break false,
                Token::Ignored => {}
            }
        };
        let first = self
            .expected
            .and_then(|(fields, counts)| fields.contains(field).then(|| counts[field as usize]));
        if found > CAPACITY || !field.accepts(found, &self.header, first) {
            let expectation = field.expectation(&self.header, first);
            frame.blame(line, element, format!("{expectation}, found {found}"));
        } else if field == Field::Orientation
            && let Some((place, norm)) = number::off_unit(&numbers)
        {
            let label = shortened(&self.header.segments[place].label);
            frame.blame(
                line,
                element,
                format!("the quaternion of {label} has norm {norm:.3}, expected 1"),
            );
        }
        if let Some(limit) = field.limit()
            && let Some(number) = numbers.iter().find(|number| number.abs() > limit)
        {
            let message = format!("expected numbers within {limit}, found {number:e}");
            frame.blame(line, element, message);
        }
        if frame.present.contains(field) {
            frame.blame(line, element, "the element occurs twice".into());
        }
        frame.numbers[field as usize] = numbers;
        frame.present = frame.present.with(field);
        Ok(whole)
    }

    /// Checks that a frame has the selected fields of the first good frame.
    fn compare_to_first(&mut self, frame: &mut Frame) {
        match self.expected {
            Some((fields, _)) => {
                if let Some(missing) = fields.without(frame.present).iter().next() {
                    let message = "missing, although the first frame has it".to_owned();
                    frame.blame(frame.line, missing.element(), message);
                }
            }
            None if frame.fault.is_none() => {
                let counts = core::array::from_fn(|field| frame.numbers[field].len());
                self.expected = Some((frame.present, counts));
            }
            None => {}
        }
    }

    /// Reads what follows the frames: it only has to be well-formed.
    fn read_tail(&mut self) -> Result<bool> {
        loop {
            let outermost = self.scanner.depth() == 0;
            match self.scanner.next()? {
                Token::Start(_) if outermost => {
                    let message = "a second document follows the recording";
                    let problem = self.scanner.problem(message);
                    return Err(problem.help("write each recording to a file of its own"));
                }
                Token::Start(element)
                    if element.name() == "subject" && self.other_subjects.len() < UNKNOWN_LIMIT =>
                {
                    let mut label = "without a name".to_owned();
                    element.attributes(|name, value| {
                        if name == "label" {
                            label = shortened(value);
                        }
                        Ok(())
                    })?;
                    self.other_subjects.push(label);
                }
                Token::Text(text) if outermost && !text.trim().is_empty() => {
                    return Err(self.scanner.problem("text follows the recording"));
                }
                Token::EndOfFile if outermost => {
                    self.state = State::Done { truncated: false };
                    return Ok(false);
                }
                Token::EndOfFile => return self.cut(),
                _ => {}
            }
        }
    }

    /// The file ends in the middle of the recording.
    fn cut(&mut self) -> Result<bool> {
        if self.options.allow_truncated {
            self.state = State::Done { truncated: true };
            return Ok(false);
        }
        let frames = self.good_frames;
        Err(self
            .scanner
            .problem(format!(
                "the file ends too early, after {frames} good frames"
            ))
            .help("copy or export it again, or allow truncated files to use the frames that are there"))
    }
}
