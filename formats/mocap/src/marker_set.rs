//! The points of a table, with the segments between them.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::table::Table;

/// A point with its three columns.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Marker {
    pub(crate) name: String,
    pub(crate) columns: [usize; 3],
}

/// A segment between two points, or between midpoints of several, given by their indices.
#[derive(Debug, Clone)]
pub(crate) struct Rod {
    pub(crate) segment: String,
    pub(crate) ends: [Vec<usize>; 2],
    /// Whether its length is that of a bone; the trunk is not rigid.
    pub(crate) rigid: bool,
    /// Its parent, by its index.
    pub(crate) parent: Option<usize>,
    /// The points to its right and left, if it has them.
    pub(crate) left: Option<[Vec<usize>; 2]>,
}

/// The points of a table with the segments between them.
pub(crate) struct Points<'a> {
    pub(crate) table: &'a mut Table,
    pub(crate) markers: Vec<Marker>,
    pub(crate) rods: Vec<Rod>,
    /// Time of each row (s).
    pub(crate) times: Vec<f64>,
    /// Length of one unit (m).
    pub(crate) unit_m: f64,
    /// Why a point was dropped in a row.
    pub(crate) dropped: BTreeMap<[usize; 2], &'static str>,
}

impl Points<'_> {
    pub(crate) fn rows(&self) -> usize {
        self.times.len()
    }

    pub(crate) fn at(&self, row: usize, marker: usize) -> Option<Vector3<f64>> {
        let place = self.markers[marker]
            .columns
            .map(|column| self.table.value(row, column));
        (place.iter().all(|value| value.is_finite())).then(|| Vector3::from(place) * self.unit_m)
    }

    /// The middle of an end of a rod (m).
    pub(crate) fn end(&self, row: usize, markers: &[usize]) -> Option<Vector3<f64>> {
        let mut sum = Vector3::zeros();
        for marker in markers {
            sum += self.at(row, *marker)?;
        }
        Some(sum / markers.len() as f64)
    }
}
