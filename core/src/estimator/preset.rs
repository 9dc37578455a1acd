//! Named tunings as data: measured quantities, initial state, bounds, windows and limbs.

use nalgebra::SVector;

use super::coefficients::{STATES, in_other_order};
use super::measurement::{
    MeasurementModel, TRACKING, TRANSITIONS, TRANSITIONS_WITH_GNSS, TURNING, VERTICAL,
};
use super::unscented::{Root, Settings, SettingsError};
use crate::dynamics::muscle_input::{
    BACK_TRACKING, BELLY_TRACKING, EXPERIENCED_BELLY_TURNS, LAYOUTS, MuscleModel, RW_SUIT_TURNS,
};
use crate::math::{Lanes, Real};

/// Sample rate of Xsens recordings (Hz).
pub const SAMPLE_RATE: f32 = 240.0;

/// All tuning parameters of an estimator. Vectors are in the order of [`StateVector`](super::StateVector): muscle
/// input in pitch, yaw, roll, then damping in pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preset {
    /// Name used in commands.
    pub name: &'static str,
    /// Measured quantities with their noise R; a larger noise gives the measurements less weight.
    pub measurement: MeasurementModel,
    /// Limbs that produce the muscle input; the [`Dynamics`](crate::dynamics::Dynamics) must use the same.
    pub muscles: MuscleModel,
    /// Initial state (dimensionless), within the bounds.
    pub state: [f32; STATES],
    /// Initial standard deviation; a larger one lets the first measurements change the state more.
    pub deviation: [f32; STATES],
    /// Process noise per second, Q / dt; a larger one follows changes faster and gives noisier estimates.
    pub process_noise_rate: [f32; STATES],
    /// Lower bounds of the state.
    pub low: [f32; STATES],
    /// Upper bounds of the state.
    pub high: [f32; STATES],
    /// Weight of the central sigma point, W_0, 0 to 0.99; a larger one spreads the other points wider.
    pub central_weight: f32,
    /// Share by which a sigma point beyond a bound is reflected if the state is at that bound, 0 to 1: k of paper eq.
    /// (movepukf).
    pub reflection: f32,
    /// Sample rate (Hz).
    pub sample_rate: f32,
    /// N_pred: number of samples from the start of a prediction to the measurement with which it is compared.
    pub prediction_window: usize,
    /// N_solve: number of samples from one update to the next.
    pub solution_window: usize,
}

/// Lower bound of damping that allows a skydiver to drive a rotation, paper "Transition Maneuvers".
pub const NEGATIVE_DAMPING_BOUND: f32 = -0.25;

/// Tracking back to earth, the full example of the paper.
pub const TRACKING_ON_BACK: Preset = Preset {
    name: "tracking",
    measurement: TRACKING,
    muscles: BACK_TRACKING,
    state: [0.0, 0.0, 0.0, 6.0, 6.0, 6.0],
    deviation: [0.25, 0.25, 0.25, 6.0, 6.0, 6.0],
    process_noise_rate: [0.25, 0.25, 0.25, 1.0, 1.0, 1.0],
    low: [0.0, 0.0, 0.0, 0.01, 0.01, 0.01],
    high: [6.5, 6.5, 6.5, 24.0, 24.0, 24.0],
    central_weight: 0.5,
    reflection: 0.5,
    sample_rate: SAMPLE_RATE,
    prediction_window: 60,
    solution_window: 4,
};

const TURNING_BOUNDS: [f32; STATES] = [3.5, 10.5, 2.5, 24.0, 24.0, 24.0];
const NEGATIVE_BOUNDS: [f32; STATES] = [
    0.0,
    0.0,
    0.0,
    NEGATIVE_DAMPING_BOUND,
    NEGATIVE_DAMPING_BOUND,
    NEGATIVE_DAMPING_BOUND,
];

/// For inputs that change within half a second, as in flips and barrel rolls. A prediction assumes constant inputs, so
/// over the paper's window of 0.25 s it rotates too late and too little, and with the paper's process noise the
/// coefficients need seconds to follow.
const AGILE: Preset = Preset {
    process_noise_rate: [4.0, 4.0, 4.0, 64.0, 64.0, 64.0],
    prediction_window: 20,
    ..TRACKING_ON_BACK
};

/// All presets. The link identifies them by position, so new ones must be appended.
pub const PRESETS: [Preset; 11] = [
    TRACKING_ON_BACK,
    Preset {
        name: "belly-tracking",
        muscles: BELLY_TRACKING,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "transitions",
        measurement: TRANSITIONS,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "transitions-negative-damping",
        measurement: TRANSITIONS,
        low: NEGATIVE_BOUNDS,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "transitions-gnss",
        measurement: TRANSITIONS_WITH_GNSS,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "layouts",
        measurement: TRANSITIONS,
        muscles: LAYOUTS,
        low: NEGATIVE_BOUNDS,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "turning",
        measurement: TURNING,
        high: TURNING_BOUNDS,
        solution_window: 12,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "turning-experienced",
        measurement: TURNING,
        muscles: EXPERIENCED_BELLY_TURNS,
        high: TURNING_BOUNDS,
        solution_window: 12,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "turning-rw-suit",
        measurement: TURNING,
        muscles: RW_SUIT_TURNS,
        high: TURNING_BOUNDS,
        solution_window: 12,
        ..TRACKING_ON_BACK
    },
    Preset {
        name: "tracking-agile",
        ..AGILE
    },
    Preset {
        name: "transitions-agile",
        measurement: VERTICAL,
        // The paper's 0.5 gives slightly worse results here, see docs/benchmarks.md.
        central_weight: 0.3,
        ..AGILE
    },
];

impl Preset {
    /// Returns the preset with this name, or `None` if there is none.
    pub fn from_name(name: &str) -> Option<&'static Self> {
        PRESETS.iter().find(|preset| preset.name == name)
    }

    /// Multiplies the process noise Q, the measurement noise R and the initial variances P0 by these factors.
    pub fn scale(&mut self, process: f32, measurement: f32, start: f32) {
        self.process_noise_rate = self.process_noise_rate.map(|rate| rate * process);
        self.deviation = self.deviation.map(|deviation| deviation * start.root());
        for (_, deviation) in self.measurement.channels.iter_mut().flatten() {
            *deviation *= measurement.root();
        }
    }

    /// Time between two samples (s).
    pub fn time_step<T: Real>(&self) -> T {
        T::one() / T::single(self.sample_rate)
    }

    /// Returns the settings of the unscented filter in the order of paper eq. (ukf_state), with the given square root
    /// of the covariance.
    ///
    /// # Errors
    /// Returns an error if the settings are unsafe to run.
    pub fn settings<T: Real>(&self, root: Root) -> Result<Settings<T, STATES>, SettingsError> {
        let vector = |values: [f32; STATES]| in_other_order(&values.map(T::single).into());
        let settings = Settings {
            state: vector(self.state),
            variance: vector(self.deviation.map(|d| d * d)),
            // The paper adds Q dt once per update, whatever the length of the solution window.
            process_noise: vector(self.process_noise_rate) * self.time_step::<T>(),
            low: vector(self.low),
            high: vector(self.high),
            central_weight: T::single(self.central_weight),
            reflection: T::single(self.reflection),
            root,
        };
        settings.check()?;
        let noise: SVector<T, _> = self.measurement.noise();
        if noise.iter().all(|r| r.is_finite() && *r > T::zero()) {
            Ok(settings)
        } else {
            Err(SettingsError::MeasurementNoise)
        }
    }
}
