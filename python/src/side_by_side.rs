//! Many flights of one kind, four at a time side by side; the rest of up to three fly alone, with the same bits.

use bodyflight_core::four::Four;
use nalgebra::SimdValue;

/// Flights that are flown at once.
pub(crate) const SIDE_BY_SIDE: usize = 4;

/// Four flights side by side.
pub(crate) trait Together: Copy {
    /// One of the flights, alone.
    type One: Copy;

    /// Returns four flights that are all like `one`.
    fn all(one: &Self::One) -> Self;

    /// Returns the flight in a lane, 0 to 3.
    fn lane(&self, lane: usize) -> Self::One;

    /// Replaces the flight in a lane, 0 to 3.
    fn put(&mut self, lane: usize, one: &Self::One);
}

/// Many flights, in the order in which they were given.
#[derive(Clone)]
pub(crate) struct Flights<F: Together> {
    /// The first flights, in fours.
    pub(crate) fours: Vec<F>,
    /// The rest.
    pub(crate) rest: Vec<F::One>,
}

impl<F: Together> Flights<F> {
    /// Returns `count` flights like `one`.
    pub(crate) fn new(count: usize, one: &F::One) -> Self {
        Self {
            fours: vec![F::all(one); count / SIDE_BY_SIDE],
            rest: vec![*one; count % SIDE_BY_SIDE],
        }
    }

    /// Number of flights.
    pub(crate) const fn len(&self) -> usize {
        self.fours.len() * SIDE_BY_SIDE + self.rest.len()
    }

    /// Returns the flight with this index, or `None` if there are not so many.
    pub(crate) fn get(&self, index: usize) -> Option<F::One> {
        match self.fours.get(index / SIDE_BY_SIDE) {
            Some(four) => Some(four.lane(index % SIDE_BY_SIDE)),
            None => self.rest.get(index - self.of_fours()).copied(),
        }
    }

    /// Replaces the flight with this index, which must be below [`Flights::len`].
    pub(crate) fn put(&mut self, index: usize, one: &F::One) {
        let alone = index.saturating_sub(self.of_fours());
        if let Some(four) = self.fours.get_mut(index / SIDE_BY_SIDE) {
            four.put(index % SIDE_BY_SIDE, one);
        } else if let Some(place) = self.rest.get_mut(alone) {
            *place = *one;
        }
    }

    /// Returns the flights one by one.
    pub(crate) fn iter(&self) -> impl Iterator<Item = F::One> {
        (0..self.len()).filter_map(|index| self.get(index))
    }

    /// Number of flights in fours: the index of the first of the rest.
    pub(crate) const fn of_fours(&self) -> usize {
        self.fours.len() * SIDE_BY_SIDE
    }
}

/// Returns the columns of four rows.
#[inline]
pub(crate) fn columns<const N: usize>(rows: &[[f32; N]; SIDE_BY_SIDE]) -> [Four; N] {
    let [a, b, c, d] = rows;
    std::array::from_fn(|k| Four::from([a[k], b[k], c[k], d[k]]))
}

/// Writes columns to four rows.
#[inline]
pub(crate) fn write_rows<const N: usize>(columns: &[Four; N], rows: &mut [[f32; N]; SIDE_BY_SIDE]) {
    for (k, column) in columns.iter().enumerate() {
        for (lane, row) in rows.iter_mut().enumerate() {
            row[k] = column.extract(lane);
        }
    }
}
