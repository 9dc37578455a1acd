//! A fall flown again, with the drag, lift and wind that were told from it or from its first part.

use bodyflight_core::air::{Air, Density, GRAVITY};
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;

use crate::Sample;
use crate::atmosphere::Atmosphere;
use crate::drag::{Piece, upwards};
use crate::wind::Profile;

/// Longest step (s).
const STEP: f64 = 0.05;

/// What a fall is flown with.
pub struct Flown<'a> {
    /// Drag and lift over time; the last goes on.
    pub pieces: &'a [Piece],
    /// Wind over the height; the lowest goes on.
    pub wind: &'a Profile,
    /// Density over the height.
    pub atmosphere: &'a Atmosphere,
}

impl Flown<'_> {
    fn acceleration(
        &self,
        time: f64,
        position: &Vector3<f64>,
        velocity: &Vector3<f64>,
    ) -> Vector3<f64> {
        let later = self.pieces.partition_point(|piece| piece.time[1] < time);
        let Some(piece) = self.pieces.get(later).or(self.pieces.last()) else {
            return Vector3::z() * -GRAVITY;
        };
        let air = self
            .wind
            .at(position.z)
            .map_or_else(Vector3::zeros, |wind| {
                Vector3::new(wind.velocity.x, wind.velocity.y, 0.0)
            });
        let density = self.atmosphere.density(position.z);
        let point = PointMass {
            air: Air {
                density: Density::Constant(density),
                velocity: Vector::from_components(air),
                profile: 0.0,
            },
            drag_area: piece.drag,
            mass: 1.0,
            gravity: GRAVITY,
        };
        let position = Vector::from_components(*position);
        let dragged = point.acceleration(&position, &Vector::from_components(*velocity));
        let stream = velocity - air;
        let lift = upwards(&stream).map_or_else(Vector3::zeros, |up| {
            up * (0.5 * density * stream.norm_squared() * piece.lift)
        });
        dragged.components + lift
    }

    /// Velocities at the times of `samples`, from the first of them on, started at `velocity` (m/s).
    pub fn velocities(&self, samples: &[Sample], velocity: Vector3<f64>) -> Vec<Vector3<f64>> {
        let mut velocities = Vec::with_capacity(samples.len());
        let Some(first) = samples.first() else {
            return velocities;
        };
        let (mut time, mut position, mut velocity) = (first.time, first.position, velocity);
        for sample in samples {
            let steps = ((sample.time - time) / STEP).ceil().max(1.0);
            let duration = (sample.time - time) / steps;
            let mut left = steps;
            while left > 0.5 {
                let half = 0.5 * duration;
                let start = self.acceleration(time, &position, &velocity);
                let middle = self.acceleration(
                    time + half,
                    &(position + velocity * half),
                    &(velocity + start * half),
                );
                position += (velocity + start * half) * duration;
                velocity += middle * duration;
                time += duration;
                left -= 1.0;
            }
            velocities.push(velocity);
        }
        velocities
    }
}
