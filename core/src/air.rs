//! The air: its density and its velocity.

use crate::frame::{Inertial, Vector};
use crate::math::{Lanes, Real, clamp};

/// Gravitational acceleration used throughout (m/s2), as in the reference numbers.
pub const GRAVITY: f64 = 9.81;

/// Standard gravity (m/s2): the unit in which accelerometers state a load.
pub const STANDARD_GRAVITY: f64 = 9.806_65;

/// Density of the air.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Density<T> {
    /// Constant density (kg/m3).
    Constant(T),
    /// Standard atmosphere, with the inertial origin at a given altitude.
    StandardAtmosphere {
        /// Altitude of the inertial origin above sea level (m).
        origin_altitude: T,
    },
    /// Density linear in the height.
    Linear {
        /// Density at the reference height (kg/m3).
        density: T,
        /// Reference height (m, inertial).
        height: T,
        /// Relative change of the density per metre of height, as a share of the reference density (1/m).
        slope: T,
    },
}

impl<T: Lanes> Density<T> {
    /// Density at `height` above the inertial origin (kg/m3).
    pub fn at(&self, height: T) -> T {
        match *self {
            Self::Constant(density) => density,
            Self::StandardAtmosphere { origin_altitude } => {
                standard_density(origin_altitude + height)
            }
            Self::Linear {
                density,
                height: reference,
                slope,
            } => {
                // Keeps the density positive, however far the fall goes.
                let share = T::one() + slope * (height - reference);
                density * clamp(share, T::of(0.05), T::of(20.0))
            }
        }
    }
}

/// Density of the U.S. Standard Atmosphere 1976, troposphere (kg/m3), at a geometric altitude above sea level (m).
///
/// Altitudes outside -500 to 11000 m are clamped to that range.
pub fn standard_density<T: Lanes>(altitude: T) -> T {
    let altitude = clamp(altitude, T::of(-500.0), T::of(11_000.0));
    let earth_radius = T::of(6_356_766.0);
    let geopotential = altitude * earth_radius / (earth_radius + altitude);
    let temperature_ratio = T::one() - geopotential * T::of(0.0065 / 288.15);
    T::of(1.225) * temperature_ratio.power(T::of(4.255_88))
}

/// Height of the U.S. Standard Atmosphere 1976 (m, geopotential, above sea level) at a pressure (Pa), troposphere.
pub fn pressure_height<T: Lanes>(pressure: T) -> T {
    let ratio = pressure / T::of(101_325.0);
    T::of(44_330.77) * (T::one() - ratio.power(T::of(0.190_263)))
}

/// Density of dry air (kg/m3) at a height above ground (m), from pressure (Pa) and temperature (K) at ground level.
/// The temperature falls by 6.5 K per kilometre, as in the troposphere of the U.S. Standard Atmosphere 1976.
pub fn density_above_ground<T: Lanes>(pressure: T, temperature: T, height: T) -> T {
    const GAS_CONSTANT: f64 = 287.053;
    let cooled = clamp(
        T::one() - height * T::of(0.0065) / temperature,
        T::of(0.5),
        T::of(1.5),
    );
    pressure / (T::of(GAS_CONSTANT) * temperature) * cooled.power(T::of(4.255_88))
}

/// Height in the standard atmosphere to which fall rates are normalised unless another one is asked for (m above sea
/// level).
pub const REFERENCE_HEIGHT: f64 = 2000.0;

/// Fall rate at which the same body has the same drag in air of another density (m/s): scaled by the square root of the
/// ratio of the densities (kg/m3).
pub fn normalised_fall_rate<T: Lanes>(fall_rate: T, density: T, reference: T) -> T {
    fall_rate * (density / reference).root()
}

/// Density and velocity of the air around the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air<T: Lanes> {
    /// Density of the air.
    pub density: Density<T>,
    /// Velocity of the air (m/s): wind, or the upward flow of a wind tunnel.
    pub velocity: Vector<T, Inertial>,
    /// Share of the velocity lost per square metre of horizontal distance from the vertical axis through the origin
    /// (1/m2); models the profile of a wind tunnel, zero for natural wind.
    pub profile: T,
    /// Wind shear, added to the velocity.
    pub shear: Option<Shear<T>>,
}

/// Wind that changes linearly with height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shear<T: Lanes> {
    /// Change of the wind per metre of height (1/s).
    pub per_metre: Vector<T, Inertial>,
    /// Height at which the shear adds no wind (m, inertial).
    pub height: T,
}

impl<T: Lanes> Air<T> {
    /// Still air of constant density (kg/m3).
    pub fn still(density: T) -> Self {
        Self {
            density: Density::Constant(density),
            velocity: Vector::zero(),
            profile: T::zero(),
            shear: None,
        }
    }

    /// Velocity of the air at a position (m, inertial).
    #[inline]
    pub fn velocity_at(&self, position: &Vector<T, Inertial>) -> Vector<T, Inertial> {
        if self.profile == T::zero() && self.shear.is_none() {
            return self.velocity;
        }
        self.uneven_velocity_at(position)
    }

    /// Kept out of line so that uniform air does not pay for it.
    #[cold]
    #[inline(never)]
    fn uneven_velocity_at(&self, position: &Vector<T, Inertial>) -> Vector<T, Inertial> {
        let (north, west) = (position.north(), position.west());
        let loss = self.profile * (north * north + west * west);
        let share = clamp(T::one() - loss, T::zero(), T::of(2.0));
        let even = self.velocity * share;
        self.shear.map_or(even, |shear| {
            even + shear.per_metre * (position.up() - shear.height)
        })
    }

    /// Converts the air to another precision.
    pub fn cast<U: Lanes>(&self) -> Air<U>
    where
        T: Real,
    {
        let scalar = |value: T| U::of(value.to_f64());
        Air {
            density: match self.density {
                Density::Constant(density) => Density::Constant(scalar(density)),
                Density::StandardAtmosphere { origin_altitude } => Density::StandardAtmosphere {
                    origin_altitude: scalar(origin_altitude),
                },
                Density::Linear {
                    density,
                    height,
                    slope,
                } => Density::Linear {
                    density: scalar(density),
                    height: scalar(height),
                    slope: scalar(slope),
                },
            },
            velocity: self.velocity.cast(),
            profile: scalar(self.profile),
            shear: self.shear.map(|shear| Shear {
                per_metre: shear.per_metre.cast(),
                height: scalar(shear.height),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wind_grows_with_the_height_and_leaves_the_stream_of_a_tunnel_its_profile() {
        let air = Air {
            velocity: Vector::new(3.0, 0.0, 1.0),
            shear: Some(Shear {
                per_metre: Vector::new(0.01, -0.02, 0.0),
                height: 1000.0,
            }),
            ..Air::still(1.0)
        };
        let found = air.velocity_at(&Vector::new(50.0, 20.0, 1200.0));
        let expected = Vector::<f64, Inertial>::new(5.0, -4.0, 1.0);
        assert!((found - expected).norm() < 1e-12);
        let tunnel = Air {
            profile: 0.01,
            ..air
        };
        let found = tunnel.velocity_at(&Vector::new(3.0, 4.0, 1000.0));
        assert!((found - air.velocity * 0.75).norm() < 1e-12);
        assert_eq!(
            tunnel.cast::<f32>().cast::<f64>().shear.map(|s| s.height),
            Some(1000.0)
        );
    }

    #[test]
    fn a_normalised_fall_rate_has_the_same_dynamic_pressure() {
        let reference = standard_density(REFERENCE_HEIGHT);
        let rate = normalised_fall_rate(60.0, 0.8, reference);
        assert!(
            (reference * rate * rate - 0.8 * 60.0 * 60.0).abs() < 1e-9,
            "{rate}"
        );
    }

    #[test]
    fn the_standard_atmosphere_has_its_tabled_values() {
        // U.S. Standard Atmosphere 1976: 1.2250, 0.9093, 0.8194, 0.4135 kg/m3.
        for (altitude, density) in [
            (0.0, 1.225),
            (3000.0, 0.9093),
            (4000.0, 0.8194),
            (10_000.0, 0.4135),
        ] {
            assert!(
                (standard_density::<f64>(altitude) - density).abs() < 2e-4,
                "{altitude}"
            );
        }
        let single = f64::from(standard_density(3000.0f32));
        assert!((single - standard_density(3000.0f64)).abs() < 1e-6);
        assert!(standard_density(f32::NAN).is_finite());
    }
}
