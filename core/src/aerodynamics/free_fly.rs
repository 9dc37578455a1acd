//! Loads that depend on the direction of the airstream, for falls on the back, upright and head-down.
//!
//! The paper's coefficients apply to belly flight: each face of a segment has the drag of a cylinder across the
//! airstream, stacked segments are all fully exposed, and forces across the airstream are those of a body that lies
//! flat. With them a body flown upright or head-down falls at 50 to 60 m/s, where people fall at 65 to 100.
//! [`LoadModel::FreeFly`] adds the effects of the direction and leaves belly flight unchanged:
//!
//! - the ends of segments have the drag of a cylinder along the airstream ([`end_drag`](super::load_model::end_drag));
//! - a segment in the wake of its neighbour loses drag ([`WAKES`], [`SHELTER`]);
//! - the effect of the arch depends on the side from which the air comes;
//! - forces across the airstream and couples fade as the body aligns lengthwise with the airstream.
//!
//! The drag coefficient of the limbs does not decrease with speed: at 50 to 100 m/s thighs, arms and trunk in rough
//! cloth are at Reynolds numbers of 3e5 to 2e6, beyond the drag crisis of rough cylinders, where the coefficient is
//! constant. The exponent in [`Stream`](super::stream::Stream) allows for measurements that show otherwise.

use core::f64::consts::FRAC_1_PI;

use nalgebra::{SimdBool, Vector3};

use super::arch::{arch_area, arch_factor};
use super::load_model::LoadModel;
use super::{Aerodynamics, ArchFactor, ExposedSegment};
use crate::body::posture::PosedSegment;
use crate::body::{Body, Segment, SegmentArray};
use crate::math::Lanes;

/// Pairs of neighbours; whichever is upstream shelters the other.
pub const WAKES: [[Segment; 2]; 13] = [
    [Segment::Pelvis, Segment::Abdomen],
    [Segment::Abdomen, Segment::Thorax],
    [Segment::Thorax, Segment::Head],
    [Segment::Pelvis, Segment::LeftThigh],
    [Segment::Pelvis, Segment::RightThigh],
    [Segment::LeftThigh, Segment::LeftShank],
    [Segment::RightThigh, Segment::RightShank],
    [Segment::LeftShank, Segment::LeftFoot],
    [Segment::RightShank, Segment::RightFoot],
    [Segment::LeftUpperArm, Segment::LeftForearm],
    [Segment::RightUpperArm, Segment::RightForearm],
    [Segment::LeftForearm, Segment::LeftHand],
    [Segment::RightForearm, Segment::RightHand],
];

/// Share of its drag that a segment fully inside a wake loses. Bodies in tandem within two or three diameters lose all
/// of it or more; a tenth is kept for the parts of a segment that lie off its axis.
pub const SHELTER: f64 = 0.9;

/// The data of a posture for airstreams from any direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeFly<T: Lanes> {
    /// Change of the drag factor by the arch, for air coming from the belly side and from the back.
    arch: [T; 2],
    /// One wake for each pair of [`WAKES`].
    wakes: [Wake<T>; WAKES.len()],
}

/// Two neighbouring segments, with lengths in units of the radius of their wake.
///
/// The squared radius of the wake is the sum of the squared radii of both ends, so that the shelter ends smoothly.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wake<T: Lanes> {
    /// Vector from the centre of the first segment to that of the second, body axes.
    apart: Vector3<T>,
    /// One minus the squared length of `apart`. Adding the squared component of `apart` along the airstream gives the
    /// depth in the wake of the downstream segment.
    depth: T,
    /// Share of its drag that the first segment loses deep in the wake of the second, and the second in that of the
    /// first.
    loss: [T; 2],
}

impl<T: Lanes> Wake<T> {
    /// Creates the wake of two neighbours `apart` (m, body axes) whose ends have these squared radii (m2).
    fn of(apart: &Vector3<T>, [first, second]: [T; 2]) -> Self {
        let (zero, one, width) = (T::zero(), T::one(), first + second);
        let covered = |shade: T, shaded: T| {
            let partly = shade.simd_lt(shaded);
            partly.if_else(|| shade / shaded, || one)
        };
        // Without a width there is no wake.
        let narrow = width.simd_le(zero);
        let loss = |covered: T| narrow.if_else(|| zero, || T::of(SHELTER) * covered);
        let scale = |apart: Vector3<T>| narrow.if_else(Vector3::zeros, || apart);
        Self {
            apart: scale(apart * (one / width.root())),
            depth: narrow.if_else(|| zero, || one - apart.norm_squared() / width),
            loss: [loss(covered(second, first)), loss(covered(first, second))],
        }
    }
}

/// Factors on the loads for one direction of the airstream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt<T: Lanes> {
    /// Factor on the drag of each segment, from arch and shelter.
    pub drag: SegmentArray<T>,
    /// Factor on the forces across the airstream and on the couples.
    pub across: T,
}

impl<T: Lanes> Felt<T> {
    /// All factors one, as in the paper's model.
    #[inline]
    pub fn whole() -> Self {
        Self {
            drag: SegmentArray::from_fn(|_| T::one()),
            across: T::one(),
        }
    }

    /// Applies the factors to a segment.
    #[must_use]
    pub fn by(&self, segment: Segment, exposed: &ExposedSegment<T>) -> ExposedSegment<T> {
        ExposedSegment {
            drag: exposed.drag * self.drag[segment],
            lift_area: exposed.lift_area * self.across,
            moment_volume: exposed.moment_volume * self.across,
            ..*exposed
        }
    }
}

impl<T: Lanes> FreeFly<T> {
    /// Precomputes the data of a posed body; `None` with the paper's model.
    pub(crate) fn of(
        body: &Body<T>,
        posed: &SegmentArray<PosedSegment<T>>,
        aerodynamics: &Aerodynamics<T>,
    ) -> Option<Self> {
        if aerodynamics.model == LoadModel::Paper {
            return None;
        }
        let one = T::one();
        let by_area = |scale: T| {
            let area = arch_area(body, posed);
            [area, -area].map(|area| scale * (arch_factor(area) - one))
        };
        let square_radius = |segment: Segment| body.segments[segment].area.z * T::of(FRAC_1_PI);
        Some(Self {
            arch: match aerodynamics.arch {
                ArchFactor::Fixed(factor) => [factor - one; 2],
                ArchFactor::FromPosture => by_area(one),
                ArchFactor::Scaled(scale) => by_area(scale),
            },
            wakes: WAKES.map(|pair| {
                let [first, second] = pair.map(|segment| posed[segment].cg);
                Wake::of(&(second - first), pair.map(square_radius))
            }),
        })
    }

    /// Factors on the loads for a velocity through the air along `direction` (unit vector, body axes). Kept out of
    /// line so that the paper's model does not pay for it.
    #[cold]
    #[inline(never)]
    pub fn felt(&self, direction: &Vector3<T>) -> Felt<T> {
        let mut felt = Felt::whole();
        felt.across = self.shares(direction, &mut felt.drag);
        felt
    }

    /// In-place form of [`FreeFly::felt`]: stores the factors on the drag and returns the factor on forces across the
    /// airstream.
    #[inline]
    pub(super) fn shares(&self, direction: &Vector3<T>, drag: &mut SegmentArray<T>) -> T {
        let (zero, one) = (T::zero(), T::one());
        // Share of the airstream that meets belly or back, by the cross-flow principle.
        let flat = direction.y * direction.y;
        let [belly, back] = self.arch;
        let arch = one + flat * direction.y.simd_lt(zero).if_else(|| belly, || back);
        for share in drag.values_mut() {
            *share = arch;
        }
        for (&[first, second], wake) in WAKES.iter().zip(&self.wakes) {
            let along = wake.apart.dot(direction);
            let inside = wake.depth + along * along;
            let (covers, first_behind) = (inside.simd_gt(zero), along.simd_gt(zero));
            if covers.none() {
                continue;
            }
            let behind = [first_behind, !first_behind];
            for ((segment, behind), loss) in [first, second].into_iter().zip(behind).zip(wake.loss)
            {
                let kept = |share: T| share * (one - loss * inside * inside);
                let share = drag[segment];
                drag[segment] = (covers & behind).if_else(|| kept(share), || share);
            }
        }
        flat
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aerodynamics::compiled::CompiledAerodynamics;
    use crate::aerodynamics::{Flow, expose, total_load};
    use crate::body::pattern;
    use crate::body::posture::{Posture, pose};
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    fn free_fly() -> Aerodynamics<f64> {
        Aerodynamics {
            model: LoadModel::FreeFly,
            ..Aerodynamics::paper()
        }
    }

    fn compiled(
        posture: &Posture<f64>,
        aerodynamics: &Aerodynamics<f64>,
    ) -> CompiledAerodynamics<f64> {
        let body = reference_body();
        let mut compiled = CompiledAerodynamics::hidden();
        compiled.expose(&body, &pose(&body, posture), aerodynamics);
        compiled
    }

    /// The loads summed segment by segment.
    fn plain(posture: &Posture<f64>, flow: &Flow<f64>) -> crate::aerodynamics::Loads<f64> {
        let body = reference_body();
        let posed = pose(&body, posture);
        let exposed = expose(&body, &posed, &free_fly());
        let free = FreeFly::of(&body, &posed, &free_fly()).expect("asked for");
        let felt = free.felt(&flow.direction);
        total_load(
            &exposed.map(|segment, exposed| felt.by(segment, exposed)),
            flow,
        )
    }

    proptest! {
        #[test]
        fn compiled_and_frozen_are_the_plain_form(
            posture in any_posture(),
            velocity in prop::array::uniform3(-80.0f64..80.0),
        ) {
            let flow = Flow::new(&Vector3::from(velocity), 1.1);
            prop_assume!(flow.dynamic_pressure > 10.0);
            let plain = plain(&posture, &flow);
            let compiled = compiled(&posture, &free_fly());
            let frozen = compiled.about(&flow.direction).total_load(&flow);
            let whole = compiled.total_load(&flow);
            let scale = 1e-13 * flow.dynamic_pressure;
            prop_assert!((plain.force - whole.force).norm() < scale);
            prop_assert!((plain.moment - whole.moment).norm() < scale);
            prop_assert!((plain.force - frozen.force).norm() < scale);
            prop_assert!((plain.moment - frozen.moment).norm() < scale);
        }

        #[test]
        fn loads_turn_with_the_stream_without_a_jump(
            posture in any_posture(),
            direction in prop::array::uniform3(-1.0f64..1.0),
            turn in prop::array::uniform3(-1e-6f64..1e-6),
        ) {
            let direction = Vector3::from(direction);
            prop_assume!(direction.norm() > 0.1);
            let compiled = compiled(&posture, &free_fly());
            let at = |velocity: &Vector3<f64>| {
                let flow = Flow { dynamic_pressure: 1.0, ..Flow::new(velocity, 1.0) };
                compiled.total_load(&flow)
            };
            let (a, b) = (at(&direction), at(&(direction + Vector3::from(turn))));
            prop_assert!((a.force - b.force).norm() < 1e-3);
            prop_assert!((a.moment - b.moment).norm() < 1e-3);
        }
    }

    #[test]
    fn only_segments_behind_a_neighbour_are_sheltered() {
        let body = reference_body();
        let posed = pose(&body, &Posture::h_pose());
        let free = FreeFly::of(&body, &posed, &free_fly()).expect("asked for");
        let feet_first = free.felt(&-Vector3::z()).drag;
        assert!(feet_first[Segment::LeftShank] < 0.8, "{feet_first:?}");
        assert!(feet_first[Segment::Abdomen] < 0.3);
        assert!((feet_first[Segment::LeftFoot] - 1.0).abs() < 1e-12);
        let head_first = free.felt(&Vector3::z()).drag;
        assert!((head_first[Segment::Head] - 1.0).abs() < 1e-12);
        assert!(head_first[Segment::Pelvis] < 0.3);
    }

    #[test]
    fn an_arch_falls_faster_on_the_belly_and_slower_on_the_back() {
        let arched = pattern::arched(&pattern::neutral(), 0.3);
        let body = reference_body();
        let posed = pose(&body, &arched);
        let free = FreeFly::of(&body, &posed, &free_fly()).expect("asked for");
        let trunk = |direction: Vector3<f64>| free.felt(&direction).drag[Segment::Pelvis];
        assert!(trunk(-Vector3::y()) < 0.9);
        assert!(trunk(Vector3::y()) > 1.1);
    }
}
