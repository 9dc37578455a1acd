//! Flights drawn from a model, in which nothing is missing but joints, subject and sensors have their errors: what is
//! found in them is chance, and how far parameters fitted to them are off is their standard error.

use bodyflight_core::effect::{Effect, Model};
use nalgebra::DVector;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::choice::deviations;
use super::design::{Around, Part, Place, flown_wrong, freedom, places};
use super::fit::{Data, Values, columns, reach, with};
use super::linear::{Normal, Reduced, Right, sum};
use super::stretch::{CHANNELS, Channels, NUMBERS};
use super::tolerance::{COUNT, Wrong};
use super::track::Track;

/// Draws of joints and subject that are flown.
const BODIES: usize = 25;

/// Draws of the noise for each of them.
const NOISES: usize = 8;

/// What flights look like in which nothing is missing.
pub(super) struct Null {
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

impl Null {
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

    /// Draws them from the model with `values`, around which `around` is the problem, with a column for every
    /// parameter of the library.
    pub(super) fn draw(
        track: &Track,
        around: &Around,
        plain: &Model<f64>,
        values: &Values,
        seed: u64,
    ) -> Self {
        let draws = Draws::new(track, around, &with(plain, values), seed);
        let places = places();
        let own = columns(values);
        let priors: Vec<f64> = own.iter().map(|place| reach(*place)).collect();
        let own: Vec<usize> = own
            .iter()
            .filter_map(|place| places.iter().position(|other| other == place))
            .collect();
        let mut misfits = Vec::new();
        let mut gains: Vec<Vec<f64>> = vec![Vec::new(); Effect::ALL.len()];
        let mut off: Vec<Vec<f64>> = vec![Vec::new(); own.len()];
        for draw in 0..BODIES * NOISES {
            let reduced = draws.reduced(draw);
            let fitted = reduced.only(&own);
            let gain = fitted.gain(&priors);
            misfits.push(reduced.misfit - gain);
            if let Some((step, _)) = fitted.solved(&priors) {
                for (off, step) in off.iter_mut().zip(&step) {
                    off.push(step.abs());
                }
            }
            for (gains, &effect) in gains.iter_mut().zip(Effect::ALL) {
                let (columns, priors) = beside(&places, &own, effect);
                gains.push((reduced.only(&columns).gain(&priors) - gain).max(0.0));
            }
        }
        // Medians: a draw may be so far off that the flight tumbles, and one such draw is most of a mean.
        let rows = (around.parts.len() * NUMBERS) as f64;
        let middle = quantile(misfits.clone(), 0.5);
        let spread = quantile(misfits, 0.84) - middle;
        let inflation: Vec<f64> = gains
            .iter()
            .zip(Effect::ALL)
            .map(|(gains, effect)| {
                let freedom = freedom(*effect);
                let median = freedom * (1.0 - 2.0 / (9.0 * freedom)).powi(3);
                (quantile(gains.clone(), 0.5) / median).max(1.0)
            })
            .collect();
        let known = |effect: &Effect| values.iter().any(|(known, _)| known == effect);
        let best_of = |draw: usize| {
            let all = gains.iter().zip(Effect::ALL).zip(&inflation);
            all.filter(|((_, effect), _)| !known(effect))
                .filter_map(|((gains, effect), inflation)| {
                    Some(deviations(gains.get(draw)? / inflation, freedom(*effect)))
                })
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let mut best: Vec<f64> = (0..BODIES * NOISES).map(best_of).collect();
        best.sort_by(f64::total_cmp);
        Self {
            rows,
            misfit: [middle, spread.max((2.0 * rows).sqrt())],
            inflation,
            best,
            floor: draws.floor(),
            // As of a normal distribution: two thirds of the draws are less far off.
            errors: off.into_iter().map(|off| quantile(off, 0.683)).collect(),
        }
    }
}

/// Columns of an effect beside those `own` already in the model, with their priors.
fn beside(places: &[Place], own: &[usize], effect: Effect) -> (Vec<usize>, Vec<f64>) {
    let of_effect = (0..places.len()).filter(|&k| places[k].effect == effect && !own.contains(&k));
    let columns: Vec<usize> = own.iter().copied().chain(of_effect).collect();
    let priors = columns.iter().map(|&k| reach(places[k])).collect();
    (columns, priors)
}

/// What is expected of a flight in which nothing is missing: its misfit, and the root mean square of each channel.
pub(super) fn expected(
    track: &Track,
    around: &Around,
    model: &Model<f64>,
    seed: u64,
) -> (f64, Channels) {
    let draws = Draws::new(track, around, model, seed);
    let misfits = (0..BODIES * NOISES).map(|draw| draws.reduced(draw).misfit);
    (quantile(misfits.collect(), 0.5), draws.floor())
}

/// Draws of everything that may be wrong without being an effect, and of what the sensors add.
struct Draws<'a> {
    around: &'a Around,
    normal: Normal,
    /// By body and stretch: what the body flies differently from that in the files.
    beyond_files: Vec<Vec<DVector<f64>>>,
    /// By body and stretch: what is left of that once the body was fitted, in deviations.
    left: Vec<Vec<DVector<f64>>>,
    /// Fitted bodies.
    fitted: Vec<Wrong>,
    seed: u64,
}

impl<'a> Draws<'a> {
    fn new(track: &Track, around: &'a Around, model: &Model<f64>, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let bodies: Vec<Wrong> = (0..BODIES).map(|_| Wrong::drawn(&mut random)).collect();
        let flown = flown_wrong(track, around, model, &bodies);
        let normals: Vec<Normal> = around
            .parts
            .par_iter()
            .map(|(_, block)| Normal::of(&block.effects, &block.nuisances))
            .collect();
        let columns = |(_, block): &Part| block.effects.ncols();
        let columns = around.parts.first().map_or(0, columns);
        let fitted = flown.par_iter().map(|flown| {
            let around = around.measuring(&flown.beyond_around);
            let data = Data::new(track, model, &around);
            let fit = data.settled(&Values::new(), |_| true);
            (data.residuals(&fit), fit.wrong)
        });
        let (left, fitted) = fitted.unzip();
        Self {
            around,
            normal: sum(Normal::nothing(columns, COUNT), &normals),
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
    fn reduced(&self, draw: usize) -> Reduced {
        let body = draw % BODIES;
        let parts: Vec<Right> = self
            .around
            .parts
            .par_iter()
            .zip(&self.left[body])
            .enumerate()
            .map(|(stretch, ((_, block), left))| {
                let white = left + self.noise(stretch, draw);
                Right::of(&white, &block.effects, &block.nuisances)
            })
            .collect();
        let right = sum(Right::nothing(&self.normal), &parts);
        Reduced::of(&self.normal, &right, &self.fitted[body].0)
    }

    /// Root mean square of each channel, in the middle of the bodies.
    fn floor(&self) -> Channels {
        let square_of = |body: usize| {
            let plain: Vec<_> = (0..self.around.parts.len())
                .map(|stretch| {
                    let block = &self.around.parts[stretch].1;
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

/// The value below which a share of the values lies.
pub(super) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
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
