//! Which samples of a flight carry a measured velocity.
//!
//! A suit has one in every sample. A receiver measures a few times a second; velocities between its solutions are
//! interpolated, so their errors are not independent, and where the body accelerates they are wrong. Each solution therefore
//! counts once, at its own time, and with the accuracy that the receiver states. A receiver filters its solutions, and what
//! disturbs its signals lasts, so those within a second count as one. Sensors on the limbs alone measure none.

use bodyflight_core::effect::sensors::Sensors;
use bodyflight_core::estimator::motion::measurement::{MotionMeasurement, SensorMeasurement};
use bodyflight_core::estimator::motion::sensors::{ReceiverVelocity, VERTICAL_RATIO};
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::frame::Vector;
use bodyflight_replay::gnss::Solution;

/// Time within which a receiver's errors are taken to be the same (s).
const LASTS: f64 = 1.0;

/// Where the velocities of a flight come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Velocities {
    /// Each sample has its own.
    Sampled,
    /// A receiver's solutions in order of time, each with the index of the first sample that is not earlier.
    Solved(Vec<(usize, ReceiverVelocity<f64>)>),
    /// No sample has one: those of the samples are assumed.
    Assumed,
}

impl Velocities {
    /// Those of a receiver, if there is one, for samples in order of time.
    pub fn of(solutions: Option<&[Solution]>, samples: &[FlightSample]) -> Self {
        let Some(solutions) = solutions else {
            return Self::Sampled;
        };
        let pairs = solutions.array_windows();
        let interval = bodyflight_falls::median(pairs.map(|[a, b]| b.time - a.time));
        let alike = interval
            .map_or(1.0, |interval| (LASTS / interval).max(1.0))
            .sqrt();
        let carried = solutions.iter().filter_map(|solution| {
            let index = samples.partition_point(|sample| sample.time < solution.time);
            let age = samples.get(index)?.time - solution.time;
            let deviation = solution.accuracy * alike;
            // What was measured before the flight begins belongs to another motion.
            (index > 0).then_some((
                index,
                ReceiverVelocity {
                    velocity: solution.velocity,
                    horizontal_deviation: deviation,
                    vertical_deviation: deviation * f64::from(VERTICAL_RATIO),
                    age,
                    arm: Vector::zero(),
                },
            ))
        });
        Self::Solved(carried.collect())
    }

    /// Whether each sample has its own. Only then the forces are seen, and with them whether joint errors are constant, as the
    /// solution for a whole flight takes them to be.
    pub fn are_sampled(&self) -> bool {
        matches!(self, Self::Sampled)
    }

    /// Whether none is measured.
    pub fn are_assumed(&self) -> bool {
        matches!(self, Self::Assumed)
    }

    /// Corrects for known sensor errors.
    pub fn correct(&mut self, sensors: &Sensors<f64>) {
        if let Self::Solved(solutions) = self {
            for (_, solution) in solutions {
                solution.velocity -= sensors.velocity_offset;
                solution.age += sensors.velocity_latency;
            }
        }
    }

    /// Standard deviations of a receiver's velocities most of the time (m/s): horizontal and vertical. `None` without one.
    pub fn deviations(&self) -> Option<[f64; 2]> {
        let Self::Solved(solutions) = self else {
            return None;
        };
        let usual = |of: fn(&ReceiverVelocity<f64>) -> f64| {
            bodyflight_falls::median(solutions.iter().map(|(_, solution)| of(solution)))
        };
        Some([
            usual(|solution| solution.horizontal_deviation)?,
            usual(|solution| solution.vertical_deviation)?,
        ])
    }

    /// What is measured at the sample `index`.
    pub fn measured(&self, samples: &[FlightSample], index: usize) -> SensorMeasurement<f64> {
        let Some(sample) = samples.get(index) else {
            return SensorMeasurement::none();
        };
        let motion = MotionMeasurement::of(&sample.motion);
        let solutions = match self {
            Self::Sampled => return motion.into(),
            Self::Solved(solutions) => solutions.as_slice(),
            Self::Assumed => &[],
        };
        // Of several since the last sample, the latest.
        let until = solutions.partition_point(|(carrier, _)| *carrier <= index);
        let last = until.checked_sub(1).and_then(|place| solutions.get(place));
        SensorMeasurement {
            receiver: last.and_then(|(carrier, solution)| (*carrier == index).then_some(*solution)),
            ..MotionMeasurement {
                velocity: None,
                ..motion
            }
            .into()
        }
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::dynamics::Motion;
    use bodyflight_core::frame::Rotation;

    use super::*;

    fn samples() -> Vec<FlightSample> {
        let sample = |k: u32| FlightSample {
            time: f64::from(k) / 100.0,
            posture: Posture::h_pose(),
            motion: Motion {
                inertial_from_body: Rotation::identity(),
                position: Vector::zero(),
                velocity: Vector::new(0.0, -50.0, 0.0),
                angular_velocity: Vector::zero(),
            },
        };
        (0..200).map(sample).collect()
    }

    #[test]
    fn a_solution_counts_once_and_at_its_own_time() {
        let samples = samples();
        let solution = |k: u32| Solution {
            time: 0.2 * f64::from(k) - 0.037,
            velocity: Vector::new(f64::from(k), 0.0, -50.0),
            accuracy: 0.3,
        };
        let solutions: Vec<Solution> = (0..12).map(solution).collect();
        let velocities = Velocities::of(Some(&solutions), &samples);
        let taken = (0..samples.len()).filter_map(|index| {
            let measured = velocities.measured(&samples, index);
            assert!(measured.motion.velocity.is_none());
            assert!(measured.motion.inertial_from_body.is_some());
            Some((samples[index].time, measured.receiver?))
        });
        let taken: Vec<(f64, ReceiverVelocity<f64>)> = taken.collect();
        // The first solution is from before the flight, the last from after it.
        assert_eq!(taken.len(), solutions.len() - 2);
        for ((time, taken), expected) in taken.into_iter().zip(&solutions[1..]) {
            assert!((time - taken.age - expected.time).abs() < 1e-9, "{time}");
            assert!((0.0..0.01).contains(&taken.age), "{taken:?}");
            assert_eq!(taken.velocity, expected.velocity);
        }
        // Five in a second tell as much as one does.
        let [horizontal, vertical] = velocities.deviations().unwrap();
        assert!(
            (horizontal - 0.3 * 5f64.sqrt()).abs() < 1e-6,
            "{horizontal}"
        );
        assert!((vertical - 1.5 * horizontal).abs() < 1e-6, "{vertical}");
    }

    #[test]
    fn a_suit_measures_its_velocity_in_every_sample() {
        let samples = samples();
        let velocities = Velocities::of(None, &samples);
        let measured = velocities.measured(&samples, 7);
        assert_eq!(measured, MotionMeasurement::of(&samples[7].motion).into());
        assert_eq!(velocities.deviations(), None);
    }

    #[test]
    fn a_velocity_that_is_assumed_is_no_measurement() {
        let samples = samples();
        let measured = Velocities::Assumed.measured(&samples, 7);
        assert!(measured.motion.velocity.is_none() && measured.receiver.is_none());
        assert!(measured.motion.angular_velocity.is_some());
        assert_eq!(Velocities::Assumed.deviations(), None);
    }

    #[test]
    fn a_late_receiver_is_corrected() {
        let samples = samples();
        let solution = Solution {
            time: 1.0,
            velocity: Vector::new(3.0, 0.0, -50.0),
            accuracy: 0.3,
        };
        let mut velocities = Velocities::of(Some(&[solution]), &samples);
        velocities.correct(&Sensors {
            velocity_latency: 0.2,
            velocity_offset: Vector::new(1.0, 0.0, 0.0),
            ..Sensors::perfect()
        });
        let receiver = velocities.measured(&samples, 100).receiver.unwrap();
        assert!((receiver.age - 0.2).abs() < 1e-9);
        assert!((receiver.velocity.components.x - 2.0).abs() < 1e-12);
    }
}
