//! The compiled form: what the aerodynamic sums owe to the posture, collected once per posture sample.
//!
//! Every term but the drag's maximum is a polynomial in the flow direction, so the sums over segments
//! collapse to a few small matrices (model.md "Aerodynamics without angles", with `x x^T + z z^T = 1 - y y^T`).
//! Equal to the plain form to rounding, by property test.

use nalgebra::{Matrix3, Vector3};

use super::{Aerodynamics, ExposedSegment, Flow, Loads, expose_into};
use crate::body::posture::PosedSegment;
use crate::body::{Body, SEGMENT_COUNT, SegmentArray};
use crate::math::{Real, outer, skew};

/// Aerodynamics of one posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompiledAerodynamics<T: Real> {
    /// The segments, for the drag's loop and for muscle inputs.
    pub segments: SegmentArray<ExposedSegment<T>>,
    forms: Forms<T>,
}

/// Everything but the drag.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Forms<T: Real> {
    /// `Sum 2 A_xz Cl y y^T` (m2): force across the stream.
    lift: Matrix3<T>,
    /// `Sum 2 A_xz l Cm y y^T` (m3): couples.
    couple: Matrix3<T>,
    /// `Sum 2 A_xz Cl [r]x y y^T` (m3): moment of the part of the force along y.
    lift_moment: Matrix3<T>,
    /// `Sum 2 A_xz Cl r_k y y^T` (m3) for k = x, y, z: centre of the part of the force along u.
    lift_centre: [Matrix3<T>; 3],
}

/// Drag of all segments, divided by the dynamic pressure.
struct Drag<T: Real> {
    exposed_area: T,
    /// Areas times drag coefficients (m2).
    area: T,
    /// The same times the centres (m3).
    centre: Vector3<T>,
}

impl<T: Real> Forms<T> {
    fn none() -> Self {
        let zero = Matrix3::zeros();
        Self {
            lift: zero,
            couple: zero,
            lift_moment: zero,
            lift_centre: [zero; 3],
        }
    }

    fn of(segments: &SegmentArray<ExposedSegment<T>>) -> Self {
        let mut forms = Self::none();
        for segment in segments.values() {
            let dyad = outer(&segment.dorsal, T::one());
            let lift_dyad = dyad * segment.lift_area;
            forms.lift += lift_dyad;
            forms.couple += dyad * segment.moment_volume;
            forms.lift_moment += skew(&segment.centre) * lift_dyad;
            for (sum, &coordinate) in forms.lift_centre.iter_mut().zip(segment.centre.iter()) {
                *sum += lift_dyad * coordinate;
            }
        }
        forms
    }

    #[inline]
    fn load(&self, flow: &Flow<T>, drag: &Drag<T>) -> Loads<T> {
        let u = &flow.direction;
        let across = self.lift * u;
        let centre = Vector3::from(self.lift_centre.map(|form| u.dot(&(form * u))));
        let force = u * (u.dot(&across) - drag.area) - across;
        let moment =
            (centre - drag.centre).cross(u) - self.lift_moment * u - u.cross(&(self.couple * u));
        Loads {
            exposed_area: drag.exposed_area,
            force: force * flow.dynamic_pressure,
            moment: moment * flow.dynamic_pressure,
        }
    }
}

impl<T: Real> CompiledAerodynamics<T> {
    /// Collects the sums.
    pub fn new(segments: SegmentArray<ExposedSegment<T>>) -> Self {
        let forms = Forms::of(&segments);
        Self { segments, forms }
    }

    /// Nothing that the air could see.
    pub(crate) fn hidden() -> Self {
        Self {
            segments: SegmentArray::new([ExposedSegment::hidden(); SEGMENT_COUNT]),
            forms: Forms::none(),
        }
    }

    /// Exposes a posed body where its segments are kept, and collects the sums.
    pub(crate) fn expose(
        &mut self,
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
    ) {
        expose_into(body, posed, aerodynamics, &mut self.segments);
        self.forms = Forms::of(&self.segments);
    }

    /// Force and moment on the body, as [`super::total_load`].
    #[inline]
    pub fn total_load(&self, flow: &Flow<T>) -> Loads<T> {
        self.total_load_and_areas(flow).0
    }

    /// [`CompiledAerodynamics::total_load`], and the exposed area of each segment (m2) for who needs it again.
    #[inline]
    pub fn total_load_and_areas(&self, flow: &Flow<T>) -> (Loads<T>, SegmentArray<T>) {
        let mut drag = Drag {
            exposed_area: T::zero(),
            area: T::zero(),
            centre: Vector3::zeros(),
        };
        let mut areas = SegmentArray::from_fn(|_| T::zero());
        for (segment, (_, place)) in self.segments.values().zip(areas.iter_mut()) {
            let area = segment.exposed_area(&flow.direction);
            *place = area;
            drag.exposed_area += area;
            let drag_area = segment.drag * area;
            drag.area += drag_area;
            drag.centre += segment.centre * drag_area;
        }
        (self.forms.load(flow, &drag), areas)
    }

    /// The form for streams from about `direction` (unit vector, body axes).
    pub fn about(&self, direction: &Vector3<T>) -> FrozenAerodynamics<T> {
        let mut frozen = FrozenAerodynamics {
            forms: self.forms,
            silhouette: Vector3::zeros(),
            drag_silhouette: Vector3::zeros(),
            drag_centre: Matrix3::zeros(),
            least: [T::zero(); 2],
        };
        for segment in self.segments.values() {
            let face = segment.facing(direction);
            frozen.silhouette += face;
            let drag = face * segment.drag;
            frozen.drag_silhouette += drag;
            frozen.drag_centre += segment.centre * drag.transpose();
        }
        frozen.least = [&frozen.silhouette, &frozen.drag_silhouette]
            .map(|face| face.dot(direction) * T::of(LEAST_SHARE));
        frozen
    }
}

/// Share of the area at the reference below which frozen areas do not fall, however the stream turns.
const LEAST_SHARE: f64 = 0.25;

/// Aerodynamics of one posture without its segments: exact while each segment shows the stream the same
/// face as at the reference direction, of first order beyond that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrozenAerodynamics<T: Real> {
    forms: Forms<T>,
    /// Sum of the vectors of the faces (m2): its product with the direction is the exposed area.
    silhouette: Vector3<T>,
    /// The same with drag coefficients (m2).
    drag_silhouette: Vector3<T>,
    /// `Sum r (Cd a)^T` (m3): its product with the direction is the centre of the drag times its area.
    drag_centre: Matrix3<T>,
    /// Least exposed area and least drag area (m2).
    least: [T; 2],
}

impl<T: Real> FrozenAerodynamics<T> {
    /// Force and moment on the body, see [`CompiledAerodynamics::total_load`].
    #[inline]
    pub fn total_load(&self, flow: &Flow<T>) -> Loads<T> {
        let at_least = |value: T, least: T| if value > least { value } else { least };
        let [least_area, least_drag] = self.least;
        let u = &flow.direction;
        let drag = Drag {
            exposed_area: at_least(self.silhouette.dot(u), least_area),
            area: at_least(self.drag_silhouette.dot(u), least_drag),
            centre: self.drag_centre * u,
        };
        self.forms.load(flow, &drag)
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

        #[test]
        fn frozen_equals_compiled_near_its_reference(
            posture in any_posture(),
            velocity in prop::array::uniform3(-80.0f64..80.0),
            change in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let body = reference_body();
            let exposed = expose(&body, &pose(&body, &posture), &Aerodynamics::paper());
            let compiled = CompiledAerodynamics::new(exposed);
            let velocity = Vector3::from(velocity);
            prop_assume!(velocity.norm() > 10.0);
            let reference = Flow::new(&velocity, 1.0);
            let frozen = compiled.about(&reference.direction);
            // At the reference itself the faces are the same.
            let (a, b) = (compiled.total_load(&reference), frozen.total_load(&reference));
            let scale = reference.dynamic_pressure;
            prop_assert!((a.force - b.force).norm() < 1e-13 * scale);
            prop_assert!((a.moment - b.moment).norm() < 1e-13 * scale);
            prop_assert!((a.exposed_area - b.exposed_area).abs() < 1e-13);
            // Away from it the exposed area falls short, by less than the turn of the stream.
            let turned = Flow::new(&(velocity * (1.0 / velocity.norm()) + Vector3::from(change) * 0.1), 1.0);
            let (a, b) = (compiled.total_load(&turned), frozen.total_load(&turned));
            prop_assert!(b.exposed_area <= a.exposed_area + 1e-12);
            prop_assert!(a.exposed_area - b.exposed_area < 0.2 * a.exposed_area);
        }
    }
}
