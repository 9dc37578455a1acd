//! The quantities known at each frame, with names, units and meanings, and the columns that they form.

use bodyflight_core::Segment;

use bodyflight_io::diagnostic::Result;

/// A unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unit {
    /// Suffix in names, such as `mps`; empty for a plain number.
    pub suffix: &'static str,
    /// Symbol in text, such as `m/s`.
    pub symbol: &'static str,
}

impl Unit {
    /// Dimensionless.
    pub const ONE: Self = Self::new("", "1");
    /// Seconds.
    pub const SECOND: Self = Self::new("s", "s");
    /// Metres.
    pub const METRE: Self = Self::new("m", "m");
    /// Metres per second.
    pub const METRE_PER_SECOND: Self = Self::new("mps", "m/s");
    /// Radians.
    pub const RADIAN: Self = Self::new("rad", "rad");
    /// Radians per second.
    pub const RADIAN_PER_SECOND: Self = Self::new("radps", "rad/s");
    /// Newtons.
    pub const NEWTON: Self = Self::new("n", "N");
    /// Newton metres.
    pub const NEWTON_METRE: Self = Self::new("nm", "N m");
    /// Newton seconds: momentum.
    pub const NEWTON_SECOND: Self = Self::new("ns", "N s");
    /// Newton metre seconds: angular momentum.
    pub const NEWTON_METRE_SECOND: Self = Self::new("nms", "N m s");
    /// Square metres.
    pub const SQUARE_METRE: Self = Self::new("m2", "m2");
    /// Cubic metres.
    pub const CUBIC_METRE: Self = Self::new("m3", "m3");

    const fn new(suffix: &'static str, symbol: &'static str) -> Self {
        Self { suffix, symbol }
    }
}

/// What a quantity describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// The body, or the flight.
    Body,
    /// Each segment.
    Segments,
}

/// A quantity: a number or a vector, for the whole body or for each segment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantity {
    /// Name without segment, component and unit.
    pub name: String,
    /// Unit of all components.
    pub unit: Unit,
    /// Names of the components of a vector; empty for a scalar.
    pub parts: &'static [&'static str],
    /// Whether it describes the body or each segment.
    pub of: Of,
    /// Meaning, with the axes it is given in.
    pub meaning: &'static str,
}

impl Quantity {
    /// Number of values per row.
    pub fn width(&self) -> usize {
        let segments = match self.of {
            Of::Body => 1,
            Of::Segments => Segment::ALL.len(),
        };
        segments * self.parts.len().max(1)
    }

    /// Shape of a row: segments, components.
    pub fn shape(&self) -> Vec<usize> {
        let segments = (self.of == Of::Segments).then_some(Segment::ALL.len());
        let parts = (!self.parts.is_empty()).then_some(self.parts.len());
        segments.into_iter().chain(parts).collect()
    }

    /// Column names without the segment: name, component, unit.
    pub fn tails(&self) -> Vec<String> {
        if self.parts.is_empty() {
            return vec![joined([&self.name, "", self.unit.suffix])];
        }
        let part = |part: &&str| joined([&self.name, part, self.unit.suffix]);
        self.parts.iter().map(part).collect()
    }

    /// Column names.
    pub fn columns(&self) -> Vec<String> {
        let tails = self.tails();
        match self.of {
            Of::Body => tails,
            Of::Segments => Segment::ALL
                .iter()
                .flat_map(|segment| {
                    tails
                        .iter()
                        .map(|tail| format!("{}_{tail}", segment.name()))
                })
                .collect(),
        }
    }

    /// Name of the array that holds all values: name, unit.
    pub fn array(&self) -> String {
        let of = match self.of {
            Of::Body => "",
            Of::Segments => "segment",
        };
        joined([of, &self.name, self.unit.suffix])
    }
}

fn joined(words: [&str; 3]) -> String {
    let words: Vec<&str> = words.into_iter().filter(|word| !word.is_empty()).collect();
    words.join("_")
}

/// A file that takes rows of values of all quantities.
pub trait Sink {
    /// Appends a row; NaN means a missing value.
    ///
    /// # Errors
    /// Returns an error if writing fails.
    fn write(&mut self, row: &[f64]) -> Result<()>;

    /// Completes the file and moves it to its final name.
    ///
    /// # Errors
    /// Returns an error if writing fails; no file is left then.
    fn finish(self: Box<Self>) -> Result<()>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_carry_segment_part_and_unit() {
        let force = Quantity {
            name: "force".to_owned(),
            unit: Unit::NEWTON,
            parts: &["left", "dorsal", "cranial"],
            of: Of::Segments,
            meaning: "",
        };
        let columns = force.columns();
        assert_eq!(columns.len(), force.width());
        assert_eq!(columns[0], "pelvis_force_left_n");
        assert!(columns.contains(&"l_hand_force_cranial_n".to_owned()));
        assert_eq!(force.array(), "segment_force_n");
        assert_eq!(force.shape(), [16, 3]);
        let nis = Quantity {
            name: "nis".to_owned(),
            unit: Unit::ONE,
            parts: &[],
            of: Of::Body,
            meaning: "",
        };
        assert_eq!((nis.columns(), nis.width()), (vec!["nis".to_owned()], 1));
        assert!(nis.shape().is_empty());
    }
}
