//! What is known at each frame: quantities with names, units and meanings, and the columns that they make.

use bodyflight_core::Segment;

use crate::diagnostic::Result;

/// A unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unit {
    /// As names end: `mps`; empty where there is none.
    pub suffix: &'static str,
    /// As people write it: `m/s`.
    pub symbol: &'static str,
}

impl Unit {
    /// A number.
    pub const ONE: Self = Self::new("", "1");
    /// Seconds.
    pub const SECOND: Self = Self::new("s", "s");
    /// Metres.
    pub const METRE: Self = Self::new("m", "m");
    /// Metres a second.
    pub const METRE_PER_SECOND: Self = Self::new("mps", "m/s");
    /// Radians.
    pub const RADIAN: Self = Self::new("rad", "rad");
    /// Radians a second.
    pub const RADIAN_PER_SECOND: Self = Self::new("radps", "rad/s");
    /// Newtons.
    pub const NEWTON: Self = Self::new("n", "N");
    /// Newton metres.
    pub const NEWTON_METRE: Self = Self::new("nm", "N m");
    /// Square metres.
    pub const SQUARE_METRE: Self = Self::new("m2", "m2");
    /// Cubic metres.
    pub const CUBIC_METRE: Self = Self::new("m3", "m3");

    const fn new(suffix: &'static str, symbol: &'static str) -> Self {
        Self { suffix, symbol }
    }
}

/// What a quantity is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Of {
    /// The body, or the flight.
    Body,
    /// Each segment.
    Segments,
}

/// A quantity: one number, a vector, or one of these for each segment.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Quantity {
    /// Name without segment, part and unit.
    pub name: String,
    /// Unit of all parts.
    pub unit: Unit,
    /// Names of the parts of a vector; none for a single number.
    pub parts: &'static [&'static str],
    /// What it is of.
    pub of: Of,
    /// What it means, and in which axes.
    pub meaning: &'static str,
}

impl Quantity {
    /// Numbers of a row.
    pub fn width(&self) -> usize {
        let segments = match self.of {
            Of::Body => 1,
            Of::Segments => Segment::ALL.len(),
        };
        segments * self.parts.len().max(1)
    }

    /// Lengths of the axes of a row: segments, parts.
    pub fn shape(&self) -> Vec<usize> {
        let segments = (self.of == Of::Segments).then_some(Segment::ALL.len());
        let parts = (!self.parts.is_empty()).then_some(self.parts.len());
        segments.into_iter().chain(parts).collect()
    }

    /// Names of the numbers of a row without their segment: name, part, unit.
    pub fn tails(&self) -> Vec<String> {
        if self.parts.is_empty() {
            return vec![joined([&self.name, "", self.unit.suffix])];
        }
        let part = |part: &&str| joined([&self.name, part, self.unit.suffix]);
        self.parts.iter().map(part).collect()
    }

    /// Names of the numbers of a row.
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

    /// Name of all numbers of a row as one array: name, unit.
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

/// A file that takes rows of all quantities.
pub trait Sink {
    /// Adds a row; a number that is none is missing.
    ///
    /// # Errors
    /// Returns an error if the disk refuses.
    fn write(&mut self, row: &[f64]) -> Result<()>;

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// Returns an error if the disk refuses; then no file is left.
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
