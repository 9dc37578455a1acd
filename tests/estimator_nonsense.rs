//! Nonsense that is legal on the line, in the unit's precision and steps: garbage, outages, jumps, stuck sensors, wild
//! restarts. The flights are the same model's, with a moving posture and inputs that the filter does not know.
//!
//! `BODYFLIGHT_RANDOM_MINUTES=N` flies N random minutes instead of 30, and `BODYFLIGHT_RANDOM_FIRST=K` begins with minute K.
//! Each finding is printed with its minute.

use bodyflight_core::body::Segment;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::trim::{trim, with_knees};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::estimator::motion::ReducedMotionFilter;
use bodyflight_core::estimator::motion::estimate::MotionEstimate;
use bodyflight_core::estimator::motion::measurement::MotionMeasurement;
use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset};
use bodyflight_core::estimator::motion::state::{ATTITUDE, MUSCLE, SPIN, STATES, VELOCITY};
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::frame::{Body, Inertial, Rotation, Vector, facing_north};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Lanes, Posture};
use bodyflight_tests::estimator_flights::Noise;
use bodyflight_tests::range_watch::RangeWatch;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// What happens to the measurements of a stretch; bits select attitude, angular velocity and velocity.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Event {
    Clean,
    Garbage(u32),
    Missing(u32),
    Jump(u32),
    Stuck(u32),
    Noise,
    NotFinite,
    Restart,
}

/// Counts over the minutes flown.
#[derive(Debug, Default)]
struct Counts {
    not_finite: u32,
    indefinite: u32,
    subnormal: u32,
    events: u32,
    /// Clean stretches in which the filter was not consistent after two seconds.
    late: u32,
    /// Times at which it was consistent for half a second with an error above five of its deviations.
    confident_and_wrong: u32,
}

impl Counts {
    /// Checks the numbers of an estimate and of the filter.
    fn see(&mut self, estimate: &MotionEstimate<f32>, filter: &ReducedMotionFilter<f32>) {
        self.not_finite += u32::from(
            !estimate.deviation.iter().all(|d| d.is_finite()) || !filter.state().is_finite(),
        );
        let factors = filter.factors().elements();
        self.indefinite +=
            u32::from(!(0..STATES).all(|j| factors[(j, j)] > 0.0 && factors[(j, j)].is_finite()));
        self.subnormal += u32::from(
            factors
                .iter()
                .chain(&filter.activity())
                .any(|v| v.is_subnormal()),
        );
    }
}

/// Random numbers of a flight.
struct Random(Noise);

impl Random {
    /// Uniform between two numbers, from the normal distribution's angle.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        let [x, y] = [self.0.normal(1.0), self.0.normal(1.0)];
        let turn = y.atan2(x) / std::f64::consts::TAU + 0.5;
        low + (high - low) * turn
    }

    fn below(&mut self, count: u32) -> u32 {
        (self.between(0.0, 1.0) * f64::from(count)) as u32 % count
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.0.normal(size))
    }

    fn cube<F>(&mut self, half: f64) -> Vector<f64, F> {
        Vector::from_components(Vector3::from_fn(|_, _| self.between(-half, half)))
    }

    fn attitude(&mut self) -> Rotation<f64, Inertial, Body> {
        let [w, x, y, z] = [(); 4].map(|()| self.0.normal(1.0));
        Rotation::from_quaternion(UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
    }

    fn event(&mut self) -> Event {
        let which = 1 + self.below(7);
        match self.below(8) {
            0 | 1 => Event::Garbage(which),
            2 => Event::Missing(which),
            3 => Event::Jump(which),
            4 => Event::Stuck(which),
            5 => Event::Noise,
            6 => Event::NotFinite,
            _ => Event::Restart,
        }
    }

    /// A motion measured with the paper's noise.
    fn measured(&mut self, motion: &Motion<f64>) -> MotionMeasurement<f64> {
        let tilt = small_rotation(&self.vector(0.01));
        let mut seen = MotionMeasurement::of(motion);
        seen.inertial_from_body = Some(Rotation::from_quaternion(
            motion.inertial_from_body.quaternion() * tilt,
        ));
        let spin = Vector::from_components(self.vector(0.03));
        seen.angular_velocity = seen.angular_velocity.map(|v| v + spin);
        let sizes = Vector3::new(0.1, 0.1, 1.0);
        let velocity = Vector::from_components(self.vector(1.0).component_mul(&sizes));
        seen.velocity = seen.velocity.map(|v| v + velocity);
        seen
    }
}

/// What an event changes in all of its measurements.
struct Change {
    event: Event,
    jump: MotionMeasurement<f64>,
    turn: UnitQuaternion<f64>,
    held: Option<MotionMeasurement<f64>>,
}

impl Change {
    fn new(event: Event, random: &mut Random) -> Self {
        Self {
            event,
            jump: MotionMeasurement {
                inertial_from_body: None,
                angular_velocity: Some(Vector::from_components(random.vector(3.0))),
                velocity: Some(Vector::from_components(random.vector(15.0))),
                horizontal_speed: None,
            },
            turn: UnitQuaternion::from_scaled_axis(random.vector(0.8)),
            held: None,
        }
    }

    fn apply(&mut self, seen: &mut MotionMeasurement<f64>, random: &mut Random) {
        let wild = MotionMeasurement {
            inertial_from_body: Some(random.attitude()),
            angular_velocity: Some(random.cube(32.0)),
            velocity: Some(random.cube(128.0)),
            horizontal_speed: None,
        };
        let turn = self.turn;
        let (with, which) = match self.event {
            Event::Garbage(which) => (wild, which),
            Event::Missing(which) => (MotionMeasurement::none(), which),
            Event::Stuck(which) => (*self.held.get_or_insert(*seen), which),
            Event::Jump(which) => (
                MotionMeasurement {
                    inertial_from_body: seen
                        .inertial_from_body
                        .map(|q| Rotation::from_quaternion(q.quaternion() * turn)),
                    angular_velocity: seen
                        .angular_velocity
                        .zip(self.jump.angular_velocity)
                        .map(|(a, b)| a + b),
                    velocity: seen.velocity.zip(self.jump.velocity).map(|(a, b)| a + b),
                    horizontal_speed: None,
                },
                which,
            ),
            Event::Noise => {
                let (spin, velocity) = (random.vector(3.0), random.vector(20.0));
                seen.angular_velocity = seen
                    .angular_velocity
                    .map(|v| v + Vector::from_components(spin));
                seen.velocity = seen.velocity.map(|v| v + Vector::from_components(velocity));
                return;
            }
            Event::NotFinite if random.below(2) == 0 => (
                MotionMeasurement {
                    inertial_from_body: seen.inertial_from_body,
                    angular_velocity: Some(Vector::new(f64::INFINITY, 0.0, 0.0)),
                    velocity: Some(Vector::new(f64::NAN, 1e30, 0.0)),
                    horizontal_speed: Some(f64::NAN),
                },
                7,
            ),
            Event::Clean | Event::Restart | Event::NotFinite => return,
        };
        if which & 1 != 0 {
            seen.inertial_from_body = with.inertial_from_body;
        }
        if which & 2 != 0 {
            seen.angular_velocity = with.angular_velocity;
        }
        if which & 4 != 0 {
            seen.velocity = with.velocity;
            seen.horizontal_speed = with.horizontal_speed;
        }
    }
}

/// Largest error of the motion and of the muscle input, in stated deviations, and the coordinate that has it.
fn error(
    estimate: &MotionEstimate<f32>,
    motion: &Motion<f64>,
    inputs: &Inputs<f64>,
) -> (f64, usize) {
    let found: Motion<f64> = estimate.motion.cast();
    let turn =
        motion.inertial_from_body.quaternion().inverse() * found.inertial_from_body.quaternion();
    let velocity = found.velocity_inertial() - motion.velocity_inertial();
    let spin = found.angular_velocity - motion.angular_velocity;
    let muscle = estimate.inputs.muscle.cast::<f64>().to_vector() - inputs.muscle.to_vector();
    let groups = [
        (ATTITUDE, turn.scaled_axis()),
        (VELOCITY, velocity.components),
        (SPIN, spin.components),
        (MUSCLE, muscle),
    ];
    let ratio = |first: usize, gap: Vector3<f64>| {
        (first..first + 3)
            .map(move |k| (gap[k - first].abs() / f64::from(estimate.deviation[k]), k))
    };
    let all = groups
        .into_iter()
        .flat_map(|(first, gap)| ratio(first, gap));
    all.fold(
        (0.0, 0),
        |most, one| if one.0 > most.0 { one } else { most },
    )
}

/// What keeps an estimate from being consistent: channels with mean square, correlation and share of rejections, the
/// residual load, the time without measurements, a sensor that jumped, and the rate.
fn why(estimate: &MotionEstimate<f32>) -> String {
    let watch = &estimate.watch;
    let channels = watch.channels.iter().enumerate();
    let channels = channels.filter(|(_, c)| c.seen && c.consistency() != Consistency::Consistent);
    let mut text: String = channels
        .map(|(k, c)| {
            let [square, correlation, rejected] = [c.mean_square, c.correlation, c.rejected];
            format!("channel {k}: {square:.2} {correlation:.2} {rejected:.3}, ")
        })
        .collect();
    let deviations = estimate.deviation.fixed_rows::<9>(0).into_owned();
    text.push_str(&format!(
        "residual {:.1}, unseen {:.1?}, suspect {}, pace {:?}, deviations {:.2?}",
        watch.residual,
        watch.unseen,
        watch.suspect,
        watch.pace,
        deviations.as_slice()
    ));
    text
}

/// Flies a random minute.
fn minute(seed: u64, counts: &mut Counts, ranges: &mut RangeWatch) {
    let mut random = Random(Noise::new(seed));
    let body = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
    let dynamics = Dynamics {
        muscles: BACK_TRACKING,
        ..Dynamics::paper(body, 1.0)
    };
    let fall = trim(&dynamics, &pattern::neutral(), 0.0).unwrap();
    let attitude = facing_north(fall.body_pitch);
    let start = Motion {
        inertial_from_body: attitude,
        position: Vector::zero(),
        velocity: attitude.inverse() * Vector::new(0.0, 0.0, -fall.terminal_speed),
        angular_velocity: Vector::zero(),
    };
    let rate = [60.0, 100.0, 120.0, 240.0][random.below(4) as usize];
    let base = with_knees(&pattern::neutral(), fall.knee);
    let (swing, slow) = (random.between(0.0, 0.3), random.between(0.3, 1.5));
    let posture_at = |time: f64| -> Posture<f64> {
        let bend = -1.4 + swing * (slow * time).sin();
        base.with(Segment::RightForearm, joint_rotation(0.0, bend, 0.0))
    };
    let sizes = [0.6, 0.8, 0.4].map(|most| random.between(0.0, most));
    let turns = [(); 3].map(|()| random.between(0.2, 1.5));
    let preset = MotionPreset {
        sample_rate: f32::of(rate),
        ..MOTION
    };
    let mut from = posture_at(0.0);
    let made =
        ReducedMotionFilter::<f32>::new(&preset, &dynamics.cast(), &start.cast(), &from.cast());
    let mut filter = Box::new(made.unwrap());
    let mut state = State::from_motion(&start, &dynamics.hold(&from));
    let mut change = Change::new(Event::Clean, &mut random);
    let (mut until, mut wrong) = (random.between(3.0, 6.0), 0.0);
    let mut last = (0.0, Event::Clean);
    let mut waiting: Option<f64> = None;
    for k in 1..=(60.0 * rate) as u32 {
        let time = f64::from(k) / rate;
        let to = posture_at(time);
        let mut inputs = Inputs::belly_turn();
        let muscle: [f64; 3] =
            core::array::from_fn(|axis| sizes[axis] * (turns[axis] * time).sin());
        inputs.muscle = muscle.into();
        let sample = dynamics.between(&from, &to, 1.0 / rate);
        state = dynamics.step(&state, &sample, &inputs, 1.0 / rate);
        state.cg_position = Vector::zero();
        from = to;
        let motion = state.motion(&sample);
        if time > until {
            let clean = change.event == Event::Clean;
            let next = if clean { random.event() } else { Event::Clean };
            if !clean {
                last = (time, change.event);
            }
            change = Change::new(next, &mut random);
            until = time
                + if clean {
                    random.between(0.05, 12.0)
                } else {
                    random.between(3.0, 8.0)
                };
            waiting = (!clean).then_some(time);
            if next == Event::Restart {
                let wild = Motion {
                    inertial_from_body: random.attitude(),
                    position: Vector::zero(),
                    velocity: random.cube(60.0),
                    angular_velocity: random.cube(8.0),
                };
                let restarted = if random.below(2) == 0 { wild } else { motion };
                filter.restart(&restarted.cast(), &from.cast()).unwrap();
                until = time;
            }
        }
        let mut seen = random.measured(&motion);
        change.apply(&mut seen, &mut random);
        let pushed = filter.push_recorded(&to.cast(), &seen.cast().into(), ranges);
        ranges.see(&filter);
        let Some(estimate) = pushed else {
            continue;
        };
        counts.see(&estimate, &filter);
        let consistent = estimate.consistency == Consistency::Consistent;
        let before = wrong;
        let (ratio, coordinate) = error(&estimate, &motion, &inputs);
        wrong = if consistent && ratio > 5.0 {
            wrong + 4.0 / rate
        } else {
            0.0
        };
        if wrong > 0.5 && before <= 0.5 {
            counts.confident_and_wrong += 1;
            println!(
                "minute {seed}, {time:.2} s, {rate} Hz: {ratio:.1} deviations in {coordinate} during {:?}; {last:?}",
                change.event
            );
        }
        if let Some(since) = waiting
            && (consistent || time - since > 2.0)
        {
            counts.events += 1;
            if !consistent {
                counts.late += 1;
                println!(
                    "minute {seed}, {time:.2} s, {rate} Hz: late after {last:?}: {}",
                    why(&estimate)
                );
            }
            waiting = None;
        }
    }
}

#[test]
fn random_minutes_leave_the_filter_definite_and_it_comes_back() {
    let asked = |name, otherwise| {
        let asked = std::env::var(name).ok();
        asked.map_or(otherwise, |number| number.parse().unwrap())
    };
    let minutes = asked("BODYFLIGHT_RANDOM_MINUTES", 30);
    let first = asked("BODYFLIGHT_RANDOM_FIRST", 0);
    let mut counts = Counts::default();
    let mut ranges = RangeWatch::default();
    for seed in first..first + minutes {
        minute(seed, &mut counts, &mut ranges);
    }
    println!("{minutes} minutes: {counts:?}\n{}", ranges.report());
    assert_eq!(
        [counts.not_finite, counts.indefinite, counts.subnormal],
        [0; 3]
    );
    // Aims: none late, and never confident and wrong; the minutes of every test run reach them. What many more reach is on
    // the page of the estimator.
    let allowed = 0.005 * f64::from(counts.events) * f64::from(u8::from(minutes > 100));
    assert!(f64::from(counts.late) <= allowed, "{counts:?}");
    assert!(
        f64::from(counts.confident_and_wrong) <= allowed,
        "{counts:?}"
    );
}
