//! Loads by the direction of the stream: falls on the back, upright and head-down.
//!
//! The paper's coefficients are those of belly flight: each face of a segment has the drag of a cylinder across the
//! stream, stacked segments all meet the whole stream, and forces across it are those of a body that lies flat. Flown
//! upright or head-down such a body falls at 50 to 60 m/s, where people fall at 65 to 100. [`LoadModel::FreeFly`] adds
//! what the direction changes and leaves belly flight as it is:
//!
//! - the ends of segments have the drag of a cylinder along the stream ([`end_drag`](super::load_model::end_drag));
//! - a segment in the wake of its neighbour loses drag ([`WAKES`], [`SHELTER`]);
//! - an arch is felt by the side from which the stream comes;
//! - forces across the stream and couples fade as the body turns its length into the stream.
//!
//! The drag of limbs does not fall with the speed: thighs, arms and trunk at 50 to 100 m/s are at Reynolds numbers of
//! 3e5 to 2e6 in rough cloth, beyond the drag crisis of rough cylinders, where the coefficient is level. The
//! exponent in [`Stream`](super::stream::Stream) is there for who measures another.

use core::f64::consts::FRAC_1_PI;

use nalgebra::Vector3;

use super::arch::{arch_area, arch_factor};
use super::load_model::LoadModel;
use super::{Aerodynamics, ArchFactor, ExposedSegment};
use crate::body::posture::PosedSegment;
use crate::body::{Body, Segment, SegmentArray};
use crate::math::Real;

/// Neighbours of which the one ahead shelters the one behind, whichever way the stream comes.
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

/// Share of its drag that a segment wholly in a wake loses: bodies in tandem within two or three diameters lose all
/// of it and more; a tenth is left for what a body shows beside its axis.
pub const SHELTER: f64 = 0.9;

/// What a posture has for streams from any direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeFly<T: Real> {
    /// Change of the drag by the arch, for streams to belly and back.
    arch: [T; 2],
    /// One for each of [`WAKES`].
    wakes: [Wake<T>; WAKES.len()],
}

/// Two neighbours, in units of the radius of their wake.
///
/// The square of that radius is the sum of the squares of both ends' radii: a wake that wide, which ends without a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wake<T: Real> {
    /// From the centre of the first to that of the second, body axes.
    apart: Vector3<T>,
    /// One less the square of that distance: with the square of its part along the stream, how deep in the wake the one behind lies.
    depth: T,
    /// Share of its drag that the first loses deep in the wake of the second, and the second in that of the first.
    loss: [T; 2],
}

impl<T: Real> Wake<T> {
    /// No shelter.
    fn none() -> Self {
        Self {
            apart: Vector3::zeros(),
            depth: T::zero(),
            loss: [T::zero(); 2],
        }
    }

    /// Of neighbours `apart` (m, body axes), whose ends have radii of these squares (m2).
    fn of(apart: &Vector3<T>, [first, second]: [T; 2]) -> Self {
        let (one, width) = (T::one(), first + second);
        if width <= T::zero() {
            return Self::none();
        }
        let covered = |shade: T, shaded: T| if shade < shaded { shade / shaded } else { one };
        let loss = |covered: T| T::of(SHELTER) * covered;
        Self {
            apart: apart * (one / width.root()),
            depth: one - apart.norm_squared() / width,
            loss: [loss(covered(second, first)), loss(covered(first, second))],
        }
    }
}

/// Shares of the loads that one direction of the stream leaves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Felt<T: Real> {
    /// Factor on the drag of each segment: arch and shelter.
    pub drag: SegmentArray<T>,
    /// Factor on forces across the stream and couples.
    pub across: T,
}

impl<T: Real> Felt<T> {
    /// All of them: the paper's model.
    #[inline]
    pub fn whole() -> Self {
        Self {
            drag: SegmentArray::from_fn(|_| T::one()),
            across: T::one(),
        }
    }

    /// A segment as it feels this stream.
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

impl<T: Real> FreeFly<T> {
    /// Of a posed body; `None` where the paper's model is asked for.
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

    /// What a stream from `direction` (unit vector of the velocity through the air, body axes) leaves of the loads. Apart, so that who flies
    /// the paper's model does not pay for it.
    #[cold]
    #[inline(never)]
    pub fn felt(&self, direction: &Vector3<T>) -> Felt<T> {
        let mut felt = Felt::whole();
        felt.across = self.shares(direction, &mut felt.drag);
        felt
    }

    /// [`FreeFly::felt`] where the shares of the drag are kept; the factor on forces across the stream.
    #[inline]
    pub(super) fn shares(&self, direction: &Vector3<T>, drag: &mut SegmentArray<T>) -> T {
        let (zero, one) = (T::zero(), T::one());
        // Share of the stream that meets belly or back, as in the principle of cross-flow.
        let flat = direction.y * direction.y;
        let [belly, back] = self.arch;
        let arch = one + flat * if direction.y < zero { belly } else { back };
        for share in drag.values_mut() {
            *share = arch;
        }
        for (&[first, second], wake) in WAKES.iter().zip(&self.wakes) {
            let along = wake.apart.dot(direction);
            let inside = wake.depth + along * along;
            if inside > zero {
                let [of_first, of_second] = wake.loss;
                let (behind, loss) = if along > zero {
                    (first, of_first)
                } else {
                    (second, of_second)
                };
                drag[behind] *= one - loss * inside * inside;
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

    /// Segment by segment.
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
    fn what_lies_behind_its_neighbour_is_sheltered_and_only_that() {
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
