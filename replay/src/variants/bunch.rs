//! Bodies side by side in one posture: their steps, and what they have in common.

use bodyflight_core::body::posture::PosedSegment;
use bodyflight_core::dynamics::residual::ResidualLoad;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::observation::Observation;
use bodyflight_core::{AxisCoefficients, Lanes, SegmentArray};
use nalgebra::{Matrix3, SimdValue, UnitQuaternion, Vector3};

use crate::comparison::Pair;
use crate::side_by_side::SideBySide;
use bodyflight_io::diagnostic::Result;

/// One of the variants.
pub(super) struct Member<'a> {
    pub(super) index: usize,
    pub(super) beside: SideBySide<'a>,
}

/// Variants side by side.
pub(super) struct Bunch<T: Lanes> {
    dynamics: Dynamics<T>,
    state: State<T>,
    inputs: Inputs<T>,
}

/// A posed body, with a sample of its masses; the aerodynamics are those of the bunch that stepped last.
pub(super) struct Posed<T: Lanes> {
    segments: SegmentArray<PosedSegment<T>>,
    sample: PostureSample<T>,
}

/// Puts members side by side, whose number must be a multiple of the lanes.
pub(super) fn bunches<T: Lanes<Element = f64>>(members: &[Member<'_>]) -> Vec<Bunch<T>> {
    members.chunks(T::LANES).filter_map(Bunch::of).collect()
}

/// The numbers of each lane side by side.
fn joined<V: SimdValue>(of: impl Fn(usize) -> V::Element) -> V {
    let mut all = V::splat(of(0));
    for lane in 1..V::LANES {
        all.replace(lane, of(lane));
    }
    all
}

fn joined_vector<T: Lanes<Element = f64>, F>(of: impl Fn(usize) -> Vector<f64, F>) -> Vector<T, F> {
    Vector::from_components(joined(|lane| of(lane).components))
}

fn joined_axes<T: Lanes<Element = f64>>(
    of: impl Fn(usize) -> AxisCoefficients<f64>,
) -> AxisCoefficients<T> {
    let axis = |axis: usize| joined(|lane| of(lane).to_array()[axis]);
    AxisCoefficients::new(axis(0), axis(1), axis(2))
}

impl<T: Lanes<Element = f64>> Bunch<T> {
    /// Puts as many members as there are lanes side by side; `None` if one has no state of its own.
    fn of(members: &[Member<'_>]) -> Option<Self> {
        let states = members.iter().map(|member| member.beside.run.state());
        let states: Vec<&State<f64>> = states.collect::<Option<_>>()?;
        let model = |lane: usize| &members[lane].beside.model.dynamics;
        let mut dynamics: Dynamics<T> = model(0).cast();
        let air = &mut dynamics.aerodynamics.coefficients;
        for (segment, all) in air.iter_mut() {
            let of = |lane: usize| &model(lane).aerodynamics.coefficients[segment];
            all.drag = joined(|lane| of(lane).drag);
            all.lift = joined(|lane| of(lane).lift);
            all.moment = joined(|lane| of(lane).moment);
        }
        for (segment, all) in dynamics.body.segments.iter_mut() {
            all.area = joined(|lane| model(lane).body.segments[segment].area);
        }
        let attitude = joined(|lane| *states[lane].inertial_from_body.quaternion());
        Some(Self {
            dynamics,
            state: State {
                inertial_from_body: Rotation::from_quaternion(attitude),
                cg_position: joined_vector(|lane| states[lane].cg_position),
                linear_momentum: joined_vector(|lane| states[lane].linear_momentum),
                angular_momentum: joined_vector(|lane| states[lane].angular_momentum),
            },
            inputs: Inputs::default(),
        })
    }

    /// Takes the inputs for the frame that begins at one time (s) and has its middle at another.
    pub(super) fn take_inputs(&mut self, members: &[Member<'_>], begin: f64, middle: f64) {
        if let Some(muscles) = members.first().and_then(|one| one.beside.muscles(begin)) {
            self.dynamics.muscles = muscles;
        }
        let all: Vec<Inputs<f64>> = members
            .iter()
            .map(|member| member.beside.inputs(middle))
            .collect();
        self.inputs = Inputs {
            muscle: joined_axes(|lane| all[lane].muscle),
            damping: joined_axes(|lane| all[lane].damping),
            residual: ResidualLoad {
                force: joined_vector(|lane| all[lane].residual.force),
                moment: joined_vector(|lane| all[lane].residual.moment),
            },
        };
    }

    /// Advances by a step of this duration (s), in which the body is posed so.
    pub(super) fn step(&mut self, posed: &mut Posed<T>, duration: f64) {
        self.dynamics
            .expose_into(&posed.segments, &mut posed.sample);
        let (state, duration) = (&self.state, T::of(duration));
        self.state = self
            .dynamics
            .step(state, &posed.sample, &self.inputs, duration);
    }

    /// Compares each motion, in the posture as posed, with what was measured at a time (s).
    pub(super) fn compare(
        &self,
        posed: &Posed<T>,
        members: &mut [Member<'_>],
        (time, measured): (f64, Observation<f64>),
        see: &mut dyn FnMut(usize, Pair),
    ) -> Result<()> {
        let all = self.state.motion(&posed.sample);
        for (lane, member) in members.iter_mut().enumerate() {
            let attitude: UnitQuaternion<f64> = all.inertial_from_body.quaternion().extract(lane);
            let motion = Motion {
                inertial_from_body: Rotation::from_quaternion(attitude),
                position: lane_of(&all.position, lane),
                velocity: lane_of(&all.velocity, lane),
                angular_velocity: lane_of(&all.angular_velocity, lane),
            };
            let simulated = member.beside.seen(&motion, time)?;
            let pair = Pair {
                time,
                measured,
                simulated,
            };
            member.beside.last.pair = pair;
            see(member.index, pair);
        }
        Ok(())
    }
}

fn lane_of<T: Lanes<Element = f64>, F>(all: &Vector<T, F>, lane: usize) -> Vector<f64, F> {
    Vector::from_components(all.components.extract(lane))
}

impl<T: Lanes<Element = f64>> Posed<T> {
    /// Nothing yet.
    pub(super) fn none() -> Self {
        let nowhere = PosedSegment {
            body_from_segment: Matrix3::zeros(),
            joint: Vector3::zeros(),
            cg: Vector3::zeros(),
        };
        Self {
            segments: SegmentArray::from_fn(|_| nowhere),
            sample: PostureSample::blank(),
        }
    }

    /// Takes one posed body, with its sample, for all lanes.
    pub(super) fn take(
        &mut self,
        segments: &SegmentArray<PosedSegment<f64>>,
        one: &PostureSample<f64>,
    ) {
        for (segment, all) in self.segments.iter_mut() {
            let one = &segments[segment];
            all.body_from_segment = Matrix3::splat(one.body_from_segment);
            all.joint = Vector3::splat(one.joint);
            all.cg = Vector3::splat(one.cg);
        }
        let sample = &mut self.sample;
        sample.mass.mass = T::splat(one.mass.mass);
        sample.mass.cg = Vector3::splat(one.mass.cg);
        sample.mass.inertia_about_origin = Matrix3::splat(one.mass.inertia_about_origin);
        sample.motion.cg_rate = Vector3::splat(one.motion.cg_rate);
        sample.motion.inertia_rate = Matrix3::splat(one.motion.inertia_rate);
        sample.motion.relative_angular_momentum =
            Vector3::splat(one.motion.relative_angular_momentum);
        sample.inertia = Matrix3::splat(one.inertia);
        sample.inverse_inertia = Matrix3::splat(one.inverse_inertia);
        sample.relative_angular_momentum = Vector3::splat(one.relative_angular_momentum);
    }
}
