//! What the header of a file says of its rows, which say it too.

/// Relative difference of two rates of one file that no rounding explains: 30 for 29.97 Hz is 0.001.
const RATES_APART: f64 = 0.02;

/// What a header says of the rows after it, which repeat it in another form.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Header {
    /// Frames per second (Hz), with the name of the field.
    pub(crate) rate: Option<(&'static str, f64)>,
    /// Number of frames.
    pub(crate) frames: Option<u64>,
    /// Number of frames for which the file has bytes, if it is not that of the rows.
    pub(crate) found: Option<u64>,
    /// What else contradicts itself in the file.
    pub(crate) contradictions: Vec<String>,
}

impl Header {
    /// What contradicts frames at this rate (Hz).
    pub(crate) fn other_rate(&self, rate: f64) -> Option<String> {
        // Programs leave it at zero.
        let (field, said) = self.rate.filter(|(_, said)| *said > 0.0)?;
        let is_same = (said / rate - 1.0).abs() <= RATES_APART;
        (!is_same).then(|| {
            format!(
                "{field} is {said} Hz, and the frames are at {rate:.3} Hz: one of them is wrong; rate_hz under [time] in the mapping says which is right"
            )
        })
    }

    /// What contradicts this number of rows: that some are missing, or else that there are more than stated, which no frame
    /// suffers from.
    pub(crate) fn other_frames(&self, rows: u64) -> [Option<String>; 2] {
        let found = self.found.unwrap_or(rows);
        let said = |is_wrong: bool, why: &str| {
            let frames = self.frames.filter(|_| is_wrong)?;
            Some(format!(
                "the header states {frames} frames, and the file has {found}: {why}"
            ))
        };
        let stated = self.frames.unwrap_or(found);
        [
            said(
                stated > found,
                "it was cut off, or its header belongs to another file",
            ),
            said(stated < found, "its header may belong to another file"),
        ]
    }
}
