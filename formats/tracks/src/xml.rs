//! Iterates over the parts of XML files that tracks need.

use bodyflight_io::diagnostic::Problem;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// What a reader is told of a file: an element begins, its text, an element ends. Names have no prefix.
pub(crate) enum Part<'a> {
    Begin(&'a str, &'a BytesStart<'a>),
    Text(&'a str),
    End(&'a str),
}

/// Tells the parts of a file, in order; stops at the first error, which is only one if nothing was usable before it.
pub(crate) fn parts(
    format: &str,
    text: &[u8],
    mut told: impl FnMut(Part<'_>),
) -> Result<(), Problem> {
    let text = String::from_utf8_lossy(text);
    let mut reader = Reader::from_str(&text);
    reader.config_mut().trim_text(true);
    reader.config_mut().expand_empty_elements = true;
    loop {
        match reader.read_event() {
            Ok(Event::Start(element)) => {
                told(Part::Begin(element.local_name().as_ref(), &element));
            }
            Ok(Event::Text(text)) => told(Part::Text(&text)),
            Ok(Event::End(element)) => {
                told(Part::End(element.local_name().as_ref()));
            }
            Ok(Event::Eof) => return Ok(()),
            Ok(_) => {}
            Err(error) => {
                return Err(
                    Problem::bad_input(format!("cannot read this as {format}: {error}")).help(
                        format!("give the {format} file as written by the logger or its software"),
                    ),
                );
            }
        }
    }
}

/// The value of an attribute.
pub(crate) fn attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let attribute = element.try_get_attribute(name).ok()??;
    Some(attribute.value.into_owned())
}
