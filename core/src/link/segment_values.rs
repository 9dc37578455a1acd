//! The segment table on the link: one row per message, accepted only when all rows and the digest agree.

use nalgebra::{Matrix3, Vector3};

use super::frame::checksum;
use super::message::{SegmentValues, Verdict};
use super::wire::{BadValue, Body as _, Reader, Wire, Writer};
use crate::aerodynamics::{Aerodynamics, Coefficients};
use crate::body::{Body, SEGMENT_COUNT, Segment, SegmentArray, SegmentParameters};

impl Wire for Segment {
    const SIZE: usize = 1;
    const KIND: &'static str = "u8: segment";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put([self as u8])
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        let [number] = reader.take();
        Self::ALL
            .get(usize::from(number))
            .copied()
            .ok_or(BadValue::OutOfRange)
    }
}

impl SegmentValues {
    /// Creates the row for `segment`.
    pub fn new(
        segment: Segment,
        parameters: &SegmentParameters<f32>,
        coefficients: &Coefficients<f32>,
    ) -> Self {
        let inertia = &parameters.inertia;
        Self {
            segment,
            mass: parameters.mass,
            length: parameters.length,
            joint_offset: parameters.joint_offset.into(),
            cg: parameters.cg.into(),
            inertia: [
                inertia.m11,
                inertia.m22,
                inertia.m33,
                inertia.m21,
                inertia.m31,
                inertia.m32,
            ],
            area: parameters.area.into(),
            moment_arm: parameters.moment_arm,
            coefficients: [coefficients.drag, coefficients.lift, coefficients.moment],
        }
    }

    /// Returns the segment parameters of the row.
    pub fn parameters(&self) -> SegmentParameters<f32> {
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        SegmentParameters {
            mass: self.mass,
            length: self.length,
            joint_offset: Vector3::from(self.joint_offset),
            cg: Vector3::from(self.cg),
            inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            area: Vector3::from(self.area),
            moment_arm: self.moment_arm,
        }
    }

    /// Returns the aerodynamic coefficients of the row.
    pub const fn coefficients(&self) -> Coefficients<f32> {
        let [drag, lift, moment] = self.coefficients;
        Coefficients { drag, lift, moment }
    }

    /// A segment without mass and without area.
    fn massless(segment: Segment) -> Self {
        Self {
            segment,
            mass: 0.0,
            length: 0.0,
            joint_offset: [0.0; 3],
            cg: [0.0; 3],
            inertia: [0.0; 6],
            area: [0.0; 3],
            moment_arm: 0.0,
            coefficients: [0.0; 3],
        }
    }

    fn bytes(&self) -> [u8; <Self as super::wire::Body>::SIZE] {
        let mut bytes = [0; <Self as super::wire::Body>::SIZE];
        // The buffer has the size of the body, so nothing is truncated.
        let _ = self.put(&mut Writer::new(&mut bytes));
        bytes
    }

    /// Returns whether the row is a possible rigid body: no inertia without mass, otherwise a positive definite
    /// inertia.
    fn is_rigid_body(&self) -> bool {
        if self.mass <= 0.0 {
            return self.inertia.iter().all(|value| value.abs() <= 0.0);
        }
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        let minor = xx * yy - xy * xy;
        let determinant = zz * minor - yz * (xx * yz - xy * xz) + xz * (xy * yz - yy * xz);
        xx > 0.0 && minor > 0.0 && determinant > 0.0
    }
}

/// The rows received so far. Rows may arrive in any order and repeatedly; the last one counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentTable {
    rows: SegmentArray<Option<SegmentValues>>,
}

impl Default for SegmentTable {
    fn default() -> Self {
        Self::new()
    }
}

impl SegmentTable {
    /// Creates an empty table.
    pub const fn new() -> Self {
        Self {
            rows: SegmentArray::new([None; SEGMENT_COUNT]),
        }
    }

    /// Creates the table of `body` with its aerodynamic coefficients.
    pub fn of(body: &Body<f32>, aerodynamics: &Aerodynamics<f32>) -> Self {
        Self {
            rows: body.segments.map(|segment, parameters| {
                let coefficients = &aerodynamics.coefficients[segment];
                Some(SegmentValues::new(segment, parameters, coefficients))
            }),
        }
    }

    /// Stores one row.
    pub fn insert(&mut self, row: SegmentValues) {
        // Found by search rather than by index: for a segment read from the wire the compiler keeps the bounds check.
        let place = self
            .rows
            .iter_mut()
            .find(|(segment, _)| *segment == row.segment);
        if let Some((_, place)) = place {
            *place = Some(row);
        }
    }

    /// Iterates over the rows received, in order.
    pub fn rows(&self) -> impl Iterator<Item = &SegmentValues> {
        self.rows.values().flatten()
    }

    /// Returns which rows were received, bit 0 for the first segment.
    pub fn received(&self) -> u16 {
        self.rows()
            .fold(0, |bits, row| bits | 1 << (row.segment as u16))
    }

    /// Returns the CRC-32C over the rows in order, which both sides compare.
    pub fn digest(&self) -> u32 {
        let rows = self.rows.map(|_, row| row.map(|row| row.bytes()));
        checksum(rows.values().flatten().map(<[u8; _]>::as_slice))
    }

    /// Returns the body, of stature `height` (m), if the table is complete, matches `digest` and describes a possible
    /// body.
    ///
    /// # Errors
    /// Returns an error with the verdict to send back.
    pub fn body(&self, height: f32, digest: u32) -> Result<Body<f32>, Verdict> {
        if self.received() != u16::MAX {
            return Err(Verdict::Incomplete);
        }
        if self.digest() != digest {
            return Err(Verdict::DigestMismatch);
        }
        let mass: f32 = self.rows().map(|row| row.mass).sum();
        if mass <= 0.0 || !self.rows().all(SegmentValues::is_rigid_body) {
            return Err(Verdict::NotABody);
        }
        let segments = self.of_segment(SegmentValues::parameters);
        Ok(Body { segments, height })
    }

    /// Returns the coefficients of all segments of a complete table.
    pub fn coefficients(&self) -> SegmentArray<Coefficients<f32>> {
        self.of_segment(SegmentValues::coefficients)
    }

    fn of_segment<V>(&self, value: impl Fn(&SegmentValues) -> V) -> SegmentArray<V> {
        self.rows
            .map(|segment, row| value(&row.unwrap_or_else(|| SegmentValues::massless(segment))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aerodynamics::ArchFactor;

    fn rows() -> [SegmentValues; SEGMENT_COUNT] {
        Segment::ALL.map(|segment| {
            let number = f32::from(segment as u8);
            SegmentValues {
                mass: 1.0 + number,
                length: 0.25,
                cg: [0.0, 0.125, -number],
                inertia: [0.5, 0.25, 0.125, 0.01, -0.02, 0.03],
                coefficients: [1.25, 1.5 + number, 3.5],
                ..SegmentValues::massless(segment)
            }
        })
    }

    #[test]
    fn a_table_in_any_order_makes_the_body_it_was_made_from() {
        let mut table = SegmentTable::new();
        assert_eq!(table.body(1.75, table.digest()), Err(Verdict::Incomplete));
        for row in rows().into_iter().rev() {
            table.insert(row);
            table.insert(row);
        }
        assert_eq!(table.received(), u16::MAX);
        let body = table.body(1.75, table.digest()).unwrap();
        let aerodynamics = Aerodynamics {
            coefficients: table.coefficients(),
            arch: ArchFactor::FromPosture,
            ..Aerodynamics::paper()
        };
        let again = SegmentTable::of(&body, &aerodynamics);
        assert_eq!(again, table);
        assert_eq!(again.digest(), table.digest());
        for row in rows() {
            assert_eq!(body.segments[row.segment], row.parameters());
            let coefficients = aerodynamics.coefficients[row.segment];
            assert_eq!(coefficients, row.coefficients());
        }
    }

    #[test]
    fn an_impossible_segment_table_is_refused() {
        let mut table = SegmentTable::new();
        for row in rows() {
            table.insert(row);
        }
        let digest = table.digest();
        assert_eq!(table.body(1.75, digest ^ 1), Err(Verdict::DigestMismatch));
        let [mut row, ..] = rows();
        row.inertia = [0.5, 0.25, 0.125, 0.4, 0.0, 0.0];
        table.insert(row);
        assert_ne!(table.digest(), digest);
        assert_eq!(table.body(1.75, table.digest()), Err(Verdict::NotABody));
        for segment in Segment::ALL {
            table.insert(SegmentValues::massless(segment));
        }
        assert_eq!(table.body(1.75, table.digest()), Err(Verdict::NotABody));
    }
}
