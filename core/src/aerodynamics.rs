//! Aerodynamics: the force and moment of the air on each segment and on the whole body.
//!
//! The paper's angles of attack and sideslip cancel (model.md "Aerodynamics without angles"). Let `u` be the unit
//! vector of the velocity through the air and `y` the dorsal axis of a segment, both in body axes. The loads on the
//! segment are
//!
//! - a drag `-q Cd Area u` with the exposed area `max(A_yz |v_x|, A_xz |v_y|, A_xy |v_z|)`,
//! - a force across the airstream `-2 q A_xz Cl v_y (y - v_y u)`,
//! - a moment `-2 q A_xz l Cm v_y (u x y)`,
//!
//! which equal the sums over the x and z axes in model.md, since `x x^T + z z^T = 1 - y y^T`.
//!
//! This module is the plain form, segment by segment. [`compiled`] precomputes what depends on the posture alone;
//! [`arch`] is the factor of the arch on the drag; [`free_fly`] adds the dependence on the direction of the airstream
//! beyond belly flight.

pub mod arch;
pub mod compiled;
pub mod free_fly;
pub mod load_model;
pub mod stream;

use nalgebra::{SimdBool, Vector3};

use crate::axis::AxisCoefficients;
use crate::body::posture::PosedSegment;
use crate::body::{Body, SEGMENT_COUNT, Segment, SegmentArray};
use crate::math::{Lanes, Real, usually};
use load_model::{LoadModel, end_drag};

/// Maximum coefficients of a segment (dimensionless), paper eq. (params).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients<T> {
    /// Drag along the airstream, Cd.
    pub drag: T,
    /// Force across the airstream, Cl.
    pub lift: T,
    /// Moment, Cm.
    pub moment: T,
}

/// Factor by which the arch of the body changes the drag, paper eq. (arch_eq).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ArchFactor<T> {
    /// The same factor for every posture.
    Fixed(T),
    /// The factor follows from the arch area of the posed body.
    FromPosture,
    /// As [`ArchFactor::FromPosture`], with the factor's deviation from one multiplied by this number.
    Scaled(T),
}

/// Parameters of the aerodynamic model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aerodynamics<T> {
    /// Coefficients of each segment.
    pub coefficients: SegmentArray<Coefficients<T>>,
    /// Arch factor on the drag.
    pub arch: ArchFactor<T>,
    /// Dependence of the loads on the direction of the airstream.
    pub model: LoadModel,
}

/// Damping moment coefficients Cm_damp of belly turns, paper eq. (params).
pub const BELLY_TURN_DAMPING: AxisCoefficients<f64> = AxisCoefficients::new(3.0, 0.5, 6.0);

/// Maximum coefficients of the paper, eq. (params).
pub const PAPER_COEFFICIENTS: Coefficients<f64> = Coefficients {
    drag: 1.2,
    lift: 1.8,
    moment: 3.5,
};

impl<T: Lanes> Aerodynamics<T> {
    /// Creates the paper's load model with the same coefficients for every segment.
    pub fn uniform(coefficients: Coefficients<T>, arch: ArchFactor<T>) -> Self {
        Self {
            coefficients: SegmentArray::from_fn(|_| coefficients),
            arch,
            model: LoadModel::Paper,
        }
    }

    /// Creates the paper's load model with its coefficients, eq. (params), and the arch factor from the posture.
    pub fn paper() -> Self {
        let Coefficients { drag, lift, moment } = PAPER_COEFFICIENTS;
        let coefficients = Coefficients {
            drag: T::of(drag),
            lift: T::of(lift),
            moment: T::of(moment),
        };
        Self::uniform(coefficients, ArchFactor::FromPosture)
    }

    /// Multiplies the coefficients of all segments by a factor, as if all their areas were scaled by it.
    pub fn scale_area(&mut self, factor: T) {
        for coefficients in self.coefficients.values_mut() {
            coefficients.drag *= factor;
            coefficients.lift *= factor;
            coefficients.moment *= factor;
        }
    }

    /// Converts the parameters to another precision.
    pub fn cast<U: Lanes>(&self) -> Aerodynamics<U>
    where
        T: Real,
    {
        let scalar = |value: T| U::of(value.to_f64());
        Aerodynamics {
            coefficients: self.coefficients.map(|_, c| Coefficients {
                drag: scalar(c.drag),
                lift: scalar(c.lift),
                moment: scalar(c.moment),
            }),
            arch: match self.arch {
                ArchFactor::Fixed(factor) => ArchFactor::Fixed(scalar(factor)),
                ArchFactor::FromPosture => ArchFactor::FromPosture,
                ArchFactor::Scaled(scale) => ArchFactor::Scaled(scalar(scale)),
            },
            model: self.model,
        }
    }
}

/// Angles of attack and sideslip (rad) of a velocity through the air in body or segment axes, paper eqs. (alfabeta),
/// (alfabetaI), in an `atan2` form that holds in every direction.
///
/// `alpha = atan2(-V, W)`, `beta = -asin(U / |V|)`; both are 0 for a body at rest.
pub fn flow_angles<T: Lanes>(velocity: &Vector3<T>) -> (T, T) {
    let transverse = (velocity.y * velocity.y + velocity.z * velocity.z).root();
    (
        (-velocity.y).arctangent2(velocity.z),
        (-velocity.x).arctangent2(transverse),
    )
}

/// Velocity through the air in the form that the load formulas use: direction and dynamic pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flow<T: Lanes> {
    /// Unit vector of the velocity through the air, body axes; zero at rest.
    pub direction: Vector3<T>,
    /// Dynamic pressure `density speed^2 / 2` (Pa).
    pub dynamic_pressure: T,
}

impl<T: Lanes> Flow<T> {
    /// Computes the flow from the velocity through the air (m/s, body axes) and the density (kg/m3).
    #[inline]
    pub fn new(velocity: &Vector3<T>, density: T) -> Self {
        let square = velocity.norm_squared();
        let scale = T::one() / square.root();
        let direction = usually(scale.finite(), || velocity * scale, Vector3::zeros);
        Self {
            direction,
            dynamic_pressure: T::of(0.5) * density * square,
        }
    }
}

/// A segment as exposed to the air, in body axes; coefficients and areas are multiplied once per posture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExposedSegment<T: Lanes> {
    /// Silhouette vectors: each segment axis times the area normal to it (m2).
    pub silhouette: [Vector3<T>; 3],
    /// Dorsal axis y of the segment.
    pub dorsal: Vector3<T>,
    /// Point at which the force acts: the segment's centre of gravity, from the origin (m).
    pub centre: Vector3<T>,
    /// Drag coefficient including the arch factor, `f_arch Cd`. With [`free_fly`] the arch is not included, because
    /// its effect depends on the airstream.
    pub drag: T,
    /// Area of the force across the airstream, `2 A_xz Cl` (m2).
    pub lift_area: T,
    /// Volume of the moment, `2 A_xz l Cm` (m3).
    pub moment_volume: T,
}

/// Force and moment on one segment, divided by the dynamic pressure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentLoad<T: Lanes> {
    /// Exposed area (m2).
    pub exposed_area: T,
    /// Force per dynamic pressure (m2), body axes.
    pub force: Vector3<T>,
    /// Moment about the body origin per dynamic pressure (m3), body axes: `r x F + M`.
    pub moment: Vector3<T>,
}

impl<T: Lanes> ExposedSegment<T> {
    /// A segment without any exposed area.
    pub(crate) fn hidden() -> Self {
        let zero = Vector3::zeros();
        Self {
            silhouette: [zero; 3],
            dorsal: zero,
            centre: zero,
            drag: T::zero(),
            lift_area: T::zero(),
            moment_volume: T::zero(),
        }
    }

    /// Total area exposed to the airstream (m2), paper eq. (area) with the components of `v`.
    #[inline]
    pub fn exposed_area(&self, direction: &Vector3<T>) -> T {
        let [x, y, z] = self.silhouette.map(|axis| axis.dot(direction).simd_abs());
        x.greater(y).greater(z)
    }

    /// Returns the silhouette vector that faces the airstream; its product with the direction is the exposed area.
    #[inline]
    pub fn facing(&self, direction: &Vector3<T>) -> Vector3<T> {
        let [x, y, z] = self.silhouette.map(|axis| {
            let area = axis.dot(direction);
            let faces = area.simd_lt(T::zero()).if_else(|| -axis, || axis);
            (faces, area.simd_abs())
        });
        let larger = |a: (Vector3<T>, T), b: (Vector3<T>, T)| {
            (a.1.simd_gt(b.1).if_else(|| a.0, || b.0), a.1.greater(b.1))
        };
        larger(larger(x, y), z).0
    }

    /// Force and moment for a direction of the airstream, paper eqs. (limbf), (limbm) with the coefficients (coeffCl),
    /// (cm), in the form of model.md.
    #[inline]
    pub fn load(&self, direction: &Vector3<T>) -> SegmentLoad<T> {
        self.load_on_area(direction, self.exposed_area(direction), T::one())
    }

    /// Same as [`ExposedSegment::load`], with the exposed area (m2) for this direction already known and a factor on
    /// everything but the drag.
    #[inline]
    pub fn load_on_area(
        &self,
        direction: &Vector3<T>,
        exposed_area: T,
        across: T,
    ) -> SegmentLoad<T> {
        // Component along y of paper eq. (unityVloclimb).
        let normal = self.dorsal.dot(direction);
        let felt = normal * across;
        let across = self.lift_area * felt;
        let along = self.drag * exposed_area - across * normal;
        let force = -(direction * along + self.dorsal * across);
        let couple = direction.cross(&self.dorsal) * -(self.moment_volume * felt);
        SegmentLoad {
            exposed_area,
            force,
            moment: self.centre.cross(&force) + couple,
        }
    }
}

/// Force and moment on the whole body, without damping and muscle input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loads<T: Lanes> {
    /// Sum of exposed areas (m2).
    pub exposed_area: T,
    /// Force (N), body axes.
    pub force: Vector3<T>,
    /// Moment about the body origin (N m), body axes.
    pub moment: Vector3<T>,
}

/// Computes how all segments are exposed to the air. With [`LoadModel::FreeFly`] the direction of the airstream scales
/// the loads further, see [`free_fly::Felt`].
pub fn expose<T: Lanes>(
    body: &Body<T>,
    posed: &SegmentArray<PosedSegment<T>>,
    aerodynamics: &Aerodynamics<T>,
) -> SegmentArray<ExposedSegment<T>> {
    let mut exposed = SegmentArray::new([ExposedSegment::hidden(); SEGMENT_COUNT]);
    expose_into(body, posed, aerodynamics, &mut exposed);
    exposed
}

/// In-place form of [`expose`].
pub(crate) fn expose_into<T: Lanes>(
    body: &Body<T>,
    posed: &SegmentArray<PosedSegment<T>>,
    aerodynamics: &Aerodynamics<T>,
    exposed: &mut SegmentArray<ExposedSegment<T>>,
) {
    let exposure = Exposure::of(body, posed, aerodynamics);
    for (segment, place) in exposed.iter_mut() {
        *place = exposure.segment(body, posed, aerodynamics, segment);
    }
}

/// What the exposure of all segments has in common.
pub(crate) struct Exposure<T> {
    free: bool,
    arch_factor: T,
}

impl<T: Lanes> Exposure<T> {
    #[inline(always)]
    pub(crate) fn of(
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
    ) -> Self {
        let free = aerodynamics.model == LoadModel::FreeFly;
        let arch_factor = match aerodynamics.arch {
            _ if free => T::one(),
            ArchFactor::Fixed(factor) => factor,
            ArchFactor::FromPosture => arch::arch_factor(arch::arch_area(body, posed)),
            ArchFactor::Scaled(scale) => {
                let factor = arch::arch_factor(arch::arch_area(body, posed));
                T::one() + scale * (factor - T::one())
            }
        };
        Self { free, arch_factor }
    }

    /// Drag coefficient of a segment, including the arch factor.
    #[inline(always)]
    pub(crate) fn drag(&self, aerodynamics: &Aerodynamics<T>, segment: Segment) -> T {
        self.arch_factor * aerodynamics.coefficients[segment].drag
    }

    #[inline(always)]
    pub(crate) fn segment(
        &self,
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
        segment: Segment,
    ) -> ExposedSegment<T> {
        let (parameters, placed) = (&body.segments[segment], &posed[segment]);
        let coefficients = &aerodynamics.coefficients[segment];
        let axes = &placed.body_from_segment;
        let axis = |k: usize| axes.column(k).into_owned();
        let double_area = T::of(2.0) * parameters.area.y;
        let mut end = axis(2) * parameters.area.z;
        if self.free {
            end *= T::of(end_drag(segment));
        }
        ExposedSegment {
            silhouette: [
                axis(0) * parameters.area.x,
                axis(1) * parameters.area.y,
                end,
            ],
            dorsal: axis(1),
            centre: placed.cg,
            drag: self.drag(aerodynamics, segment),
            lift_area: double_area * coefficients.lift,
            moment_volume: double_area * parameters.moment_arm * coefficients.moment,
        }
    }
}

/// Sums the loads of all segments, paper eqs. (sum_f), (sum_m).
pub fn total_load<T: Lanes>(
    segments: &SegmentArray<ExposedSegment<T>>,
    flow: &Flow<T>,
) -> Loads<T> {
    let zero = Vector3::zeros();
    let mut sum = Loads {
        exposed_area: T::zero(),
        force: zero,
        moment: zero,
    };
    for segment in Segment::ALL {
        let load = segments[segment].load(&flow.direction);
        sum.exposed_area += load.exposed_area;
        sum.force += load.force;
        sum.moment += load.moment;
    }
    sum.force *= flow.dynamic_pressure;
    sum.moment *= flow.dynamic_pressure;
    sum
}

/// Coefficient of the damping moment per axis (N m s), `0.005 density A |V|^2 H Cm_damp`, paper eq. (sum_m); the
/// moment that resists rotation is `-coefficient * angular_velocity`.
///
/// `damping` is Cm_damp; `height` is the stature (m).
#[inline]
pub fn damping_rate<T: Lanes>(
    damping: &AxisCoefficients<T>,
    exposed_area: T,
    height: T,
    flow: &Flow<T>,
) -> Vector3<T> {
    damping.to_vector() * (T::of(0.01) * flow.dynamic_pressure * exposed_area * height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::posture::pose;
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_dorsal_form_is_the_sum_over_the_other_axes(
            posture in any_posture(),
            velocity in prop::array::uniform3(-60.0f64..60.0),
        ) {
            // model.md: 2 q A_xz Cl [v_z (z - v_z u) + v_x (x - v_x u)] and the same for the moment.
            let body = reference_body();
            let posed = pose(&body, &posture);
            let exposed = expose(&body, &posed, &Aerodynamics::paper());
            let flow = Flow::new(&Vector3::from(velocity), 1.1);
            let u = flow.direction;
            for (segment, load) in exposed.map(|_, s| s.load(&u)).iter() {
                let axes = &posed[segment].body_from_segment;
                let (x, z) = (axes.column(0).into_owned(), axes.column(2).into_owned());
                let (vx, vz) = (u.dot(&x), u.dot(&z));
                let e = &exposed[segment];
                let across = (z - u * vz) * vz + (x - u * vx) * vx;
                let force = across * e.lift_area - u * (e.drag * load.exposed_area);
                let couple = (u.cross(&z) * vz + u.cross(&x) * vx) * e.moment_volume;
                prop_assert!((force - load.force).norm() < 1e-13);
                let moment = e.centre.cross(&force) + couple;
                prop_assert!((moment - load.moment).norm() < 1e-12);
            }
        }

        #[test]
        fn drag_opposes_motion_and_lift_does_no_work(
            posture in any_posture(),
            velocity in prop::array::uniform3(-60.0f64..60.0),
        ) {
            let body = reference_body();
            let exposed = expose(&body, &pose(&body, &posture), &Aerodynamics::paper());
            let flow = Flow::new(&Vector3::from(velocity), 1.0);
            for (_, segment) in exposed.iter() {
                let load = segment.load(&flow.direction);
                let along = load.force.dot(&flow.direction) + segment.drag * load.exposed_area
                    * flow.direction.norm_squared();
                prop_assert!(along.abs() < 1e-13);
            }
        }
    }

    proptest! {
        #[test]
        fn the_dorsal_form_is_the_paper_s_in_angles(angle in -3.1f64..3.1) {
            // The paper's angles for an airstream in the Y-Z plane of a segment, eqs. (limbf) to (cm): the magnitude
            // follows sin(2 alpha), the force across has the sign of v along z, and the moment is along v x n.
            let body = reference_body();
            let posed = pose(&body, &crate::Posture::h_pose());
            let segment = expose(&body, &posed, &Aerodynamics::uniform(PAPER_COEFFICIENTS, ArchFactor::Fixed(1.0)))
                [Segment::Pelvis];
            let v = Vector3::new(0.0, -libm::sin(angle), libm::cos(angle));
            let (alpha, beta) = flow_angles(&v);
            prop_assert!((alpha - angle).abs() < 1e-12 && beta.abs() < 1e-12);
            let (sine, cosine) = (libm::sin(alpha), libm::cos(alpha));
            let areas = body.segments[Segment::Pelvis].area;
            let area = (areas.y * sine.abs()).max(areas.z * cosine.abs());
            let mut across = v.cross(&v.cross(&Vector3::z()));
            prop_assume!(across.norm() > 1e-6);
            across = across.normalize();
            if across.z * v.z < 0.0 {
                across = -across;
            }
            let magnitude = areas.y * libm::sin(2.0 * alpha).abs();
            let force = across * (PAPER_COEFFICIENTS.lift * magnitude) - v * (PAPER_COEFFICIENTS.drag * area);
            let arm = body.segments[Segment::Pelvis].moment_arm;
            let couple = v.cross(&across) * (PAPER_COEFFICIENTS.moment * magnitude * arm);
            let load = segment.load(&v);
            prop_assert!((load.exposed_area - area).abs() < 1e-12);
            prop_assert!((load.force - force).norm() < 1e-12, "{:?} {force:?}", load.force);
            let moment = segment.centre.cross(&force) + couple;
            prop_assert!((load.moment - moment).norm() < 1e-12);
        }
    }

    #[test]
    fn still_air_exerts_nothing() {
        let body = reference_body();
        let exposed = expose(
            &body,
            &pose(&body, &crate::Posture::h_pose()),
            &Aerodynamics::paper(),
        );
        let loads = total_load(&exposed, &Flow::new(&Vector3::zeros(), 1.2));
        assert_eq!(
            (loads.force, loads.moment),
            (Vector3::zeros(), Vector3::zeros())
        );
    }

    #[test]
    fn belly_to_earth_flow_has_an_angle_of_attack_of_a_quarter_turn() {
        let (alpha, beta) = flow_angles(&Vector3::new(0.0, -50.0, 0.0));
        assert!((alpha - core::f64::consts::FRAC_PI_2).abs() < 1e-12 && beta.abs() < 1e-12);
    }
}
