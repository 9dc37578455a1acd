//! The compiled form: the part of the aerodynamic sums that depends on the posture, computed once per posture sample.
//!
//! Except for the maximum in the drag, every term is a polynomial in the flow direction, so the sums over segments
//! collapse to a few small matrices (model.md "Aerodynamics without angles", with `x x^T + z z^T = 1 - y y^T`). A
//! property test checks that it equals the plain form to rounding.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::free_fly::{Felt, FreeFly};
use super::load_model::LoadModel;
use super::stream::Stream;
use super::{Aerodynamics, ExposedSegment, Exposure, Flow, Loads, expose_into};
use crate::body::posture::PosedSegment;
use crate::body::{Body, SEGMENT_COUNT, SegmentArray};
use crate::math::{Lanes, cross_columns};

/// Aerodynamics of one posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompiledAerodynamics<T: Lanes> {
    /// The segments, needed for the drag and for muscle input.
    pub segments: SegmentArray<ExposedSegment<T>>,
    forms: Forms<T>,
    free_fly: Option<FreeFly<T>>,
}

/// Areas of a posture that are exposed to a given airstream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen<T: Lanes> {
    /// Exposed area of each segment (m2), scaled by the effects of shelter and arch on its drag.
    pub areas: SegmentArray<T>,
    /// Factor on the forces across the airstream and on the couples.
    pub across: T,
}

impl<T: Lanes> Seen<T> {
    /// No exposed areas, to be filled later.
    pub(crate) fn nothing() -> Self {
        Self {
            areas: SegmentArray::from_fn(|_| T::zero()),
            across: T::one(),
        }
    }

    /// Exposed areas in the paper's model.
    pub fn of(segments: &SegmentArray<ExposedSegment<T>>, direction: &Vector3<T>) -> Self {
        Self {
            areas: segments.map(|_, segment| segment.exposed_area(direction)),
            across: T::one(),
        }
    }
}

/// Precomputed sums for everything but the drag.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Forms<T: Lanes> {
    /// `Sum 2 A_xz Cl y y^T` (m2): force across the airstream.
    lift: Matrix3<T>,
    /// `Sum 2 A_xz l Cm y y^T` (m3): couples.
    couple: Matrix3<T>,
    /// `Sum 2 A_xz Cl [r]x y y^T` (m3): moment of the component of the force along y.
    lift_moment: Matrix3<T>,
    /// `Sum 2 A_xz Cl r_k y y^T` (m3) for k = x, y, z: centre of the component of the force along u.
    lift_centre: [Matrix3<T>; 3],
}

/// Drag of all segments, divided by the dynamic pressure.
struct Drag<T: Lanes> {
    exposed_area: T,
    /// Sum of areas times drag coefficients (m2).
    area: T,
    /// Sum of areas times drag coefficients times centres (m3).
    centre: Vector3<T>,
}

impl<T: Lanes> Drag<T> {
    fn none() -> Self {
        Self {
            exposed_area: T::zero(),
            area: T::zero(),
            centre: Vector3::zeros(),
        }
    }

    #[inline]
    fn add(&mut self, segment: &ExposedSegment<T>, drag_area: T) {
        self.area += drag_area;
        self.centre += segment.centre * drag_area;
    }
}

/// Components xx, xy, xz, yy, yz, zz of a symmetric matrix.
type Symmetric<T> = Vector6<T>;

/// A symmetric matrix with all its components.
fn whole<T: Lanes>(components: &Symmetric<T>) -> Matrix3<T> {
    let [xx, xy, xz, yy, yz, zz] = (*components).into();
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// What a segment adds to [`Forms`], or the sum over several.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FormShare<T: Lanes> {
    lift: Symmetric<T>,
    couple: Symmetric<T>,
    lift_moment: Matrix3<T>,
    lift_centre: [Symmetric<T>; 3],
}

impl<T: Lanes> FormShare<T> {
    fn none() -> Self {
        let none = Symmetric::zeros();
        Self {
            lift: none,
            couple: none,
            lift_moment: Matrix3::zeros(),
            lift_centre: [none; 3],
        }
    }

    #[inline(always)]
    pub(crate) fn of(segment: &ExposedSegment<T>) -> Self {
        let [x, y, z] = segment.dorsal.into();
        let dyad = Symmetric::from([x * x, x * y, x * z, y * y, y * z, z * z]);
        let lift = dyad * segment.lift_area;
        let [x, y, z] = segment.centre.into();
        Self {
            lift,
            couple: dyad * segment.moment_volume,
            lift_moment: cross_columns(&segment.centre, &whole(&lift)),
            lift_centre: [lift * x, lift * y, lift * z],
        }
    }

    #[inline(always)]
    fn add(&mut self, share: &Self) {
        self.lift += share.lift;
        self.couple += share.couple;
        self.lift_moment += share.lift_moment;
        for (sum, share) in self.lift_centre.iter_mut().zip(&share.lift_centre) {
            *sum += share;
        }
    }

    fn whole(&self) -> Forms<T> {
        Forms {
            lift: whole(&self.lift),
            couple: whole(&self.couple),
            lift_moment: self.lift_moment,
            lift_centre: self.lift_centre.map(|form| whole(&form)),
        }
    }
}

impl<T: Lanes> Forms<T> {
    fn none() -> Self {
        FormShare::none().whole()
    }

    fn of(segments: &SegmentArray<ExposedSegment<T>>) -> Self {
        let mut sum = FormShare::none();
        for segment in segments.values() {
            sum.add(&FormShare::of(segment));
        }
        sum.whole()
    }

    fn scaled(mut self, factor: T) -> Self {
        self.lift *= factor;
        self.couple *= factor;
        self.lift_moment *= factor;
        self.lift_centre = self.lift_centre.map(|form| form * factor);
        self
    }

    /// Computes the loads; `across` scales everything but the drag.
    #[inline(always)]
    fn load(&self, flow: &Flow<T>, drag: &Drag<T>, across: T) -> Loads<T> {
        let u = &flow.direction;
        let lift = self.lift * u * across;
        let centre = Vector3::from(self.lift_centre.map(|form| u.dot(&(form * u)) * across));
        let force = u * (u.dot(&lift) - drag.area) - lift;
        let moment = (centre - drag.centre).cross(u)
            - self.lift_moment * u * across
            - u.cross(&(self.couple * u * across));
        Loads {
            exposed_area: drag.exposed_area,
            force: force * flow.dynamic_pressure,
            moment: moment * flow.dynamic_pressure,
        }
    }
}

impl<T: Lanes> CompiledAerodynamics<T> {
    /// Computes the sums for these segments.
    pub fn new(segments: SegmentArray<ExposedSegment<T>>) -> Self {
        let forms = Forms::of(&segments);
        Self {
            segments,
            forms,
            free_fly: None,
        }
    }

    /// Aerodynamics of a body without any exposed area.
    pub(crate) fn hidden() -> Self {
        Self {
            segments: SegmentArray::new([ExposedSegment::hidden(); SEGMENT_COUNT]),
            forms: Forms::none(),
            free_fly: None,
        }
    }

    /// Exposes a posed body in place and computes the sums.
    pub(crate) fn expose(
        &mut self,
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
    ) {
        expose_into(body, posed, aerodynamics, &mut self.segments);
        self.forms = Forms::of(&self.segments);
        self.expose_direction(body, posed, aerodynamics);
    }

    /// Exposes the segments that `moved` or changed anew, and all with new drag coefficients; `shares` are those before.
    pub(crate) fn expose_moved(
        &mut self,
        (body, posed): (&Body<T>, &SegmentArray<PosedSegment<T>>),
        aerodynamics: &Aerodynamics<T>,
        moved: &SegmentArray<bool>,
        shares: &SegmentArray<FormShare<T>>,
    ) {
        let exposure = Exposure::of(body, posed, aerodynamics);
        let mut sum = FormShare::none();
        for (segment, exposed) in self.segments.iter_mut() {
            if moved[segment] {
                *exposed = exposure.segment(body, posed, aerodynamics, segment);
                sum.add(&FormShare::of(exposed));
            } else {
                exposed.drag = exposure.drag(aerodynamics, segment);
                sum.add(&shares[segment]);
            }
        }
        self.forms = sum.whole();
        self.expose_direction(body, posed, aerodynamics);
    }

    fn expose_direction(
        &mut self,
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
    ) {
        if aerodynamics.model == LoadModel::Paper {
            self.free_fly = None;
        } else {
            self.expose_free_fly(body, posed, aerodynamics);
        }
    }

    /// Kept out of line so that the paper's model does not need its stack.
    #[cold]
    #[inline(never)]
    fn expose_free_fly(
        &mut self,
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
    ) {
        self.free_fly = FreeFly::of(body, posed, aerodynamics);
    }

    /// Factors on the loads for a velocity along `direction` (unit vector, body axes); `None` in the paper's model,
    /// where all are one.
    #[inline]
    pub fn felt(&self, direction: &Vector3<T>) -> Option<Felt<T>> {
        let free_fly = self.free_fly.as_ref()?;
        Some(free_fly.felt(direction))
    }

    /// Exposed areas for a velocity through the air along `direction` (unit vector, body axes).
    pub fn seen(&self, direction: &Vector3<T>) -> Seen<T> {
        let mut seen = Seen::of(&self.segments, direction);
        if let Some(felt) = self.felt(direction) {
            seen.across = felt.across;
            for ((_, area), share) in seen.areas.iter_mut().zip(felt.drag.values()) {
                *area *= *share;
            }
        }
        seen
    }

    /// Force and moment where each segment has its own local airstream, see [`Stream::total_load`].
    #[cold]
    #[inline(never)]
    pub fn total_load_in(
        &self,
        stream: &Stream<T>,
        velocity: &Vector3<T>,
        spin: &Vector3<T>,
        density: T,
    ) -> Loads<T> {
        let direction = Flow::new(velocity, density).direction;
        match self.felt(&direction) {
            None => stream.total_load(&self.segments, velocity, spin, density),
            Some(felt) => {
                let segments = self
                    .segments
                    .map(|segment, exposed| felt.by(segment, exposed));
                stream.total_load(&segments, velocity, spin, density)
            }
        }
    }

    /// Force and moment on the body, equal to [`super::total_load`].
    #[inline]
    pub fn total_load(&self, flow: &Flow<T>) -> Loads<T> {
        self.total_load_seen(flow, &mut Seen::nothing())
    }

    /// Same as [`CompiledAerodynamics::total_load`]; also stores the exposed areas in `seen` for reuse.
    #[inline]
    pub fn total_load_seen(&self, flow: &Flow<T>, seen: &mut Seen<T>) -> Loads<T> {
        if let Some(free_fly) = &self.free_fly {
            return self.felt_load_seen(free_fly, flow, seen);
        }
        let mut drag = Drag::none();
        for (segment, place) in self.segments.values().zip(seen.areas.values_mut()) {
            let area = segment.exposed_area(&flow.direction);
            *place = area;
            drag.exposed_area += area;
            drag.add(segment, segment.drag * area);
        }
        seen.across = T::one();
        self.forms.load(flow, &drag, T::one())
    }

    /// The same for loads that depend on the direction of the airstream. Kept out of line so that the paper's model
    /// does not pay for it.
    #[cold]
    #[inline(never)]
    fn felt_load_seen(
        &self,
        free_fly: &FreeFly<T>,
        flow: &Flow<T>,
        seen: &mut Seen<T>,
    ) -> Loads<T> {
        let across = free_fly.shares(&flow.direction, &mut seen.areas);
        seen.across = across;
        let mut drag = Drag::none();
        for (segment, place) in self.segments.values().zip(seen.areas.values_mut()) {
            let area = segment.exposed_area(&flow.direction);
            *place *= area;
            drag.exposed_area += area;
            drag.add(segment, segment.drag * *place);
        }
        self.forms.load(flow, &drag, across)
    }

    /// Returns a form that is accurate for velocities near `direction` (unit vector, body axes).
    pub fn about(&self, direction: &Vector3<T>) -> FrozenAerodynamics<T> {
        let felt = self.felt(direction);
        let mut frozen = FrozenAerodynamics {
            forms: match &felt {
                None => self.forms,
                Some(felt) => self.forms.scaled(felt.across),
            },
            silhouette: Vector3::zeros(),
            drag_silhouette: Vector3::zeros(),
            drag_centre: Matrix3::zeros(),
            least: [T::zero(); 2],
        };
        for (which, segment) in self.segments.iter() {
            let face = segment.facing(direction);
            frozen.silhouette += face;
            let share = felt.as_ref().map_or(T::one(), |felt| felt.drag[which]);
            let drag = face * (segment.drag * share);
            frozen.drag_silhouette += drag;
            frozen.drag_centre += segment.centre * drag.transpose();
        }
        frozen.least = [&frozen.silhouette, &frozen.drag_silhouette]
            .map(|face| face.dot(direction) * T::of(LEAST_SHARE));
        frozen
    }
}

/// Lower bound of the frozen areas as a share of those at the reference direction, however the airstream turns.
const LEAST_SHARE: f64 = 0.25;

#[inline]
fn at_least<T: Lanes>(value: T, least: T) -> T {
    value.greater(least)
}

/// Aerodynamics of one posture without its segments: exact while each segment exposes the same face to the airstream
/// as at the reference direction, first-order accurate beyond that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrozenAerodynamics<T: Lanes> {
    forms: Forms<T>,
    /// Sum of the silhouette vectors that face the airstream (m2); its product with the direction is the exposed area.
    silhouette: Vector3<T>,
    /// Sum of the same vectors times the drag coefficients (m2).
    drag_silhouette: Vector3<T>,
    /// `Sum r (Cd a)^T` (m3); its product with the direction is the centre of the drag times its area.
    drag_centre: Matrix3<T>,
    /// Lower bounds of the exposed area and of the drag area (m2).
    least: [T; 2],
}

impl<T: Lanes> FrozenAerodynamics<T> {
    /// Area exposed to an airstream in this `direction` (m2).
    #[inline]
    pub fn exposed_area(&self, direction: &Vector3<T>) -> T {
        at_least(self.silhouette.dot(direction), self.least[0])
    }

    /// Force and moment on the body, see [`CompiledAerodynamics::total_load`].
    #[inline]
    pub fn total_load(&self, flow: &Flow<T>) -> Loads<T> {
        let [_, least_drag] = self.least;
        let u = &flow.direction;
        let drag = Drag {
            exposed_area: self.exposed_area(u),
            area: at_least(self.drag_silhouette.dot(u), least_drag),
            centre: self.drag_centre * u,
        };
        self.forms.load(flow, &drag, T::one())
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
            // At the reference direction the exposed faces are the same.
            let (a, b) = (compiled.total_load(&reference), frozen.total_load(&reference));
            let scale = reference.dynamic_pressure;
            prop_assert!((a.force - b.force).norm() < 1e-13 * scale);
            prop_assert!((a.moment - b.moment).norm() < 1e-13 * scale);
            prop_assert!((a.exposed_area - b.exposed_area).abs() < 1e-13);
            // Away from it the frozen exposed area is too small, but by less than 20 %.
            let turned = Flow::new(&(velocity * (1.0 / velocity.norm()) + Vector3::from(change) * 0.1), 1.0);
            let (a, b) = (compiled.total_load(&turned), frozen.total_load(&turned));
            prop_assert!(b.exposed_area <= a.exposed_area + 1e-12);
            prop_assert!(a.exposed_area - b.exposed_area < 0.2 * a.exposed_area);
        }
    }
}
