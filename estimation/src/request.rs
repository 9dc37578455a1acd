//! A user's request for an estimation, independent of the filter.

use crate::motion::{self, Method};
use crate::windows;
use crate::{Estimation, Filter};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::preset_file::Tuning;

/// A preset, and how to run it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// The preset's tuning.
    pub tuning: Tuning,
    /// Forward, or the whole flight at once.
    pub method: Method,
    /// The model inside the filter; by default the full one in the motion filter, the reduced one over windows.
    pub filter: Option<Filter>,
}

impl Request {
    /// Runs the estimation over a flight's recording. `progress` is called with the time reached (s).
    ///
    /// # Errors
    /// Returns an error if a file is unusable, or the preset does not fit the method or the recording.
    pub fn run(
        &self,
        flight: &Flight,
        options: Options,
        precision: Precision,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Estimation> {
        match self.tuning {
            Tuning::Windows(preset) => {
                if self.method == Method::Smooth {
                    return Err(Problem::bad_input(format!(
                        "method smooth needs the motion filter, which preset \"{}\" does not use",
                        preset.name
                    ))
                    .help("--method filter, or --preset auto"));
                }
                let filter = self.filter.unwrap_or(Filter::Reduced);
                windows::estimate(flight, &preset, filter, options, precision, progress)
            }
            Tuning::Motion {
                mut preset,
                joint_error_given,
                noise_given,
                damping_given,
            } => {
                if !damping_given {
                    preset = motion::about_damping_of(&flight.subject, preset);
                }
                let settings = motion::Settings {
                    preset,
                    keep_noise: noise_given,
                    find_joint_error: !joint_error_given,
                    filter: self.filter.unwrap_or(Filter::Paper),
                    method: self.method,
                };
                motion::estimate(flight, &settings, options, precision, progress)
            }
        }
    }
}
