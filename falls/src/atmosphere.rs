//! Air density at a height, from the standard atmosphere or from pressure and temperature on the ground.

use bodyflight_core::air::{density_above_ground, standard_density};

/// Source of the air density.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Atmosphere {
    /// U.S. Standard Atmosphere 1976.
    #[default]
    Standard,
    /// Measured on the ground; the temperature decreases with height as in the standard atmosphere.
    Ground {
        /// Pressure (Pa).
        pressure: f64,
        /// Temperature (K).
        temperature: f64,
        /// Height of the ground above mean sea level (m).
        height: f64,
    },
}

impl Atmosphere {
    /// Density (kg/m3) at a height above mean sea level (m).
    pub fn density(&self, height: f64) -> f64 {
        match *self {
            Self::Standard => standard_density(height),
            Self::Ground {
                pressure,
                temperature,
                height: ground,
            } => density_above_ground(pressure, temperature, height - ground),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn standard_values_on_the_ground_give_the_standard_atmosphere() {
        let ground = Atmosphere::Ground {
            pressure: 101_325.0,
            temperature: 288.15,
            height: 0.0,
        };
        for height in [0.0, 1000.0, 4000.0] {
            let ratio = ground.density(height) / Atmosphere::Standard.density(height);
            assert!((ratio - 1.0).abs() < 2e-3, "{height}: {ratio}");
        }
        let hot = Atmosphere::Ground {
            pressure: 101_325.0,
            temperature: 308.15,
            height: 0.0,
        };
        assert!(hot.density(1000.0) < 0.95 * Atmosphere::Standard.density(1000.0));
    }
}
