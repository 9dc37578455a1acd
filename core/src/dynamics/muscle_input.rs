//! Muscle input: the moments and forces with which a skydiver resists the air. Which limbs produce them depends on
//! maneuver and skill and is given as data, paper "Modeling of the Input Moments".
//!
//! The input is one dimensionless coefficient per axis, in_pitch, in_yaw and in_roll in the paper; a coefficient of 1
//! cancels the aerodynamic moment on the limbs involved.

use nalgebra::Vector3;

use crate::aerodynamics::compiled::Seen;
use crate::aerodynamics::{ExposedSegment, Flow};
use crate::axis::AxisCoefficients;
use crate::body::{Segment, SegmentArray};
use crate::math::Lanes;

/// A set of segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limbs(u16);

impl Limbs {
    /// Creates a set from a list of segments.
    pub const fn of(segments: &[Segment]) -> Self {
        let (mut bits, mut rest) = (0, segments);
        while let [first, tail @ ..] = rest {
            bits |= 1 << *first as u16;
            rest = tail;
        }
        Self(bits)
    }

    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Returns whether `segment` belongs to the set.
    #[inline]
    pub const fn contains(self, segment: Segment) -> bool {
        self.0 & (1 << segment as u16) != 0
    }

    /// Returns the union of both sets.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Which limbs produce the inputs, paper eq. (eq1), and with which lever arms, eq. (eq1_1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MuscleModel {
    /// Limbs that produce pitch, N_center in the paper.
    pub center: Limbs,
    /// Proximal limbs of the upper body, which produce yaw.
    pub upper_proximal: Limbs,
    /// Proximal limbs of the lower body, which produce yaw.
    pub lower_proximal: Limbs,
    /// Right distal limbs, which produce yaw.
    pub right_distal: Limbs,
    /// Left distal limbs, which produce yaw.
    pub left_distal: Limbs,
    /// Right limbs, which produce roll.
    pub right: Limbs,
    /// Left limbs, which produce roll.
    pub left: Limbs,
    /// Characteristic lever arms l_1 to l_4 as shares of the stature; longer arms give smaller forces. The paper gives
    /// no numbers; these are distances in the neutral pose: from the pelvic joint to the upper and to the lower
    /// proximal limbs, and sideways to the proximal and to the distal limbs.
    pub lever_arms: [f32; 4],
    /// Whether muscle moments are accompanied by forces.
    pub forces: MuscleForces,
}

/// What muscle input causes besides its moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MuscleForces {
    /// No forces: muscles act within the body, and the posture already determines the aerodynamic load on a limb that
    /// is held in place.
    #[default]
    Moment,
    /// The forces of paper eq. (eq1_1), which are the moments divided by lever arms.
    Paper,
}

impl MuscleForces {
    /// Name used in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Moment => "moment",
            Self::Paper => "paper",
        }
    }

    /// Returns the choice with this name, or `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Moment, Self::Paper]
            .into_iter()
            .find(|choice| choice.name() == name)
    }
}

/// Lever arms l_1 to l_4 of a body, as shares of the stature, see [`MuscleModel::lever_arms`].
pub const LEVER_ARMS: [f32; 4] = [0.28, 0.12, 0.18, 0.22];

/// Lever arms that fit the results of the paper: ten times those of a body. With shorter ones the paper's filter, given
/// flights of its own model, misses the paper's accuracy in the vertical velocity, see docs/reproduction/report.md.
pub const FITTED_LEVER_ARMS: [f32; 4] = [2.8, 1.2, 1.8, 2.2];

const HIPS: Limbs = Limbs::of(&[Segment::LeftThigh, Segment::RightThigh]);
const LEGS: Limbs = Limbs::of(&[Segment::LeftShank, Segment::RightShank]);
const HEAD_AND_THORAX: Limbs = Limbs::of(&[Segment::Thorax, Segment::Head]);
const RIGHT_LEG: Limbs = Limbs::of(&[Segment::RightThigh, Segment::RightShank]);
const LEFT_LEG: Limbs = Limbs::of(&[Segment::LeftThigh, Segment::LeftShank]);

/// Back-to-earth tracking, and the paper's model for transitions: all limbs are used.
pub const BACK_TRACKING: MuscleModel = MuscleModel {
    center: HEAD_AND_THORAX,
    upper_proximal: Limbs::of(&[
        Segment::Thorax,
        Segment::Head,
        Segment::LeftUpperArm,
        Segment::RightUpperArm,
    ]),
    lower_proximal: HIPS,
    right_distal: Limbs::of(&[Segment::RightShank, Segment::RightForearm]),
    left_distal: Limbs::of(&[Segment::LeftShank, Segment::LeftForearm]),
    right: RIGHT_LEG.and(Limbs::of(&[Segment::RightForearm, Segment::RightUpperArm])),
    left: LEFT_LEG.and(Limbs::of(&[Segment::LeftForearm, Segment::LeftUpperArm])),
    lever_arms: LEVER_ARMS,
    forces: MuscleForces::Paper,
};

/// Belly-to-earth tracking by a proficient skydiver: no distal limbs in yaw and no limbs at all in roll.
pub const BELLY_TRACKING: MuscleModel = MuscleModel {
    right_distal: Limbs::NONE,
    left_distal: Limbs::NONE,
    right: Limbs::NONE,
    left: Limbs::NONE,
    ..BACK_TRACKING
};

/// Belly turns by an experienced skydiver: only the most efficient limbs, with pitch by hips and legs.
pub const EXPERIENCED_BELLY_TURNS: MuscleModel = MuscleModel {
    center: HIPS.and(LEGS),
    upper_proximal: HEAD_AND_THORAX,
    ..BELLY_TRACKING
};

/// Turns in an RW suit with booties: thighs and legs produce the input about every axis.
pub const RW_SUIT_TURNS: MuscleModel = MuscleModel {
    center: HIPS.and(LEGS),
    upper_proximal: Limbs::NONE,
    lower_proximal: HIPS,
    right_distal: Limbs::of(&[Segment::RightShank]),
    left_distal: Limbs::of(&[Segment::LeftShank]),
    right: RIGHT_LEG,
    left: LEFT_LEG,
    lever_arms: LEVER_ARMS,
    forces: MuscleForces::Paper,
};

/// Layouts: pitch by legs and thighs, paper "Reconstruction of layouts in simulation".
pub const LAYOUTS: MuscleModel = MuscleModel {
    center: HIPS.and(LEGS),
    ..BACK_TRACKING
};

/// The paper's limb groups with the names used by presets and files.
pub const MODELS: [(&str, MuscleModel); 5] = [
    ("back-tracking", BACK_TRACKING),
    ("belly-tracking", BELLY_TRACKING),
    ("experienced-belly-turns", EXPERIENCED_BELLY_TURNS),
    ("rw-suit-turns", RW_SUIT_TURNS),
    ("layouts", LAYOUTS),
];

/// Force and moment of muscle input, linear in the coefficients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MuscleLoad<T: Lanes> {
    /// Force (N), body axes.
    pub force: Vector3<T>,
    /// Moment about the body origin (N m), body axes.
    pub moment: Vector3<T>,
}

/// Number of groups of limbs in a [`MuscleModel`].
pub const GROUPS: usize = 7;

/// Aerodynamic moment about the body origin that each group of limbs experiences about its own axis (N m): the terms
/// of paper eq. (eq1). For a given direction of the airstream it is quadratic in the speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroupMoments<T>(
    /// Moments in the order of the limb groups in [`MuscleModel`].
    pub [T; GROUPS],
);

impl<T: Lanes> GroupMoments<T> {
    /// Sums over the limbs of each group. `M_atot` of a limb is its `r x F + M` (not a sum, see the list of misprints
    /// in model.md).
    ///
    /// `seen` holds the areas exposed to this flow. Groups whose input is zero are left at zero.
    #[inline]
    pub fn of(
        model: &MuscleModel,
        input: &AxisCoefficients<T>,
        segments: &SegmentArray<ExposedSegment<T>>,
        seen: &Seen<T>,
        flow: &Flow<T>,
    ) -> Self {
        let mut moments = [T::zero(); GROUPS];
        let groups = model.groups();
        let acting = model.acting(input);
        for ((segment, exposed), &area) in segments.iter().zip(seen.areas.values()) {
            if !acting.contains(segment) {
                continue;
            }
            let load = exposed.load_on_area(&flow.direction, area, seen.across);
            let moment = load.moment * flow.dynamic_pressure;
            for (sum, (limbs, axis)) in moments.iter_mut().zip(groups) {
                if limbs.contains(segment) {
                    *sum += moment[axis];
                }
            }
        }
        Self(moments)
    }

    /// Muscle moment and force, paper eqs. (eq1) and (eq1_1), for the reciprocal lever arms of
    /// [`MuscleModel::levers`].
    #[inline]
    pub fn load(&self, input: &AxisCoefficients<T>, levers: &[T; 4]) -> MuscleLoad<T> {
        let [center, upper, lower, right_distal, left_distal, right, left] = self.0;
        let [l1, l2, l3, l4] = *levers;
        MuscleLoad {
            moment: Vector3::new(
                -input.pitch * center,
                -input.yaw * (upper + lower + right_distal + left_distal),
                -input.roll * (left + right),
            ),
            force: Vector3::new(
                -input.yaw * (upper * l1 - lower * l2),
                input.pitch * l1 * center - input.roll * l3 * (left - right),
                -input.yaw * l4 * (right_distal - left_distal),
            ),
        }
    }
}

/// Muscle moment and force, paper eqs. (eq1) and (eq1_1), in body axes; `seen` holds the areas exposed to this flow,
/// `height` is the stature (m).
#[inline]
pub fn muscle_load<T: Lanes>(
    model: &MuscleModel,
    input: &AxisCoefficients<T>,
    segments: &SegmentArray<ExposedSegment<T>>,
    seen: &Seen<T>,
    flow: &Flow<T>,
    height: T,
) -> MuscleLoad<T> {
    if input.is_zero() {
        return MuscleLoad {
            force: Vector3::zeros(),
            moment: Vector3::zeros(),
        };
    }
    GroupMoments::of(model, input, segments, seen, flow).load(input, &model.levers(height))
}

impl MuscleModel {
    /// Returns the paper's limb groups with this name, see [`MODELS`], or `None` if there are none.
    pub fn from_name(name: &str) -> Option<Self> {
        let mut models = MODELS.into_iter();
        models
            .find(|(known, _)| *known == name)
            .map(|(_, model)| model)
    }

    /// Name of the limb groups, regardless of their forces; empty for a combination without a name.
    pub fn name(&self) -> &'static str {
        let mut models = MODELS.into_iter();
        models
            .find(|(_, known)| {
                known
                    .with_forces(self.forces)
                    .with_lever_arms(self.lever_arms)
                    == *self
            })
            .map_or("", |(name, _)| name)
    }

    /// Returns the groups, each with the axis about which it acts: 0 X, 1 Y, 2 Z.
    #[inline]
    const fn groups(&self) -> [(Limbs, usize); GROUPS] {
        [
            (self.center, 0),
            (self.upper_proximal, 1),
            (self.lower_proximal, 1),
            (self.right_distal, 1),
            (self.left_distal, 1),
            (self.right, 2),
            (self.left, 2),
        ]
    }

    /// Returns the same limbs with a different choice of forces.
    #[must_use]
    pub const fn with_forces(mut self, forces: MuscleForces) -> Self {
        self.forces = forces;
        self
    }

    /// Returns the same limbs with other lever arms l_1 to l_4, as shares of the stature.
    #[must_use]
    pub const fn with_lever_arms(mut self, lever_arms: [f32; 4]) -> Self {
        self.lever_arms = lever_arms;
        self
    }

    /// Reciprocals of the lever arms l_1 to l_4 for a person of this stature (1/m), which convert moments to forces;
    /// zero if the model has no forces.
    #[inline]
    pub fn levers<T: Lanes>(&self, height: T) -> [T; 4] {
        match self.forces {
            MuscleForces::Moment => [T::zero(); 4],
            MuscleForces::Paper => self
                .lever_arms
                .map(|share| T::one() / (T::single(share) * height)),
        }
    }

    /// Segments that contribute to the inputs that are not zero.
    #[inline]
    fn acting<T: Lanes>(&self, input: &AxisCoefficients<T>) -> Limbs {
        let yaw = self.upper_proximal.and(self.lower_proximal);
        let yaw = yaw.and(self.right_distal).and(self.left_distal);
        let parts = [
            (input.pitch, self.center),
            (input.yaw, yaw),
            (input.roll, self.right.and(self.left)),
        ];
        parts
            .into_iter()
            .fold(Limbs::NONE, |acting, (input, limbs)| {
                if input == T::zero() {
                    acting
                } else {
                    acting.and(limbs)
                }
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aerodynamics::{Aerodynamics, expose};
    use crate::body::pattern;
    use crate::body::posture::pose;
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    fn exposed(posture: &crate::Posture<f64>) -> SegmentArray<ExposedSegment<f64>> {
        let body = reference_body();
        expose(&body, &pose(&body, posture), &Aerodynamics::paper())
    }

    proptest! {
        #[test]
        fn the_load_is_linear_in_the_input(
            posture in any_posture(),
            velocity in prop::array::uniform3(-60.0f64..60.0),
            a in prop::array::uniform3(0.0f64..6.0),
        ) {
            let segments = exposed(&posture);
            let flow = Flow::new(&Vector3::from(velocity), 1.0);
            let seen = Seen::of(&segments, &flow.direction);
            for (_, model) in MODELS {
                let load = |pitch, yaw, roll| {
                    let input = AxisCoefficients { pitch, yaw, roll };
                    muscle_load(&model, &input, &segments, &seen, &flow, 1.75)
                };
                let whole = load(a[0], a[1], a[2]);
                let parts = [load(a[0], 0.0, 0.0), load(0.0, a[1], 0.0), load(0.0, 0.0, a[2])];
                let force: Vector3<f64> = parts.iter().map(|p| p.force).sum();
                let moment: Vector3<f64> = parts.iter().map(|p| p.moment).sum();
                prop_assert!((whole.force - force).norm() < 1e-9 * (1.0 + force.norm()));
                prop_assert!((whole.moment - moment).norm() < 1e-9 * (1.0 + moment.norm()));
            }
        }
    }

    #[test]
    fn unit_pitch_input_cancels_the_moment_of_its_limbs() {
        let segments = exposed(&pattern::neutral());
        let flow = Flow::new(&Vector3::new(0.0, -50.0, 8.0), 1.0);
        let input = AxisCoefficients {
            pitch: 1.0,
            ..AxisCoefficients::zero()
        };
        let seen = Seen::of(&segments, &flow.direction);
        let load = muscle_load(&LAYOUTS, &input, &segments, &seen, &flow, 1.75);
        let felt: f64 = [
            Segment::LeftThigh,
            Segment::RightThigh,
            Segment::LeftShank,
            Segment::RightShank,
        ]
        .map(|limb| segments[limb].load(&flow.direction).moment.x * flow.dynamic_pressure)
        .iter()
        .sum();
        assert!((load.moment.x + felt).abs() < 1e-9 && felt.abs() > 1.0);
        assert_eq!(load.moment.yz(), nalgebra::Vector2::zeros());
    }
}
