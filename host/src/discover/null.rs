//! Flights drawn from the plain model, in which nothing is missing but joints, subject and sensors have their errors:
//! what is found in them is chance.

use bodyflight_core::effect::{Effect, Model};
use nalgebra::DVector;

use super::design::{Block, Place, drawn, places};
use super::fit::{Reduced, reach};
use super::report;
use super::stretch::{Channels, NUMBERS, Stretch};
use super::track::Track;

/// Flights drawn from the plain model, by which significance is judged.
const DRAWS: u64 = 40;

/// What flights look like in which nothing is missing.
pub(super) struct Null {
    /// Mean misfit and its deviation.
    pub(super) misfit: [f64; 2],
    /// Mean gain of each effect over the number of its parameters, at least one.
    pub(super) inflation: Vec<f64>,
    /// Root mean square of each channel.
    pub(super) floor: Channels,
}

impl Null {
    /// What an effect gains by chance over the number of its parameters.
    pub(super) fn inflation_of(&self, effect: Effect) -> f64 {
        let all = Effect::ALL.iter().zip(&self.inflation);
        all.into_iter()
            .find(|(e, _)| **e == effect)
            .map_or(1.0, |(_, inflation)| *inflation)
    }
}

/// Draws them.
pub(super) fn draw(
    track: &Track,
    pairs: &[(Stretch, Block)],
    model: &Model<f64>,
    seed: u64,
) -> Null {
    let places = places();
    let mut misfits = Vec::new();
    let mut gains: Vec<Vec<f64>> = vec![Vec::new(); Effect::ALL.len()];
    let mut squares = Vec::new();
    for draw in 0..DRAWS {
        let residuals = drawn(track, pairs, model, seed_of(seed, draw));
        let reduced = Reduced::of(
            residuals
                .iter()
                .zip(pairs)
                .map(|((white, _), (_, block))| (white, &block.effects, &block.nuisances)),
        );
        misfits.push(reduced.misfit);
        for (gains, &effect) in gains.iter_mut().zip(Effect::ALL) {
            gains.push(gain_of(&reduced, &places, effect));
        }
        squares.push(square_of(&residuals));
    }
    // Medians: a draw may be so far off that the flight tumbles, and one such draw is most of a mean.
    let rows = (pairs.len() * NUMBERS) as f64;
    let middle = quantile(&mut misfits, 0.5);
    let spread = quantile(&mut misfits, 0.84) - middle;
    let inflation = gains.iter_mut().zip(Effect::ALL).map(|(gains, effect)| {
        let freedom = effect.description().parameters.len() as f64;
        let median = freedom * (1.0 - 2.0 / (9.0 * freedom)).powi(3);
        (quantile(gains, 0.5) / median).max(1.0)
    });
    Null {
        misfit: [middle, spread.max((2.0 * rows).sqrt())],
        inflation: inflation.collect(),
        floor: middle_of(&squares),
    }
}

/// Root mean square of each channel of a flight in which nothing is missing.
pub(super) fn floor(
    track: &Track,
    pairs: &[(Stretch, Block)],
    model: &Model<f64>,
    seed: u64,
) -> Channels {
    let draws = (0..DRAWS).map(|draw| drawn(track, pairs, model, seed_of(seed, draw)));
    middle_of(
        &draws
            .map(|residuals| square_of(&residuals))
            .collect::<Vec<_>>(),
    )
}

const fn seed_of(seed: u64, draw: u64) -> u64 {
    seed.wrapping_mul(1000).wrapping_add(draw)
}

fn square_of(residuals: &[(DVector<f64>, DVector<f64>)]) -> Channels {
    let plain: Vec<_> = residuals.iter().map(|(_, plain)| plain).collect();
    report::mean_square(&plain)
}

fn middle_of(squares: &[Channels]) -> Channels {
    Channels::from_fn(|channel, _| {
        let mut values: Vec<f64> = squares.iter().map(|square| square[channel]).collect();
        quantile(&mut values, 0.5).sqrt()
    })
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
fn gain_of(reduced: &Reduced, places: &[Place], effect: Effect) -> f64 {
    let own: Vec<usize> = (0..places.len())
        .filter(|&k| places[k].effect == effect)
        .collect();
    let reach: Vec<f64> = own.iter().map(|&k| reach(places[k])).collect();
    reduced.only(&own).gain(&reach)
}
