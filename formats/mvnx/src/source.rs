//! Between a file and the XML parser: checks the first bytes, and limits the size of each event.

use std::io::{self, BufRead, Cursor, Read};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;

/// Longest single XML event (bytes); the longest of a recording, 92 numbers, is below 2 KiB.
const EVENT_LIMIT: usize = 1 << 20;
/// Most bytes passed to the parser at once, so that the limit also holds for inputs that are entirely in memory.
const CHUNK: usize = 1 << 16;
/// Bytes examined to recognise files that are not XML.
const HEAD: usize = 2048;

/// A buffered input. Its kind is not a parameter of the reader: as such, the reader would be compiled in each crate that
/// uses it, some of which are compiled for size.
pub(super) type Bytes<'a> = Box<dyn BufRead + Send + 'a>;

/// Refuses input that is recognisably not XML in UTF-8, and puts the bytes that were examined back.
pub(super) fn sniff(
    mut input: Bytes<'_>,
    is_container: bool,
) -> core::result::Result<Result<Bytes<'_>>, io::Error> {
    let mut head = Vec::with_capacity(HEAD);
    Read::by_ref(&mut input)
        .take(HEAD as u64)
        .read_to_end(&mut head)?;
    Ok(match foreign_content(&head, is_container) {
        Some(problem) => Err(problem),
        None => Ok(Box::new(Cursor::new(head).chain(input))),
    })
}

/// Identifies content by its first bytes, `None` for text that may be XML.
fn foreign_content(head: &[u8], is_container: bool) -> Option<Problem> {
    const UNPACK: &str = "unpack it and give the .mvnx file inside";
    const UTF_8: &str = "save it as UTF-8, as MVN does";
    let problem = |message: &str, help: &str| Some(Problem::bad_input(message).help(help));
    // The container of MVN: a header of 128 bytes, then frames of the suit's bus.
    let container = head.starts_with(&[0x42, 0x00, 0x42, 0x00]) || is_container;
    let text = head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head);
    let first = text.iter().find(|byte| !byte.is_ascii_whitespace());
    if container && first != Some(&b'<') {
        problem(
            "this is the proprietary .mvn container, which only MVN can read",
            "open it in MVN and export it as .mvnx",
        )
    } else if head.starts_with(&[0x1F, 0x8B]) {
        problem("this is a gzip archive, not XML", UNPACK)
    } else if head.starts_with(b"PK") {
        problem("this is a zip archive, not XML", UNPACK)
    } else if head.starts_with(&[0xFF, 0xFE])
        || head.starts_with(&[0xFE, 0xFF])
        || head.starts_with(b"<\0")
        || head.starts_with(b"\0<")
    {
        problem("this file is UTF-16 text; MVNX is UTF-8", UTF_8)
    } else if head.starts_with(b"version https://git-lfs") {
        problem(
            "this is a Git LFS pointer, not the recording itself",
            "fetch the content with `git lfs pull`",
        )
    } else {
        let other = FileKind::Recording.mistaken(FileKind::of_head(head));
        other.or_else(|| match first {
            Some(b'<') => None,
            _ => problem(
                "this is not an XML file: it does not begin with `<`",
                FileKind::Recording.got(),
            ),
        })
    }
}

/// An input that counts lines and refuses endless events.
pub(super) struct LimitedInput<'a> {
    input: Bytes<'a>,
    used: usize,
    line: u64,
    at_end: bool,
}

impl<'a> LimitedInput<'a> {
    pub(super) fn new(input: Bytes<'a>) -> Self {
        Self {
            input,
            used: 0,
            line: 1,
            at_end: false,
        }
    }

    /// Starts a new event.
    pub(super) fn next_event(&mut self) {
        self.used = 0;
    }

    /// Line of the next byte, from 1.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// Whether the parser has been told that the input ended.
    pub(super) fn at_end(&self) -> bool {
        self.at_end
    }

    /// Whether the current event exceeds the limit.
    pub(super) fn is_over(&self) -> bool {
        self.used >= EVENT_LIMIT
    }
}

impl BufRead for LimitedInput<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.is_over() {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let bytes = self.input.fill_buf()?;
        self.at_end = bytes.is_empty();
        Ok(&bytes[..bytes.len().min(CHUNK)])
    }

    fn consume(&mut self, amount: usize) {
        if amount == 0 {
            return;
        }
        // The bytes are buffered already, so this neither reads nor fails.
        if let Ok(bytes) = self.input.fill_buf() {
            let seen = &bytes[..amount.min(bytes.len())];
            self.line += memchr::memchr_iter(b'\n', seen).count() as u64;
        }
        self.used = self.used.saturating_add(amount);
        self.input.consume(amount);
    }
}

impl Read for LimitedInput<'_> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let amount = self.fill_buf()?.read(into)?;
        self.consume(amount);
        Ok(amount)
    }
}
