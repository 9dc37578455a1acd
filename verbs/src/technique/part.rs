//! The part of a recording that is analysed.

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{FlightFrame, Options, Warning};
use bodyflight_replay::flight::Flight;

/// Frames this close (s) to the one before are left out: limbs move slower.
const SPACING: f64 = 1.0 / 61.0;
/// Shortest part that is analysed (s), and fewest frames.
const SHORTEST: f64 = 0.5;
const FEWEST: usize = 20;
/// Turn rate that counts as a turn (rad/s), and time around it (s) that belongs to it.
const TURNING: f64 = 0.5;
const AROUND: f64 = 1.0;

/// What to analyse.
#[derive(Debug, Clone, Copy, Default)]
pub struct Settings {
    /// From when (s since frame 0).
    pub from: Option<f64>,
    /// Until when (s).
    pub to: Option<f64>,
    /// Only around turns faster than 0.5 rad/s.
    pub turns: bool,
    /// Joint error per axis (rad); otherwise the flight's tolerance of joints.
    pub joint_error: Option<f64>,
}

/// The frames used.
pub(super) struct Used {
    pub(super) frames: Vec<FlightFrame>,
    /// Time that they cover (s).
    pub(super) duration: f64,
    /// What is implausible in the recording.
    pub(super) warnings: Vec<Warning>,
}

/// The frames asked for.
pub(super) fn used(flight: &Flight, settings: &Settings, options: Options) -> Result<Used> {
    let bad = |message: String| Problem::bad_input(message).in_file(&flight.recording);
    if let (Some(from), Some(to)) = (settings.from, settings.to)
        && from >= to
    {
        return Err(Problem::bad_input(format!(
            "expected --from before --to, found {from} and {to}"
        )));
    }
    let mut all: Vec<FlightFrame> = Vec::new();
    let mut recording = flight.open(options)?;
    for frame in recording.by_ref() {
        let frame = frame?;
        let within = settings.from.is_none_or(|from| frame.time >= from)
            && settings.to.is_none_or(|to| frame.time <= to);
        let spaced = all
            .last()
            .is_none_or(|last| frame.time - last.time >= SPACING);
        if within && spaced {
            all.push(frame);
        }
        if frame.index.is_multiple_of(1024) {
            interrupt::check()?;
        }
    }
    if settings.turns {
        let turning: Vec<f64> = all
            .iter()
            .filter(|frame| {
                let spin = frame.pelvis.angular_velocity;
                spin.is_some_and(|spin| spin.up().abs() > TURNING)
            })
            .map(|frame| frame.time)
            .collect();
        all.retain(|frame| {
            let after = turning.partition_point(|time| *time < frame.time - AROUND);
            turning
                .get(after)
                .is_some_and(|time| *time <= frame.time + AROUND)
        });
        if all.is_empty() {
            return Err(bad(format!(
                "found no turn faster than {TURNING} rad/s; leave out --turns to analyse all frames"
            )));
        }
    }
    let gaps = all.windows(2).map(|pair| pair[1].time - pair[0].time);
    let duration = gaps
        .filter(|gap| *gap < AROUND)
        .fold(0.0, |sum, gap| sum + gap);
    if all.len() < FEWEST || duration < SHORTEST {
        return Err(bad(format!(
            "expected at least {SHORTEST} s and {FEWEST} frames to find patterns in, found {duration:.1} s and {} frames",
            all.len()
        ))
        .help("give --from and --to within the flight, whose length bodyflight inspect says"));
    }
    Ok(Used {
        frames: all,
        duration,
        warnings: recording.warnings(),
    })
}
