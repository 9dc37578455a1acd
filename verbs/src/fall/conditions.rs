//! What is known of the jumper and the day.

use bodyflight_falls::fall::Settings;
use bodyflight_io::diagnostic::{Problem, Result};

/// Default mass of skydiver and equipment (kg).
pub const DEFAULT_MASS: f64 = 80.0;

/// Known data of the jumper and the day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// Mass of skydiver and equipment (kg).
    pub mass: f64,
    /// Pressure on the ground (Pa); by default the barometer's, or that of the standard atmosphere.
    pub ground_pressure: Option<f64>,
    /// Temperature on the ground (K); by default that of the standard atmosphere.
    pub ground_temperature: Option<f64>,
    /// Height in the standard atmosphere to which fall rates are normalised (m).
    pub reference_height: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            mass: DEFAULT_MASS,
            ground_pressure: None,
            ground_temperature: None,
            reference_height: Settings::default().reference_height,
        }
    }
}

/// Ranges of what may be stated, in the units of users: kg, hPa, degrees Celsius and m.
const MASS: [f64; 2] = [30.0, 300.0];
const GROUND_PRESSURE: [f64; 2] = [500.0, 1100.0];
const GROUND_TEMPERATURE: [f64; 2] = [-60.0, 60.0];
const REFERENCE_HEIGHT: [f64; 2] = [-500.0, 11_000.0];

/// What a user states.
#[derive(Debug, Clone, Copy)]
pub struct Stated {
    /// Mass of skydiver and equipment (kg).
    pub mass: f64,
    /// Pressure on the ground (hPa).
    pub ground_pressure: Option<f64>,
    /// Temperature on the ground (degrees Celsius).
    pub ground_temperature: Option<f64>,
    /// Height in the standard atmosphere to which fall rates are normalised (m).
    pub reference_height: f64,
}

impl Stated {
    /// Checks the numbers; `names` are those of the four fields in messages.
    ///
    /// # Errors
    /// Returns an error if a number is out of its range.
    pub fn checked(self, names: [&str; 4]) -> Result<Conditions> {
        let [mass, pressure, temperature, height] = names;
        within(mass, self.mass, MASS)?;
        if let Some(found) = self.ground_pressure {
            within(pressure, found, GROUND_PRESSURE)?;
        }
        if let Some(found) = self.ground_temperature {
            within(temperature, found, GROUND_TEMPERATURE)?;
        }
        within(height, self.reference_height, REFERENCE_HEIGHT)?;
        Ok(Conditions {
            mass: self.mass,
            ground_pressure: self.ground_pressure.map(|pressure| 100.0 * pressure),
            ground_temperature: self.ground_temperature.map(|celsius| celsius + 273.15),
            reference_height: self.reference_height,
        })
    }
}

impl Conditions {
    /// Those of a jumper of this mass (kg), called `name` in messages.
    ///
    /// # Errors
    /// Returns an error if no jumper has it.
    pub fn of_mass(mass: f64, name: &str) -> Result<Self> {
        within(name, mass, MASS)?;
        Ok(Self {
            mass,
            ..Self::default()
        })
    }
}

fn within(name: &str, found: f64, [low, high]: [f64; 2]) -> Result<()> {
    if (low..=high).contains(&found) {
        return Ok(());
    }
    let message = format!("expected {low} to {high}, found {found}");
    Err(Problem::bad_input(message).at(name))
}
