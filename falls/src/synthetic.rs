//! A synthetic jump of a point mass, for tests: aircraft, a fall with several postures in a wind that changes with
//! height, opening, circles under canopy, ground.

use bodyflight_core::air::{GRAVITY, standard_density};
use nalgebra::Vector3;

use crate::Sample;

/// Parameters of a synthetic jump.
#[derive(Debug, Clone)]
pub(crate) struct Jump {
    /// Drag factor (m2/kg) from each time after the exit on (s).
    pub(crate) drag: Vec<(f64, f64)>,
    /// Wind at 4000 m and at the ground (m/s).
    pub(crate) wind: [Vector3<f64>; 2],
    /// Rate of fixes (Hz).
    pub(crate) rate: f64,
    /// Noise of the velocity (m/s).
    pub(crate) noise: f64,
    /// Start of the opening, after the exit (s).
    pub(crate) opening: f64,
}

/// Time of the exit after the start of the track (s).
pub(crate) const EXIT: f64 = 60.0;

impl Default for Jump {
    fn default() -> Self {
        Self {
            drag: vec![(0.0, 1.0 / 153.0)],
            wind: [Vector3::new(8.0, -5.0, 0.0), Vector3::new(2.0, 1.0, 0.0)],
            rate: 5.0,
            noise: 0.1,
            opening: 50.0,
        }
    }
}

/// Reproducible noise: the same numbers for every test.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        let mut sum = 0.0;
        for _ in 0..12 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 40) as f64 / (1u64 << 24) as f64;
        }
        sum - 6.0
    }
}

/// The wind of a jump at a height (m/s).
pub(crate) fn wind_at(jump: &Jump, height: f64) -> Vector3<f64> {
    jump.wind[1].lerp(&jump.wind[0], height / 4000.0)
}

/// The track of a jump.
pub(crate) fn jump(jump: &Jump) -> Vec<Sample> {
    const STEP: f64 = 0.01;
    let mut noise = Noise(7);
    let mut samples = Vec::new();
    let mut position = Vector3::new(0.0, 0.0, 4000.0);
    let mut velocity = Vector3::new(0.0, 45.0, 0.0);
    let mut heading = 0.0_f64;
    let mut step = 0_u32;
    let mut next = 0.0;
    let mut on_ground = 0.0;
    while on_ground < 20.0 {
        let time = f64::from(step) * STEP;
        if time + 1e-9 >= next {
            next += 1.0 / jump.rate;
            let mut disturbed = || Vector3::new(noise.next(), noise.next(), noise.next());
            samples.push(Sample {
                time,
                position: position + disturbed(),
                velocity: velocity + disturbed() * jump.noise,
            });
        }
        step += 1;
        let since = time - EXIT;
        let through_air = velocity - wind_at(jump, position.z);
        let pressure = 0.5 * standard_density(position.z) * through_air.norm();
        if position.z <= 0.0 {
            on_ground += STEP;
            velocity = Vector3::zeros();
            continue;
        } else if since < 0.0 {
            // Level flight.
        } else if since < jump.opening + 4.0 {
            let drag = jump.drag.iter().rev().find(|(from, _)| *from <= since);
            let mut factor = drag.map_or(0.0, |(_, factor)| *factor);
            let opened = ((since - jump.opening) / 3.0).clamp(0.0, 1.0);
            factor += 0.25 * opened * opened;
            velocity -= (through_air * pressure * factor + Vector3::z() * GRAVITY) * STEP;
        } else {
            heading += 0.35 * STEP;
            let flown = Vector3::new(12.0 * heading.cos(), 12.0 * heading.sin(), -5.5);
            let wanted = wind_at(jump, position.z) + flown;
            velocity += (wanted - velocity) * STEP;
        }
        position += velocity * STEP;
    }
    samples
}
