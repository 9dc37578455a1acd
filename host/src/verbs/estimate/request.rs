//! What a user asks of an estimation, whichever filter it takes.

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
    /// The numbers.
    pub tuning: Tuning,
    /// Forward, or the whole flight at once.
    pub method: Method,
    /// Which model the filter flies; by default the whole one by the motion filter, the reduced one over windows.
    pub filter: Option<Filter>,
}

impl Request {
    /// Runs it over the recording of a flight; `progress` is called with the time reached (s).
    ///
    /// # Errors
    /// Returns an error if a file is not usable, or the preset does not go with the method or the recording.
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
                        "method smooth is of the motion filter, and preset \"{}\" is not",
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
