//! A recording held in memory for a comparison, at a rate that bounds its size.

use bodyflight_core::Posture;
use bodyflight_core::math::wrap_angle;
use bodyflight_core::observation::Observation;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{FlightFrame, Options, Warning};
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;

/// Highest rate at which recordings are compared (Hz).
const RATE: f64 = 60.0;
/// Most frames kept of a recording; the rate is halved until they are enough.
const FRAMES: usize = 36_000;

/// A recording in memory.
#[derive(Debug, Clone)]
pub struct Track {
    /// Readable name.
    pub name: String,
    /// What is known of the flight.
    pub flight: Flight,
    /// Frames, evenly thinned out.
    pub frames: Vec<FlightFrame>,
    /// What is observed in each frame.
    pub seen: Vec<Observation<f64>>,
    /// Frames read.
    pub read: u64,
    /// Time between frames as recorded, and as kept (s).
    pub intervals: [f64; 2],
    /// Inconsistencies of the recording.
    pub warnings: Vec<Warning>,
}

impl Track {
    /// Reads the recording of a flight.
    ///
    /// # Errors
    /// Returns an error if a file is unusable, or if the recording lacks velocities or lasts less than a second.
    pub fn read(
        name: &str,
        flight: &Flight,
        options: Options,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self> {
        let mut source = flight.open(options)?;
        let mut frames: Vec<FlightFrame> = Vec::new();
        let (mut read, mut due, mut apart) = (0_u64, f64::NEG_INFINITY, 1.0 / RATE);
        let (mut last, mut shortest) = (f64::NAN, f64::INFINITY);
        for frame in source.by_ref() {
            let frame = frame?;
            read += 1;
            if frame.time > last {
                shortest = shortest.min(frame.time - last);
            }
            last = frame.time;
            if read.is_multiple_of(1024) {
                progress(frame.time);
                interrupt::check()?;
            }
            // Some slack, since the rates need not divide evenly.
            if frame.time < due - 1e-3 {
                continue;
            }
            due = (due + apart).max(frame.time + 0.5 * apart);
            frames.push(frame);
            if frames.len() > FRAMES {
                frames = frames.into_iter().step_by(2).collect();
                apart *= 2.0;
                due = frames.last().map_or(due, |frame| frame.time + apart);
            }
        }
        let in_file = |problem: Problem| problem.in_file(&flight.recording);
        let seen = frames
            .iter()
            .map(|frame| Ok(Observation::of(&frame.motion()?)))
            .collect::<Result<Vec<_>>>()
            .map_err(in_file)?;
        let span = match (frames.first(), frames.last()) {
            (Some(first), Some(last)) => last.time - first.time,
            _ => 0.0,
        };
        if span < 1.0 {
            let message = format!("expected a recording of at least 1 s, found {span:.2} s");
            return Err(in_file(Problem::bad_input(message)));
        }
        let kept = span / (frames.len() - 1) as f64;
        Ok(Self {
            name: name.to_owned(),
            flight: flight.clone(),
            frames,
            seen,
            read,
            intervals: [shortest.min(kept), kept],
            warnings: source.warnings(),
        })
    }

    /// First and last time (s).
    pub fn span(&self) -> [f64; 2] {
        [self.frames.first(), self.frames.last()].map(|frame| frame.map_or(0.0, |frame| frame.time))
    }

    /// Frames between two times (s).
    pub fn between(&self, from: f64, to: f64) -> &[FlightFrame] {
        let place = |time: f64| self.frames.partition_point(|frame| frame.time < time);
        self.frames
            .get(place(from - 1e-9)..place(to + 1e-9))
            .unwrap_or(&[])
    }

    /// The frames around a time (s), and its share of the way from one to the other.
    fn around(&self, time: f64) -> (usize, usize, f64) {
        let last = self.frames.len() - 1;
        let after = self.frames.partition_point(|frame| frame.time <= time);
        let (from, to) = (after.saturating_sub(1), after.min(last));
        let [begin, end] = [from, to].map(|frame| self.frames[frame].time);
        let share = if end > begin {
            ((time - begin) / (end - begin)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (from, to, share)
    }

    /// The posture at a time (s).
    pub fn posture(&self, time: f64) -> Posture<f64> {
        let (from, to, share) = self.around(time);
        let [from, to] = [from, to].map(|frame| &self.frames[frame].posture);
        from.interpolated(to, share)
    }

    /// A channel at a time (s).
    pub fn channel(&self, channel: Channel, time: f64) -> f64 {
        let (from, to, share) = self.around(time);
        let [from, to] = [from, to].map(|frame| channel.value(&self.seen[frame]));
        let step = to - from;
        let step = if channel.is_angle() {
            wrap_angle(step)
        } else {
            step
        };
        let value = from + share * step;
        if channel.is_angle() {
            wrap_angle(value)
        } else {
            value
        }
    }

    /// Mean turn rate between two times (rad/s).
    pub fn turn_between(&self, from: f64, to: f64) -> f64 {
        let inside = self.frames.iter().zip(&self.seen);
        let inside = inside.filter(|(frame, _)| (from..=to).contains(&frame.time));
        let (sum, count) = inside.fold((0.0, 0.0), |(sum, count), (_, seen)| {
            (sum + seen.yaw_rate, count + 1.0)
        });
        sum / f64::max(count, 1.0)
    }

    /// A number of each frame, averaged over this time (s) around it.
    pub fn smoothed(&self, over: f64, value: impl Fn(&Observation<f64>) -> f64) -> Vec<f64> {
        let values: Vec<f64> = self.seen.iter().map(value).collect();
        averaged(&values, self.half(over))
    }

    /// Half as many frames as this time (s) takes.
    pub fn half(&self, over: f64) -> usize {
        whole(0.5 * over / self.intervals[1])
    }
}

/// Each value averaged with this many before and after it; fewer at the ends.
pub(super) fn averaged(values: &[f64], half: usize) -> Vec<f64> {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for value in values {
        sum += value;
        sums.push(sum);
    }
    (0..values.len())
        .map(|k| {
            let half = half.min(k).min(values.len() - 1 - k);
            (sums[k + half + 1] - sums[k - half]) / (2 * half + 1) as f64
        })
        .collect()
}

/// A count from a number that is not negative.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of frames"
)]
pub(super) fn whole(number: f64) -> usize {
    number.max(0.0).round() as usize
}
