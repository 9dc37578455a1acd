//! The wind under an open canopy: while the canopy circles, its velocity over ground circles about the wind velocity.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::Sample;
use crate::wind::Wind;

/// Length of the parts in which circles are searched for, and the distance between their starts (s).
const PART: f64 = 30.0;
const STRIDE: f64 = 15.0;

/// Widest gap between neighbouring headings in a part that still counts as a circle (rad).
const GAP: f64 = 1.4;

/// Range of a canopy's horizontal airspeed (m/s).
const SPEEDS: [f64; 2] = [4.0, 25.0];

/// Correlation time of the errors on a circle (s), since a canopy speeds up and slows down as it turns.
const KEPT: f64 = 5.0;

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
    if part.len() < 8 {
        return None;
    }
    // The equation |v|^2 = 2 v.c + (r^2 - |c|^2) is linear in the unknowns.
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for sample in part {
        let velocity = sample.velocity.xy();
        let row = Vector3::new(2.0 * velocity.x, 2.0 * velocity.y, 1.0);
        normal += row * row.transpose();
        right += row * velocity.norm_squared();
    }
    let solved = normal.cholesky()?.solve(&right);
    let centre = Vector2::new(solved[0], solved[1]);
    let radius = (solved[2] + centre.norm_squared()).max(0.0).sqrt();
    let mut headings: Vec<f64> = part
        .iter()
        .map(|sample| {
            let around = sample.velocity.xy() - centre;
            around.y.atan2(around.x)
        })
        .collect();
    headings.sort_by(f64::total_cmp);
    let across_end = headings[0] + core::f64::consts::TAU - headings[headings.len() - 1];
    let widest = headings
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .fold(across_end, f64::max);
    if widest > GAP || !(SPEEDS[0]..SPEEDS[1]).contains(&radius) {
        return None;
    }
    let squares: f64 = part
        .iter()
        .map(|sample| ((sample.velocity.xy() - centre).norm() - radius).powi(2))
        .sum();
    let duration = part[part.len() - 1].time - part[0].time;
    let independent = (duration / KEPT).max(3.0);
    let deviation = (2.0 * squares / part.len() as f64 / independent)
        .sqrt()
        .max(0.2);
    Some(Circle {
        wind: Wind {
            height: part.iter().map(Sample::height).sum::<f64>() / part.len() as f64,
            velocity: centre,
            deviation: Vector2::repeat(deviation),
        },
        airspeed: radius,
    })
}

#[cfg(test)]
mod tests {
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
