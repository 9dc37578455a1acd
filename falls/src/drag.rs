//! Drag and lift of a fall over time, and its division into pieces of constant posture.
//!
//! Over a second, the change of velocity is the sum of gravity, drag and lift. So each block of the track gives a drag
//! factor, area times coefficient over mass (m2/kg), without differentiation. Since postures change, the blocks are
//! divided into pieces of constant drag factor. Dynamic programming finds the division with the least squares; every
//! piece has a penalty, so the data determine the number of pieces.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector3;

use crate::atmosphere::Atmosphere;
use crate::statistics::{noise_from_third_differences, third_difference};
use crate::wind::Profile;
use crate::{Sample, median};

/// Length of a block (s).
const BLOCK: f64 = 1.0;

/// Longest time between samples within a block (s).
const GAP: f64 = 1.5;

/// Variation of the drag between blocks within one posture, as a fraction.
const JITTER: f64 = 0.03;

/// Shortest length of a piece (s).
const LEAST: f64 = 3.0;

/// Penalty of a piece for each fitted value, as a multiple of the logarithm of the number of blocks.
const PRICE: f64 = 3.0;

/// Glide ratio from which lift is fitted too: tracking suits, wingsuits.
const GLIDES: f64 = 0.4;

/// One second of the fall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// Time of its middle (s).
    pub time: f64,
    /// Length (s).
    pub duration: f64,
    /// Mean height above mean sea level (m).
    pub height: f64,
    /// Drag factor: area times coefficient over mass (m2/kg).
    pub drag: f64,
    /// Lift factor, upwards across the stream: area times coefficient over mass (m2/kg).
    pub lift: f64,
    /// Standard deviation of both from receiver noise (m2/kg).
    pub deviation: f64,
    /// Mean airspeed (m/s).
    pub airspeed: f64,
    /// Mean downward speed (m/s).
    pub down: f64,
    /// Mean horizontal airspeed (m/s).
    pub across: f64,
}

/// A piece of the fall with one posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// Start and end (s).
    pub time: [f64; 2],
    /// Drag factor (m2/kg).
    pub drag: f64,
    /// Standard deviation of the drag factor (m2/kg).
    pub deviation: f64,
    /// Lift factor (m2/kg); zero if the fall does not glide.
    pub lift: f64,
    /// Glide ratio through the air: horizontal over downward speed.
    pub glide: f64,
}

/// The blocks of a fall.
pub fn blocks(
    samples: &[Sample],
    wind: &Profile,
    atmosphere: &Atmosphere,
    noise: f64,
) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut first = 0;
    for index in 1..samples.len() {
        if samples[index].time - samples[index - 1].time > GAP {
            first = index;
        } else if samples[index].time - samples[first].time >= BLOCK - 1e-6 {
            blocks.extend(block(
                &samples[first..=index],
                &wind.values[first..=index],
                atmosphere,
                noise,
            ));
            first = index;
        }
    }
    blocks
}

fn block(
    part: &[Sample],
    wind: &[crate::wind::Wind],
    atmosphere: &Atmosphere,
    noise: f64,
) -> Option<Block> {
    let (first, last) = (part.first()?, part.last()?);
    let duration = last.time - first.time;
    let through_air = |index: usize| {
        let air = wind[index].velocity;
        part[index].velocity - Vector3::new(air.x, air.y, 0.0)
    };
    let mut drag = Vector3::zeros();
    let mut lift = Vector3::zeros();
    let mut mean = Vector3::zeros();
    for index in 0..part.len() {
        let before = index
            .checked_sub(1)
            .map_or(first.time, |before| part[before].time);
        let after = part.get(index + 1).map_or(last.time, |after| after.time);
        let share = 0.5 * (after - before);
        let stream = through_air(index);
        let pressure = 0.5 * atmosphere.density(part[index].height()) * stream.norm();
        drag -= stream * (pressure * share);
        let upwards = upwards(&stream).unwrap_or_else(Vector3::zeros);
        lift += upwards * (pressure * stream.norm() * share);
        mean += stream * (share / duration);
    }
    let push = last.velocity - first.velocity + Vector3::z() * (GRAVITY * duration);
    let squared = drag.norm_squared();
    if squared <= 0.0 {
        return None;
    }
    let factor = push.dot(&drag) / squared;
    let rest = push - drag * factor;
    let lift_squared = lift.norm_squared();
    Some(Block {
        time: 0.5 * (first.time + last.time),
        duration,
        height: 0.5 * (first.height() + last.height()),
        drag: factor,
        lift: if lift_squared > 0.01 * squared {
            rest.dot(&lift) / lift_squared
        } else {
            0.0
        },
        deviation: noise * core::f64::consts::SQRT_2 / squared.sqrt(),
        airspeed: mean.norm(),
        down: -mean.z,
        across: mean.xy().norm(),
    })
}

/// The direction across a stream that points up most; `None` for a vertical stream.
pub fn upwards(stream: &Vector3<f64>) -> Option<Vector3<f64>> {
    let along = stream.try_normalize(1e-6)?;
    (Vector3::z() - along * along.z).try_normalize(1e-2)
}

/// Whether a fall glides enough to determine its lift.
pub fn glides(blocks: &[Block]) -> bool {
    let glide = median(
        blocks
            .iter()
            .map(|block| block.across / block.down.max(1.0)),
    );
    glide.is_some_and(|glide| glide > GLIDES)
}

/// Cumulative sums over the blocks; their differences give the sum of squares of any piece.
#[derive(Default, Clone, Copy)]
struct Sums {
    weight: f64,
    value: f64,
    square: f64,
}

impl Sums {
    fn with(mut self, value: f64, weight: f64) -> Self {
        self.weight += weight;
        self.value += weight * value;
        self.square += weight * value * value;
        self
    }

    /// Returns the sum of squares about the mean between two places, the mean, and its standard deviation.
    fn between(from: &Self, to: &Self) -> (f64, f64, f64) {
        let weight = to.weight - from.weight;
        let value = to.value - from.value;
        let square = to.square - from.square;
        (
            (square - value * value / weight).max(0.0),
            value / weight,
            weight.sqrt().recip(),
        )
    }
}

/// Variance of each block's value within one posture, scaled up to the scatter between neighbouring values.
fn variances(values: &[f64], blocks: &[Block]) -> Vec<f64> {
    let usual = median(blocks.iter().map(|block| block.drag.abs())).unwrap_or(0.0);
    let own = |block: &Block| block.deviation.powi(2) + (JITTER * usual).powi(2);
    let next = values
        .windows(2)
        .zip(blocks.windows(2))
        .map(|(values, blocks)| {
            (values[1] - values[0]).powi(2) / (own(&blocks[0]) + own(&blocks[1]))
        });
    // The median of a squared normal number is 0.455.
    let scale = median(next).map_or(1.0, |middle| (middle / 0.455).max(1.0));
    blocks.iter().map(|block| own(block) * scale).collect()
}

/// The pieces of a fall; empty if there are no blocks.
pub fn pieces(blocks: &[Block]) -> Vec<Piece> {
    let glides = glides(blocks);
    let mut series: Vec<Vec<f64>> = vec![blocks.iter().map(|block| block.drag).collect()];
    if glides {
        series.push(blocks.iter().map(|block| block.lift).collect());
    }
    let sums: Vec<Vec<Sums>> = series
        .iter()
        .map(|values| {
            let mut sums = vec![Sums::default()];
            for (value, variance) in values.iter().zip(variances(values, blocks)) {
                sums.push(sums[sums.len() - 1].with(*value, 1.0 / variance));
            }
            sums
        })
        .collect();
    let count = blocks.len();
    let price = PRICE * series.len() as f64 * (count.max(2) as f64).ln();
    let long_enough = |from: usize, to: usize| {
        let duration: f64 = blocks[from..to].iter().map(|block| block.duration).sum();
        duration >= LEAST || (from == 0 && to == count)
    };
    // For each place, the cost of the best division up to it, and the start of its last piece.
    let mut best = vec![(f64::INFINITY, 0); count + 1];
    best[0] = (0.0, 0);
    for to in 1..=count {
        for from in 0..to {
            if !long_enough(from, to) || !best[from].0.is_finite() {
                continue;
            }
            let squares: f64 = sums
                .iter()
                .map(|sums| Sums::between(&sums[from], &sums[to]).0)
                .sum();
            let cost = best[from].0 + squares + price;
            if cost < best[to].0 {
                best[to] = (cost, from);
            }
        }
    }
    let mut pieces = Vec::new();
    let mut to = count;
    while to > 0 {
        let from = best[to].1;
        let (_, drag, deviation) = Sums::between(&sums[0][from], &sums[0][to]);
        let part = &blocks[from..to];
        pieces.push(Piece {
            time: [
                part[0].time - 0.5 * part[0].duration,
                part[part.len() - 1].time + 0.5 * part[part.len() - 1].duration,
            ],
            drag,
            deviation,
            lift: sums
                .get(1)
                .map_or(0.0, |sums| Sums::between(&sums[from], &sums[to]).1),
            glide: part.iter().map(|block| block.across).sum::<f64>()
                / part.iter().map(|block| block.down).sum::<f64>().max(1.0),
        });
        to = from;
    }
    pieces.reverse();
    pieces
}

/// Noise of one component of a velocity (m/s), from the third differences of four consecutive samples.
pub fn velocity_noise(samples: &[Sample]) -> f64 {
    const LEAST_NOISE: f64 = 0.1;
    let left = samples.windows(4).flat_map(|four| {
        let third = third_difference(core::array::from_fn(|k| four[k].velocity));
        [third.x.abs(), third.y.abs(), third.z.abs()]
    });
    median(left)
        .map_or(0.0, noise_from_third_differences)
        .max(LEAST_NOISE)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flown(factors: &[(usize, f64)]) -> Vec<Block> {
        let mut blocks = Vec::new();
        for (count, factor) in factors {
            for _ in 0..*count {
                let index = blocks.len();
                let wobble = [0.4, -1.0, 0.7, 0.1, -0.5][index % 5] * 2e-4;
                blocks.push(Block {
                    time: index as f64 + 0.5,
                    duration: 1.0,
                    height: 3000.0,
                    drag: factor + wobble,
                    lift: 0.0,
                    deviation: 1e-4,
                    airspeed: 50.0,
                    down: 50.0,
                    across: 1.0,
                });
            }
        }
        blocks
    }

    #[test]
    fn one_posture_is_one_piece_and_each_change_begins_another() {
        assert_eq!(pieces(&flown(&[(40, 0.0065)])).len(), 1);
        let three = pieces(&flown(&[(15, 0.0065), (12, 0.0035), (9, 0.0070)]));
        assert_eq!(three.len(), 3, "{three:?}");
        for (piece, (from, factor)) in
            three
                .iter()
                .zip([(0.0, 0.0065), (15.0, 0.0035), (27.0, 0.007)])
        {
            assert!((piece.time[0] - from).abs() < 1.5, "{piece:?}");
            assert!((piece.drag - factor).abs() < 2e-4, "{piece:?}");
        }
        assert_eq!(pieces(&[]), []);
    }
}
