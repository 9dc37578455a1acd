//! Flights drawn from a model, in which nothing is missing but joints, subject and sensors have their errors: what is
//! found in them is chance, and how far parameters fitted to them are off is their standard error.

use bodyflight_core::effect::{Effect, Model};
use nalgebra::DVector;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::criteria::DISAGREES;
use super::effect_set::{EffectSet, ParameterId, all_parameters, extended, freedom};
use super::fit::{Data, set_parameters};
use super::linearization::{Linearization, Part, flown_with};
use super::normal_equations::{Marginalized, NormalMatrix, NormalVector, sum};
use super::nuisance::{COUNT, Nuisance};
use super::statistics::{deviations, quantile};
use super::stretch::{CHANNELS, Channels, NUMBERS};
use super::track::Track;

/// Draws of joints and subject that are flown.
const BODIES: usize = 25;

/// Draws of the noise for each of them.
const NOISES: usize = 8;

/// What flights look like in which nothing is missing.
pub(super) struct NullDistribution {
    /// Numbers that are compared.
    pub(super) rows: f64,
    /// Mean misfit and its deviation.
    pub(super) misfit: [f64; 2],
    /// Mean gain of each effect over the number of its parameters, at least one.
    inflation: Vec<f64>,
    /// Of each draw, how far the effect that gains most in it is beyond chance (deviations), rising.
    best: Vec<f64>,
    /// Root mean square of each channel.
    pub(super) floor: Channels,
    /// Of the parameters of the effects in the model: how far fits are off.
    pub(super) errors: Vec<f64>,
}

impl NullDistribution {
    /// What an effect gains by chance over the number of its parameters.
    pub(super) fn inflation_of(&self, effect: Effect) -> f64 {
        let all = Effect::ALL.iter().zip(&self.inflation);
        all.into_iter()
            .find(|(e, _)| **e == effect)
            .map_or(1.0, |(_, inflation)| *inflation)
    }

    /// Probability that some effect of the library gains as much by chance.
    pub(super) fn chance_of(&self, deviations: f64) -> f64 {
        let below = self.best.partition_point(|best| *best < deviations);
        (self.best.len() - below + 1) as f64 / (self.best.len() + 1) as f64
    }

    /// How much an effect is to be preferred: its gain beyond chance, less what its parameters cost by Schwarz'
    /// criterion.
    pub(super) fn score(&self, effect: Effect, gain: f64) -> f64 {
        gain / self.inflation_of(effect) - freedom(effect) * self.rows.ln()
    }

    /// Misfit below which a fit leaves no more than flights have in which nothing is missing.
    pub(super) fn little(&self) -> f64 {
        let [expected, deviation] = self.misfit;
        expected + DISAGREES * deviation
    }

    /// Draws them from the model with `effects`, about which the problem is linearized, with a column for every
    /// parameter of the library.
    pub(super) fn draw(
        track: &Track,
        linearization: &Linearization,
        plain: &Model<f64>,
        effects: &EffectSet,
        seed: u64,
    ) -> Self {
        let draws = Draws::new(track, linearization, &extended(plain, effects), seed);
        let tally = Tally::of(&draws, effects);
        // Medians: a draw may be so far off that the flight tumbles, and one such draw is most of a mean.
        let rows = (linearization.parts.len() * NUMBERS) as f64;
        let middle = quantile(tally.misfits.clone(), 0.5);
        let spread = quantile(tally.misfits.clone(), 0.84) - middle;
        let inflation = tally.inflation();
        Self {
            rows,
            misfit: [middle, spread.max((2.0 * rows).sqrt())],
            best: tally.best(effects, &inflation),
            inflation,
            floor: draws.floor(),
            // As of a normal distribution: two thirds of the draws are less far off.
            errors: tally
                .off
                .into_iter()
                .map(|off| quantile(off, 0.683))
                .collect(),
        }
    }
}

/// What fits to the draws come to.
struct Tally {
    /// Of each draw.
    misfits: Vec<f64>,
    /// Of each effect, in each draw.
    gains: Vec<Vec<f64>>,
    /// How far off each parameter of the effects in the model is, in each draw.
    off: Vec<Vec<f64>>,
}

impl Tally {
    fn of(draws: &Draws<'_>, effects: &EffectSet) -> Self {
        let all = all_parameters();
        let own = set_parameters(effects);
        let priors: Vec<f64> = own.iter().map(|id| id.prior_deviation()).collect();
        let own: Vec<usize> = own
            .iter()
            .filter_map(|id| all.iter().position(|other| other == id))
            .collect();
        let mut tally = Self {
            misfits: Vec::new(),
            gains: vec![Vec::new(); Effect::ALL.len()],
            off: vec![Vec::new(); own.len()],
        };
        for draw in 0..BODIES * NOISES {
            let marginalized = draws.marginalized(draw);
            let fitted = marginalized.only(&own);
            let gain = fitted.gain(&priors);
            tally.misfits.push(marginalized.misfit - gain);
            if let Some((step, _)) = fitted.solved(&priors) {
                for (off, step) in tally.off.iter_mut().zip(&step) {
                    off.push(step.abs());
                }
            }
            for (gains, &effect) in tally.gains.iter_mut().zip(Effect::ALL) {
                let (columns, priors) = beside(&all, &own, effect);
                gains.push((marginalized.only(&columns).gain(&priors) - gain).max(0.0));
            }
        }
        tally
    }

    /// Mean gain of each effect over the number of its parameters, at least one.
    fn inflation(&self) -> Vec<f64> {
        let inflation = |(gains, effect): (&Vec<f64>, &Effect)| {
            let freedom = freedom(*effect);
            let median = freedom * (1.0 - 2.0 / (9.0 * freedom)).powi(3);
            (quantile(gains.clone(), 0.5) / median).max(1.0)
        };
        self.gains.iter().zip(Effect::ALL).map(inflation).collect()
    }

    /// Of each draw, how far the effect that gains most in it is beyond chance (deviations), rising; effects in the
    /// model left out.
    fn best(&self, effects: &EffectSet, inflation: &[f64]) -> Vec<f64> {
        let known = |effect: &Effect| effects.iter().any(|(known, _)| known == effect);
        let best_of = |draw: usize| {
            let all = self.gains.iter().zip(Effect::ALL).zip(inflation);
            all.filter(|((_, effect), _)| !known(effect))
                .filter_map(|((gains, effect), inflation)| {
                    Some(deviations(gains.get(draw)? / inflation, freedom(*effect)))
                })
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let mut best: Vec<f64> = (0..self.misfits.len()).map(best_of).collect();
        best.sort_by(f64::total_cmp);
        best
    }
}

/// Columns of an effect beside those `own` already in the model, with their priors.
fn beside(all: &[ParameterId], own: &[usize], effect: Effect) -> (Vec<usize>, Vec<f64>) {
    let of_effect = (0..all.len()).filter(|&k| all[k].effect == effect && !own.contains(&k));
    let columns: Vec<usize> = own.iter().copied().chain(of_effect).collect();
    let priors = columns.iter().map(|&k| all[k].prior_deviation()).collect();
    (columns, priors)
}

/// What is expected of a flight in which nothing is missing: its misfit, and the root mean square of each channel.
pub(super) fn expected(
    track: &Track,
    linearization: &Linearization,
    model: &Model<f64>,
    seed: u64,
) -> (f64, Channels) {
    let draws = Draws::new(track, linearization, model, seed);
    let misfits = (0..BODIES * NOISES).map(|draw| draws.marginalized(draw).misfit);
    (quantile(misfits.collect(), 0.5), draws.floor())
}

/// Draws of everything that may be wrong without being an effect, and of what the sensors add.
struct Draws<'a> {
    linearization: &'a Linearization,
    matrix: NormalMatrix,
    /// By body and stretch: what the body flies differently from that in the files.
    beyond_files: Vec<Vec<DVector<f64>>>,
    /// By body and stretch: what is left of that once the body was fitted, in deviations.
    left: Vec<Vec<DVector<f64>>>,
    /// Fitted bodies.
    fitted: Vec<Nuisance>,
    seed: u64,
}

impl<'a> Draws<'a> {
    fn new(track: &Track, linearization: &'a Linearization, model: &Model<f64>, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let bodies: Vec<Nuisance> = (0..BODIES).map(|_| Nuisance::drawn(&mut random)).collect();
        let flown = flown_with(track, linearization, model, &bodies);
        let normals: Vec<NormalMatrix> = linearization
            .parts
            .par_iter()
            .map(|(_, block)| NormalMatrix::of(&block.effects, &block.nuisances))
            .collect();
        let columns = |(_, block): &Part| block.effects.ncols();
        let columns = linearization.parts.first().map_or(0, columns);
        let fitted = flown.par_iter().map(|flown| {
            let linearization = linearization.measuring(&flown.beyond_linearization);
            let data = Data::new(track, model, &linearization);
            let fit = data.profiled(&EffectSet::new(), |_| true);
            (data.residuals(&fit), fit.nuisance)
        });
        let (left, fitted) = fitted.unzip();
        Self {
            linearization,
            matrix: sum(NormalMatrix::nothing(columns, COUNT), &normals),
            beyond_files: flown.into_iter().map(|flown| flown.beyond_files).collect(),
            left,
            fitted,
            seed,
        }
    }

    /// Noise of one stretch in one draw (deviations).
    fn noise(&self, stretch: usize, draw: usize) -> DVector<f64> {
        let number = (self.seed << 32) ^ ((stretch as u64) << 12) ^ draw as u64;
        let mut random = ChaCha8Rng::seed_from_u64(number);
        DVector::from_fn(NUMBERS, |_, _| random.sample::<f64, _>(StandardNormal))
    }

    /// The body of a draw with its noise, joints and subject taken out.
    fn marginalized(&self, draw: usize) -> Marginalized {
        let body = draw % BODIES;
        let parts: Vec<NormalVector> = self
            .linearization
            .parts
            .par_iter()
            .zip(&self.left[body])
            .enumerate()
            .map(|(stretch, ((_, block), left))| {
                let white = left + self.noise(stretch, draw);
                NormalVector::of(&white, &block.effects, &block.nuisances)
            })
            .collect();
        let vector = sum(NormalVector::nothing(&self.matrix), &parts);
        Marginalized::of(&self.matrix, &vector, &self.fitted[body].0)
    }

    /// Root mean square of each channel, in the middle of the bodies.
    fn floor(&self) -> Channels {
        let square_of = |body: usize| {
            let plain: Vec<_> = (0..self.linearization.parts.len())
                .map(|stretch| {
                    let block = &self.linearization.parts[stretch].1;
                    &self.beyond_files[body][stretch] + block.noise(&self.noise(stretch, body))
                })
                .collect();
            super::gap::mean_square(&plain.iter().collect::<Vec<_>>())
        };
        let squares: Vec<Channels> = (0..BODIES).into_par_iter().map(square_of).collect();
        let middle = |channel: usize| quantile(squares.iter().map(|s| s[channel]).collect(), 0.5);
        Channels::from_iterator((0..CHANNELS).map(|channel| middle(channel).sqrt()))
    }
}
