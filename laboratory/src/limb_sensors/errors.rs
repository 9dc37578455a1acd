//! Errors of one sensor and of how it is worn.

use bodyflight_core::math::rotation_by;
use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use rand_distr::StandardNormal;

/// One sample: its time by the sensor's clock (s), angular velocity (rad/s), and specific force (m/s2).
pub type Row = (f64, Vector3<f64>, Vector3<f64>);

/// Standard deviations of the errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sizes {
    /// Noise of the gyroscope, each sample (rad/s).
    pub rate_noise: f64,
    /// Its bias (rad/s), and how far that moves after the calibration.
    pub bias: f64,
    /// See `bias`.
    pub bias_drift: f64,
    /// Its scale, each axis.
    pub scale: f64,
    /// Noise of the accelerometer, each sample (m/s2).
    pub force_noise: f64,
    /// Its bias (m/s2).
    pub force_bias: f64,
    /// Place of the sensor (m), each axis.
    pub place: f64,
    /// Soft tissue: a turn that comes and goes (rad), each axis.
    pub tissue: f64,
    /// Poses: factor on the usual errors of a person who stands upright without a mirror.
    pub poses: f64,
    /// Offset of the clock (s).
    pub skew: f64,
    /// Time of a sample (s).
    pub jitter: f64,
    /// Share of samples that are lost.
    pub lost: f64,
}

impl Sizes {
    /// A small raw sensor of consumer grade, strapped over a suit.
    pub const TYPICAL: Self = Self {
        rate_noise: 0.001,
        bias: 0.01,
        bias_drift: 0.000_35,
        scale: 0.003,
        force_noise: 0.03,
        force_bias: 0.05,
        place: 0.03,
        tissue: 0.02,
        poses: 1.0,
        skew: 0.005,
        jitter: 0.000_3,
        lost: 0.001,
    };
}

/// Sine of a soft-tissue motion.
#[derive(Debug, Clone, Copy)]
struct Wave {
    size: Vector3<f64>,
    /// Angular frequency (rad/s).
    frequency: f64,
    phase: f64,
}

/// The errors of one sensor.
pub(super) struct SensorErrors {
    random: ChaCha8Rng,
    sizes: Sizes,
    bias: Vector3<f64>,
    drift: Vector3<f64>,
    scale: Vector3<f64>,
    force_bias: Vector3<f64>,
    skew: f64,
    waves: [Wave; 3],
    pub(super) misplaced: Vector3<f64>,
    pub(super) segment_from_sensor: UnitQuaternion<f64>,
}

impl SensorErrors {
    pub(super) fn new(random: &mut ChaCha8Rng, sizes: &Sizes) -> Self {
        let mut own: ChaCha8Rng = rand::SeedableRng::seed_from_u64(random.random());
        let vector = |own: &mut ChaCha8Rng, size: f64| normal(own) * size;
        let wave = |own: &mut ChaCha8Rng| Wave {
            size: normal(own) * (sizes.tissue * (2.0 / 3.0_f64).sqrt()),
            frequency: std::f64::consts::TAU * own.random_range(0.2..2.0),
            phase: own.random_range(0.0..std::f64::consts::TAU),
        };
        // Strapped on anyhow: any heading, and up to a radian of tilt.
        let heading = own.random_range(-3.1..3.1);
        let tilt = Vector3::new(
            own.random_range(-0.7..0.7),
            own.random_range(-0.7..0.7),
            0.0,
        );
        Self {
            bias: vector(&mut own, sizes.bias),
            drift: vector(&mut own, sizes.bias_drift),
            scale: vector(&mut own, sizes.scale).add_scalar(1.0),
            force_bias: vector(&mut own, sizes.force_bias),
            skew: own.sample::<f64, _>(StandardNormal) * sizes.skew,
            waves: [(); 3].map(|()| wave(&mut own)),
            misplaced: vector(&mut own, sizes.place),
            segment_from_sensor: rotation_by(&(Vector3::z() * heading)) * rotation_by(&tilt),
            random: own,
            sizes: *sizes,
        }
    }

    /// Turn of the sensor on its segment; `share` of it acts, as a person who stands still hardly moves soft tissue.
    pub(super) fn tissue_at(&self, time: f64, share: f64) -> UnitQuaternion<f64> {
        let waves = self.waves.iter();
        let turn = share
            * waves.fold(Vector3::zeros(), |sum, wave| {
                sum + wave.size * (wave.frequency * time + wave.phase).sin()
            });
        rotation_by(&turn)
    }

    /// What the sensor reads.
    pub(super) fn read(
        &mut self,
        rate: &Vector3<f64>,
        force: &Vector3<f64>,
        time: f64,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let bias = self.bias + self.drift * (time / 60.0).min(1.0);
        let rate_noise = normal(&mut self.random) * self.sizes.rate_noise;
        let force_noise = normal(&mut self.random) * self.sizes.force_noise;
        (
            rate.component_div(&self.scale) + bias + rate_noise,
            force + self.force_bias + force_noise,
        )
    }

    pub(super) fn is_lost(&mut self) -> bool {
        self.random.random::<f64>() < self.sizes.lost
    }

    /// Time by the sensor's clock (s).
    pub(super) fn stamp(&mut self, time: f64) -> f64 {
        let jitter: f64 = self.random.sample(StandardNormal);
        time + self.skew + (jitter * self.sizes.jitter).clamp(-0.003, 0.003)
    }
}

/// Three numbers of standard deviation one.
pub(super) fn normal(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.sample(StandardNormal))
}
