//! The suit and its sensors, which record a flight.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::small_rotation;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_core::{Posture, Segment};
use nalgebra::Vector3;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Standard deviation of the calibration error of each joint about each axis (rad): 2 degrees in total.
const JOINT_DEVIATION: f64 = 0.02;

/// Factors on the usual errors of suit and sensors.
pub(super) struct Scale {
    pub(super) errors: f64,
    pub(super) sensors: f64,
}

/// Standard deviations of the suit's errors of a joint about each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointErrors {
    /// Constant part (degrees).
    pub constant_deg: f64,
    /// Drift (degrees).
    pub wander_deg: f64,
    /// Rate of the drift (Hz).
    pub wander_hz: f64,
    /// Part proportional to the joint angle (fraction).
    pub gain: f64,
}

impl Default for JointErrors {
    fn default() -> Self {
        Self {
            constant_deg: JOINT_DEVIATION.to_degrees(),
            wander_deg: 0.0,
            wander_hz: 0.3,
            gain: 0.0,
        }
    }
}

impl JointErrors {
    /// Exact joints.
    pub const NONE: Self = Self {
        constant_deg: 0.0,
        wander_deg: 0.0,
        wander_hz: 0.3,
        gain: 0.0,
    };

    /// Calibration alone.
    pub const CONSTANT: Self = Self {
        constant_deg: 1.1,
        ..Self::NONE
    };

    /// Drift alone.
    pub const WANDER: Self = Self {
        wander_deg: 1.1,
        ..Self::NONE
    };

    /// All kinds of errors.
    pub const MIXED: Self = Self {
        constant_deg: 1.1,
        wander_deg: 0.9,
        gain: 0.05,
        ..Self::NONE
    };

    /// All kinds of errors, far larger than those of a suit that was calibrated with care.
    pub const WIDE: Self = Self {
        constant_deg: 2.9,
        wander_deg: 2.3,
        gain: 0.08,
        ..Self::NONE
    };

    /// Parses `constant:2,wander:1.5@0.3,gain:0.05`: degrees, degrees at a rate in Hz, a fraction. Parts that are not
    /// named are zero.
    ///
    /// # Errors
    /// Returns an error if a part is none of these or a number is not plausible.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut errors = Self::NONE;
        let mut named = Vec::new();
        for part in text.split(',') {
            let (name, value) = part
                .split_once(':')
                .ok_or_else(|| format!("expected name:value, found \"{part}\""))?;
            if named.contains(&name) {
                return Err(format!("expected {name} once, found it twice"));
            }
            named.push(name);
            let number = |text: &str, most: f64| {
                text.parse::<f64>()
                    .ok()
                    .filter(|value| (0.0..=most).contains(value))
                    .ok_or_else(|| format!("{name}: expected 0 to {most}, found \"{text}\""))
            };
            match (name, value.split_once('@')) {
                ("constant", None) => errors.constant_deg = number(value, 30.0)?,
                ("gain", None) => errors.gain = number(value, 1.0)?,
                ("wander", None) => errors.wander_deg = number(value, 30.0)?,
                ("wander", Some((size, rate))) => {
                    errors.wander_deg = number(size, 30.0)?;
                    errors.wander_hz = number(rate, 5.0)?;
                }
                _ => {
                    return Err(format!(
                        "expected constant, wander or gain, found \"{part}\""
                    ));
                }
            }
        }
        Ok(errors)
    }
}

/// Number of waves that make up a drift.
const WAVES: usize = 4;

/// The errors of a joint.
struct JointError {
    constant: Vector3<f64>,
    /// Amplitudes of sine and cosine (rad), and rate (rad/s).
    waves: [(Vector3<f64>, Vector3<f64>, f64); WAVES],
    gain: Vector3<f64>,
}

impl JointError {
    fn at(&self, time: f64, bend: &Vector3<f64>) -> Vector3<f64> {
        let mut turn = self.constant + self.gain.component_mul(bend);
        for (sine, cosine, rate) in &self.waves {
            turn += sine * (rate * time).sin() + cosine * (rate * time).cos();
        }
        turn
    }
}

/// The suit with its errors.
pub(super) struct Suit {
    random: ChaCha8Rng,
    joint_errors: Vec<JointError>,
    noise: SensorNoise,
}

impl Suit {
    /// Creates a suit with these joint errors.
    pub(super) fn new(random: ChaCha8Rng, joints: &JointErrors, scale: Scale) -> Self {
        let mut suit = Self {
            random,
            joint_errors: Vec::new(),
            noise: SensorNoise::PAPER.scaled(scale.sensors),
        };
        let share = scale.errors;
        let of_joint = |suit: &mut Self| {
            let constant = suit.vector([joints.constant_deg.to_radians() * share; 3]);
            let wave = (joints.wander_deg.to_radians() * share) / (WAVES as f64).sqrt();
            JointError {
                constant,
                // Without wander no random numbers are drawn, so the other errors of a seed stay the same.
                waves: core::array::from_fn(|_| {
                    if wave == 0.0 {
                        return (Vector3::zeros(), Vector3::zeros(), 0.0);
                    }
                    let rate = joints.wander_hz * (0.3 + 1.4 * suit.random.random::<f64>());
                    let (sine, cosine) = (suit.vector([wave; 3]), suit.vector([wave; 3]));
                    (sine, cosine, core::f64::consts::TAU * rate)
                }),
                gain: if joints.gain == 0.0 {
                    Vector3::zeros()
                } else {
                    suit.vector([joints.gain * share; 3])
                },
            }
        };
        suit.joint_errors = Segment::ALL.iter().map(|_| of_joint(&mut suit)).collect();
        suit
    }

    /// Normal random numbers with these standard deviations.
    fn vector(&mut self, deviations: [f64; 3]) -> Vector3<f64> {
        Vector3::from(deviations.map(|d| self.random.sample::<f64, _>(StandardNormal) * d))
    }

    /// The recorded frame for a posture and a motion.
    pub(super) fn recorded(
        &mut self,
        time: f64,
        posture: &Posture<f64>,
        motion: &Motion<f64>,
    ) -> FlightSample {
        let mut recorded = *posture;
        for (&segment, error) in Segment::ALL.iter().zip(&self.joint_errors) {
            let joint = posture.parent_from_segment(segment);
            let turn = small_rotation(&error.at(time, &joint.scaled_axis()));
            recorded.set(segment, joint * turn);
        }
        let noise = self.noise;
        let turn = small_rotation(&self.vector([noise.attitude; 3]));
        let inertial_from_body =
            Rotation::from_quaternion(motion.inertial_from_body.quaternion() * turn);
        let spin = motion.angular_velocity.components + self.vector([noise.angular_velocity; 3]);
        let horizontal = noise.horizontal_velocity;
        let velocity = motion.velocity_inertial().components
            + self.vector([horizontal, horizontal, noise.vertical_velocity]);
        FlightSample {
            time,
            posture: recorded,
            motion: Motion {
                inertial_from_body,
                position: motion.position,
                velocity: inertial_from_body.inverse() * Vector::from_components(velocity),
                angular_velocity: Vector::from_components(spin),
            },
        }
    }
}
