//! Whether a file has what a flight needs: all segments, and where they are.

use std::collections::VecDeque;

use bodyflight_core::SegmentArray;
use bodyflight_io::diagnostic::{Problem, Result};

use crate::xsens::MvnSegment;
use crate::{Field, Frame, Header};

/// Position of each of the model's segments among those of a frame.
pub(super) type Places = SegmentArray<usize>;

/// Finds the model's segments in a file.
pub(super) fn places(header: &Header) -> Result<Places> {
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

/// Checks that orientation and position are present in some of the first frames; faults of single frames are handled
/// later.
pub(super) fn check_fields(first: &Frame, frames: &VecDeque<Frame>) -> Result<()> {
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
