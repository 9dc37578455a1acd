//! The aerodynamic force on a sample of a track, and its factors: force over mass and dynamic pressure, by the speed
//! over ground and in the standard atmosphere.

use bodyflight_core::air::GRAVITY;
use nalgebra::Vector3;

use crate::Sample;
use crate::atmosphere::Atmosphere;

/// Aerodynamic force over mass (m/s2) of a body with this acceleration (m/s2).
pub fn specific_force(acceleration: &Vector3<f64>) -> Vector3<f64> {
    acceleration + Vector3::z() * GRAVITY
}

/// Force factor: the whole force over dynamic pressure (m2/kg); below the speed `slowest` (m/s), over that of this speed.
pub fn force_factor(sample: &Sample, acceleration: &Vector3<f64>, slowest: f64) -> f64 {
    let density = Atmosphere::Standard.density(sample.height());
    let square = sample.velocity.norm_squared().max(slowest * slowest);
    specific_force(acceleration).norm() / (0.5 * density * square)
}

/// Drag factor: the part of the force that brakes the motion over ground, over dynamic pressure (m2/kg).
pub fn drag_factor(sample: &Sample, acceleration: &Vector3<f64>) -> f64 {
    let density = Atmosphere::Standard.density(sample.height());
    let speed = sample.velocity.norm().max(1.0);
    -specific_force(acceleration).dot(&sample.velocity) / (0.5 * density * speed.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_fall_has_the_factor_that_carries_its_weight() {
        let sample = Sample {
            time: 0.0,
            position: Vector3::new(0.0, 0.0, 2000.0),
            velocity: Vector3::new(0.0, 0.0, -50.0),
        };
        let still = Vector3::zeros();
        let expected = GRAVITY / (0.5 * Atmosphere::Standard.density(2000.0) * 2500.0);
        assert!((drag_factor(&sample, &still) - expected).abs() < 1e-12);
        assert!((force_factor(&sample, &still, 20.0) - expected).abs() < 1e-12);
        let slow = force_factor(&sample, &still, 100.0);
        assert!((slow - 0.25 * expected).abs() < 1e-12);
    }
}
