//! XML events with line numbers. Refuses every XML feature that a recording does not need.

use std::borrow::Cow;

use quick_xml::events::{BytesDecl, BytesStart, Event};
use quick_xml::{Error, XmlVersion};

use super::source::{Bytes, LimitedInput};
use bodyflight_io::diagnostic::{Kind, Problem, Result};

/// Deepest nesting; a recording has 7.
const DEPTH_LIMIT: usize = 32;
/// Most attributes of an element, and the longest value (bytes).
const ATTRIBUTE_LIMIT: usize = 64;
const ATTRIBUTE_LENGTH: usize = 4096;

/// A relevant event.
pub(super) enum Token<'a> {
    /// An element starts.
    Start(Element<'a>),
    /// The innermost element ends; this many are still open.
    End(usize),
    /// Text, or part of it.
    Text(Cow<'a, str>),
    /// A character reference in text, such as `&amp;`.
    Reference,
    /// Comments and the like.
    Ignored,
    /// The input ends. Inside an element, the file is truncated.
    EndOfFile,
}

/// A start tag.
pub(super) struct Element<'a> {
    tag: BytesStart<'a>,
    pub(super) line: u64,
}

impl Element<'_> {
    /// Name with its prefix, if any.
    pub(super) fn name(&self) -> &str {
        self.tag.name().into_inner()
    }

    /// Calls `take` with each attribute's name and value.
    pub(super) fn attributes(&self, mut take: impl FnMut(&str, &str) -> Result<()>) -> Result<()> {
        let problem = |message: String| {
            Problem::bad_input(message)
                .at_line(self.line)
                .at(format!("<{}>", shortened(self.name())))
        };
        for (count, attribute) in self.tag.attributes().enumerate() {
            let attribute = attribute.map_err(|error| problem(error.to_string()))?;
            let name = attribute.key.into_inner();
            if count >= ATTRIBUTE_LIMIT || attribute.value.len() > ATTRIBUTE_LENGTH {
                return Err(problem(format!(
                    "more than {ATTRIBUTE_LIMIT} attributes, or one longer than {ATTRIBUTE_LENGTH} bytes"
                )));
            }
            let value = attribute
                .normalized_value(XmlVersion::Explicit1_0)
                .map_err(|error| problem(format!("attribute {}: {error}", shortened(name))))?;
            take(name, &value).map_err(|found| {
                let place = format!("<{}>, {}", shortened(self.name()), shortened(name));
                found.at_line(self.line).at(place)
            })?;
        }
        Ok(())
    }
}

/// The parser with its position.
pub(super) struct Scanner<'a> {
    parser: quick_xml::Reader<LimitedInput<'a>>,
    buffer: Vec<u8>,
    depth: usize,
    line: u64,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(input: Bytes<'a>) -> Self {
        let mut parser = quick_xml::Reader::from_reader(LimitedInput::new(input));
        parser.config_mut().expand_empty_elements = true;
        Self {
            parser,
            buffer: Vec::new(),
            depth: 0,
            line: 1,
        }
    }

    /// Line of the latest event, from 1.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// Number of open elements.
    pub(super) fn depth(&self) -> usize {
        self.depth
    }

    /// Bytes held for the current event.
    pub(super) fn buffered_bytes(&self) -> usize {
        self.buffer.capacity()
    }

    /// A problem at the latest event.
    pub(super) fn problem(&self, message: impl Into<String>) -> Problem {
        Problem::bad_input(message).at_line(self.line)
    }

    /// The next event.
    pub(super) fn next(&mut self) -> Result<Token<'_>> {
        self.buffer.clear();
        self.parser.get_mut().next_event();
        let line = self.parser.get_ref().line();
        self.line = line;
        let byte = self.parser.buffer_position();
        let problem = |message: String| {
            Problem::bad_input(format!("{message} (byte {byte} of the file)")).at_line(line)
        };
        let event = match self.parser.read_event_into(&mut self.buffer) {
            Ok(event) => event,
            Err(error) => return refusal(error, self.parser.get_ref(), problem),
        };
        Ok(match event {
            Event::Start(tag) | Event::Empty(tag) => {
                self.depth += 1;
                if self.depth > DEPTH_LIMIT {
                    return Err(problem(format!(
                        "elements nested deeper than {DEPTH_LIMIT} levels"
                    )));
                }
                Token::Start(Element { tag, line })
            }
            Event::End(_) => {
                self.depth = self.depth.saturating_sub(1);
                Token::End(self.depth)
            }
            Event::Text(text) => Token::Text(text.into_inner()),
            Event::CData(text) => Token::Text(text.into_inner()),
            Event::GeneralRef(reference) => {
                check_reference(&reference.into_inner(), problem)?;
                Token::Reference
            }
            Event::DocType(_) => {
                return Err(problem("unexpected DOCTYPE".into()).help(
                    "remove it: recordings do not need one, and entities are never expanded",
                ));
            }
            Event::Decl(declaration) => {
                check_encoding(&declaration, problem)?;
                Token::Ignored
            }
            Event::Comment(_) | Event::PI(_) => Token::Ignored,
            Event::Eof => Token::EndOfFile,
        })
    }

    /// Skips the element that just started, whatever it contains.
    ///
    /// Returns false if the file ends first.
    pub(super) fn skip_element(&mut self) -> Result<bool> {
        let outside = self.depth.saturating_sub(1);
        loop {
            match self.next()? {
                Token::End(depth) if depth == outside => return Ok(true),
                Token::EndOfFile => return Ok(false),
                _ => {}
            }
        }
    }

    /// Text of the element that just started, without that of elements inside it; at most `limit` bytes.
    pub(super) fn text(&mut self, limit: usize) -> Result<String> {
        let mut text = String::new();
        loop {
            match self.next()? {
                Token::End(_) => return Ok(text.trim().to_owned()),
                Token::Start(_) => {
                    let whole = self.skip_element()?;
                    if !whole {
                        return Err(self.cut());
                    }
                }
                Token::Text(part) => {
                    // Cut between characters, never inside one.
                    let room = limit.saturating_sub(text.len());
                    text.extend(
                        part.char_indices()
                            .take_while(|(at, c)| at + c.len_utf8() <= room)
                            .map(|(_, c)| c),
                    );
                }
                Token::EndOfFile => return Err(self.cut()),
                _ => {}
            }
        }
    }

    /// The file ends too early.
    pub(super) fn cut(&self) -> Problem {
        self.problem("the file ends here, before the header is complete")
            .help("copy or export the recording again")
    }
}

/// Translates a parser error: the file ended, or cannot be read any further.
fn refusal<'t>(
    error: Error,
    input: &LimitedInput<'_>,
    problem: impl Fn(String) -> Problem,
) -> Result<Token<'t>> {
    Err(match error {
        // All of these mean that the input ended inside a construct.
        Error::Syntax(_) | Error::IllFormed(_) | Error::Encoding(_)
            if input.at_end() && !input.is_over() =>
        {
            return Ok(Token::EndOfFile);
        }
        Error::Io(_) if input.is_over() => problem("a single element or text over 1 MiB".into())
            .help("this is not a recording, or it is damaged here"),
        Error::Io(error) => Problem {
            kind: Kind::System,
            ..problem("cannot read any further".into()).caused_by(error)
        },
        Error::Encoding(error) => problem("not valid UTF-8".into())
            .help("save the file as UTF-8, as MVN does")
            .caused_by(error),
        error => problem("not well-formed XML".into())
            .help("export the recording again")
            .caused_by(error),
    })
}

/// Refuses any reference that is not to a character.
fn check_reference(name: &str, problem: impl Fn(String) -> Problem) -> Result<()> {
    let predefined = ["amp", "lt", "gt", "apos", "quot"].contains(&name);
    if predefined || name.starts_with('#') {
        return Ok(());
    }
    Err(problem(format!(
        "unexpected entity reference `&{};`",
        shortened(name)
    )))
}

/// Refuses a declared encoding that is not UTF-8.
fn check_encoding(declaration: &BytesDecl<'_>, problem: impl Fn(String) -> Problem) -> Result<()> {
    match declaration.encoding() {
        Some(Ok(encoding))
            if !["utf-8", "utf8", "us-ascii"].contains(&&*encoding.to_ascii_lowercase()) =>
        {
            Err(problem(format!(
                "declared encoding `{}`, expected UTF-8",
                shortened(&encoding)
            ))
            .help("save the file as UTF-8, as MVN does"))
        }
        _ => Ok(()),
    }
}

/// Shortens text from a file and makes it printable, for messages.
pub(super) fn shortened(text: &str) -> String {
    const LENGTH: usize = 40;
    let mut shown: String = text
        .chars()
        .take(LENGTH)
        .flat_map(char::escape_debug)
        .collect();
    if text.chars().nth(LENGTH).is_some() {
        shown.push_str("...");
    }
    shown
}
