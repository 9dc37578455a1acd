//! The clock of a recording: the frame rate of the header, the times of the frames, and frames that repeat others.

use super::plausibility::SAME;

/// Fewest frames for which rates are compared.
const LEAST_FRAMES: u64 = 10;
/// Largest relative difference between the rate of the frame times, written in whole milliseconds, and the frame rate.
const TOLERANCE: f64 = 0.03;
/// Share of their difference within which the motion agrees with one of two rates.
const NEAR: f64 = 0.3;
/// Change of either between two frames of a body that moves, well above the last digit of a file.
const MOVES: f64 = 5e-5;
/// Share of repeated frames above which a recording was made at a lower rate than it states.
pub const REPEATED: f64 = 0.1;
/// Share of repeated frames above which it lost some.
pub const LOST: f64 = 0.01;

/// What has been seen of the clock.
#[derive(Debug, Clone, Default)]
pub(super) struct Clock {
    frame_rate: f64,
    /// Written time (ms or s) of the first and the last frame that have one, with their indices.
    written: Option<[(u64, f64); 2]>,
    /// Frames whose written time is before that of the frame before, and index and time (s) of the first.
    backwards: u64,
    first_backwards: Option<(u64, f64)>,
    /// Frames, and those that repeat the one before although the body moves.
    frames: u64,
    repeated: u64,
    is_moving: bool,
    first_repeated: Option<(u64, f64)>,
}

impl Clock {
    pub(super) fn new(frame_rate: f64) -> Self {
        Self {
            frame_rate,
            ..Self::default()
        }
    }

    /// Takes a good frame: index, time (s), written time, and the largest change since the one before, of a component of
    /// a quaternion or of the place of the pelvis (m); none for the first.
    pub(super) fn see(
        &mut self,
        (index, time): (u64, f64),
        written: Option<f64>,
        change: Option<f64>,
    ) {
        if let Some(written) = written {
            let here = (index, written);
            if self.written.is_some_and(|[_, (_, last)]| written < last) {
                self.backwards += 1;
                self.first_backwards.get_or_insert((index, time));
            }
            self.written = Some([self.written.map_or(here, |[first, _]| first), here]);
        }
        self.frames += 1;
        if let Some(change) = change {
            if change < SAME {
                if self.is_moving {
                    self.repeated += 1;
                    self.first_repeated.get_or_insert((index, time));
                }
                // A body at rest repeats itself too: each repetition needs a motion before it.
                self.is_moving = false;
            } else {
                self.is_moving = change > MOVES;
            }
        }
    }

    /// Frames per second according to the frame times, if they disagree with the header, and the frame that shows it.
    fn written_rate(&self) -> Option<(u64, f64)> {
        let [(first, from), (last, to)] = self.written?;
        if last < first + LEAST_FRAMES || to <= from {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let frames = (last - first) as f64;
        // MVN writes milliseconds; some programs write seconds.
        let rates = [1000.0, 1.0].map(|unit| frames * unit / (to - from));
        let near = |rate: &f64| (rate / self.frame_rate - 1.0).abs() < TOLERANCE;
        (!rates.iter().any(near)).then_some((last, rates[0]))
    }

    /// Frame times that disagree with the header: the frame that shows it, a sentence, and whether the motion contradicts
    /// the header rather than confirm it or tell nothing. `scale` is the ratio of velocities to those of the positions at
    /// the rate of the header.
    pub(super) fn rates(&self, scale: Option<f64>) -> Option<(u64, String, bool)> {
        let (frame, written) = self.written_rate()?;
        let header = self.frame_rate;
        let both =
            format!("the frame times give {written:.1} frames per second, the header {header:.1}");
        let apart = written / header - 1.0;
        // Displacements in one frame are as long as the frame really was.
        let off = |scale: f64, expected: f64| (scale - expected).abs() < NEAR * apart.abs();
        let (why, is_wrong) = match scale {
            Some(scale) if off(scale, 1.0) => (
                "; the header is used, with which positions and velocities agree",
                false,
            ),
            Some(scale) if off(scale, written / header) => (
                ", and positions and velocities agree with the frame times: set frameRate in the header",
                true,
            ),
            _ => ("; the header is used", false),
        };
        Some((frame, both + why, is_wrong))
    }

    /// Frame times that are all the same, and the last frame.
    pub(super) fn stands(&self) -> Option<(u64, String)> {
        let [(first, from), (last, to)] = self.written?;
        let stands =
            last >= first + LEAST_FRAMES && (to - from).abs() < f64::EPSILON && self.backwards == 0;
        stands.then(|| {
            let message = "the frame times do not advance; the frame rate of the header is used";
            (last, message.to_owned())
        })
    }

    /// Frame times that run backwards, and the frame that shows it.
    pub(super) fn backwards(&self) -> Option<(u64, String)> {
        let (index, time) = self.first_backwards?;
        Some((
            index,
            format!(
                "the frame times run backwards {} times, first at {time:.3} s; the order of the frames and the frame rate of the header are used",
                self.backwards
            ),
        ))
    }

    /// Frames that repeat the one before while the body moves: the first, its time (s), a sentence, and whether they are so
    /// many that the recording is not what it says.
    pub(super) fn repetitions(&self) -> Option<(u64, f64, String, bool)> {
        let (index, time) = self.first_repeated?;
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let share = self.repeated as f64 / self.frames.max(1) as f64;
        let is_slower = share > REPEATED;
        (self.frames >= LEAST_FRAMES && share > LOST).then(|| {
            let why = if is_slower {
                format!(
                    "recorded at about {:.0} frames a second and written at {:.0}",
                    self.frame_rate * (1.0 - share),
                    self.frame_rate
                )
            } else {
                "frames were lost and filled".to_owned()
            };
            let message = format!(
                "{} of {} frames repeat the one before while the body moves: {why}",
                self.repeated, self.frames
            );
            (index, time, message, is_slower)
        })
    }
}
