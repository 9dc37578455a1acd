//! The analysis of a whole jump: its numbers as a skydiver reads them, and how far they can be trusted.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

use crate::atmosphere::Atmosphere;
use crate::canopy::{Circle, circles};
use crate::cleaning::{TakenOut, cleaned};
use crate::drag::{Block, Piece, blocks, glides, pieces, velocity_noise};
use crate::phases::{Stretch, Times, divided, times};
use crate::prediction::{Flown, Forecast, Prediction, Trials};
use crate::verdict::{Evidence, LEAST, PLAUSIBLE, Verdict, judged};
use crate::wind::{Profile, Wind, wind};
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
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            atmosphere: Atmosphere::Standard,
            reference_height: 2000.0,
        }
    }
}

/// Results of the analysis.
#[derive(Debug, Clone, PartialEq)]
pub struct Jump {
    /// Verdict on the fall.
    pub verdict: Verdict,
    /// Reason for the verdict, in a sentence.
    pub reason: String,
    /// Phases of the whole track.
    pub stretches: Vec<Stretch>,
    /// Times of the fall (s, as in the samples).
    pub times: Times,
    /// Rows that were removed.
    pub taken_out: TakenOut,
    /// The samples used.
    pub samples: Vec<Sample>,
    /// Acceleration at each sample (m/s2).
    pub accelerations: Vec<Vector3<f64>>,
    /// Indices of the first sample of the fall, and of the one after its last.
    pub fall: [usize; 2],
    /// Standard deviation of one component of a velocity (m/s).
    pub noise: f64,
    /// Drag and lift for each second of the fall.
    pub blocks: Vec<Block>,
    /// Pieces of constant posture.
    pub pieces: Vec<Piece>,
    /// Wind during the fall.
    pub wind: Profile,
    /// Wind under canopy.
    pub circles: Vec<Circle>,
    /// Velocity of the simulated fall at each sample of the fall (m/s).
    pub flown: Vec<Vector3<f64>>,
    /// Root mean square difference of the vertical velocity between simulated and measured fall (m/s).
    pub gap: f64,
    /// Mean drag factor of the steady part (m2/kg).
    pub drag: f64,
    /// Standard deviation of the drag factor between the seconds of the steady part (m2/kg).
    pub drag_spread: f64,
    /// Fall rate normalised to the reference height (m/s).
    pub normalised_rate: f64,
    /// Largest downward speed (m/s).
    pub fastest: f64,
    /// Glide ratios of the fall (through the air) and under canopy (over ground); `None` if unknown.
    pub glide: [Option<f64>; 2],
    /// Prediction of the last third; `None` if the fall is thin.
    pub prediction: Option<Prediction>,
}

/// The opening of the canopy.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct Opening {
    /// Height at its start (m above mean sea level).
    pub height_m: f64,
    /// Time until the canopy is open (s).
    pub duration_s: f64,
    /// Height lost (m).
    pub lost_m: f64,
    /// Largest specific force along the flight path (multiples of gravity), as far as the receiver resolves it.
    pub largest_g: f64,
}

/// Analyses a track; returns `None` if it contains no fall.
pub fn analysed(samples: &[Sample], settings: &Settings) -> Option<Jump> {
    let (samples, taken_out) = cleaned(samples);
    let stretches = divided(&samples);
    let times = times(&samples, &stretches)?;
    let place = |time: f64| samples.partition_point(|sample| sample.time < time - 1e-6);
    let fall = [place(times.fall[0]), place(times.fall[1])];
    let falling = samples
        .get(fall[0]..fall[1])
        .filter(|part| part.len() > 1)?;
    let noise = velocity_noise(falling);
    let told = told(falling, times.exit.is_some(), &settings.atmosphere, noise);
    let accelerations = slopes(&samples, 0.5);
    let steady: Vec<&Block> = told
        .blocks
        .iter()
        .filter(|block| block.time > times.fall[0] + GATHERS || times.exit.is_none())
        .collect();
    let drags = || steady.iter().map(|block| block.drag);
    let drag =
        median(drags()).unwrap_or_else(|| told.pieces.last().map_or(0.0, |piece| piece.drag));
    // For a normal distribution, the median distance from the median is 0.6745 deviations.
    let drag_spread = median(drags().map(|value| (value - drag).abs())).unwrap_or(0.0) / 0.6745;
    let flown = flown(falling, &told, &settings.atmosphere);
    let gap = root_mean_square(falling, &flown);
    let canopy_part = canopy_part(&samples, &times);
    let mut jump = Jump {
        verdict: Verdict::Explained,
        reason: String::new(),
        circles: circles(canopy_part),
        glide: [glide(&told.blocks), canopy_glide(canopy_part)],
        normalised_rate: normalised_rate(
            &samples[fall[0]..fall[1]],
            &accelerations[fall[0]..fall[1]],
            settings,
            if times.exit.is_some() { GATHERS } else { 0.0 },
        ),
        fastest: falling
            .iter()
            .map(|sample| -sample.velocity.z)
            .fold(0.0, f64::max),
        prediction: predicted(falling, times.exit.is_some(), settings, noise, &told.pieces),
        stretches,
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
        drag_spread,
        samples,
    };
    (jump.verdict, jump.reason) = judged(&Evidence {
        duration: jump.duration(),
        begin: jump.times.fall[0],
        seconds: jump.blocks.len(),
        pieces: &jump.pieces,
        gap: jump.gap,
        speed: mean_speed(&jump.samples[fall[0]..fall[1]]),
    });
    Some(jump)
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
fn told(falling: &[Sample], has_exit: bool, atmosphere: &Atmosphere, noise: f64) -> Told {
    let mut profile = Profile::still(falling);
    let mut seconds = blocks(falling, &profile, atmosphere, noise);
    let begin =
        falling.first().map_or(0.0, |first| first.time) + if has_exit { GATHERS } else { 0.0 };
    let steady = falling.partition_point(|sample| sample.time < begin);
    let late = seconds.get(seconds.len() / 2..).unwrap_or(&[]);
    if !glides(late) && falling.len() > steady + 5 {
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
    let slope = slopes(part, 0.5)
        .first()
        .copied()
        .unwrap_or_else(Vector3::zeros);
    let time = part[0].time;
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
        let told = told(before, has_exit, &settings.atmosphere, noise);
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
        -sample.velocity.z * (density / reference).sqrt()
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
    let landing = times.landing.unwrap_or(f64::INFINITY);
    let first = samples.partition_point(|sample| sample.time < open);
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

impl Jump {
    /// Duration from the exit to the opening (s).
    pub fn duration(&self) -> f64 {
        self.times.fall[1] - self.times.fall[0]
    }

    /// Returns the sample at a time (s).
    pub fn sample_at(&self, time: f64) -> Option<&Sample> {
        let place = self
            .samples
            .partition_point(|sample| sample.time < time - 1e-6);
        self.samples.get(place).or(self.samples.last())
    }

    /// The opening, if it is on the track.
    pub fn opening(&self) -> Option<Opening> {
        let (begin, end) = (self.times.opening?, self.times.canopy?);
        let [from, to] = [begin, end].map(|time| self.sample_at(time).map(Sample::height));
        let during = self
            .samples
            .iter()
            .zip(&self.accelerations)
            .filter(|(sample, _)| (begin..=end).contains(&sample.time));
        let force = |acceleration: &Vector3<f64>| (acceleration + Vector3::z() * GRAVITY).norm();
        Some(Opening {
            height_m: from?,
            duration_s: end - begin,
            lost_m: from? - to?,
            largest_g: during.map(|(_, a)| force(a)).fold(0.0, f64::max) / GRAVITY,
        })
    }

    /// Difference between the wind of the highest circle and that at the end of the fall, in deviations; they include
    /// both estimates and the possible change of wind over the height between.
    pub fn winds_apart(&self) -> Option<f64> {
        let circle: &Wind = &self.circles.first()?.wind;
        let fall = self.wind.values.last()?;
        let layers = (fall.height - circle.height).abs() / 500.0;
        let squares: f64 = (0..2)
            .map(|axis| {
                let variance =
                    fall.deviation[axis].powi(2) + circle.deviation[axis].powi(2) + 4.0 * layers;
                (fall.velocity[axis] - circle.velocity[axis]).powi(2) / variance
            })
            .sum();
        Some((0.5 * squares).sqrt())
    }
}

#[cfg(test)]
mod tests;
