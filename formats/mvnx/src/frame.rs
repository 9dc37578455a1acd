//! One frame of a recording.

use super::field::{Field, Fields};

/// Purpose of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrameKind {
    /// A frame of the recording.
    #[default]
    Normal,
    /// Calibration in the N-pose, in version 3.
    Npose,
    /// Calibration in the T-pose.
    Tpose,
    /// All segments with their axes along the global ones.
    Identity,
    /// Calibration in the T-pose with the arm frames of the International Society of Biomechanics.
    TposeIsb,
    /// An unknown kind; skipped and counted.
    Other,
}

impl FrameKind {
    /// Parses the attribute `type`.
    pub fn from_name(name: &str) -> Self {
        match name {
            "normal" => Self::Normal,
            "npose" => Self::Npose,
            "tpose" => Self::Tpose,
            "identity" => Self::Identity,
            "tpose-isb" => Self::TposeIsb,
            _ => Self::Other,
        }
    }
}

/// Why a frame cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Index of the frame.
    pub index: u64,
    /// Line in the file, from 1.
    pub line: u64,
    /// The element at fault.
    pub element: &'static str,
    /// What was found and what was expected.
    pub message: String,
}

/// A frame with the numbers of the selected fields. It is reused from frame to frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Number of the frame in the recording; gaps are lost frames.
    pub index: u64,
    /// Purpose of the frame.
    pub kind: FrameKind,
    /// Line in the file, from 1.
    pub line: u64,
    /// Time as written: in milliseconds, in some files in seconds.
    pub written_time: Option<f64>,
    /// Unix time as written (ms).
    pub unix_time_ms: Option<u64>,
    /// Name of the event marked at this frame.
    pub marker: Option<String>,
    /// Why the frame must not be used, `None` for a good one.
    pub fault: Option<Fault>,
    pub(super) present: Fields,
    pub(super) numbers: [Vec<f64>; Field::ALL.len()],
}

impl Frame {
    /// Numbers of a field, `None` if the frame lacks it or it was not selected.
    pub fn numbers(&self, field: Field) -> Option<&[f64]> {
        self.present
            .contains(field)
            .then(|| self.numbers[field as usize].as_slice())
    }

    pub(crate) fn numbers_mut(&mut self, field: Field) -> Option<&mut [f64]> {
        self.present
            .contains(field)
            .then(|| self.numbers[field as usize].as_mut_slice())
    }

    /// The selected fields that the frame has.
    pub fn present(&self) -> Fields {
        self.present
    }

    /// Three numbers of a field: those of segment `place`, or of the centre of mass for 0.
    pub fn vector(&self, field: Field, place: usize) -> Option<nalgebra::Vector3<f64>> {
        let numbers = self.numbers(field)?.get(3 * place..3 * place + 3)?;
        Some(nalgebra::Vector3::from_column_slice(numbers))
    }

    /// Bytes held by the numbers.
    pub fn capacity_bytes(&self) -> usize {
        let numbers: usize = self.numbers.iter().map(Vec::capacity).sum();
        numbers * size_of::<f64>()
    }

    pub(super) fn clear(&mut self) {
        self.written_time = None;
        self.unix_time_ms = None;
        self.marker = None;
        self.fault = None;
        self.present = Fields::NONE;
    }

    /// Records the first fault of a frame; later ones are ignored.
    pub(super) fn blame(&mut self, line: u64, element: &'static str, message: String) {
        let index = self.index;
        self.fault.get_or_insert(Fault {
            index,
            line,
            element,
            message,
        });
    }
}
