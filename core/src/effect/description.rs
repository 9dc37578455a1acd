//! The description of an effect, as data.

/// Maximum number of parameters of an effect.
pub const PARAMETER_COUNT: usize = 3;

/// A parameter of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name used in files, with the unit as a suffix unless dimensionless.
    pub name: &'static str,
    /// Value at which the effect is absent.
    pub neutral: f64,
    /// Smallest plausible value.
    pub low: f64,
    /// Largest plausible value.
    pub high: f64,
}

impl Parameter {
    /// Returns whether no value below the neutral one is plausible.
    pub fn is_one_sided(&self) -> bool {
        self.low >= self.neutral
    }

    /// Returns the value at `share` of the way from neutral to an end of the range; a negative `share` leads to the
    /// low end.
    pub fn towards_end(&self, share: f64) -> f64 {
        self.neutral + share.abs() * (self.end(share) - self.neutral)
    }

    /// Returns a plausible value at a distance `size` from a plausible `value`: above it if there is room, else below it; the
    /// end of the range that is farther off if there is no room on either side.
    pub fn apart(&self, value: f64, size: f64) -> f64 {
        let (below, above) = (value - self.low, self.high - value);
        if size <= above {
            value + size
        } else if size <= below {
            value - size
        } else if above >= below {
            self.high
        } else {
            self.low
        }
    }

    /// Returns the share of the way from neutral to its end of the range at which `value` lies, never negative; zero
    /// if the range has no extent on that side.
    pub fn share_of_range(&self, value: f64) -> f64 {
        let away = value - self.neutral;
        let way = self.end(away) - self.neutral;
        if way == 0.0 { 0.0 } else { away / way }
    }

    fn end(&self, side: f64) -> f64 {
        if side < 0.0 { self.low } else { self.high }
    }
}

/// What an effect acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The body: the motion itself changes.
    Physics,
    /// The recording of the motion.
    Measurement,
    /// The body, in a way that changes at random; only its strength is known, see [`super::random`].
    Random,
}

/// Creates a row of [`Description::parameters`].
pub(super) const fn parameter(name: &'static str, neutral: f64, low: f64, high: f64) -> Parameter {
    Parameter {
        name,
        neutral,
        low,
        high,
    }
}

/// Description of an effect in words and ranges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Description {
    /// Name used in files and reports.
    pub name: &'static str,
    /// What the effect acts on.
    pub kind: Kind,
    /// Change of the model.
    pub form: &'static str,
    /// Parameters of the effect, at most [`PARAMETER_COUNT`].
    pub parameters: &'static [Parameter],
    /// Source of the form.
    pub source: &'static str,
    /// How the effect shows in a flight.
    pub signature: &'static str,
    /// Names of the effects that look similar in a flight.
    pub confused_with: &'static [&'static str],
    /// The maneuver that distinguishes them.
    pub separated_by: &'static str,
}
