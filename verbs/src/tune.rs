//! `bodyflight tune`: the paper's Monte-Carlo search for aerodynamic coefficients.
//!
//! Coefficients are drawn around the subject's, and each draw is simulated with the same postures. The draw with the
//! smallest gap in linear and angular velocity is kept and checked on flights that were not used; a search per segment
//! does this in rounds. The same seed gives the same answer on any number of cores.

mod report;

use std::sync::atomic::{AtomicUsize, Ordering};

use bodyflight_core::Segment;
use bodyflight_core::aerodynamics::Coefficients;
use bodyflight_core::body::SegmentArray;
use bodyflight_core::dynamics::Dynamics;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rayon::prelude::*;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::{FlightFrame, Options, Warning};
use bodyflight_replay::comparison::{Channel, Comparison};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::steps::{DIVERGED_HELP, too_short};
use bodyflight_replay::subject::CommonCoefficients;
use bodyflight_replay::variants::{TOGETHER, Variant, fly};
pub use report::{HeldOut, Report, SegmentBest};

/// Gap (rad/s, m/s, m/s) that counts as 1 in each channel: the paper's own accuracy, section "Model Validation in
/// Experiments". A smaller scale gives its channel more weight in the search.
const SCALES: [(Channel, f64); 3] = [
    (Channel::AngularVelocity, 0.15),
    (Channel::HorizontalVelocity, 0.45),
    (Channel::VerticalVelocity, 1.5),
];

/// Search per segment: draws per round, the share of coefficients that each draw changes, the factor by which the
/// spread shrinks after a round, and its smallest share.
const ROUND: usize = 10;
const CHANGED: f64 = 0.15;
const NARROWER: f64 = 0.9;
const NARROWEST: f64 = 0.2;

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Search {
    /// Number of draws, not counting the guess itself.
    pub draws: usize,
    /// Standard deviation of each draw, as a share of the guess.
    pub spread: f64,
    /// Seed of the draws.
    pub seed: u64,
    /// Whether each segment has its own coefficients, the same left and right.
    pub per_segment: bool,
}

/// A set of coefficients: common ones, and factors by which each segment differs from them.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    common: CommonCoefficients,
    /// Factors on drag, lift and moment, in addition to the subject's own coefficients of a segment.
    factors: SegmentArray<[f64; 3]>,
}

impl Candidate {
    fn plain(common: CommonCoefficients) -> Self {
        Self {
            common,
            factors: SegmentArray::from_fn(|_| [1.0; 3]),
        }
    }

    /// Coefficients of a segment that has `own` if the common ones are `guess`.
    fn of(
        &self,
        segment: Segment,
        own: &Coefficients<f64>,
        guess: &CommonCoefficients,
    ) -> Coefficients<f64> {
        let [drag, lift, moment] = self.factors[segment];
        // A coefficient of zero has no ratio, and is kept.
        let ratio = |to: f64, from: f64| if from > 0.0 { to / from } else { 1.0 };
        Coefficients {
            drag: own.drag * drag * ratio(self.common.cd, guess.cd),
            lift: own.lift * lift * ratio(self.common.cl, guess.cl),
            moment: own.moment * moment * ratio(self.common.cm, guess.cm),
        }
    }
}

/// A flight in memory, since a search simulates it hundreds of times.
struct Loaded<'a> {
    flight: &'a Flight,
    dynamics: Dynamics<f64>,
    frames: Vec<FlightFrame>,
    warnings: Vec<Warning>,
}

/// A simulation with a set of coefficients.
struct Flown {
    comparison: Comparison,
    /// Why it means nothing, if it diverges.
    diverged: Option<String>,
}

impl Flown {
    fn score(&self) -> f64 {
        match self.diverged {
            Some(_) => f64::INFINITY,
            None => score(&self.comparison),
        }
    }
}

impl<'a> Loaded<'a> {
    fn read(flight: &'a Flight, options: Options) -> Result<Self> {
        let (frames, warnings) = flight.open(options)?.trusted(&flight.recording)?;
        let [first, _, ..] = frames.as_slice() else {
            return Err(too_short(&flight.recording));
        };
        let dynamics = flight.dynamics(first.pelvis.position.up());
        Ok(Self {
            flight,
            dynamics,
            frames,
            warnings,
        })
    }

    /// What is implausible in the recording, with its name.
    fn said(&self) -> impl Iterator<Item = String> {
        let name = self.flight.recording.display();
        let warnings = self.warnings.iter();
        warnings.map(move |warning| format!("{name}: {warning}"))
    }

    /// The flight with other coefficients.
    fn varied(&self, candidate: &Candidate) -> Variant {
        let mut dynamics = self.dynamics;
        let guess = self.flight.subject.common_coefficients();
        for (segment, own) in dynamics.aerodynamics.coefficients.iter_mut() {
            *own = candidate.of(segment, own, &guess);
        }
        let mut flight = self.flight.clone();
        flight.subject.set_damping(candidate.common.damp.into());
        Variant { flight, dynamics }
    }

    /// Simulates the postures with each set of coefficients.
    fn fly_all<'b>(&self, candidates: impl Iterator<Item = &'b Candidate>) -> Result<Vec<Flown>> {
        let variants: Vec<Variant> = candidates.map(|one| self.varied(one)).collect();
        let mut compared = vec![Comparison::default(); variants.len()];
        let diverged = fly(&self.frames, &variants, &mut |index, pair| {
            compared[index].push(pair);
        })?;
        let flown = compared.into_iter().zip(diverged);
        let flown = flown.map(|(comparison, diverged)| Flown {
            comparison,
            diverged,
        });
        Ok(flown.collect())
    }

    /// Simulates the postures with other coefficients.
    fn fly(&self, candidate: &Candidate) -> Result<Flown> {
        let flown = self.fly_all(std::iter::once(candidate))?;
        flown
            .into_iter()
            .next()
            .ok_or_else(|| too_short(&self.flight.recording))
    }

    /// The same for coefficients from which a search starts.
    fn fly_guess(&self, guess: &Candidate) -> Result<Comparison> {
        let flown = self.fly(guess)?;
        match flown.diverged {
            None => Ok(flown.comparison),
            Some(doubt) => Err(Problem::doubt(format!(
                "with the subject's own coefficients {doubt}"
            ))
            .in_file(&self.flight.recording)
            .help(DIVERGED_HELP)),
        }
    }
}

/// Orders draws by their score, and equal ones by their place.
fn better(a: &(f64, usize, Candidate), b: &(f64, usize, Candidate)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}

/// Searches over `flights` and checks on `held_out`. `progress` is called once for each draw. Ctrl-C ends the search
/// with the best so far.
///
/// # Errors
/// Returns an error if a flight cannot be read, the simulation with the guess diverges, or Ctrl-C is pressed before the
/// first draw is complete.
pub fn tune(
    flights: &[Flight],
    held_out: &[Flight],
    search: Search,
    options: Options,
    progress: impl Fn() + Sync,
) -> Result<Report> {
    let none = || Problem::bad_input("expected at least one flight to tune on");
    let first = flights.first().ok_or_else(none)?;
    // Problems with any file are reported before the long work.
    let (used, held_out) = (load(flights, options)?, load(held_out, options)?);
    let guess = first.subject.common_coefficients();
    let start = Candidate::plain(guess);
    // Without a guess that flies, nothing is searched.
    let before = |flights: &[Loaded<'_>]| -> Result<Vec<Comparison>> {
        let flown = flights.iter().map(|flight| flight.fly_guess(&start));
        flown.collect()
    };
    let (before, before_held_out) = (before(&used)?, before(&held_out)?);
    let score_before = total(before.iter().map(score));
    let (mut score_after, mut best) = (score_before, start);
    let mut random = ChaCha8Rng::seed_from_u64(search.seed);
    let mut spread = search.spread;
    let flown = AtomicUsize::new(0);
    for draws in rounds(search) {
        let candidates = draw(&best, search.per_segment, spread, draws, &mut random);
        spread = (spread * NARROWER).max(search.spread * NARROWEST);
        let together = TOGETHER.min(draws.div_ceil(rayon::current_num_threads()));
        let found = candidates
            .par_chunks(together.max(1))
            .enumerate()
            .filter(|_| !interrupt::requested())
            .filter_map(|(chunk, candidates)| {
                let scores = scores(&used, candidates);
                // Incomplete draws have no score.
                if interrupt::requested() {
                    return None;
                }
                flown.fetch_add(candidates.len(), Ordering::Relaxed);
                candidates.iter().for_each(|_| progress());
                let first = chunk * together;
                let scored = scores.into_iter().zip(first..).zip(candidates);
                let scored = scored.map(|((score, index), candidate)| (score, index, *candidate));
                scored.min_by(better)
            })
            .min_by(better);
        if let Some((score, _, candidate)) = found.filter(|found| found.0 < score_after) {
            (score_after, best) = (score, candidate);
        }
        if interrupt::requested() {
            break;
        }
    }
    let draws = flown.into_inner();
    if draws == 0 {
        interrupt::check()?;
    }
    let checked = held_out.iter().zip(&before_held_out);
    let checked = checked.map(|(flight, before)| check(flight, before, &best));
    let checked: Result<Vec<HeldOut>> = checked.collect();
    let interrupted = interrupt::requested();
    let checked = if interrupted { Vec::new() } else { checked? };
    let warnings = used.iter().chain(&held_out).flat_map(Loaded::said);
    // A search that was ended is not judged.
    let doubts = report::gap_left(score_after).into_iter();
    let doubts = doubts.filter(|_| !interrupted);
    let doubts = doubts.chain(checked.iter().filter_map(HeldOut::doubt));
    Ok(Report {
        warnings: warnings.collect(),
        doubts: doubts.collect(),
        guess,
        best: best.common,
        segments: differing(first, &best),
        score_before,
        score_after,
        held_out: checked,
        draws,
        interrupted,
    })
}

fn load(flights: &[Flight], options: Options) -> Result<Vec<Loaded<'_>>> {
    flights
        .iter()
        .map(|flight| Loaded::read(flight, options))
        .collect()
}

/// Segments of the best set that differ from the common coefficients.
fn differing(flight: &Flight, best: &Candidate) -> Vec<SegmentBest> {
    let guess = flight.subject.common_coefficients();
    let own = flight.subject.aerodynamics().coefficients;
    let common = best.common;
    own.iter()
        .filter_map(|(segment, own)| {
            let found = best.of(segment, own, &guess);
            let as_common = [
                (found.drag, common.cd),
                (found.lift, common.cl),
                (found.moment, common.cm),
            ];
            let differs = as_common.iter().any(|(a, b)| (a - b).abs() > 1e-9);
            differs.then_some(SegmentBest {
                segment: segment.name(),
                cd: found.drag,
                cl: found.lift,
                cm: found.moment,
            })
        })
        .collect()
}

fn check(flight: &Loaded<'_>, before: &Comparison, best: &Candidate) -> Result<HeldOut> {
    let flown = flight.fly(best)?;
    let after = flown.comparison;
    Ok(HeldOut {
        recording: flight.flight.recording.display().to_string(),
        rms_before: before.rms(),
        rms_after: after.rms(),
        score_before: score(before),
        score_after: score(&after),
        diverged: flown.diverged,
    })
}

/// Number of draws in each round; common coefficients need only one round. Random changes to all coefficients of all
/// segments at once hardly ever improve, so a search per segment continues from the best of each round.
fn rounds(search: Search) -> Vec<usize> {
    if !search.per_segment {
        return vec![search.draws];
    }
    let whole = search.draws / ROUND;
    let mut rounds = vec![ROUND; whole];
    rounds.extend(Some(search.draws % ROUND).filter(|rest| *rest > 0));
    rounds
}

/// Draws coefficients around the best so far, normally distributed and at least a tenth of it. In a search per segment
/// only some of them change.
fn draw(
    best: &Candidate,
    per_segment: bool,
    spread: f64,
    draws: usize,
    random: &mut ChaCha8Rng,
) -> Vec<Candidate> {
    let mut near = |value: f64| {
        if per_segment && random.random::<f64>() > CHANGED {
            return value;
        }
        let factor = 1.0 + spread * random.sample::<f64, _>(StandardNormal);
        value * factor.max(0.1)
    };
    (0..draws)
        .map(|_| {
            let mut candidate = Candidate {
                common: CommonCoefficients {
                    cd: near(best.common.cd),
                    cl: near(best.common.cl),
                    cm: near(best.common.cm),
                    damp: best.common.damp.map(&mut near),
                },
                ..*best
            };
            if per_segment {
                for segment in Segment::ALL {
                    // The left side is drawn first, and the right side copies it.
                    let mirrored = segment.mirrored();
                    candidate.factors[segment] = if mirrored < segment {
                        candidate.factors[mirrored]
                    } else {
                        best.factors[segment].map(&mut near)
                    };
                }
            }
            candidate
        })
        .collect()
}

/// The score of each draw over all flights. One that diverges on any, or cannot be flown, has lost.
fn scores(flights: &[Loaded<'_>], candidates: &[Candidate]) -> Vec<f64> {
    let lost = || vec![f64::INFINITY; candidates.len()];
    let of_flights: Vec<Vec<f64>> = flights
        .iter()
        .map(|flight| {
            let flown = flight.fly_all(candidates.iter());
            flown.map_or_else(|_| lost(), |flown| flown.iter().map(Flown::score).collect())
        })
        .collect();
    (0..candidates.len())
        .map(|draw| total(of_flights.iter().map(|scores| scores[draw])))
        .collect()
}

/// Root mean square of the flights' scores.
fn total(scores: impl ExactSizeIterator<Item = f64>) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "only a few flights")]
    let count = scores.len().max(1) as f64;
    (scores.map(|score| score * score).sum::<f64>() / count).sqrt()
}

/// Gap in linear and angular velocity relative to the paper's accuracy, root mean square over channels.
fn score(comparison: &Comparison) -> f64 {
    let rms = comparison.rms();
    let sum: f64 = SCALES
        .iter()
        .map(|(channel, scale)| (rms.get(*channel) / scale).powi(2))
        .sum();
    (sum / 3.0).sqrt()
}
