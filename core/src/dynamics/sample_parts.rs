//! Posture samples that differ little from another: only what differs is computed, with the bits of a whole sample.
//!
//! Derivatives with respect to a joint or to a parameter of the body take hundreds of samples of almost the same body.

use super::{Dynamics, PostureSample};
use crate::aerodynamics::compiled::FormShare;
use crate::body::mass_properties::{MovingShare, MovingSum, PostureRate, SegmentMotion};
use crate::body::posture::{PosedSegment, Posture, pose};
use crate::body::{Segment, SegmentArray};
use crate::math::Real;

/// What each segment adds to a posture sample.
#[derive(Debug, Clone)]
pub struct SampleParts<T: Real> {
    posed: SegmentArray<PosedSegment<T>>,
    moving: SegmentArray<SegmentMotion<T>>,
    mass: SegmentArray<MovingShare<T>>,
    forms: SegmentArray<FormShare<T>>,
}

/// Which parts of a sample differ between two models.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Difference {
    /// Neither part, although the models may differ elsewhere.
    None,
    /// Those that depend on places, or on loads that lag: the whole sample.
    All,
    /// Masses or inertias, areas or coefficients, or both.
    Parts {
        /// The segments whose mass properties differ, if there are any.
        mass: Option<SegmentArray<bool>>,
        /// The segments on which other loads of the air than the drag differ, if any load of the air does.
        air: Option<SegmentArray<bool>>,
    },
}

impl Difference {
    /// Compares two models.
    pub fn between<T: Real>(one: &Dynamics<T>, other: &Dynamics<T>) -> Self {
        let lags = [one, other].map(|dynamics| dynamics.stream.lag);
        let mut places = lags != [T::zero(); 2];
        let [mut mass, mut air] = [SegmentArray::from_fn(|_| false); 2];
        let [now, then] = [&one.aerodynamics, &other.aerodynamics];
        for segment in Segment::ALL {
            let [a, b] = [one, other].map(|dynamics| &dynamics.body.segments[segment]);
            places |= a.joint_offset != b.joint_offset || a.cg != b.cg;
            mass[segment] = a.mass != b.mass || a.inertia != b.inertia;
            let faces = a.area != b.area || a.moment_arm != b.moment_arm || a.length != b.length;
            let [a, b] = [now, then].map(|air| &air.coefficients[segment]);
            air[segment] = faces || a.lift != b.lift || a.moment != b.moment;
            air[segment] |= now.model != then.model;
        }
        let any = |which: SegmentArray<bool>| which.values().any(|differs| *differs);
        if places {
            return Self::All;
        }
        let (has_mass, has_air) = (any(mass), any(air) || now != then);
        if !has_mass && !has_air {
            return Self::None;
        }
        Self::Parts {
            mass: has_mass.then_some(mass),
            air: has_air.then_some(air),
        }
    }
}

impl<T: Real> Dynamics<T> {
    /// Computes the parts of [`Dynamics::sample`].
    pub fn sample_parts(&self, posture: &Posture<T>, rate: &PostureRate<T>) -> SampleParts<T> {
        let posed = pose(&self.body, posture);
        let mut moving = SegmentArray::from_fn(|_| SegmentMotion::none());
        for segment in Segment::ALL {
            SegmentMotion::follow(&mut moving, segment, &posed, rate);
        }
        let exposed = crate::aerodynamics::expose(&self.body, &posed, &self.aerodynamics);
        SampleParts {
            mass: SegmentArray::from_fn(|segment| {
                let parameters = &self.body.segments[segment];
                MovingShare::of(parameters, &posed[segment], &moving[segment])
            }),
            forms: exposed.map(|_, exposed| FormShare::of(exposed)),
            posed,
            moving,
        }
    }

    /// Changes `sample`, of which these are the `parts`, to that of a posture and a rate that differ in the joint of one
    /// segment.
    pub fn resample_joint(
        &self,
        parts: &SampleParts<T>,
        joint: Segment,
        (posture, rate): (&Posture<T>, &PostureRate<T>),
        sample: &mut PostureSample<T>,
    ) {
        if self.stream.lag != T::zero() {
            return self.sample_into(posture, rate, sample);
        }
        let (mut posed, mut moving) = (parts.posed, parts.moving);
        let mut moved = SegmentArray::from_fn(|_| false);
        let mut sum = MovingSum::none();
        for segment in Segment::ALL {
            let parent = segment.parent();
            moved[segment] = segment == joint || parent.is_some_and(|parent| moved[parent]);
            if !moved[segment] {
                sum.add(&parts.mass[segment]);
                continue;
            }
            let parameters = &self.body.segments[segment];
            let turn = posture.parent_from_segment(segment);
            posed[segment] = PosedSegment::of(parameters, parent.map(|p| &posed[p]), turn);
            SegmentMotion::follow(&mut moving, segment, &posed, rate);
            let share = MovingShare::of(parameters, &posed[segment], &moving[segment]);
            sum.add(&share);
        }
        sample.set_mass(sum.done());
        let placed = (&self.body, &posed);
        let air = &mut sample.aerodynamics;
        air.expose_moved(placed, &self.aerodynamics, &moved, &parts.forms);
    }

    /// Changes `sample`, of which these are the `parts`, from that of another model to that of this one, given the
    /// `difference` between the two.
    pub fn resample(
        &self,
        parts: &SampleParts<T>,
        difference: Difference,
        (posture, rate): (&Posture<T>, &PostureRate<T>),
        sample: &mut PostureSample<T>,
    ) {
        let Difference::Parts { mass, air } = difference else {
            if difference == Difference::All {
                self.sample_into(posture, rate, sample);
            }
            return;
        };
        if let Some(differs) = mass {
            let mut sum = MovingSum::none();
            for (segment, parameters) in self.body.segments.iter() {
                if differs[segment] {
                    let (placed, motion) = (&parts.posed[segment], &parts.moving[segment]);
                    sum.add(&MovingShare::of(parameters, placed, motion));
                } else {
                    sum.add(&parts.mass[segment]);
                }
            }
            sample.set_mass(sum.done());
        }
        if let Some(differs) = air {
            let placed = (&self.body, &parts.posed);
            let air = &mut sample.aerodynamics;
            air.expose_moved(placed, &self.aerodynamics, &differs, &parts.forms);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aerodynamics::load_model::LoadModel;
    use crate::effect::{Effect, Model};
    use crate::test_body::{any_posture, reference_body};
    use proptest::prelude::*;

    fn models() -> [Dynamics<f64>; 3] {
        let paper = Dynamics::paper(reference_body(), 1.0);
        let (mut free_fly, mut late) = (paper, paper);
        free_fly.aerodynamics.model = LoadModel::FreeFly;
        late.stream.lag = 0.02;
        [paper, free_fly, late]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn a_sample_with_another_joint_is_a_whole_sample(
            a in any_posture(),
            b in any_posture(),
            other in any_posture(),
        ) {
            for dynamics in models() {
                let rate = PostureRate::between(&a, &b, 1.0);
                let (parts, before) = (dynamics.sample_parts(&a, &rate), dynamics.sample(&a, &rate));
                for joint in Segment::ALL {
                    let turn = other.parent_from_segment(joint);
                    let (posture, mut rate) = (a.with(joint, *turn), rate);
                    rate.set_between(joint, turn, b.parent_from_segment(joint), 0.5);
                    let mut sample = before;
                    dynamics.resample_joint(&parts, joint, (&posture, &rate), &mut sample);
                    prop_assert_eq!(sample, dynamics.sample(&posture, &rate), "{:?}", joint);
                }
            }
        }

        #[test]
        fn a_sample_of_another_model_is_a_whole_sample(a in any_posture(), b in any_posture()) {
            for dynamics in models() {
                let rate = PostureRate::between(&a, &b, 1.0);
                let (parts, before) = (dynamics.sample_parts(&a, &rate), dynamics.sample(&a, &rate));
                let by_effect = Effect::ALL.iter().map(|effect| {
                    let mut values = effect.neutral();
                    for (value, parameter) in values.iter_mut().zip(effect.description().parameters) {
                        *value = 0.5 * (*value + parameter.high);
                    }
                    let mut model = Model::new(dynamics, 0.0);
                    effect.apply(&values, &mut model).expect("within its range");
                    model.dynamics
                });
                let by_segment = Segment::ALL.into_iter().flat_map(|segment| {
                    let [mut heavier, mut larger] = [dynamics; 2];
                    heavier.body.segments[segment].mass *= 1.5;
                    larger.body.segments[segment].area.y *= 1.5;
                    [heavier, larger]
                });
                for other in by_effect.chain(by_segment) {
                    let mut sample = before;
                    let difference = Difference::between(&dynamics, &other);
                    other.resample(&parts, difference, (&a, &rate), &mut sample);
                    prop_assert_eq!(sample, other.sample(&a, &rate), "{:?}", difference);
                }
            }
        }
    }
}
