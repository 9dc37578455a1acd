//! `bodyflight tune`: the paper's Monte-Carlo search for aerodynamic coefficients.
//!
//! Coefficients are drawn around the subject's, each draw flies the same postures, and the draw with the
//! smallest gap in linear and angular velocity is kept and checked on flights that were not used. The same
//! seed gives the same answer on any number of cores.

use bodyflight_core::aerodynamics::Coefficients;
use bodyflight_core::dynamics::Dynamics;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rayon::prelude::*;
use serde::Serialize;

use crate::diagnostic::{Problem, Result};
use crate::formats::flight::Flight;
use crate::formats::recording::{FlightFrame, Options};
use crate::formats::subject::CommonCoefficients;
use crate::interrupt;
use crate::replay::comparison::{Channel, Comparison, PerChannel};
use crate::replay::steps::{Replay, too_short};

/// Scales of the gap: the paper's own accuracy of reconstruction, section "Model Validation in Experiments".
const SCALES: [(Channel, f64); 3] = [
    (Channel::AngularVelocity, 0.15),
    (Channel::HorizontalVelocity, 0.45),
    (Channel::VerticalVelocity, 1.5),
];

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Number of draws, the guess itself not counted.
    pub draws: usize,
    /// Standard deviation of each draw, as a share of the guess.
    pub spread: f64,
    /// Seed of the draws.
    pub seed: u64,
}

/// The result of a search.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Where the search began.
    pub guess: CommonCoefficients,
    /// The best draw.
    pub best: CommonCoefficients,
    /// Gap of the guess and of the best on the flights used, in units of the paper's accuracy.
    pub score_before: f64,
    /// Gap of the best.
    pub score_after: f64,
    /// Flights that were not used.
    pub held_out: Vec<HeldOut>,
    /// Draws flown.
    pub draws: usize,
}

/// A flight that was not used in the search.
#[derive(Debug, Clone, Serialize)]
pub struct HeldOut {
    /// The recording.
    pub recording: String,
    /// Gap with the guess.
    pub rms_before: PerChannel,
    /// Gap with the best.
    pub rms_after: PerChannel,
    /// Scores.
    pub score_before: f64,
    /// Score with the best.
    pub score_after: f64,
}

/// A flight in memory: a search flies it hundreds of times.
struct Loaded<'a> {
    flight: &'a Flight,
    dynamics: Dynamics<f64>,
    frames: Vec<FlightFrame>,
}

impl<'a> Loaded<'a> {
    fn read(flight: &'a Flight, options: Options) -> Result<Self> {
        let frames: Vec<FlightFrame> = flight.open(options)?.collect::<Result<_>>()?;
        let [first, _, ..] = frames.as_slice() else {
            return Err(too_short(&flight.recording));
        };
        let dynamics = flight.dynamics(first.pelvis.position.up());
        Ok(Self {
            flight,
            dynamics,
            frames,
        })
    }

    /// Flies the postures with other coefficients.
    fn fly(&self, candidate: &CommonCoefficients) -> Result<Comparison> {
        let mut dynamics = self.dynamics;
        for (_, coefficients) in dynamics.aerodynamics.coefficients.iter_mut() {
            *coefficients = Coefficients {
                drag: candidate.cd,
                lift: candidate.cl,
                moment: candidate.cm,
            };
        }
        let mut flight = self.flight.clone();
        flight.subject.set_damping(candidate.damp.into());
        let frames = self.frames.iter().copied().map(Ok);
        let mut comparison = Comparison::default();
        for step in Replay::<f64, _>::with_dynamics(&flight, frames, |_| dynamics)? {
            comparison.push(step?.pair);
        }
        Ok(comparison)
    }
}

/// Searches over `flights` and checks on `held_out`. `progress` is called once for each draw.
///
/// # Errors
/// Where a flight cannot be read or the guess itself does not fly.
pub fn tune(
    flights: &[Flight],
    held_out: &[Flight],
    search: Search,
    options: Options,
    progress: impl Fn() + Sync,
) -> Result<Report> {
    let Some(first) = flights.first() else {
        return Err(Problem::bad_input(
            "expected at least one flight to tune on",
        ));
    };
    // Problems of any file come before the long work.
    let (used, held_out) = (load(flights, options)?, load(held_out, options)?);
    let guess = first.subject.common_coefficients();
    let candidates = draw(&guess, search);
    let score_before = total_score(&used, &guess)?;
    let best = candidates
        .par_iter()
        .enumerate()
        .map(|(index, candidate)| {
            // A draw that tumbles out of range has lost.
            let score = total_score(&used, candidate).unwrap_or(f64::INFINITY);
            progress();
            interrupt::check().map(|()| (score, index, *candidate))
        })
        .collect::<Result<Vec<_>>>()?
        .into_iter()
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let (score_after, best) = match best {
        Some((score, _, candidate)) if score < score_before => (score, candidate),
        _ => (score_before, guess),
    };
    let held_out = held_out
        .iter()
        .map(|flight| check(flight, &guess, &best))
        .collect::<Result<_>>()?;
    Ok(Report {
        guess,
        best,
        score_before,
        score_after,
        held_out,
        draws: candidates.len(),
    })
}

fn load(flights: &[Flight], options: Options) -> Result<Vec<Loaded<'_>>> {
    flights
        .iter()
        .map(|flight| Loaded::read(flight, options))
        .collect()
}

fn check(
    flight: &Loaded<'_>,
    guess: &CommonCoefficients,
    best: &CommonCoefficients,
) -> Result<HeldOut> {
    let (before, after) = (flight.fly(guess)?, flight.fly(best)?);
    Ok(HeldOut {
        recording: flight.flight.recording.display().to_string(),
        rms_before: before.rms(),
        rms_after: after.rms(),
        score_before: score(&before),
        score_after: score(&after),
    })
}

/// CommonCoefficientss around a guess: normal, at least a tenth of the guess.
fn draw(guess: &CommonCoefficients, search: Search) -> Vec<CommonCoefficients> {
    let mut random = ChaCha8Rng::seed_from_u64(search.seed);
    let mut near = |value: f64| {
        let factor = 1.0 + search.spread * random.sample::<f64, _>(StandardNormal);
        value * factor.max(0.1)
    };
    (0..search.draws)
        .map(|_| CommonCoefficients {
            cd: near(guess.cd),
            cl: near(guess.cl),
            cm: near(guess.cm),
            damp: guess.damp.map(&mut near),
        })
        .collect()
}

/// Root mean square over flights of their scores.
fn total_score(flights: &[Loaded<'_>], candidate: &CommonCoefficients) -> Result<f64> {
    let mut sum = 0.0;
    for flight in flights {
        sum += score(&flight.fly(candidate)?).powi(2);
    }
    #[expect(clippy::cast_precision_loss, reason = "a few flights")]
    let count = flights.len().max(1) as f64;
    Ok((sum / count).sqrt())
}

/// Gap in linear and angular velocity over the paper's accuracy, root mean square over channels.
fn score(comparison: &Comparison) -> f64 {
    let rms = comparison.rms();
    let sum: f64 = SCALES
        .iter()
        .map(|(channel, scale)| (rms.get(*channel) / scale).powi(2))
        .sum();
    (sum / 3.0).sqrt()
}
