//! `bodyflight discover`: where simulation and measurement disagree, which effect is missing, and how much of the
//! gap it closes.
//!
//! The steps, one file each: the flight in memory ([`track`]), short free runs and their residuals ([`stretch`]),
//! what each effect would change in them and what may be wrong without being one ([`design`]), effects fitted to
//! them ([`fit`]), and here the choice: an effect gets a name where it is significant over flights drawn from
//! the plain model, helps in stretches that it was not fitted to, and explains most of what there is to explain.

pub mod design;
pub mod figure;
pub mod fit;
pub mod report;
pub mod stretch;
pub mod track;

use bodyflight_core::effect::{Effect, Model};

use crate::diagnostic::{Problem, Result};
use design::{Block, blocks, drawn, places};
use fit::{Data, Fit, Reduced, Values, reach, with};
use report::{Gap, Named, Outcome, Rival};
use stretch::{Stretch, stretches};
use track::Track;

/// How to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Most effects that are named.
    pub max_effects: usize,
    /// Seed of the flights that are drawn.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_effects: 3,
            seed: 1,
        }
    }
}

/// Flights drawn from the plain model, by which significance is judged.
const DRAWS: u64 = 40;

/// Deviations of a gain beyond what drawn flights show, from which on it is significant: where flights held out
/// have a vote, and where they have none. What joints have wrong is the same all through one flight, so its own
/// halves cannot vote on that.
const SIGNIFICANT: f64 = 4.5;
const SIGNIFICANT_ALONE: f64 = 9.0;

/// Deviations of the misfit beyond that of drawn flights, from which on the flight disagrees with the model.
const DISAGREES: f64 = 5.0;

/// Share of what there is to explain that the effects named must explain together.
const EXPLAINS: f64 = 0.6;

/// Share of what is left to explain that an effect must explain to be material.
const MATERIAL: f64 = 0.1;

/// Shortest flight that is judged (stretches).
const LEAST_STRETCHES: usize = 20;

/// What flights look like in which nothing is missing.
struct Null {
    /// Mean misfit and its deviation.
    misfit: [f64; 2],
    /// Mean gain of each effect over the number of its parameters, at least one.
    inflation: Vec<f64>,
    /// Root mean square of each channel.
    floor: stretch::Channels,
}

/// Looks for what the model misses in a flight.
///
/// # Errors
/// Where the flight is too short to be judged.
pub fn discover(
    track: &Track,
    held_out: &[Track],
    settings: &Settings,
    mut progress: impl FnMut(&str),
) -> Result<report::Report> {
    let model = Model::new(track.dynamics, track.start_height());
    let stretches = stretches(track);
    if stretches.len() < 2 {
        return Err(Problem::bad_input(format!(
            "expected at least 4 s of flight, found {:.1} s",
            track.duration()
        )));
    }
    progress("what each effect would change");
    let neutral = |effect: Effect| effect.neutral();
    let around = blocks(track, &stretches, &model, &neutral);
    progress("flights in which nothing is missing");
    let null = null(track, &stretches, &around, &model, settings.seed);
    let mut pairs: Vec<(Stretch, Block)> = stretches.into_iter().zip(around).collect();
    let data = Data {
        track,
        model: &model,
        stretches: &pairs,
    };
    let others: Vec<HeldOut<'_>> = held_out.iter().map(HeldOut::new).collect();
    let all = |_: usize| true;
    let plain = data.misfit(&Vec::new(), all);
    let [expected, deviation] = null.misfit;
    let disagreement = (plain - expected) / deviation;

    let mut chosen = Fit {
        values: Vec::new(),
        errors: Vec::new(),
        misfit: plain,
    };
    let mut named: Vec<Named> = Vec::new();
    while named.len() < settings.max_effects {
        progress("which effect explains most");
        if !named.is_empty() && chosen.misfit < expected + DISAGREES * deviation {
            break;
        }
        let data = Data {
            track,
            model: &model,
            stretches: &pairs,
        };
        let Some((fit, found)) = next(&data, &others, &null, &chosen) else {
            break;
        };
        named.push(found);
        // What joints and subject may have wrong acts differently in the model that was found.
        pairs = relinearised(track, &model, pairs, &fit.values);
        let data = Data {
            track,
            model: &model,
            stretches: &pairs,
        };
        chosen = pruned(&data, &null, data.fit(fit.values, all), &mut named);
    }
    let to_explain = plain - expected;
    let explained = if to_explain > 0.0 {
        (plain - chosen.misfit) / to_explain
    } else {
        0.0
    };
    let thin = pairs.len() < LEAST_STRETCHES;
    let agrees = disagreement < DISAGREES;
    let outcome = match (thin, named.is_empty()) {
        (true, _) => Outcome::Thin,
        (false, true) if agrees => Outcome::None,
        (false, false) if agrees || explained >= EXPLAINS => Outcome::Named,
        (false, _) => Outcome::Unexplained,
    };
    let values = match outcome {
        Outcome::Named => chosen.values.clone(),
        _ => Vec::new(),
    };
    report::settle(&mut named, &chosen);
    progress("what is left of the gap");
    let data = Data {
        track,
        model: &model,
        stretches: &pairs,
    };
    let gap = Gap::of(&data, &values, &null.floor);
    let held_out = others
        .iter()
        .map(|other| other.gap(&values, &null.floor))
        .collect();
    Ok(report::Report::new(report::Parts {
        outcome,
        named,
        explained,
        disagreement,
        gap,
        held_out,
        map: report::map(&data, &values, &null.floor),
        values,
    }))
}

/// The problem around a model with effects.
fn relinearised(
    track: &Track,
    model: &Model<f64>,
    pairs: Vec<(Stretch, Block)>,
    values: &Values,
) -> Vec<(Stretch, Block)> {
    let stretches: Vec<Stretch> = pairs.into_iter().map(|(stretch, _)| stretch).collect();
    let present = |effect: Effect| {
        let found = values.iter().find(|(known, _)| *known == effect);
        found.map_or_else(|| effect.neutral(), |(_, values)| *values)
    };
    let around = blocks(track, &stretches, &with(model, values), &present);
    stretches.into_iter().zip(around).collect()
}

/// A flight that effects are not fitted to, but have to help in.
struct HeldOut<'a> {
    track: &'a Track,
    model: Model<f64>,
    pairs: Vec<(Stretch, Block)>,
}

impl<'a> HeldOut<'a> {
    fn new(track: &'a Track) -> Self {
        let model = Model::new(track.dynamics, track.start_height());
        let stretches = stretches(track);
        let around = blocks(track, &stretches, &model, &|effect| effect.neutral());
        Self {
            track,
            model,
            pairs: stretches.into_iter().zip(around).collect(),
        }
    }

    fn data(&self) -> Data<'_> {
        Data {
            track: self.track,
            model: &self.model,
            stretches: &self.pairs,
        }
    }

    fn misfit(&self, values: &Values) -> f64 {
        self.data().misfit(values, |_| true)
    }

    fn gap(&self, values: &Values, floor: &stretch::Channels) -> report::HeldOutGap {
        report::HeldOutGap {
            misfit_before: self.misfit(&Vec::new()),
            misfit_after: self.misfit(values),
            numbers: self.pairs.len() * stretch::NUMBERS,
            gap: Gap::of(&self.data(), values, floor),
        }
    }
}

fn null(
    track: &Track,
    stretches: &[Stretch],
    around: &[Block],
    model: &Model<f64>,
    seed: u64,
) -> Null {
    let places = places();
    let mut misfits = Vec::new();
    let mut gains: Vec<Vec<f64>> = vec![Vec::new(); Effect::ALL.len()];
    let mut squares = Vec::new();
    for draw in 0..DRAWS {
        let seed = seed.wrapping_mul(1000) + draw;
        let residuals = drawn(track, stretches, around, model, seed);
        let reduced = Reduced::of(
            residuals
                .iter()
                .zip(around)
                .map(|((white, _), block)| (white, &block.effects, &block.nuisances)),
        );
        misfits.push(reduced.misfit);
        for (gains, &effect) in gains.iter_mut().zip(Effect::ALL) {
            gains.push(gain_of(&reduced, &places, effect));
        }
        let plain: Vec<_> = residuals.iter().map(|(_, plain)| plain).collect();
        squares.push(report::mean_square(&plain));
    }
    // Medians: a draw may be so far off that the flight tumbles, and one such draw is most of a mean.
    let rows = (stretches.len() * stretch::NUMBERS) as f64;
    let middle = quantile(&mut misfits, 0.5);
    let spread = quantile(&mut misfits, 0.84) - middle;
    let inflation = gains.iter_mut().zip(Effect::ALL).map(|(gains, effect)| {
        let freedom = effect.description().parameters.len() as f64;
        let median = freedom * (1.0 - 2.0 / (9.0 * freedom)).powi(3);
        (quantile(gains, 0.5) / median).max(1.0)
    });
    let floor = stretch::Channels::from_fn(|channel, _| {
        let mut values: Vec<f64> = squares.iter().map(|square| square[channel]).collect();
        quantile(&mut values, 0.5).sqrt()
    });
    Null {
        misfit: [middle, spread.max((2.0 * rows).sqrt())],
        inflation: inflation.collect(),
        floor,
    }
}

/// The value below which a share of the values lies.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a share of a length"
    )]
    let place = (values.len() as f64 * share) as usize;
    values
        .get(place.min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// Gain of an effect, to first order.
fn gain_of(reduced: &Reduced, places: &[design::Place], effect: Effect) -> f64 {
    let own: Vec<usize> = (0..places.len())
        .filter(|&k| places[k].effect == effect)
        .collect();
    let reach: Vec<f64> = own.iter().map(|&k| reach(places[k])).collect();
    reduced.only(&own).gain(&reach)
}

/// Deviations of a chi-squared number of `freedom` degrees from its mean, as of a normal one (Wilson and Hilferty).
fn deviations(chi_squared: f64, freedom: f64) -> f64 {
    let share = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - (1.0 - share)) / share.sqrt()
}

/// A candidate, fitted with what was chosen before.
struct Candidate {
    effect: Effect,
    fit: Fit,
    deviations: f64,
}

/// The effect that explains most of what is left, if it deserves a name, fitted with those chosen before.
fn next(
    data: &Data<'_>,
    others: &[HeldOut<'_>],
    null: &Null,
    chosen: &Fit,
) -> Option<(Fit, Named)> {
    let all = |_: usize| true;
    let mut candidates: Vec<Candidate> = Effect::ALL
        .iter()
        .zip(&null.inflation)
        .filter(|(effect, _)| chosen.values.iter().all(|(known, _)| known != *effect))
        .map(|(&effect, inflation)| {
            let mut values = chosen.values.clone();
            values.push((effect, effect.neutral()));
            let fit = data.fit(values, all);
            let freedom = effect.description().parameters.len() as f64;
            let gain = (chosen.misfit - fit.misfit) / inflation;
            Candidate {
                effect,
                fit,
                deviations: deviations(gain, freedom),
            }
        })
        .collect();
    // Those first that leave no more than flights have in which nothing is missing; then by how far the gain is
    // beyond chance: some effects take up what joints have wrong, and gain by that alone.
    let [expected, deviation] = null.misfit;
    let enough = |candidate: &Candidate| candidate.fit.misfit < expected + DISAGREES * deviation;
    candidates.sort_by(|a, b| {
        let order = enough(b).cmp(&enough(a));
        order.then(b.deviations.total_cmp(&a.deviations))
    });
    let mut candidates = candidates.into_iter();
    let best = candidates.next()?;
    let left = chosen.misfit - null.misfit[0];
    let gain = chosen.misfit - best.fit.misfit;
    let least = if others.is_empty() {
        SIGNIFICANT_ALONE
    } else {
        SIGNIFICANT
    };
    let vetoed = others.iter().any(|other| {
        let misfit = |values: &Values| other.misfit(values);
        misfit(&best.fit.values) >= misfit(&chosen.values)
    });
    if best.deviations < least
        || gain < MATERIAL * left
        || vetoed
        || !helps_elsewhere(data, chosen, &best)
    {
        return None;
    }
    // Whoever explains as much, and leaves nothing for the best beside it.
    let rivals = candidates
        .filter(|rival| chosen.misfit - rival.fit.misfit > 0.8 * gain)
        .filter(|rival| {
            let mut values = rival.fit.values.clone();
            values.push((best.effect, best.effect.neutral()));
            let both = data.fit(values, all);
            let freedom = best.effect.description().parameters.len() as f64;
            deviations(rival.fit.misfit - both.misfit, freedom) < SIGNIFICANT
        })
        .map(|rival| Rival {
            name: rival.effect.description().name,
            share: (chosen.misfit - rival.fit.misfit) / gain,
        })
        .collect();
    let named = Named::new(best.effect, best.deviations, gain / left.max(1.0), rivals);
    Some((best.fit, named))
}

/// Without the effects that are no longer worth having beside the last one.
fn pruned(data: &Data<'_>, null: &Null, mut chosen: Fit, named: &mut Vec<Named>) -> Fit {
    let earlier: Vec<Effect> = chosen
        .values
        .iter()
        .rev()
        .skip(1)
        .map(|(effect, _)| *effect)
        .collect();
    for effect in earlier {
        let rest: Values = chosen
            .values
            .iter()
            .copied()
            .filter(|(e, _)| *e != effect)
            .collect();
        let without = data.fit(rest, |_| true);
        let inflation = Effect::ALL
            .iter()
            .zip(&null.inflation)
            .find(|(e, _)| **e == effect);
        let inflation = inflation.map_or(1.0, |(_, inflation)| *inflation);
        let freedom = effect.description().parameters.len() as f64;
        let gain = (without.misfit - chosen.misfit) / inflation;
        if deviations(gain, freedom) < SIGNIFICANT_ALONE {
            named.retain(|named| named.effect() != effect);
            chosen = without;
        }
    }
    chosen
}

/// Whether an effect fitted to every other pair of stretches helps in the rest, both ways.
fn helps_elsewhere(data: &Data<'_>, chosen: &Fit, candidate: &Candidate) -> bool {
    let mut gain = 0.0;
    for half in 0..2 {
        let own = move |k: usize| (k / 2) % 2 == half;
        let other = move |k: usize| (k / 2) % 2 != half;
        let fit = data.fit(candidate.fit.values.clone(), own);
        gain += data.misfit(&chosen.values, other) - data.misfit(&fit.values, other);
    }
    gain > 0.0
}
