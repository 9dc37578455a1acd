//! The units in which skydivers read speeds and heights.

/// Units of text and pages; data files are in SI units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Units {
    /// Metres per second, metres.
    #[default]
    Si,
    /// Kilometres per hour, metres.
    Kmh,
    /// Miles per hour, feet.
    Imperial,
}

/// Metres per second in a mile per hour, and metres in a foot.
const MPH: f64 = 0.447_04;
const FOOT: f64 = 0.3048;

impl Units {
    /// A speed with its unit.
    pub fn speed(self, mps: f64) -> String {
        let (value, name) = (mps * self.speed_factor(), self.speed_name());
        match self {
            Self::Si => format!("{value:.1} {name}"),
            Self::Kmh | Self::Imperial => format!("{value:.0} {name}"),
        }
    }

    /// A height or a distance with its unit.
    pub fn length(self, metres: f64) -> String {
        format!(
            "{:.0} {}",
            metres * self.length_factor(),
            self.length_name()
        )
    }

    /// Factor from metres per second.
    pub const fn speed_factor(self) -> f64 {
        match self {
            Self::Si => 1.0,
            Self::Kmh => 3.6,
            Self::Imperial => 1.0 / MPH,
        }
    }

    /// Name of the unit of speed.
    pub const fn speed_name(self) -> &'static str {
        match self {
            Self::Si => "m/s",
            Self::Kmh => "km/h",
            Self::Imperial => "mph",
        }
    }

    /// Factor from metres.
    pub const fn length_factor(self) -> f64 {
        match self {
            Self::Si | Self::Kmh => 1.0,
            Self::Imperial => 1.0 / FOOT,
        }
    }

    /// Name of the unit of length.
    pub const fn length_name(self) -> &'static str {
        match self {
            Self::Si | Self::Kmh => "m",
            Self::Imperial => "ft",
        }
    }
}
