//! Tunings by name, as data: what is measured, how the filter starts, its bounds, windows and limbs.

use nalgebra::SVector;

use super::coefficients::{STATES, in_other_order};
use super::measurement::{
    MeasurementModel, TRACKING, TRANSITIONS, TRANSITIONS_WITH_GNSS, TURNING, VERTICAL,
};
use super::unscented::{Root, Settings, SettingsError};
use crate::dynamics::muscle_input::{
    BACK_TRACKING, BELLY_TRACKING, EXPERIENCED_BELLY_TURNS, LAYOUTS, MuscleModel, RW_SUIT_TURNS,
};
use crate::math::Real;

/// Samples a second of an Xsens recording (Hz).
pub const SAMPLE_RATE: f32 = 240.0;

/// Everything that tunes an estimator. Vectors are in the order of [`StateVector`](super::StateVector): muscle input in pitch, yaw, roll,
/// then damping in pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Preset {
    /// Name in commands.
    pub name: &'static str,
    /// What is measured, with R.
    pub measurement: MeasurementModel,
    /// Limbs that act on the muscle input; the [`Dynamics`](crate::dynamics::Dynamics) has to use the same.
    pub muscles: MuscleModel,
    /// State at the start.
    pub state: [f32; STATES],
    /// Standard deviation at the start.
    pub deviation: [f32; STATES],
    /// Process noise per second, Q / dt.
    pub process_noise_rate: [f32; STATES],
    /// Lower bounds.
    pub low: [f32; STATES],
    /// Upper bounds.
    pub high: [f32; STATES],
    /// W_0.
    pub central_weight: f32,
    /// k of paper eq. (movepukf).
    pub reflection: f32,
    /// Samples a second (Hz).
    pub sample_rate: f32,
    /// N_pred: samples from the start of a prediction to the measurement it meets.
    pub prediction_window: usize,
    /// N_solve: samples from one update to the next.
    pub solution_window: usize,
}

/// Bound of damping that lets a skydiver push a rotation on, paper "Transition Maneuvers".
pub const NEGATIVE_DAMPING_BOUND: f32 = -0.25;

/// Tracking back to earth, the paper's full example.
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

/// For inputs that change within half a second, as in flips and barrel rolls. A prediction assumes constant inputs:
/// over the paper's window of 0.25 s it turns too early and too little, and the paper's process noise lets the
/// coefficients follow in seconds.
const AGILE: Preset = Preset {
    process_noise_rate: [4.0, 4.0, 4.0, 64.0, 64.0, 64.0],
    prediction_window: 20,
    ..TRACKING_ON_BACK
};

/// All presets. The link names them by their place: new ones go to the end.
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
        // The paper's 0.5 does slightly worse here, docs/benchmarks.md.
        central_weight: 0.3,
        ..AGILE
    },
];

impl Preset {
    /// The preset of that name.
    pub fn from_name(name: &str) -> Option<&'static Self> {
        PRESETS.iter().find(|preset| preset.name == name)
    }

    /// Multiplies the process noise Q, the measurement noise R and the variances at the start P0.
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

    /// Settings of the unscented filter in the order of paper eq. (ukf_state), with the square root that a propagation
    /// wants.
    ///
    /// # Errors
    /// Returns an error for settings that cannot be run safely.
    pub fn settings<T: Real>(&self, root: Root) -> Result<Settings<T, STATES>, SettingsError> {
        let vector = |values: [f32; STATES]| in_other_order(&values.map(T::single).into());
        let settings = Settings {
            state: vector(self.state),
            variance: vector(self.deviation.map(|d| d * d)),
            // The paper adds Q dt once an update, whatever the solution window.
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
