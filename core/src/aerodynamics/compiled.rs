//! The compiled form: what the aerodynamic sums owe to the posture, collected once per posture sample.
//!
//! Every term but the drag's maximum is a polynomial in the flow direction, so the sums over segments
//! collapse to a few small matrices (model.md "Aerodynamics without angles", with `x x^T + z z^T = 1 - y y^T`).
//! Equal to the plain form to rounding, by property test.

use nalgebra::{Matrix3, Vector3};

use super::{ExposedSegment, Flow, Loads};
use crate::body::{Segment, SegmentArray};
use crate::math::{Real, outer, skew};

/// Aerodynamics of one posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompiledAerodynamics<T: Real> {
    /// The segments, for the drag's loop and for muscle inputs.
    pub segments: SegmentArray<ExposedSegment<T>>,
    /// `Sum 2 A_xz Cl y y^T` (m2): force across the stream.
    lift: Matrix3<T>,
    /// `Sum 2 A_xz l Cm y y^T` (m3): couples.
    couple: Matrix3<T>,
    /// `Sum 2 A_xz Cl [r]x y y^T` (m3): moment of the part of the force along y.
    lift_moment: Matrix3<T>,
    /// `Sum 2 A_xz Cl r_k y y^T` (m3) for k = x, y, z: centre of the part of the force along u.
    lift_centre: [Matrix3<T>; 3],
}

impl<T: Real> CompiledAerodynamics<T> {
    /// Collects the sums.
    pub fn new(segments: SegmentArray<ExposedSegment<T>>) -> Self {
        let zero = Matrix3::zeros();
        let (mut lift, mut couple, mut lift_moment) = (zero, zero, zero);
        let mut lift_centre = [zero; 3];
        for segment in segments.values() {
            let dyad = outer(&segment.dorsal, T::one());
            let lift_dyad = dyad * segment.lift_area;
            lift += lift_dyad;
            couple += dyad * segment.moment_volume;
            lift_moment += skew(&segment.centre) * lift_dyad;
            for (sum, &coordinate) in lift_centre.iter_mut().zip(segment.centre.iter()) {
                *sum += lift_dyad * coordinate;
            }
        }
        Self {
            segments,
            lift,
            couple,
            lift_moment,
            lift_centre,
        }
    }

    /// Force and moment on the body, as [`super::total_load`].
    #[inline]
    pub fn total_load(&self, flow: &Flow<T>) -> Loads<T> {
        let u = &flow.direction;
        let mut exposed_area = T::zero();
        let mut drag_area = T::zero();
        let mut drag_centre = Vector3::zeros();
        for segment in Segment::ALL {
            let segment = &self.segments[segment];
            let area = segment.exposed_area(u);
            exposed_area += area;
            let drag = segment.drag * area;
            drag_area += drag;
            drag_centre += segment.centre * drag;
        }
        let across = self.lift * u;
        let centre = Vector3::from(self.lift_centre.map(|form| u.dot(&(form * u))));
        let force = u * (u.dot(&across) - drag_area) - across;
        let moment =
            (centre - drag_centre).cross(u) - self.lift_moment * u - u.cross(&(self.couple * u));
        Loads {
            exposed_area,
            force: force * flow.dynamic_pressure,
            moment: moment * flow.dynamic_pressure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aerodynamics::{Aerodynamics, expose, total_load};
    use crate::body::posture::pose;
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn compiled_equals_plain(
            posture in any_posture(),
            velocity in prop::array::uniform3(-80.0f64..80.0),
        ) {
            let body = reference_body();
            let exposed = expose(&body, &pose(&body, &posture), &Aerodynamics::paper());
            let flow = Flow::new(&Vector3::from(velocity), 1.1);
            let plain = total_load(&exposed, &flow);
            let compiled = CompiledAerodynamics::new(exposed).total_load(&flow);
            let scale = 1.0 + flow.dynamic_pressure;
            prop_assert!((plain.force - compiled.force).norm() < 1e-13 * scale);
            prop_assert!((plain.moment - compiled.moment).norm() < 1e-13 * scale);
            prop_assert!((plain.exposed_area - compiled.exposed_area).abs() < 1e-13);
        }
    }
}
