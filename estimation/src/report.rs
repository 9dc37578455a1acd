//! The numbers of an estimation.

use bodyflight_core::Segment;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::estimator::motion::watch::{Consistency, Watch};
use bodyflight_core::estimator::status::{Faults, Health};
use serde::Serialize;

use crate::verdict::Consistencies;
use bodyflight_mvnx::recording::{Warning, faults};
use bodyflight_replay::comparison::PerChannel;
use bodyflight_replay::input_history::InputRow;

/// Number of updates with each kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Flags {
    /// A posture was unusable.
    pub posture: u64,
    /// A measured channel was unusable.
    pub measurement: u64,
    /// An update was rejected.
    pub update: u64,
    /// The covariance was kept from degenerating.
    pub covariance: u64,
    /// The reconstructed motion was limited.
    pub motion: u64,
    /// The samples were not at the rate of the recording.
    pub rate: u64,
    /// Updates in which predictions were far from the measurements.
    pub inconsistent: u64,
    /// Number of restarts after the motion had been lost for a second.
    pub restarted: u64,
}

impl Flags {
    pub(crate) fn count(&mut self, faults: Faults, health: Health) {
        self.count_faults(faults);
        self.inconsistent += u64::from(health == Health::Inconsistent);
    }

    pub(crate) fn count_faults(&mut self, faults: Faults) {
        for (count, set) in [
            (&mut self.posture, faults.posture),
            (&mut self.measurement, faults.measurement),
            (&mut self.update, faults.update),
            (&mut self.covariance, faults.covariance),
            (&mut self.motion, faults.motion),
            (&mut self.rate, faults.rate),
        ] {
            *count += u64::from(set);
        }
    }
}

/// The result of an estimation.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Gap of the reconstruction with estimated inputs.
    pub rms: PerChannel,
    /// Gap of a free run with constant coefficients.
    pub rms_constant: PerChannel,
    /// Gap of a free run from the first frame with the estimated inputs; motion filter only.
    pub rms_free_run: Option<PerChannel>,
    /// Largest absolute value of the measured channel.
    pub amplitude: PerChannel,
    /// Number of updates.
    pub updates: u64,
    /// Whether the estimates are those of the whole flight; if not, they are a filter's, also where the whole flight has no
    /// solution.
    pub is_smoothed: bool,
    /// Mean normalised innovation squared of the updates, all channels.
    pub nis_mean: f64,
    /// Faults by kind.
    pub flags: Flags,
    /// Time spent in the filter itself (s).
    pub filter_s: f64,
    /// Length of the flight (s).
    pub duration_s: f64,
    /// Standard deviation of each component of the velocity (m/s), root of its mean square over the flight after the first
    /// seconds, if none was measured: it follows from the model then.
    pub assumed_velocity_sd_mps: Option<f64>,
    /// Time from a sample to the estimate for it (s): the prediction window.
    pub delay_s: f64,
    /// Error of the recorded joints, as a standard deviation per axis (deg).
    pub joint_error_deg: Option<f64>,
    /// Standard deviation of that number (deg), unless it was given.
    pub joint_error_sd_deg: Option<f64>,
    /// Where that number comes from.
    pub joint_error_source: Option<JointErrorSource>,
    /// How consistent the motion filter was.
    pub consistency: Option<Consistencies>,
    /// Why the estimate should not be trusted.
    pub doubt: Option<String>,
    /// Whether the reason is the recording itself, whatever the model.
    #[serde(skip)]
    pub is_recording_doubtful: bool,
    /// What is implausible in the recording.
    pub warnings: Vec<Warning>,
}

/// Where the error of the recorded joints comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum JointErrorSource {
    /// A file or an option gave it.
    Given,
    /// The recording hardly tells it, so it is about what was thought likely before.
    Assumed,
    /// The recording shows it.
    Seen,
}

impl Report {
    /// The error of the joints in words, with its own error bar if it was not given; `None` if no filter counted with it.
    pub fn joint_error_in_words(&self) -> Option<String> {
        let degrees = self.joint_error_deg?;
        let deviation = self.joint_error_sd_deg.unwrap_or(0.0);
        Some(match self.joint_error_source? {
            JointErrorSource::Given => format!("joint errors given as {degrees:.2} deg"),
            JointErrorSource::Assumed => {
                format!("joint errors of {degrees:.1} +- {deviation:.1} deg assumed, hardly seen")
            }
            JointErrorSource::Seen => {
                format!("joint errors of {degrees:.2} +- {deviation:.2} deg seen")
            }
        })
    }
}

impl Report {
    /// Adds what is implausible in the recording, and doubts the estimate because of its faults, if there are any, rather than
    /// for another reason.
    pub(crate) fn warn(&mut self, warnings: Vec<Warning>) {
        let faults = faults(&warnings);
        self.warnings = warnings;
        if faults.is_some() {
            (self.doubt, self.is_recording_doubtful) = (faults, true);
        }
    }

    /// Doubts the estimate because the sensors of segments are doubted, if there are any, rather than for another reason.
    pub(crate) fn doubt_sensors(&mut self, doubted: &[Segment]) {
        if doubted.is_empty() {
            return;
        }
        let names: Vec<&str> = doubted.iter().map(|segment| segment.name()).collect();
        self.doubt = Some(format!(
            "the import of the sensors doubted {} (suit.doubted of flight.toml), so the posture may be wrong by any angle: mend what it \
             said, or leave these sensors out of the mapping, and import again",
            names.join(", ")
        ));
        self.is_recording_doubtful = true;
    }
}

/// Coefficients at one time.
#[derive(Debug, Clone, Copy)]
pub struct Point {
    /// Time from which they apply (s).
    pub time: f64,
    /// Coefficients.
    pub inputs: InputRow,
    /// Their standard deviations.
    pub deviation: InputRow,
    /// Normalised innovation squared of the update: over all channels for the paper's filter, the mean per channel for
    /// the motion filter.
    pub normalised_innovation: f64,
    /// The filter's own verdict on its consistency.
    pub consistency: Option<Consistency>,
    /// What the filter monitors.
    pub watched: Watched,
    /// Motion at that time; motion filter only.
    pub motion: Option<Motion<f64>>,
    /// Standard deviations of its velocity (m/s): north, west, up. NaN without a motion.
    pub velocity_deviation: [f64; 3],
}

/// Mean squares over about a second of quantities whose mean square should be 1; NaN for those that a filter does not
/// monitor.
#[derive(Debug, Clone, Copy)]
pub struct Watched {
    /// Normalised innovations of attitude, angular velocity and velocity, the worst channel of each.
    pub sensors: [f64; 3],
    /// The residual load, per component.
    pub residual: f64,
    /// Normalised innovations of all channels.
    pub all: f64,
}

impl Watched {
    /// The values in the order of the fields.
    pub fn values(&self) -> [f64; 5] {
        let [attitude, spin, velocity] = self.sensors;
        [attitude, spin, velocity, self.residual, self.all]
    }

    /// For a filter that monitors all channels together.
    pub fn of_all(mean_square: f64) -> Self {
        Self {
            sensors: [f64::NAN; 3],
            residual: f64::NAN,
            all: mean_square,
        }
    }

    /// For the motion filter.
    pub fn of(watch: &Watch<f64>) -> Self {
        // The horizontal speed of a satellite receiver counts as a velocity.
        let worst = |sensor: usize| {
            let channels = watch.channels.iter().enumerate();
            let seen = channels.filter(|(k, channel)| channel.seen && (k / 3).min(2) == sensor);
            seen.map(|(_, channel)| channel.mean_square)
                .fold(f64::NAN, f64::max)
        };
        Self {
            sensors: [0, 1, 2].map(worst),
            residual: watch.residual,
            all: f64::NAN,
        }
    }
}
