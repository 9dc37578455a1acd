//! A user's request for an estimation, independent of the filter.

use bodyflight_core::Real;

use super::motion::{self, Method};
use super::{Estimation, Filter, estimate};
use crate::diagnostic::{Problem, Result};
use crate::formats::flight::Flight;
use crate::formats::preset_file::Tuning;
use crate::formats::recording::Options;

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
    pub fn run<T: Real>(
        &self,
        flight: &Flight,
        options: Options,
        progress: impl FnMut(f64),
    ) -> Result<Estimation> {
        match self.tuning {
            Tuning::Windows(preset) => {
                if self.method == Method::Smooth {
                    return Err(Problem::bad_input(format!(
                        "method smooth needs the motion filter, which preset \"{}\" does not use",
                        preset.name
                    )));
                }
                let filter = self.filter.unwrap_or(Filter::Reduced);
                estimate::<T>(flight, &preset, filter, options, progress)
            }
            Tuning::Motion {
                mut preset,
                joint_error_given,
                noise_given,
                damping_given,
            } => {
                if !damping_given {
                    #[expect(clippy::cast_possible_truncation, reason = "a coefficient")]
                    let damping = flight.subject.damping().map(|value| value as f32);
                    preset.damping = damping.to_array();
                }
                let settings = motion::Settings {
                    preset,
                    keep_noise: noise_given,
                    find_joint_error: !joint_error_given,
                    filter: self.filter.unwrap_or(Filter::Paper),
                    method: self.method,
                };
                motion::estimate::<T>(flight, &settings, options, progress)
            }
        }
    }
}
