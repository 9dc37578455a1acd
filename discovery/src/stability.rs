//! Whether a choice hangs on a few moments of the flight: the same choice in flights put together from blocks of it.
//! And whether what it leaves is noise.

use nalgebra::{DMatrix, DVector};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use serde::Serialize;

use super::fit::{Data, Fit};
use super::linearization::Part;
use super::normal_equations::{Marginalized, NormalMatrix, NormalVector, sum};
use super::nuisance::Nuisance;
use super::statistics::correlation;
use super::stretch::CHANNELS;

/// Stretches of a block: three seconds, longer than what one movement of the skydiver leaves in the residuals.
const BLOCK: usize = 5;

/// Flights put together.
const RESAMPLES: usize = 100;

/// Residuals of every stretch with some effects, and what joints and subject may change in them.
pub(super) struct Parts {
    of_stretch: Vec<(NormalMatrix, NormalVector)>,
    white: Vec<DVector<f64>>,
    nuisance: Nuisance,
}

impl Parts {
    pub(super) fn of(data: &Data<'_>, fit: &Fit) -> Self {
        let white = data.residuals(fit);
        let of_stretch = |((_, block), white): (&Part, &DVector<f64>)| {
            let none = DMatrix::zeros(white.len(), 0);
            let vector = NormalVector::of(white, &none, &block.nuisances);
            (NormalMatrix::of(&none, &block.nuisances), vector)
        };
        let parts = data.linearization.parts.par_iter().zip(&white);
        let of_stretch = parts.map(of_stretch).collect();
        Self {
            of_stretch,
            white,
            nuisance: fit.nuisance.clone(),
        }
    }

    /// Correlation of one row with the next, and the number of pairs.
    fn lag_one(&self) -> (f64, usize) {
        let (mut now, mut later) = (Vec::new(), Vec::new());
        for white in &self.white {
            let white = white.as_slice();
            let next = white.get(CHANNELS..).unwrap_or(&[]);
            now.extend_from_slice(&white[..next.len()]);
            later.extend_from_slice(next);
        }
        (correlation(&now, &later), now.len())
    }

    fn misfit(&self, stretches: &[usize]) -> f64 {
        let own = || stretches.iter().filter_map(|&k| self.of_stretch.get(k));
        let nothing = NormalMatrix::nothing(0, self.nuisance.0.len());
        let vector = sum(
            NormalVector::nothing(&nothing),
            own().map(|(_, vector)| vector),
        );
        let matrix = sum(nothing, own().map(|(matrix, _)| matrix));
        Marginalized::of(&matrix, &vector, &self.nuisance.0).misfit
    }
}

/// Correlation of what is left with what is left a tenth of a second later, in deviations of the noise; zero for noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Whiteness {
    /// Of the plain model.
    pub lag_one_before: f64,
    /// With the effects found.
    pub lag_one_after: f64,
    /// Deviation of either where nothing but noise is left.
    pub deviation: f64,
}

impl Whiteness {
    pub(super) fn of(before: &Parts, after: &Parts) -> Self {
        let [(lag_one_before, _), (lag_one_after, count)] = [before, after].map(Parts::lag_one);
        Self {
            lag_one_before,
            lag_one_after,
            deviation: 1.0 / (count.max(1) as f64).sqrt(),
        }
    }
}

/// Share of the resampled flights in which the first of some candidates, or one of those `with_it`, scores best;
/// `score` makes a score of the index of a candidate and its gain over `before`.
pub(super) fn stability(
    before: &Parts,
    candidates: &[Parts],
    with_it: &[usize],
    score: impl Fn(usize, f64) -> f64 + Sync,
) -> f64 {
    let blocks = before.of_stretch.len().div_ceil(BLOCK);
    if blocks == 0 {
        return 0.0;
    }
    let wins = (0..RESAMPLES).into_par_iter().filter(|&resample| {
        let mut random = ChaCha8Rng::seed_from_u64(resample as u64);
        let stretches: Vec<usize> = (0..blocks)
            .flat_map(|_| {
                let block = random.random_range(0..blocks);
                block * BLOCK..before.of_stretch.len().min((block + 1) * BLOCK)
            })
            .collect();
        let without = before.misfit(&stretches);
        let scores = candidates
            .iter()
            .enumerate()
            .map(|(k, candidate)| (k, score(k, without - candidate.misfit(&stretches))));
        let best = scores.max_by(|a, b| a.1.total_cmp(&b.1));
        best.is_some_and(|(k, _)| k == 0 || with_it.contains(&k))
    });
    wins.count() as f64 / RESAMPLES as f64
}
