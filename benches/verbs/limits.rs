//! What the machine can do: the least that any program takes for the same bytes and the same formulas.

use std::fmt;
use std::hint::black_box;

use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Inputs, State};
use bodyflight_core::estimator::full::Full;
use bodyflight_core::estimator::motion::MotionFilter;
use bodyflight_core::estimator::motion::measurement::MotionMeasurement;
use bodyflight_core::estimator::motion::settings::MOTION;
use bodyflight_tests::estimator_flights::ANGLE_FLYING;
use bodyflight_tests::{reference, reference_body};

use crate::cost::least;

/// Bytes that are copied, to measure memory.
const COPIED: usize = 1 << 27;

/// Costs of one processor that no verb can avoid.
pub(crate) struct Limits {
    /// Time to copy a byte from memory to memory (s).
    pub(crate) byte: f64,
    /// Time of the model's formulas for a frame: posture sample and step (s).
    pub(crate) step: f64,
    /// Time of the motion filter's formulas for a frame (s).
    pub(crate) filter: f64,
}

impl Limits {
    pub(crate) fn measured() -> Self {
        let from = vec![1_u8; COPIED];
        let mut to = vec![0_u8; COPIED];
        let copied = least(|| to.copy_from_slice(black_box(&from)));
        let table = reference("segments.json").expect("shared data");
        let record = ANGLE_FLYING.fly(&reference_body(&table), BACK_TRACKING);
        let dynamics = &record.dynamics;
        let pairs = record.postures.windows(2);
        let (first, motion) = (&record.postures[0], &record.motions[0]);
        let frames = pairs.len() as f64;
        let stepped = least(|| {
            let mut state = State::from_motion(motion, &dynamics.hold(first));
            for pair in pairs.clone() {
                let sample = dynamics.between(&pair[0], &pair[1], TIME_STEP);
                state = dynamics.step(&state, &sample, &Inputs::belly_turn(), TIME_STEP);
            }
            state
        });
        let measured = record.motions.iter().map(MotionMeasurement::of);
        let measured: Vec<MotionMeasurement<f64>> = measured.collect();
        let filtered = least(|| {
            let filter = MotionFilter::<f64, Full>::new(&MOTION, dynamics, motion, first);
            let mut filter = Box::new(filter.expect("a preset"));
            for (posture, measured) in record.postures.iter().zip(&measured).skip(1) {
                black_box(filter.push_recorded(posture, &(*measured).into(), &mut ()));
            }
        });
        Self {
            byte: copied / COPIED as f64,
            step: stepped / frames,
            filter: filtered / frames,
        }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        let model = text
            .lines()
            .find_map(|line| line.strip_prefix("model name"))
            .map_or("an unknown processor", |name| {
                name.trim_start_matches([' ', '\t', ':'])
            });
        write!(
            f,
            "Limits on this machine ({model}): memory is copied at {:.1} GB/s; of a frame, the formulas of the model take \
             {:.2} us, those of the motion filter {:.1} us.",
            1e-9 / self.byte,
            1e6 * self.step,
            1e6 * self.filter
        )
    }
}
