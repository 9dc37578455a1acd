//! The analysis of a whole jump: its numbers as a skydiver reads them, and how far they can be trusted.

use bodyflight_core::air::{REFERENCE_HEIGHT, normalised_fall_rate};
use nalgebra::Vector3;

use crate::atmosphere::Atmosphere;
use crate::canopy::circles;
use crate::channels::Motion;
use crate::cleaning::{TakenOut, cleaned};
use crate::drag::{Block, Piece, blocks, glides, pieces, velocity_noise};
pub use crate::jump::{Jump, Opening};
use crate::jumps::{Found, Times, jumps};
use crate::phases::divided;
use crate::prediction::{Flown, Forecast, Prediction, Trials};
use crate::statistics::deviation_of;
use crate::verdict::{Evidence, LEAST, PLAUSIBLE, Verdict, judged};
use crate::wind::{Profile, wind};
use crate::{Sample, median, slopes};

/// Number of times that wind is estimated from drag and drag from wind in turn.
const ROUNDS: usize = 4;

/// Time after the exit in which the fall still accelerates (s).
const GATHERS: f64 = 10.0;

/// Length of the shortest part of a fall used for a trial prediction, and the increment between parts (s).
const FIRST_TRIAL: f64 = 24.0;
const TRIAL_EVERY: f64 = 3.0;

/// Vertical acceleration below which a fall is steady (m/s2).
const STEADY: f64 = 1.5;

/// Inputs besides the track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Density over the height.
    pub atmosphere: Atmosphere,
    /// Height in the standard atmosphere to which fall rates are normalised (m above mean sea level).
    pub reference_height: f64,
    /// How well the motion is known; without its horizontal part there is no wind.
    pub motion: Motion,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            atmosphere: Atmosphere::Standard,
            reference_height: REFERENCE_HEIGHT,
            motion: Motion::default(),
        }
    }
}

/// Analyses the jumps of a track, in order of time.
pub fn analysed(samples: &[Sample], settings: &Settings) -> Vec<Jump> {
    let (sections, taken_out) = cleaned(samples);
    let mut analysed = Vec::new();
    for section in &sections {
        let stretches = divided(section, settings.motion.has_horizontal);
        let found = jumps(section, &stretches, settings.motion);
        let jumps = found
            .iter()
            .filter_map(|found| jump(section, found, settings, taken_out));
        analysed.extend(jumps);
    }
    analysed
}

/// Analyses one jump of a section of the track.
fn jump(
    section: &[Sample],
    found: &Found,
    settings: &Settings,
    taken_out: TakenOut,
) -> Option<Jump> {
    let samples = section.get(found.samples[0]..found.samples[1])?.to_vec();
    let times = found.times;
    let place = |time: f64| samples.partition_point(|sample| sample.time < time - 1e-6);
    let fall = [place(times.fall[0]), place(times.fall[1])];
    let falling = samples
        .get(fall[0]..fall[1])
        .filter(|part| part.len() > 1)?;
    let noise = velocity_noise(falling);
    let told = told(falling, times.exit.is_some(), settings, noise);
    let accelerations = slopes(&samples, 0.5);
    let drag = steady_drag(&told, &times);
    let flown = flown(falling, &told, &settings.atmosphere);
    let gap = root_mean_square(falling, &flown);
    let canopy_part = canopy_part(&samples, &times);
    let mut jump = Jump {
        verdict: Verdict::Explained,
        reason: String::new(),
        circles: if settings.motion.has_horizontal {
            circles(canopy_part)
        } else {
            Vec::new()
        },
        glide: [glide(&told.blocks), canopy_glide(canopy_part)],
        normalised_rate: normalised_rate(
            falling,
            &accelerations[fall[0]..fall[1]],
            settings,
            if times.exit.is_some() { GATHERS } else { 0.0 },
        ),
        fastest: falling
            .iter()
            .map(|sample| -sample.velocity.z)
            .fold(0.0, f64::max),
        prediction: predicted(falling, times.exit.is_some(), settings, noise, &told.pieces),
        times,
        taken_out,
        accelerations,
        fall,
        noise,
        blocks: told.blocks,
        pieces: told.pieces,
        wind: told.wind,
        flown,
        gap,
        drag,
        samples,
    };
    (jump.verdict, jump.reason) = judged(&Evidence {
        duration: jump.duration(),
        begin: jump.times.fall[0],
        seconds: jump.blocks.len(),
        pieces: &jump.pieces,
        gap: jump.gap,
        speed: mean_speed(&jump.samples[fall[0]..fall[1]]),
        doubt: if settings.motion.is_doubted {
            Some("heights, velocities and clock contradict each other")
        } else {
            found.doubt.as_deref()
        },
    });
    Some(jump)
}

/// Drag factor of the steady part of a fall (m2/kg), and its standard deviation from second to second; `None` if the
/// fall has no usable second.
fn steady_drag(told: &Told, times: &Times) -> Option<[f64; 2]> {
    let steady: Vec<&Block> = told
        .blocks
        .iter()
        .filter(|block| block.time > times.fall[0] + GATHERS || times.exit.is_none())
        .collect();
    let drags = || steady.iter().map(|block| block.drag);
    let drag = median(drags())
        .or(told.pieces.last().map(|piece| piece.drag))
        .or(median(told.blocks.iter().map(|block| block.drag)));
    let spread = |drag: f64| {
        let apart = median(drags().map(|value| (value - drag).abs()));
        deviation_of(apart.unwrap_or(0.0))
    };
    drag.map(|drag| [drag, spread(drag)])
}

/// Estimates from a fall or its first part.
struct Told {
    blocks: Vec<Block>,
    pieces: Vec<Piece>,
    wind: Profile,
}

/// Estimates drag from wind and wind from drag, alternately.
///
/// A gliding fall goes where it is steered, so it carries no information about the wind; its drag is computed for still
/// air. The time in which the fall gathers speed is left out: the velocity still contains the aircraft's speed, and the
/// lift of an arbitrary exit attitude.
fn told(falling: &[Sample], has_exit: bool, settings: &Settings, noise: f64) -> Told {
    let atmosphere = &settings.atmosphere;
    let mut profile = Profile::still(falling);
    let mut seconds = blocks(falling, &profile, atmosphere, noise);
    let begin =
        falling.first().map_or(0.0, |first| first.time) + if has_exit { GATHERS } else { 0.0 };
    let steady = falling.partition_point(|sample| sample.time < begin);
    let late = seconds.get(seconds.len() / 2..).unwrap_or(&[]);
    if settings.motion.has_horizontal && !glides(late) && falling.len() > steady + 5 {
        for _ in 0..ROUNDS {
            let pieces = pieces(&seconds);
            let pull = |sample: &Sample| {
                let later = pieces.partition_point(|piece| piece.time[1] < sample.time);
                let piece = pieces.get(later).or(pieces.last());
                let drag = piece.map_or(0.0, |piece| piece.drag);
                let speed = sample.velocity.norm();
                let drag = drag.clamp(PLAUSIBLE[0], PLAUSIBLE[1]);
                0.5 * atmosphere.density(sample.height()) * speed * drag
            };
            let pulls: Vec<f64> = falling[steady..].iter().map(pull).collect();
            profile = wind(&falling[steady..], &pulls, noise).from_above(&falling[..steady]);
            seconds = blocks(falling, &profile, atmosphere, noise);
        }
    }
    Told {
        pieces: pieces(&seconds),
        blocks: seconds,
        wind: profile,
    }
}

/// The velocity at the start of a part (m/s), from a line through its first second.
fn first_velocity(part: &[Sample]) -> Vector3<f64> {
    let (Some(slope), Some(first)) = (slopes(part, 0.5).first().copied(), part.first()) else {
        return Vector3::zeros();
    };
    let time = first.time;
    let first = part.iter().take_while(|sample| sample.time <= time + 0.5);
    let (mut sum, mut count) = (Vector3::zeros(), 0.0);
    for sample in first {
        sum += sample.velocity - slope * (sample.time - time);
        count += 1.0;
    }
    sum / count
}

fn flown(falling: &[Sample], told: &Told, atmosphere: &Atmosphere) -> Vec<Vector3<f64>> {
    let flown = Flown {
        pieces: &told.pieces,
        wind: &told.wind,
        atmosphere,
    };
    flown.velocities(falling, first_velocity(falling))
}

fn mean_speed(falling: &[Sample]) -> f64 {
    let speeds = falling.iter().map(|sample| sample.velocity.norm());
    speeds.sum::<f64>() / falling.len().max(1) as f64
}

fn root_mean_square(falling: &[Sample], flown: &[Vector3<f64>]) -> f64 {
    let squares: f64 = falling
        .iter()
        .zip(flown)
        .map(|(sample, flown)| (sample.velocity.z - flown.z).powi(2))
        .sum();
    (squares / falling.len().max(1) as f64).sqrt()
}

/// Predicts the last third of the fall; `pieces` are those of the whole fall.
fn predicted(
    falling: &[Sample],
    has_exit: bool,
    settings: &Settings,
    noise: f64,
    pieces: &[Piece],
) -> Option<Prediction> {
    let (first, last) = (falling.first()?.time, falling.last()?.time);
    if last - first < LEAST {
        return None;
    }
    let forecast = |until: f64| {
        let part = |time: f64| falling.partition_point(|sample| sample.time < time);
        let cut = part(first + (until - first) * 2.0 / 3.0);
        let (before, after) = falling[..part(until)].split_at(cut);
        let told = told(before, has_exit, settings, noise);
        Forecast::made(
            &told.pieces,
            &told.wind,
            &settings.atmosphere,
            after,
            first_velocity(after),
            first + if has_exit { GATHERS } else { 0.0 },
        )
    };
    let whole = forecast(last + 1e-6)?;
    let late: Vec<Piece> = pieces
        .iter()
        .filter(|piece| piece.time[1] > whole.from)
        .copied()
        .collect();
    let mut trials = Trials::default();
    let mut until = first + FIRST_TRIAL;
    while until <= last {
        trials.add(forecast(until).as_ref());
        until += TRIAL_EVERY;
    }
    Some(Prediction::judged(&whole, &late, first, trials))
}

/// Downward speed at the reference height (m/s): that of the steady part, scaled by the square root of the density.
fn normalised_rate(
    falling: &[Sample],
    accelerations: &[Vector3<f64>],
    settings: &Settings,
    gathers: f64,
) -> f64 {
    let begin = falling.first().map_or(0.0, |sample| sample.time) + gathers;
    let reference = Atmosphere::Standard.density(settings.reference_height);
    let rate = |sample: &Sample| {
        let density = settings.atmosphere.density(sample.height());
        normalised_fall_rate(-sample.velocity.z, density, reference)
    };
    let steady = falling
        .iter()
        .zip(accelerations)
        .filter(|(sample, acceleration)| sample.time >= begin && acceleration.z.abs() < STEADY);
    median(steady.map(|(sample, _)| rate(sample)))
        .or_else(|| median(falling.iter().map(rate)))
        .unwrap_or(0.0)
}

/// The samples from the open canopy to the landing, or to the end of the track.
fn canopy_part<'a>(samples: &'a [Sample], times: &Times) -> &'a [Sample] {
    let Some(open) = times.canopy else {
        return &[];
    };
    let landing = times.landing.map_or(f64::INFINITY, |landing| landing.time);
    let first = samples.partition_point(|sample| sample.time < open.time);
    let end = samples.partition_point(|sample| sample.time < landing);
    samples.get(first..end.max(first)).unwrap_or(&[])
}

/// Glide ratio through the air in the second half of a fall.
fn glide(blocks: &[Block]) -> Option<f64> {
    let late = blocks.get(blocks.len() / 2..)?;
    let down: f64 = late.iter().map(|block| block.down).sum();
    let across: f64 = late.iter().map(|block| block.across).sum();
    (down > 0.0).then(|| across / down)
}

/// Glide ratio over ground of the whole canopy flight, which includes the effect of wind.
fn canopy_glide(part: &[Sample]) -> Option<f64> {
    let across = median(part.iter().map(Sample::across))?;
    let down = median(part.iter().map(|sample| -sample.velocity.z))?;
    (down > 0.5).then(|| across / down)
}

#[cfg(test)]
mod tests;
