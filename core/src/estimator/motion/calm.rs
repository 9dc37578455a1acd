//! When a sensor that measures a few times a second agrees with the filter again.
//!
//! Means over so few measurements are long, and would remember a fault for longer than it takes to see that it is over.

use crate::math::Real;

/// Time between two measurements (s) of a sensor that measures seldom.
pub(super) const SELDOM: f64 = 0.1;

/// Time over which innovations are taken together (s).
const SECOND: f64 = 1.0;

/// Mean square below which a second is calm.
const CALM: f32 = 0.5;

/// A second of a sensor that measures a few times in it, whose means would remember a fault for longer than that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Calm<T> {
    /// Sums of the squares and of the products, and their number.
    sums: [T; 3],
    time: T,
}

impl<T: Real> Calm<T> {
    /// The beginning of a second.
    pub(super) fn new() -> Self {
        Self {
            sums: [T::zero(); 3],
            time: T::zero(),
        }
    }

    /// Takes a square and a product, `since` (s) after the last one. Returns the means at the end of a second that was calm.
    pub(super) fn take(&mut self, pair: [T; 2], since: T) -> Option<[T; 2]> {
        let [square, product] = pair;
        for (sum, part) in self.sums.iter_mut().zip([square, product, T::one()]) {
            *sum += part;
        }
        self.time += since;
        if self.time < T::of(SECOND) {
            return None;
        }
        let [squares, products, number] = core::mem::replace(self, Self::new()).sums;
        let mean = squares / number;
        (mean < T::single(CALM)).then_some([mean, products / number])
    }

    /// Converts the sums to another precision.
    pub(super) fn cast<U: Real>(&self) -> Calm<U> {
        let scalar = |value: T| U::of(value.to_f64());
        Calm {
            sums: self.sums.map(scalar),
            time: scalar(self.time),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_of_small_innovations_is_calm() {
        let second = |square: f64| {
            let mut calm = Calm::new();
            let mut takes = (0..5).map(|_| calm.take([square, 0.5 * square], 0.2));
            takes.find_map(|means| means)
        };
        let [square, product] = second(0.3).unwrap();
        assert!((square - 0.3).abs() < 1e-12 && (product - 0.15).abs() < 1e-12);
        assert_eq!(second(0.8), None);
    }
}
