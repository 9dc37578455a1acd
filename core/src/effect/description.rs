//! What an effect is, as data.

/// Most parameters that an effect has.
pub const PARAMETER_COUNT: usize = 3;

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name in files, with its unit as suffix unless dimensionless.
    pub name: &'static str,
    /// Value at which the effect is absent.
    pub neutral: f64,
    /// Smallest plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
}

impl Parameter {
    /// Whether it can only be larger than where it does nothing.
    pub fn is_one_sided(&self) -> bool {
        self.low >= self.neutral
    }

    /// The value a share of the way from neutral to an end of the range: the low end where `share` is negative.
    pub fn towards_end(&self, share: f64) -> f64 {
        self.neutral + share.abs() * (self.end(share) - self.neutral)
    }

    /// The share of the way to its end that a value has gone, never negative; zero where there is no way.
    pub fn share_of_range(&self, value: f64) -> f64 {
        let away = value - self.neutral;
        let way = self.end(away) - self.neutral;
        if way == 0.0 { 0.0 } else { away / way }
    }

    fn end(&self, side: f64) -> f64 {
        if side < 0.0 { self.low } else { self.high }
    }
}

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// On the body: the motion itself changes.
    Physics,
    /// On what is recorded of it.
    Measurement,
}

/// A row of [`Description::parameters`].
pub(super) const fn parameter(name: &'static str, neutral: f64, low: f64, high: f64) -> Parameter {
    Parameter {
        name,
        neutral,
        low,
        high,
    }
}

/// What an effect is, in words and ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Name in files and reports.
    pub name: &'static str,
    /// Where it acts.
    pub kind: Kind,
    /// What it does to the model.
    pub form: &'static str,
    /// Its parameters, at most [`PARAMETER_COUNT`].
    pub parameters: &'static [Parameter],
    /// Where the form comes from.
    pub source: &'static str,
    /// What it looks like in a flight.
    pub signature: &'static str,
    /// Names of the effects that it is confused with.
    pub confused_with: &'static [&'static str],
    /// The maneuver that tells them apart.
    pub separated_by: &'static str,
}
