//! The linear problem: residuals of all stretches, what each effect would change in them, and what may be wrong
//! without being an effect.
//!
//! Every column is a difference of two flights of the model, so an effect needs no code here. Columns and
//! residuals are whitened by the noise of sensors and starts. Calibration of joints, and a subject that is a few
//! percent off, are nuisances with a prior: they are taken out of residuals and columns alike
//! (Brynjarsdottir and O'Hagan: without priors a discrepancy and the parameters cannot be told apart).

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::fit::{Values, with};
use super::stretch::{Channels, NUMBERS, Prepared, Stretch, start_deviation, variance};
use super::track::Track;

/// Deviation of the calibration of a joint about one axis (rad): the suit's 2 degrees.
const JOINT_DEVIATION: f64 = 0.02;

/// What a subject file may have wrong, with standard deviations.
const SUBJECT: [(Effect, [f64; PARAMETER_COUNT]); 6] = [
    (Effect::Mass, [0.03, 0.0, 0.0]),
    (Effect::AddedMass, [0.03, 0.0, 0.0]),
    (Effect::Drag, [0.04; PARAMETER_COUNT]),
    (Effect::Lift, [0.04; PARAMETER_COUNT]),
    (Effect::Moment, [0.04; PARAMETER_COUNT]),
    (Effect::CgOffset, [0.004; PARAMETER_COUNT]),
];

/// Joints, by the segment behind them, and axes.
const JOINTS: usize = 3 * (bodyflight_core::body::SEGMENT_COUNT - 1);

/// One parameter of an effect, a column of the problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The effect.
    pub effect: Effect,
    /// Which of its parameters.
    pub index: usize,
}

/// All parameters of all effects, in order.
pub fn places() -> Vec<Place> {
    let parameters = |&effect: &Effect| {
        let count = effect.description().parameters.len();
        (0..count).map(move |index| Place { effect, index })
    };
    Effect::ALL.iter().flat_map(parameters).collect()
}

/// The parameters among them that a subject's file may have wrong.
pub fn subject_places() -> Vec<Place> {
    let of_subject = |place: &Place| SUBJECT.iter().any(|(effect, _)| *effect == place.effect);
    places().into_iter().filter(of_subject).collect()
}

/// What is added to a parameter for a difference.
fn step(place: Place) -> f64 {
    let parameter = &place.effect.description().parameters[place.index];
    0.02 * (parameter.high - parameter.low)
}

/// Whitened numbers of one stretch.
pub struct Block {
    /// Residual.
    pub residual: DVector<f64>,
    /// What each parameter of the places asked for changes.
    pub effects: DMatrix<f64>,
    /// What each nuisance changes, in deviations of its prior.
    pub nuisances: DMatrix<f64>,
    /// The whitening.
    whitening: Cholesky<f64, Dyn>,
}

/// A joint turned by an error.
fn turned(posture: Posture<f64>, joint: usize, angle: f64) -> Posture<f64> {
    let segment = Segment::ALL[joint / 3 + 1];
    let mut turn = Vector3::zeros();
    turn[joint % 3] = angle;
    posture.with(
        segment,
        posture.parent_from_segment(segment) * small_rotation(&turn),
    )
}

/// The plain model with effects of which one parameter is changed by a small step, and the step that was possible.
///
/// Effects are applied from the plain model again: some multiply what is there, or take its place.
pub(super) fn changed(plain: &Model<f64>, values: &Values, place: Place) -> (Model<f64>, f64) {
    let mut values = values.clone();
    if !values.iter().any(|(effect, _)| *effect == place.effect) {
        values.push((place.effect, place.effect.neutral()));
    }
    let parameter = &place.effect.description().parameters[place.index];
    let mut size = step(place);
    for (effect, values) in &mut values {
        if *effect == place.effect {
            let value = &mut values[place.index];
            if *value + size > parameter.high {
                size = -size;
            }
            *value += size;
        }
    }
    (with(plain, &values), size)
}

/// Stretches with the problem around a model with effects, with columns for some places, among them at least
/// [`subject_places`]; without those whose noise has no covariance.
pub fn blocks(
    track: &Track,
    plain: &Model<f64>,
    stretches: Vec<Stretch>,
    values: &Values,
    places: &[Place],
) -> Vec<(Stretch, Block)> {
    stretches
        .into_par_iter()
        .filter_map(|stretch| {
            let block = block(track, &stretch, plain, values, places)?;
            Some((stretch, block))
        })
        .collect()
}

fn block(
    track: &Track,
    stretch: &Stretch,
    plain: &Model<f64>,
    values: &Values,
    places: &[Place],
) -> Option<Block> {
    let none = Channels::zeros();
    let model = &with(plain, values);
    let recorded = |posture: Posture<f64>| posture;
    let base = Prepared::new(track, stretch, model, &recorded);
    let residual = base.residual(&none);

    // The start is free within what smoothing leaves: it adds to the noise.
    let mut covariance = DMatrix::from_diagonal(&variance());
    for (channel, deviation) in start_deviation().iter().enumerate() {
        let mut start = none;
        start[channel] = *deviation;
        let column = base.apart(&start, &base);
        covariance += &column * column.transpose();
    }
    let whitening = covariance.cholesky()?;
    let whiten = |column: DVector<f64>| white(&whitening, column);

    let mut effects = DMatrix::zeros(NUMBERS, places.len());
    for (k, place) in places.iter().enumerate() {
        let (other, size) = changed(plain, values, *place);
        let column = Prepared::new(track, stretch, &other, &recorded).apart(&none, &base) / size;
        effects.set_column(k, &whiten(column));
    }
    let mut nuisances = DMatrix::zeros(NUMBERS, JOINTS + SUBJECT.len() * PARAMETER_COUNT);
    for joint in 0..JOINTS {
        let askew = |posture: Posture<f64>| turned(posture, joint, JOINT_DEVIATION);
        let column = Prepared::new(track, stretch, model, &askew).apart(&none, &base);
        nuisances.set_column(joint, &whiten(column));
    }
    for (row, (effect, deviations)) in SUBJECT.iter().enumerate() {
        for (index, deviation) in deviations.iter().enumerate() {
            let wanted = Place {
                effect: *effect,
                index,
            };
            if let Some(k) = places.iter().position(|place| *place == wanted) {
                let column = effects.column(k) * *deviation;
                nuisances.set_column(JOINTS + PARAMETER_COUNT * row + index, &column);
            }
        }
    }
    Some(Block {
        residual: whiten(residual),
        effects,
        nuisances,
        whitening,
    })
}

fn white(whitening: &Cholesky<f64, Dyn>, mut column: DVector<f64>) -> DVector<f64> {
    whitening.l_dirty().solve_lower_triangular_mut(&mut column);
    column
}

impl Block {
    /// Residual of a stretch in another model, and what single parameters change in it, whitened.
    pub fn around(
        &self,
        track: &Track,
        stretch: &Stretch,
        plain: &Model<f64>,
        values: &Values,
        places: &[Place],
    ) -> (DVector<f64>, DMatrix<f64>) {
        let none = Channels::zeros();
        let recorded = |posture: Posture<f64>| posture;
        let base = Prepared::new(track, stretch, &with(plain, values), &recorded);
        let residual = base.residual(&none);
        let mut columns = DMatrix::zeros(NUMBERS, places.len());
        for (k, place) in places.iter().enumerate() {
            let (other, size) = changed(plain, values, *place);
            let column =
                Prepared::new(track, stretch, &other, &recorded).apart(&none, &base) / size;
            columns.set_column(k, &white(&self.whitening, column));
        }
        (white(&self.whitening, residual), columns)
    }
}

/// One draw of everything that may be wrong without being an effect, and what the sensors add: residuals of all
/// stretches, whitened and plain, as they would be if the model were right.
pub fn drawn(
    track: &Track,
    pairs: &[(Stretch, Block)],
    model: &Model<f64>,
    seed: u64,
) -> Vec<(DVector<f64>, DVector<f64>)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || random.sample::<f64, _>(StandardNormal);
    let errors: Vec<f64> = (0..JOINTS).map(|_| normal() * JOINT_DEVIATION).collect();
    let mut other = *model;
    for (effect, deviations) in SUBJECT {
        let mut values = effect.neutral();
        for (value, deviation) in values.iter_mut().zip(deviations) {
            *value += normal() * deviation;
        }
        // Deviations are far inside the plausible ranges.
        let _ = effect.apply(&values, &mut other);
    }
    let seeds: Vec<u64> = pairs.iter().map(|_| random.random()).collect();
    let noise = variance().map(f64::sqrt);
    let askew = |posture: Posture<f64>| {
        let joints = errors.iter().enumerate();
        joints.fold(posture, |posture, (joint, angle)| {
            turned(posture, joint, *angle)
        })
    };
    let all = pairs.par_iter().zip(seeds);
    all.map(|((stretch, block), seed)| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || random.sample::<f64, _>(StandardNormal);
        let start = start_deviation().map(|deviation| deviation * normal());
        let base = Prepared::new(track, stretch, model, &|posture| posture);
        let flown = Prepared::new(track, stretch, &other, &askew).apart(&start, &base);
        let plain = flown + noise.map(|deviation| deviation * normal());
        (white(&block.whitening, plain.clone()), plain)
    })
    .collect()
}
