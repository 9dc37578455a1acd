//! The estimator against synthetic flights.

use bodyflight_core::Real;
use bodyflight_core::body::posture::Posture;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::estimator::measurement::Measurement;
use bodyflight_core::estimator::preset::Preset;
use bodyflight_core::estimator::propagation::Propagation;
use bodyflight_core::estimator::status::Estimate;
use bodyflight_core::estimator::{Estimator, PaperFilter, ReducedFilter};
use bodyflight_core::math::wrap_angle;
use bodyflight_tests::estimator_flights::{ANGLE_FLYING, Record, TRANSITIONS, TURNS};
use bodyflight_tests::{reference, reference_body};

/// Root mean squares of reconstructed less flown.
#[derive(Debug, Clone, Copy, Default)]
struct Misfit {
    horizontal_speed: f64,
    heading: f64,
    pitch: f64,
    roll: f64,
    yaw_rate: f64,
    angular_velocity: f64,
    count: f64,
}

impl Misfit {
    fn add(&mut self, seen: &Measurement<f64>, flown: &Measurement<f64>, spin: f64) {
        let square = |x: f64| x * x;
        self.horizontal_speed += square(seen.horizontal_speed - flown.horizontal_speed);
        self.heading += square(wrap_angle(seen.heading - flown.heading));
        self.pitch += square(wrap_angle(seen.pitch - flown.pitch));
        self.roll += square(wrap_angle(seen.roll - flown.roll));
        self.yaw_rate += square(seen.yaw_rate - flown.yaw_rate);
        self.angular_velocity += square(spin);
        self.count += 1.0;
    }
    fn rms(self) -> Self {
        let mean = |x: f64| (x / self.count).sqrt();
        Self {
            horizontal_speed: mean(self.horizontal_speed),
            heading: mean(self.heading),
            pitch: mean(self.pitch),
            roll: mean(self.roll),
            yaw_rate: mean(self.yaw_rate),
            angular_velocity: mean(self.angular_velocity),
            count: self.count,
        }
    }
}

fn estimate<T: Real, P: Propagation<T>, const N: usize>(
    record: &Record,
    preset: &Preset,
    seed: u64,
    mut visit: impl FnMut(&Estimate<T>),
) -> Misfit {
    let dynamics: Dynamics<T> = Dynamics {
        muscles: preset.muscles,
        ..record.dynamics
    }
    .cast();
    let (posture, motion) = (record.postures[0].cast(), record.motions[0].cast());
    let mut estimator =
        Box::new(Estimator::<T, P, N>::new(preset, &dynamics, &motion, &posture).unwrap());
    let mut misfit = Misfit::default();
    let measured = record.measured(seed);
    for (posture, measured) in record.postures.iter().zip(&measured).skip(1) {
        let posture: Posture<T> = posture.cast();
        let Some(estimate) = estimator.push(&dynamics, &posture, &measured.cast()) else {
            continue;
        };
        visit(&estimate);
        let flown = &record.motions[estimate.solved_sample as usize];
        let spin = estimate.motion.angular_velocity.cast::<f64>().components
            - flown.angular_velocity.components;
        misfit.add(
            &estimate.reconstructed.cast(),
            &Measurement::of(flown),
            spin.norm() / 3f64.sqrt(),
        );
    }
    misfit.rms()
}

/// The same flight with the paper's constant coefficients of belly turns.
fn constant(record: &Record) -> Misfit {
    let inputs = Inputs::belly_turn();
    let d = &record.dynamics;
    let mut state = State::from_motion(&record.motions[0], &d.hold(&record.postures[0]));
    let mut misfit = Misfit::default();
    for (ends, flown) in record
        .postures
        .windows(2)
        .zip(record.motions.iter().skip(1))
    {
        let sample = d.between(&ends[0], &ends[1], TIME_STEP);
        state = d.step(&state, &sample, &inputs, TIME_STEP);
        let motion = state.motion(&sample);
        let spin = motion.angular_velocity.components - flown.angular_velocity.components;
        misfit.add(
            &Measurement::of(&motion),
            &Measurement::of(flown),
            spin.norm() / 3f64.sqrt(),
        );
    }
    misfit.rms()
}

#[test]
fn look() {
    let body = reference_body(&reference("segments.json").unwrap());
    for (flight, preset) in [
        (ANGLE_FLYING, "tracking"),
        (TRANSITIONS, "transitions"),
        (TRANSITIONS, "transitions-negative-damping"),
        (TURNS, "turning"),
    ] {
        let preset = Preset::from_name(preset).unwrap();
        let r = flight.fly(&body, BACK_TRACKING);
        println!("== {} {}", flight.name, preset.name);
        let mut top = 0.0f64;
        let mut at = 0;
        for (k, m) in r.motions.iter().enumerate() {
            let w = m.angular_velocity.components.norm();
            if w > top {
                top = w;
                at = k;
            }
        }
        println!("top spin {top:.2} at {:.2}", at as f64 / 240.0);
        let line = |name: &str, m: Misfit| {
            println!(
                "{name:10} vh {:.3} heading {:.3} pitch {:.3} roll {:.3} yawrate {:.3} spin {:.3}",
                m.horizontal_speed, m.heading, m.pitch, m.roll, m.yaw_rate, m.angular_velocity
            )
        };
        line("constant", constant(&r));
        let mut nis = 0.0;
        let t = std::time::Instant::now();
        line(
            "paper",
            estimate::<f64, bodyflight_core::estimator::full::Full, 60>(
                &r,
                preset,
                1,
                |e: &Estimate<f64>| nis = e.mean_normalised_innovation,
            ),
        );
        let t1 = t.elapsed();
        let t = std::time::Instant::now();
        line(
            "paper32",
            estimate::<f32, bodyflight_core::estimator::full::Full, 60>(
                &r,
                preset,
                1,
                |_: &Estimate<f32>| (),
            ),
        );
        println!("time {:?} {:?} nis {nis}", t1, t.elapsed());
        let t = std::time::Instant::now();
        line(
            "reduced",
            estimate::<f64, bodyflight_core::estimator::reduced::Reduced, 30>(
                &r,
                preset,
                1,
                |_| (),
            ),
        );
        line(
            "reduced32",
            estimate::<f32, bodyflight_core::estimator::reduced::Reduced, 30>(
                &r,
                preset,
                1,
                |_| (),
            ),
        );
        println!("time {:?}", t.elapsed());
    }
    let _ = (
        core::mem::size_of::<PaperFilter<f32>>(),
        core::mem::size_of::<ReducedFilter<f32>>(),
    );
    println!(
        "{:?}",
        (
            core::mem::size_of::<PaperFilter<f32>>(),
            core::mem::size_of::<ReducedFilter<f32>>()
        )
    );
}
#[test]
fn trace_errors() {
    let body = reference_body(&reference("segments.json").unwrap());
    let preset = Preset::from_name("tracking").unwrap();
    let r = ANGLE_FLYING.fly(&body, BACK_TRACKING);
    let mut n = 0;
    estimate::<f64, bodyflight_core::estimator::full::Full, 60>(&r, preset, 1, |e| {
        n += 1;
        if n % 8 != 0 {
            return;
        }
        let f = &r.motions[e.solved_sample as usize];
        let m = Measurement::of(f);
        let i = ANGLE_FLYING.inputs(f64::from(e.sample) / 240.0);
        println!(
            "{:6.2} w {:5.1}/{:5.1} pitch {:5.2}/{:5.2} roll {:5.2}/{:5.2} hd {:5.2}/{:5.2} vh {:5.1}/{:5.1} x {:.2} {:.2} {:.2} {:.1} {:.1} {:.1} true {:.1} {:.1} {:.1} {:.1} {:.1} {:.1} nis {:.0} {:?}",
            f64::from(e.solved_sample) / 240.0,
            e.motion.angular_velocity.components.norm(),
            f.angular_velocity.components.norm(),
            e.reconstructed.pitch,
            m.pitch,
            e.reconstructed.roll,
            m.roll,
            e.reconstructed.heading,
            m.heading,
            e.reconstructed.horizontal_speed,
            m.horizontal_speed,
            e.state[0],
            e.state[1],
            e.state[2],
            e.state[3],
            e.state[4],
            e.state[5],
            i.muscle.yaw,
            i.muscle.pitch,
            i.muscle.roll,
            i.damping.y,
            i.damping.x,
            i.damping.z,
            e.normalised_innovation,
            e.health
        );
    });
}
#[test]
fn sweep() {
    use bodyflight_core::estimator::{full::Full, reduced::Reduced};
    let body = reference_body(&reference("segments.json").unwrap());
    for (base, name) in [(ANGLE_FLYING, "tracking"), (TRANSITIONS, "transitions")] {
        for (muscle, keep, arm) in [
            (3.0, 8.0, 0.6),
            (2.5, 5.0, 0.6),
            (2.0, 2.0, 0.6),
            (2.5, 5.0, 1.2),
            (4.0, 12.0, 0.6),
        ] {
            for sway in [0.0, 0.03] {
                for pitch in [0.4, 0.8] {
                    if name == "transitions" && pitch > 0.5 {
                        continue;
                    }
                    let mut flight = base;
                    let pulses: Vec<_> = flight
                        .pulses
                        .iter()
                        .map(|p| {
                            let mut p = *p;
                            if p.muscle[2] > 0.6 {
                                p.muscle[2] = muscle;
                                p.damping[2] = keep - base.damping[2];
                                p.joints = p.joints.map(|(j, _)| (j, arm));
                                p.during[1] = p.during[0] + 1.6;
                            }
                            p
                        })
                        .collect();
                    flight.pulses = Box::leak(pulses.into_boxed_slice());
                    flight.sway = sway;
                    if name == "tracking" {
                        flight.muscle = [0.0, pitch, 0.0];
                    }
                    let r = flight.fly(&body, BACK_TRACKING);
                    let mut top = 0.0f64;
                    for m in &r.motions {
                        top = top.max(m.angular_velocity.components.norm());
                    }
                    print!(
                        "{} muscle {muscle} keep {keep} arm {arm} sway {sway} pitch {pitch} top {top:5.1}:",
                        base.name
                    );
                    for p in flight.pulses {
                        let k = ((p.during[1] + 0.7) * 240.0) as usize;
                        if k < r.motions.len() {
                            let m = Measurement::of(&r.motions[k]);
                            print!(" {:.1}", m.roll);
                        }
                    }
                    println!();
                    let preset = Preset::from_name(name).unwrap();
                    let line = |name: &str, m: Misfit| {
                        println!(
                            "{name:10} vh {:.3} heading {:.3} pitch {:.3} roll {:.3} yawrate {:.3} spin {:.3}",
                            m.horizontal_speed,
                            m.heading,
                            m.pitch,
                            m.roll,
                            m.yaw_rate,
                            m.angular_velocity
                        )
                    };
                    line("full", estimate::<f64, Full, 60>(&r, preset, 1, |_| ()));
                    line("redu", estimate::<f64, Reduced, 30>(&r, preset, 1, |_| ()));
                }
            }
        }
    }
}
