//! Bodies that are flown side by side have the bits that each of them has alone.

use bodyflight_core::aerodynamics::ArchFactor;
use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_core::air::{Density, Shear};
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::dynamics::residual::ResidualLoad;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::four::Four;
use bodyflight_core::frame::Vector;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::nalgebra::SimdValue;
use bodyflight_core::observation::Observation;
use bodyflight_core::{AxisCoefficients, Lanes, Posture, Segment};

/// Bodies of one maneuver, which begin at different times of it.
const BODIES: [u8; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
const SIDE_BY_SIDE: usize = 4;
const STEPS: u32 = 48;

/// One body of eight, which are at different times of a maneuver.
#[derive(Clone, Copy)]
struct Flight<T: Lanes> {
    state: State<T>,
    posture: Posture<T>,
    inputs: Inputs<T>,
}

fn joined<V: SimdValue>(ones: [V::Element; SIDE_BY_SIDE]) -> V {
    let [a, b, c, d] = ones;
    let mut four = V::splat(a);
    four.replace(1, b);
    four.replace(2, c);
    four.replace(3, d);
    four
}

fn joined_postures(ones: [Posture<f32>; SIDE_BY_SIDE]) -> Posture<Four> {
    let mut four = Posture::h_pose();
    for segment in Segment::ALL {
        four.set(
            segment,
            joined(ones.map(|one| *one.parent_from_segment(segment))),
        );
    }
    four
}

fn joined_vectors<F>(ones: [Vector<f32, F>; SIDE_BY_SIDE]) -> Vector<Four, F> {
    Vector::from_components(joined(ones.map(|one| one.components)))
}

fn joined_coefficients(ones: [AxisCoefficients<f32>; SIDE_BY_SIDE]) -> AxisCoefficients<Four> {
    let [pitch, yaw, roll] = [0, 1, 2].map(|axis| joined(ones.map(|one| one.to_array()[axis])));
    AxisCoefficients { pitch, yaw, roll }
}

fn joined_flights(ones: [Flight<f32>; SIDE_BY_SIDE]) -> Flight<Four> {
    let states = ones.map(|one| one.state);
    let attitude = states.map(|state| *state.inertial_from_body.quaternion());
    Flight {
        state: State {
            inertial_from_body: bodyflight_core::frame::Rotation::from_quaternion(joined(attitude)),
            cg_position: joined_vectors(states.map(|state| state.cg_position)),
            linear_momentum: joined_vectors(states.map(|state| state.linear_momentum)),
            angular_momentum: joined_vectors(states.map(|state| state.angular_momentum)),
        },
        posture: joined_postures(ones.map(|one| one.posture)),
        inputs: joined_inputs(ones.map(|one| one.inputs)),
    }
}

fn joined_inputs(ones: [Inputs<f32>; SIDE_BY_SIDE]) -> Inputs<Four> {
    Inputs {
        muscle: joined_coefficients(ones.map(|one| one.muscle)),
        damping: joined_coefficients(ones.map(|one| one.damping)),
        residual: ResidualLoad {
            force: joined_vectors(ones.map(|one| one.residual.force)),
            moment: joined_vectors(ones.map(|one| one.residual.moment)),
        },
    }
}

/// Flies one step and returns all that can be seen of it.
fn step<T: Lanes>(
    dynamics: &Dynamics<T>,
    flight: &mut Flight<T>,
    next: &Posture<T>,
    inputs: &Inputs<T>,
) -> Vec<T> {
    let duration = T::of(TIME_STEP);
    let sample = dynamics.between(&flight.posture, next, duration);
    flight.state = dynamics.step(&flight.state, &sample, &flight.inputs, duration);
    (flight.posture, flight.inputs) = (*next, *inputs);
    let state = &flight.state;
    let motion = state.motion(&sample);
    let seen = Observation::of(&motion);
    let mut all = vec![
        seen.angles.heading,
        seen.angles.pitch,
        seen.angles.roll,
        seen.yaw_rate,
        seen.horizontal_speed,
        seen.vertical_velocity,
    ];
    all.extend(state.inertial_from_body.wxyz());
    all.extend(state.cg_position.to_array());
    all.extend(state.linear_momentum.to_array());
    all.extend(state.angular_momentum.to_array());
    all.extend(motion.velocity.to_array());
    all.extend(sample.mass.cg.iter());
    all.extend(sample.inertia.iter());
    all.extend(sample.motion.inertia_rate.iter());
    all
}

fn begun(dynamics: &Dynamics<f32>, maneuver: &Maneuver, time: f64, lean: f32) -> Flight<f32> {
    let posture = maneuver.posture(time);
    let inertial_from_body = maneuver.start_attitude();
    let motion = Motion {
        inertial_from_body,
        position: Vector::new(10.0 * lean, 3.0, 2000.0 + 900.0 * lean),
        velocity: Vector::new(lean, -50.0 + 9.0 * lean, 4.0 * lean),
        angular_velocity: Vector::new(0.2 * lean, lean, -0.1),
    };
    Flight {
        state: State::from_motion(&motion, &dynamics.hold(&posture)),
        posture,
        inputs: maneuver.inputs(time),
    }
}

fn models(maneuver: &Maneuver) -> [Dynamics<f32>; 3] {
    let body = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
    let mut paper = Dynamics::<f64>::paper(body, 1.0);
    paper.muscles = maneuver.muscles;
    let mut free_fly = paper;
    free_fly.aerodynamics.model = LoadModel::FreeFly;
    // Everything that can be on, in a body one of whose segments has no principal axes along its own.
    let mut all = free_fly;
    all.aerodynamics.arch = ArchFactor::Scaled(0.7);
    all.air.density = Density::StandardAtmosphere {
        origin_altitude: 100.0,
    };
    all.air.velocity = Vector::new(3.0, -2.0, 20.0);
    all.air.profile = 0.01;
    all.air.shear = Some(Shear {
        per_metre: Vector::new(0.001, 0.0, 0.0),
        height: 1000.0,
    });
    all.stream.rotation = 0.8;
    all.stream.reynolds = 0.1;
    all.stream.shelter = 0.3;
    all.stream.lag = 0.02;
    let inertia = &mut all.body.segments[Segment::Head].inertia;
    (inertia.m12, inertia.m21) = (0.002, 0.002);
    [paper, free_fly, all].map(|dynamics| dynamics.cast())
}

#[test]
fn eight_bodies_in_fours_are_eight_bodies_alone_to_the_bit() {
    for maneuver in MANEUVERS {
        for (model, dynamics) in models(maneuver).iter().enumerate() {
            let together = dynamics.cast::<Four>();
            let start = |body: u8| maneuver.duration * f64::from(body) / 8.0;
            let mut alone = BODIES.map(|body| {
                let lean = 0.3 * f32::from(body) - 1.0;
                begun(dynamics, maneuver, start(body), lean)
            });
            let (first, last) = alone.split_first_chunk::<SIDE_BY_SIDE>().unwrap();
            let mut fours = [
                joined_flights(*first),
                joined_flights(*last.first_chunk().unwrap()),
            ];
            for k in 1..=STEPS {
                let time = |body: u8| start(body) + f64::from(k) * TIME_STEP;
                let next = BODIES.map(|body| maneuver.posture(time(body)));
                let mut inputs = BODIES.map(|body| maneuver.inputs(time(body)));
                if model == 2 {
                    inputs[1].residual.force = Vector::new(0.01, 0.02, -0.01);
                }
                let alone: [Vec<f32>; 8] = std::array::from_fn(|body| {
                    step(dynamics, &mut alone[body], &next[body], &inputs[body])
                });
                for (half, four) in fours.iter_mut().enumerate() {
                    let part = |lane: usize| half * SIDE_BY_SIDE + lane;
                    let lanes: [usize; SIDE_BY_SIDE] = std::array::from_fn(part);
                    let postures = joined_postures(lanes.map(|body| next[body]));
                    let inputs = joined_inputs(lanes.map(|body| inputs[body]));
                    let seen = step(&together, four, &postures, &inputs);
                    for (lane, body) in lanes.into_iter().enumerate() {
                        let found: Vec<f32> = seen.iter().map(|four| four.extract(lane)).collect();
                        assert_eq!(
                            found.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
                            alone[body].iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
                            "{}, model {model}, step {k}, body {body}: {found:?} {:?}",
                            maneuver.name,
                            alone[body]
                        );
                    }
                }
            }
        }
    }
}
