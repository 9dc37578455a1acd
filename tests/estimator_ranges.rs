//! Declared ranges: their page, flights within them, and the effect of rounding to their formats.

use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::estimator::MOTION_LIMITS;
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::measurement::{MotionMeasurement, SensorMeasurement};
use bodyflight_core::estimator::motion::sensors::{Gyroscope, ReceiverVelocity, SpecificForce};
use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset};
use bodyflight_core::estimator::ranges::{
    ANGULAR_MOMENTUM, ANGULAR_VELOCITY, CENTRE, DAMPING, DAMPING_RATE, DYNAMIC_PRESSURE, FORCE,
    INERTIA, INVERSE_INERTIA, LINEAR_MOMENTUM, MOMENT, MUSCLE_INPUT, POSITION, RANGES,
    RESIDUAL_FORCE, RESIDUAL_MOMENT, Range, TABLE_HEAD, VELOCITY, quantised,
};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::wrap_angle;
use bodyflight_core::{Posture, Segment};
use bodyflight_tests::estimator_flights::{ANGLE_FLYING, FLIPS_AND_ROLLS, Flight, TURNS};
use bodyflight_tests::range_watch::RangeWatch;
use bodyflight_tests::transitions::STYLES;
use bodyflight_tests::{reference, reference_body};
use nalgebra::Vector3;

/// The expected content of the page.
fn page() -> String {
    let mut text = String::from(
        "# Ranges\n\n\
        The table lists each number in the dynamics and the filter with its declared range and the 32-bit \
        fixed-point format that holds it with one guard bit. It is generated from \
        `core/src/estimator/ranges.rs` by \
        `BODYFLIGHT_WRITE_DOCS=1 cargo test -p bodyflight-tests --test estimator_ranges`. The test fails if the \
        page is out of date, if a flight leaves a range or a random search over allowed people, densities, winds, motions \
        and inputs does, or if rounding every state to its format after every \
        step changes a prediction over 0.25 s by more than a tenth of the sensor noise.\n\n\
        What is bounded by *construction* is normalised or clamped, or follows from numbers that are; by *search*, it is \
        what the largest value found leaves room for (20,000 motions in every test run, more with \
        `BODYFLIGHT_RANGES_ROUNDS`); *time* means that it grows and nothing resets it: 8192 m hold for 80 s at the largest \
        speed, and a filter in fixed point would have to move its origin along. \
        The covariance of the motion filter is kept as factors `U D U^T` of coordinates of very different size. The rows for \
        factors, gain and transition are for coordinates divided by powers of two (2 rad, 64 m/s, 32 rad/s, 4 of muscle \
        input, 8 of damping, 1/4 m2, 1/16 m3), and contain the extremes of the search: a person of 30 kg in a storm of \
        173 m/s, measured by garbage. In flights `D` stays between 4e-8 and 100, `U` below 500, gains below 60 and innovations \
        below 100, so a fixed-point filter would have to scale by the flight, or clamp; in single precision no range is \
        reached. The tests of the filter in the unit's form with nonsense and with sensors check these ranges (`tests/range_watch.rs`).\n\n",
    );
    text.push_str(TABLE_HEAD);
    text.push('\n');
    for range in RANGES {
        text.push_str(&format!("{range}\n"));
    }
    text
}

#[test]
fn the_page_is_what_the_code_declares() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/ranges.md");
    if std::env::var_os("BODYFLIGHT_WRITE_DOCS").is_some() {
        std::fs::write(path, page()).unwrap();
    }
    assert_eq!(std::fs::read_to_string(path).unwrap(), page());
}

/// Flies a script step by step.
fn walk(
    flight: &Flight,
    mut visit: impl FnMut(usize, &Inputs<f64>, &Dynamics<f64>, &State<f64>, &PostureSample<f64>),
) {
    // Without the reference, someone of about the same size.
    let body = reference("segments.json").map_or_else(
        || Person::new(1.75, 77.0, Sex::Male).body().unwrap(),
        |table| reference_body(&table),
    );
    let record = flight.fly(&body, BACK_TRACKING);
    let dynamics = record.dynamics;
    let start = dynamics.hold(&record.postures[0]);
    let mut state = State::from_motion(&record.motions[0], &start);
    for (k, ends) in record.postures.windows(2).enumerate() {
        let sample = dynamics.between(&ends[0], &ends[1], TIME_STEP);
        let inputs = record.course.inputs((k as f64 + 0.5) * TIME_STEP);
        visit(k, &inputs, &dynamics, &state, &sample);
        state = dynamics.step(&state, &sample, &inputs, TIME_STEP);
    }
}

#[test]
fn whole_flights_stay_in_range() {
    let mut used: Vec<(Range, f64)> = Vec::new();
    let mut note = |range: &Range, values: &[f64]| {
        let largest = values.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        assert!(
            values.iter().all(|v| range.holds(*v)),
            "{}: {values:?}",
            range.name
        );
        match used.iter_mut().find(|(r, _)| r == range) {
            Some((_, top)) => *top = top.max(largest),
            None => used.push((*range, largest)),
        }
    };
    // The script of a style balances the body of the reference; another one dives faster and faster with it.
    let style = reference("segments.json").map(|_| STYLES[0].flight());
    for flight in [ANGLE_FLYING, FLIPS_AND_ROLLS, TURNS]
        .into_iter()
        .chain(style)
    {
        walk(&flight, |_, inputs, dynamics, state, sample| {
            let motion = state.motion(sample);
            let velocity = motion.velocity;
            let (loads, damping) = dynamics.loads(sample, inputs, &velocity, &Vector::zero(), 1.0);
            note(&POSITION, &state.cg_position.to_array());
            note(&VELOCITY, &velocity.to_array());
            note(&ANGULAR_VELOCITY, &motion.angular_velocity.to_array());
            note(&LINEAR_MOMENTUM, &state.linear_momentum.to_array());
            note(&ANGULAR_MOMENTUM, &state.angular_momentum.to_array());
            note(&CENTRE, sample.mass.cg.as_slice());
            note(&INERTIA, sample.inertia.as_slice());
            note(&INVERSE_INERTIA, sample.inverse_inertia.as_slice());
            note(&FORCE, loads.force.as_slice());
            note(&MOMENT, loads.moment.as_slice());
            note(&DAMPING_RATE, damping.as_slice());
            note(&DYNAMIC_PRESSURE, &[0.5 * velocity.norm_squared()]);
            note(&MUSCLE_INPUT, &inputs.muscle.to_array());
            note(&DAMPING, &inputs.damping.to_array());
        });
    }
    assert_eq!(used.len(), 14, "every flight was flown");
    for (range, top) in used {
        println!("{:24} reached {top:9.3} of {}", range.name, range.limit);
    }
}

/// Numbers from -1 to 1, half of them at the edges.
struct Edges(u64);

impl Edges {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        let between = (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        if self.0 >> 9 & 1 == 0 {
            between.signum()
        } else {
            between
        }
    }

    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (0.5 * self.next() + 0.5)
    }

    fn vector(&mut self, size: f64) -> [f64; 3] {
        [(); 3].map(|()| size * self.next())
    }

    /// A person of 1.2 to 2.3 m and 30 to 200 kg in any air; `None` if the tables have no such body.
    fn dynamics(&mut self) -> Option<Dynamics<f64>> {
        let sex = if self.next() < 0.0 {
            Sex::Female
        } else {
            Sex::Male
        };
        let person = Person::new(self.within(1.2, 2.3), self.within(30.0, 200.0), sex);
        let mut dynamics = Dynamics {
            muscles: BACK_TRACKING,
            ..Dynamics::paper(person.body().ok()?, self.within(0.1, 2.0))
        };
        dynamics.air.velocity = Vector::from_components(self.vector(100.0).into());
        Some(dynamics)
    }
}

/// Motions, inputs and winds up to everything that the link lets a unit be told and that the filter lets a state be, for
/// people of 1.2 to 2.3 m and 30 to 200 kg in any posture.
#[test]
fn nothing_that_is_allowed_leaves_a_range() {
    let rounds = std::env::var("BODYFLIGHT_RANGES_ROUNDS");
    let rounds = rounds.map_or(20_000, |rounds| rounds.parse().unwrap());
    let mut edges = Edges(7);
    let mut used: Vec<(Range, f64)> = RANGES.iter().map(|range| (*range, 0.0)).collect();
    let mut note = |range: &Range, values: &[f64]| {
        let largest = values.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        let (_, top) = used.iter_mut().find(|(r, _)| r == range).unwrap();
        *top = top.max(largest);
        assert!(
            values.iter().all(|v| range.holds(*v)),
            "{}: {values:?}",
            range.name
        );
    };
    let mut flown = 0;
    for _ in 0..rounds {
        let Some(dynamics) = edges.dynamics() else {
            continue;
        };
        flown += 1;
        let mut postures = [(); 2].map(|()| {
            Segment::ALL
                .into_iter()
                .skip(1)
                .fold(Posture::h_pose(), |posture, segment| {
                    let [psi, theta, phi] = edges.vector(3.0);
                    posture.with(segment, joint_rotation(psi, theta, phi))
                })
        });
        // A limb moves by up to 30 rad/s, faster than any.
        postures[1] = postures[0].interpolated(&postures[1], 0.04);
        let sample = dynamics.between(&postures[0], &postures[1], TIME_STEP);
        let limited = |vector: [f64; 3], limit: f32| {
            let vector = Vector3::from(vector);
            vector * (f64::from(limit) / vector.norm().max(f64::from(limit)))
        };
        let [fastest, spinning] = MOTION_LIMITS;
        let [psi, theta, phi] = edges.vector(3.0);
        let attitude = Rotation::from_quaternion(joint_rotation(psi, theta, phi));
        let motion = Motion {
            inertial_from_body: attitude,
            position: Vector::zero(),
            velocity: Vector::from_components(limited(edges.vector(100.0), fastest)),
            angular_velocity: Vector::from_components(limited(edges.vector(35.0), spinning)),
        };
        let state = State::from_motion(&motion, &sample);
        let damping = [(); 3].map(|()| edges.within(-0.5, 30.0));
        let inputs = Inputs {
            muscle: edges.vector(12.0).into(),
            damping: damping.into(),
            ..Inputs::belly_turn()
        };
        let through_air = motion.velocity - attitude.inverse() * dynamics.air.velocity;
        let spin = motion.angular_velocity;
        let density = dynamics.air.density.at(0.0);
        let (loads, damping) = dynamics.loads(&sample, &inputs, &through_air, &spin, density);
        note(&VELOCITY, &motion.velocity.to_array());
        note(&ANGULAR_VELOCITY, &motion.angular_velocity.to_array());
        note(&LINEAR_MOMENTUM, &state.linear_momentum.to_array());
        note(&ANGULAR_MOMENTUM, &state.angular_momentum.to_array());
        note(&CENTRE, sample.mass.cg.as_slice());
        note(&INERTIA, sample.inertia.as_slice());
        note(&INVERSE_INERTIA, sample.inverse_inertia.as_slice());
        let pressure = 0.5 * density * through_air.norm_squared();
        let residual = [RESIDUAL_FORCE.limit, RESIDUAL_MOMENT.limit].map(|size| size * pressure);
        note(&FORCE, &[loads.force.abs().max() + residual[0]]);
        note(&MOMENT, &[loads.moment.abs().max() + residual[1]]);
        note(&DAMPING_RATE, damping.as_slice());
        note(&DYNAMIC_PRESSURE, &[pressure]);
        note(&MUSCLE_INPUT, &inputs.muscle.to_array());
        note(&DAMPING, &inputs.damping.to_array());
    }
    assert!(flown > rounds / 4, "{flown} of {rounds} people have a body");
    for (range, top) in used {
        println!("{:24} reached {top:12.3} of {}", range.name, range.limit);
    }
}

/// The unit's filter at the edges: people, densities and winds as above, any start, and for a second measurements anywhere
/// in the range of the link or close to the truth.
#[test]
fn a_filter_stays_in_range_at_the_edges() {
    let rounds = std::env::var("BODYFLIGHT_RANGES_ROUNDS");
    let rounds = rounds.map_or(20_000, |rounds| rounds.parse().unwrap()) / 50;
    let mut edges = Edges(11);
    let mut ranges = RangeWatch::default();
    let mut flown = 0;
    for round in 0..rounds {
        let Some(dynamics) = edges.dynamics() else {
            continue;
        };
        flown += 1;
        let attitude = |edges: &mut Edges| {
            let [psi, theta, phi] = edges.vector(3.0);
            Rotation::from_quaternion(joint_rotation(psi, theta, phi))
        };
        let start = Motion {
            inertial_from_body: attitude(&mut edges),
            position: Vector::zero(),
            velocity: Vector::from_components(edges.vector(57.0).into()),
            angular_velocity: Vector::from_components(edges.vector(20.0).into()),
        };
        let mut preset = MotionPreset {
            sample_rate: [40.0, 240.0][round % 2],
            ..MOTION
        };
        if edges.next() < 0.0 {
            preset = preset.with_assumed_posture();
        }
        let posture = Posture::h_pose();
        let made = ReducedMotionFilter::<f32>::new(
            &preset,
            &dynamics.cast(),
            &start.cast(),
            &posture.cast(),
        );
        let mut filter = Box::new(made.unwrap());
        for k in 0..80 {
            let bent = joint_rotation(0.0, 0.02 * f64::from(k), 0.0);
            let posture = posture.with(Segment::RightForearm, bent);
            let mut seen = MotionMeasurement::none();
            if edges.next() < 0.5 {
                seen.inertial_from_body = Some(attitude(&mut edges));
            }
            if edges.next() < 0.5 {
                seen.velocity = Some(Vector::from_components(edges.vector(73.0).into()));
            }
            let mut sensors = SensorMeasurement::from(seen);
            sensors.gyroscope = Some(Gyroscope {
                angular_velocity: Vector::from_components(edges.vector(20.0).into()),
                deviation: edges.within(0.0, 1.0),
            });
            sensors.specific_force = Some(SpecificForce {
                force: Vector::from_components(edges.vector(255.0).into()),
                deviation: edges.within(0.0, 3.0),
                arm: Vector::zero(),
            });
            sensors.receiver = (edges.next() > 0.5).then(|| ReceiverVelocity {
                velocity: Vector::from_components(edges.vector(73.0).into()),
                horizontal_deviation: edges.within(0.0, 60.0),
                vertical_deviation: edges.within(0.0, 60.0),
                age: edges.within(0.0, 1.0),
                arm: Vector::zero(),
            });
            filter.push_recorded(&posture.cast(), &sensors.cast(), &mut ranges);
            ranges.see(&filter);
        }
    }
    assert!(flown > rounds / 4, "{flown} of {rounds} people have a body");
    println!("{}", ranges.report());
}

/// A posture sample with everything that a step reads of it rounded to its format.
fn coarse(sample: &PostureSample<f64>) -> PostureSample<f64> {
    let vector = |v: &Vector3<f64>, range: &Range| v.map(|c| range.rounded(c));
    let mut coarse = *sample;
    coarse.mass.cg = vector(&sample.mass.cg, &CENTRE);
    coarse.motion.cg_rate = vector(&sample.motion.cg_rate, &VELOCITY);
    coarse.inertia = sample.inertia.map(|c| INERTIA.rounded(c));
    coarse.inverse_inertia = sample.inverse_inertia.map(|c| INVERSE_INERTIA.rounded(c));
    coarse.relative_angular_momentum = vector(&sample.relative_angular_momentum, &ANGULAR_MOMENTUM);
    coarse
}

#[test]
fn rounding_every_state_to_its_format_does_not_show() {
    // Predictions over successive quarter seconds of flight, exact and with all states and postures rounded.
    // The script of a style balances the body of the reference; another one dives faster and faster with it.
    let style = reference("segments.json").map(|_| STYLES[0].flight());
    for flight in [ANGLE_FLYING, FLIPS_AND_ROLLS, TURNS]
        .into_iter()
        .chain(style)
    {
        let mut windows: Vec<(State<f64>, State<f64>)> = Vec::new();
        let mut worst = [0.0f64; 4];
        walk(&flight, |k, inputs, dynamics, state, sample| {
            if k % 60 == 0 {
                for (exact, rounded) in windows.drain(..) {
                    let [a, b] = [exact, rounded].map(|s| Measurement::of(&s.motion(sample)));
                    // Near a pitch of 90 degrees, heading and roll are undefined.
                    if a.pitch.abs() < 1.3 {
                        let differences = [
                            a.horizontal_speed - b.horizontal_speed,
                            wrap_angle(a.heading - b.heading),
                            wrap_angle(a.pitch - b.pitch),
                            wrap_angle(a.roll - b.roll),
                        ];
                        for (worst, difference) in worst.iter_mut().zip(differences) {
                            *worst = worst.max(difference.abs());
                        }
                    }
                }
                windows.push((*state, quantised(state)));
            }
            for (exact, rounded) in &mut windows {
                *exact = dynamics.step(exact, sample, inputs, TIME_STEP);
                *rounded = quantised(&dynamics.step(rounded, &coarse(sample), inputs, TIME_STEP));
            }
        });
        println!(
            "{}: rounding moves a prediction by {worst:?} (V_hor, heading, pitch, roll)",
            flight.name
        );
        for (worst, deviation) in worst.into_iter().zip([0.1, 0.05, 0.01, 0.01]) {
            assert!(worst < deviation / 10.0, "{}: {worst}", flight.name);
        }
    }
}
