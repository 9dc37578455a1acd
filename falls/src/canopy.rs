//! The wind under an open canopy: while the canopy circles, its velocity over ground circles about the wind velocity.
//!
//! A canopy in a spiral gains speed as it turns, so the circle is not round, and its centre is not quite the wind. The fit
//! therefore tests itself: it is repeated without each part of the circle in turn, and without the change of airspeed, and
//! what the wind differs by is in its error bar.

use nalgebra::{Matrix4, Vector2, Vector4};

use crate::Sample;
use crate::wind::Wind;

/// Length of the parts in which circles are searched for, and the distance between their starts (s).
const PART: f64 = 30.0;
const STRIDE: f64 = 15.0;

/// Widest gap between neighbouring headings in a part that still counts as a circle (rad).
const GAP: f64 = 1.4;

/// Angle that the heading turns through in one direction (rad): a whole circle, short of some noise.
const TURN: f64 = 6.0;

/// Range of a canopy's horizontal airspeed (m/s).
const SPEEDS: [f64; 2] = [4.0, 25.0];

/// Correlation time of the errors on a circle (s), since a canopy speeds up and slows down as it turns.
const KEPT: f64 = 5.0;

/// Smallest deviation of the wind (m/s): gusts, and a canopy that does not fly quite as fast in every direction.
const LEAST: f64 = 0.3;

/// Wind and airspeed determined from a circle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// The wind at the mean height of the circle.
    pub wind: Wind,
    /// Horizontal airspeed (m/s).
    pub airspeed: f64,
}

/// Finds the circles in the part of the track under canopy.
pub fn circles(samples: &[Sample]) -> Vec<Circle> {
    let Some(first) = samples.first() else {
        return Vec::new();
    };
    let mut circles = Vec::new();
    let mut begin = first.time;
    let last = samples[samples.len() - 1].time;
    while begin + PART <= last {
        let from = samples.partition_point(|sample| sample.time < begin);
        let to = samples.partition_point(|sample| sample.time < begin + PART);
        circles.extend(circle(&samples[from..to]));
        begin += STRIDE;
    }
    circles
}

/// Fits a circle to the velocities of a part by least squares; `None` if they do not go all the way round.
fn circle(part: &[Sample]) -> Option<Circle> {
    let (first, last) = (part.first()?.time, part.last()?.time);
    let middle = 0.5 * (first + last);
    let fitted = fit(part, middle, true)?;
    if !(SPEEDS[0]..SPEEDS[1]).contains(&fitted.radius) || !goes_round(part, &fitted.centre) {
        return None;
    }
    // Leaving out each block in turn shows how far the wind depends on it (a jackknife).
    let blocks = ((last - first) / KEPT).floor().max(4.0);
    let mut without = Vec::new();
    let mut block = 0.0;
    while block < blocks {
        let bounds = [block, block + 1.0].map(|edge| first + (last - first) * edge / blocks);
        let others = part
            .iter()
            .filter(|sample| !(bounds[0]..bounds[1]).contains(&sample.time));
        without.push(fit(others, middle, true)?.centre);
        block += 1.0;
    }
    let mean = without.iter().sum::<Vector2<f64>>() / blocks;
    let steady = fit(part, middle, false)?.centre;
    let deviation = Vector2::from_fn(|axis, _| {
        let squares: f64 = without
            .iter()
            .map(|centre| (centre[axis] - mean[axis]).powi(2))
            .sum();
        let bent = fitted.centre[axis] - steady[axis];
        ((blocks - 1.0) / blocks * squares + bent * bent + LEAST * LEAST).sqrt()
    });
    Some(Circle {
        wind: Wind {
            height: part.iter().map(Sample::height).sum::<f64>() / part.len() as f64,
            velocity: fitted.centre,
            deviation,
        },
        airspeed: fitted.radius,
    })
}

/// A circle of velocities.
struct Fit {
    centre: Vector2<f64>,
    /// At the middle of the part.
    radius: f64,
}

/// Fits a circle, whose radius may change over time, by least squares.
fn fit<'a>(part: impl IntoIterator<Item = &'a Sample>, middle: f64, changes: bool) -> Option<Fit> {
    // The equation |v|^2 = 2 v.c + (r^2 - |c|^2) is linear in the unknowns, also if r^2 is a linear function of time.
    let mut normal = Matrix4::zeros();
    let mut right = Vector4::zeros();
    for sample in part {
        let velocity = sample.velocity.xy();
        let since = if changes { sample.time - middle } else { 0.0 };
        let row = Vector4::new(2.0 * velocity.x, 2.0 * velocity.y, 1.0, since);
        normal += row * row.transpose();
        right += row * velocity.norm_squared();
    }
    normal[(3, 3)] += 1e-6;
    let solved = normal.cholesky()?.solve(&right);
    let centre = Vector2::new(solved[0], solved[1]);
    Some(Fit {
        centre,
        radius: (solved[2] + centre.norm_squared()).max(0.0).sqrt(),
    })
}

/// Whether the velocities turn all the way round a centre, in one direction and without a wide gap.
fn goes_round(part: &[Sample], centre: &Vector2<f64>) -> bool {
    use core::f64::consts::{PI, TAU};
    let mut headings: Vec<f64> = part
        .iter()
        .map(|sample| {
            let around = sample.velocity.xy() - centre;
            around.y.atan2(around.x)
        })
        .collect();
    let turned: f64 = headings
        .windows(2)
        .map(|pair| (pair[1] - pair[0] + PI).rem_euclid(TAU) - PI)
        .sum();
    headings.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (headings.first(), headings.last()) else {
        return false;
    };
    let across_end = first + TAU - last;
    let widest = headings
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .fold(across_end, f64::max);
    turned.abs() >= TURN && widest <= GAP
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::synthetic::{Jump, jump, wind_at};

    #[test]
    fn circles_give_the_wind_of_the_jump() {
        let jumped = Jump::default();
        let samples: Vec<Sample> = jump(&jumped)
            .into_iter()
            .filter(|sample| sample.time > 130.0 && sample.height() > 50.0)
            .collect();
        let circles = circles(&samples);
        assert!(circles.len() > 3);
        for circle in circles {
            let flown = wind_at(&jumped, circle.wind.height).xy();
            assert!((circle.wind.velocity - flown).norm() < 0.5, "{circle:?}");
            assert!((circle.airspeed - 12.0).abs() < 1.5, "{circle:?}");
        }
    }

    #[test]
    fn a_spiral_that_gains_speed_has_honest_bars() {
        let wind = Vector2::new(3.0, -2.0);
        for gain in [0.0, 0.2, 0.4] {
            let mut heading = 0.0_f64;
            let spiral: Vec<Sample> = (0..160)
                .map(|index| {
                    let time = f64::from(index) * 0.2;
                    heading += 0.2 * (0.15 + 0.02 * time);
                    let speed = 9.0 + gain * time;
                    Sample {
                        time,
                        position: Vector3::new(0.0, 0.0, 1000.0 - 12.0 * time),
                        velocity: Vector3::new(
                            wind.x + speed * heading.cos(),
                            wind.y + speed * heading.sin(),
                            -12.0,
                        ),
                    }
                })
                .collect();
            let found = circles(&spiral);
            for circle in &found {
                let off = circle.wind.velocity - wind;
                for axis in 0..2 {
                    let off = off[axis].abs();
                    assert!(
                        off < 2.0 * circle.wind.deviation[axis],
                        "{gain}: {circle:?}"
                    );
                }
            }
            assert_eq!(found.len(), 1, "{gain}");
        }
    }

    #[test]
    fn turns_to_and_fro_are_no_circle() {
        let swings: Vec<Sample> = (0..300)
            .map(|index| {
                let time = f64::from(index) * 0.2;
                let heading = 3.0 * (0.4 * time).sin();
                Sample {
                    time,
                    position: Vector3::zeros(),
                    velocity: Vector3::new(12.0 * heading.cos(), 12.0 * heading.sin(), -5.0),
                }
            })
            .collect();
        assert_eq!(circles(&swings), []);
    }

    #[test]
    fn a_straight_flight_has_no_circles() {
        let straight: Vec<Sample> = (0..300)
            .map(|index| Sample {
                time: f64::from(index) * 0.2,
                position: Vector3::zeros(),
                velocity: Vector3::new(10.0, 0.01 * f64::from(index % 7), -5.0),
            })
            .collect();
        assert_eq!(circles(&straight), []);
    }
}
