//! `preset.toml`: the settings of an estimator, and the names of the built-in presets.
//!
//! ```toml
//! base = "auto"            # a built-in preset, modified by the other fields
//! joint_error_deg = 1.0
//! muscle = [0.3, 0.3, 0.3] # standard deviation of quiet input: pitch, yaw, roll
//! ```

use std::path::Path;

use bodyflight_core::estimator::motion::settings::{MOTION, MotionPreset, Slopes};
use bodyflight_core::estimator::preset::{PRESETS, Preset};
use bodyflight_core::estimator::unit_preset;
use bodyflight_core::estimator::unscented::{Root, SettingsError};
use serde::Deserialize;

use bodyflight_io::diagnostic::choices::choices;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;

/// Name of the default preset: the motion filter with the limb groups and damping of the flight.
pub const AUTO: &str = "auto";

/// Name of the same filter with derivatives by sigma points.
pub const SIGMA_POINTS: &str = unit_preset::SIGMA_POINTS_NAME;

/// Settings of one of the two filters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tuning {
    /// For the motion filter.
    Motion {
        /// The settings.
        preset: MotionPreset,
        /// Whether a file or flag gave the joint error; otherwise it is estimated from the innovations.
        joint_error_given: bool,
        /// Whether a file gave the noise; otherwise it is estimated from the recording where possible.
        noise_given: bool,
        /// Whether a file gave the damping; otherwise it is the subject's.
        damping_given: bool,
    },
    /// For the paper's filter over windows and its reduced form.
    Windows(Preset),
}

/// Ranges of times (s), and of amounts that have no natural bound.
const TIMES: [f32; 2] = [1e-3, 1000.0];
const AMOUNTS: [f32; 2] = [0.0, 1e4];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    base: Option<String>,
    // For both filters.
    solution_window: Option<usize>,
    // For the motion filter.
    noise: Option<NoiseTable>,
    muscle: Option<[f32; 3]>,
    muscle_time_s: Option<f32>,
    damping: Option<[f32; 3]>,
    damping_deviation: Option<[f32; 3]>,
    damping_time_s: Option<f32>,
    awake: Option<[f32; 2]>,
    awake_time_s: Option<f32>,
    awake_threshold: Option<f32>,
    damping_threshold: Option<f32>,
    joint_error_deg: Option<f32>,
    joint_error_time_s: Option<f32>,
    acceleration_noise: Option<f32>,
    angular_acceleration_noise: Option<f32>,
    gate: Option<f32>,
    // For the filter over windows.
    prediction_window: Option<usize>,
    measurement_deviation: Option<Vec<f32>>,
    process_noise_rate: Option<[f32; 6]>,
    deviation: Option<[f32; 6]>,
    state: Option<[f32; 6]>,
    low: Option<[f32; 6]>,
    high: Option<[f32; 6]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoiseTable {
    attitude_rad: Option<f32>,
    angular_velocity_radps: Option<f32>,
    horizontal_velocity_mps: Option<f32>,
    vertical_velocity_mps: Option<f32>,
    horizontal_speed_mps: Option<f32>,
}

/// The name of a field, its values, and their range.
type Checked = (&'static str, Vec<f32>, [f32; 2]);

impl NoiseTable {
    fn ranges(&self) -> [Checked; 5] {
        let velocity = [1e-6, 100.0];
        [
            ("noise.attitude_rad", self.attitude_rad, [1e-6, 3.2]),
            (
                "noise.angular_velocity_radps",
                self.angular_velocity_radps,
                [1e-6, 50.0],
            ),
            (
                "noise.horizontal_velocity_mps",
                self.horizontal_velocity_mps,
                velocity,
            ),
            (
                "noise.vertical_velocity_mps",
                self.vertical_velocity_mps,
                velocity,
            ),
            (
                "noise.horizontal_speed_mps",
                self.horizontal_speed_mps,
                velocity,
            ),
        ]
        .map(|(name, value, range)| (name, value.into_iter().collect(), range))
    }
}

impl Tuning {
    /// Returns the built-in preset of that name, or reads one from a file.
    ///
    /// # Errors
    /// Returns an error if there is no such preset, the file cannot be read, or it has a field that its base does not
    /// support.
    pub fn find(name_or_file: &str) -> Result<Self> {
        if let Some(tuning) = Self::built_in(name_or_file) {
            return Ok(tuning);
        }
        let path = Path::new(name_or_file);
        if path.extension().is_none() {
            return Err(unknown(name_or_file));
        }
        let text = input::settings(path, FileKind::Preset)?;
        Self::parse(&text, path)
    }

    fn built_in(name: &str) -> Option<Self> {
        let slopes = match name {
            AUTO => Some(Slopes::Differences),
            SIGMA_POINTS => Some(Slopes::SigmaPoints),
            _ => None,
        };
        if let Some(slopes) = slopes {
            return Some(Self::Motion {
                preset: MotionPreset { slopes, ..MOTION },
                joint_error_given: false,
                noise_given: false,
                damping_given: false,
            });
        }
        Preset::from_name(name).copied().map(Self::Windows)
    }

    /// Parses the text of a `preset.toml`; `path` is used in messages.
    ///
    /// # Errors
    /// Returns an error if the text is not valid or has a field that its base does not support.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let file: File = toml::from_str(text).map_err(|error| Problem::toml(&error, text, path))?;
        let base = file.base.as_deref().unwrap_or(AUTO);
        let here = |problem: Problem| problem.in_file(path).on_its_line(text);
        let tuning = Self::built_in(base).ok_or_else(|| here(unknown(base).at("field base")))?;
        let wrong = |field: &str, kind: &str| {
            here(
                Problem::bad_input(format!(
                    "base \"{base}\" has no {field}, which belongs to {kind}"
                ))
                .at(format!("field {field}")),
            )
            .help("bodyflight estimate --presets describes each preset")
        };
        match tuning {
            Self::Motion { mut preset, .. } => {
                if let Some(field) = file.windows_field() {
                    return Err(wrong(field, "the filter over windows"));
                }
                file.check_motion().map_err(here)?;
                file.change_motion(&mut preset);
                Ok(Self::Motion {
                    preset,
                    joint_error_given: file.joint_error_deg.is_some(),
                    noise_given: file.noise.is_some(),
                    damping_given: file.damping.is_some(),
                })
            }
            Self::Windows(mut preset) => {
                if let Some(field) = file.motion_field() {
                    return Err(wrong(field, "the motion filter"));
                }
                file.change_windows(&mut preset);
                file.check_windows(&preset).map_err(here)?;
                Ok(Self::Windows(preset))
            }
        }
    }
}

impl File {
    fn windows_field(&self) -> Option<&'static str> {
        [
            ("prediction_window", self.prediction_window.is_some()),
            (
                "measurement_deviation",
                self.measurement_deviation.is_some(),
            ),
            ("process_noise_rate", self.process_noise_rate.is_some()),
            ("deviation", self.deviation.is_some()),
            ("state", self.state.is_some()),
            ("low", self.low.is_some()),
            ("high", self.high.is_some()),
        ]
        .into_iter()
        .find_map(|(name, given)| given.then_some(name))
    }

    fn motion_field(&self) -> Option<&'static str> {
        [
            ("noise", self.noise.is_some()),
            ("muscle", self.muscle.is_some()),
            ("muscle_time_s", self.muscle_time_s.is_some()),
            ("damping", self.damping.is_some()),
            ("damping_deviation", self.damping_deviation.is_some()),
            ("damping_time_s", self.damping_time_s.is_some()),
            ("awake", self.awake.is_some()),
            ("awake_time_s", self.awake_time_s.is_some()),
            ("awake_threshold", self.awake_threshold.is_some()),
            ("damping_threshold", self.damping_threshold.is_some()),
            ("joint_error_deg", self.joint_error_deg.is_some()),
            ("joint_error_time_s", self.joint_error_time_s.is_some()),
            ("acceleration_noise", self.acceleration_noise.is_some()),
            (
                "angular_acceleration_noise",
                self.angular_acceleration_noise.is_some(),
            ),
            ("gate", self.gate.is_some()),
        ]
        .into_iter()
        .find_map(|(name, given)| given.then_some(name))
    }

    /// Checks the numbers of the motion filter, each against what a body or a sensor can have.
    fn check_motion(&self) -> Result<()> {
        let all = |values: Option<[f32; 3]>| values.into_iter().flatten().collect();
        let two = |values: Option<[f32; 2]>| values.into_iter().flatten().collect();
        let one = |value: Option<f32>| value.into_iter().collect();
        let ranges: [Checked; 15] = [
            ("muscle", all(self.muscle), [1e-4, 20.0]),
            ("muscle_time_s", one(self.muscle_time_s), TIMES),
            ("damping", all(self.damping), [-100.0, 100.0]),
            (
                "damping_deviation",
                all(self.damping_deviation),
                [1e-4, 100.0],
            ),
            ("damping_time_s", one(self.damping_time_s), TIMES),
            ("awake", two(self.awake), AMOUNTS),
            ("awake_time_s", one(self.awake_time_s), TIMES),
            ("awake_threshold", one(self.awake_threshold), AMOUNTS),
            ("damping_threshold", one(self.damping_threshold), AMOUNTS),
            ("joint_error_deg", one(self.joint_error_deg), [0.01, 45.0]),
            ("joint_error_time_s", one(self.joint_error_time_s), TIMES),
            ("acceleration_noise", one(self.acceleration_noise), AMOUNTS),
            (
                "angular_acceleration_noise",
                one(self.angular_acceleration_noise),
                AMOUNTS,
            ),
            ("gate", one(self.gate), [1.0, 100.0]),
            (
                "solution_window",
                one(self
                    .solution_window
                    .map(|count| f32::from(u16::try_from(count).unwrap_or(u16::MAX)))),
                [1.0, 1e4],
            ),
        ];
        let noise = self.noise.as_ref().map(NoiseTable::ranges);
        for (name, values, [low, high]) in ranges.into_iter().chain(noise.into_iter().flatten()) {
            if let Some(value) = values.iter().find(|value| !(low..=high).contains(*value)) {
                return Err(
                    Problem::bad_input(format!("expected {low} to {high}, found {value}"))
                        .at(format!("field {name}"))
                        .help("docs/estimator.md, Presets, says what each field is"),
                );
            }
        }
        Ok(())
    }

    /// Checks the numbers of a filter over windows, as the filter does.
    fn check_windows(&self, preset: &Preset) -> Result<()> {
        let channels = preset.measurement.channels.iter().flatten().count();
        let given = self
            .measurement_deviation
            .as_ref()
            .map_or(channels, Vec::len);
        let problem = |field: &str, message: String| {
            Err(Problem::bad_input(message)
                .at(format!("field {field}"))
                .help("docs/estimator.md, Presets, says what each field is"))
        };
        if given > channels {
            let message = format!(
                "expected at most {channels} numbers, one for each quantity that \"{}\" measures, found {given}",
                preset.name
            );
            return problem("measurement_deviation", message);
        }
        let Err(error) = preset.settings::<f64>(Root::Symmetric) else {
            return Ok(());
        };
        let field = match error {
            SettingsError::Variance | SettingsError::VarianceSpread => "deviation",
            SettingsError::ProcessNoise => "process_noise_rate",
            SettingsError::Bounds => "low",
            SettingsError::State => "state",
            SettingsError::MeasurementNoise => "measurement_deviation",
            _ => "base",
        };
        problem(field, error.to_string())
    }

    fn change_motion(&self, preset: &mut MotionPreset) {
        set(&mut preset.muscle, self.muscle);
        set(&mut preset.muscle_time, self.muscle_time_s);
        set(&mut preset.damping, self.damping);
        set(&mut preset.damping_deviation, self.damping_deviation);
        set(&mut preset.damping_time, self.damping_time_s);
        set(&mut preset.awake, self.awake);
        set(&mut preset.awake_time, self.awake_time_s);
        set(&mut preset.awake_threshold, self.awake_threshold);
        set(&mut preset.damping_threshold, self.damping_threshold);
        set(
            &mut preset.joint_error,
            self.joint_error_deg.map(f32::to_radians),
        );
        set(&mut preset.joint_error_time, self.joint_error_time_s);
        set(&mut preset.acceleration_noise, self.acceleration_noise);
        set(
            &mut preset.angular_acceleration_noise,
            self.angular_acceleration_noise,
        );
        set(&mut preset.gate, self.gate);
        set(&mut preset.solution_window, self.solution_window);
        if let Some(table) = &self.noise {
            let noise = &mut preset.noise;
            set(&mut noise.attitude, table.attitude_rad);
            set(&mut noise.angular_velocity, table.angular_velocity_radps);
            set(
                &mut noise.horizontal_velocity,
                table.horizontal_velocity_mps,
            );
            set(&mut noise.vertical_velocity, table.vertical_velocity_mps);
            set(&mut noise.horizontal_speed, table.horizontal_speed_mps);
        }
    }

    fn change_windows(&self, preset: &mut Preset) {
        set(&mut preset.solution_window, self.solution_window);
        set(&mut preset.prediction_window, self.prediction_window);
        set(&mut preset.process_noise_rate, self.process_noise_rate);
        set(&mut preset.deviation, self.deviation);
        set(&mut preset.state, self.state);
        set(&mut preset.low, self.low);
        set(&mut preset.high, self.high);
        let channels = preset.measurement.channels.iter_mut().flatten();
        for ((_, deviation), given) in channels.zip(self.measurement_deviation.iter().flatten()) {
            *deviation = *given;
        }
    }
}

fn set<V>(place: &mut V, value: Option<V>) {
    if let Some(value) = value {
        *place = value;
    }
}

fn unknown(name: &str) -> Problem {
    let names = PRESETS.iter().map(|preset| preset.name);
    let known = choices(name, [AUTO, SIGMA_POINTS].into_iter().chain(names));
    Problem::bad_input(format!("unknown preset \"{name}\"")).help(format!(
        "{known}; or give a preset.toml, see docs/estimator.md"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Tuning> {
        Tuning::parse(text, Path::new("preset.toml"))
    }

    #[test]
    fn a_file_changes_its_base() {
        let Ok(Tuning::Motion {
            preset,
            joint_error_given: true,
            noise_given: true,
            damping_given: false,
        }) = parse("joint_error_deg = 1.0\nmuscle = [1, 2, 3]\n[noise]\nattitude_rad = 0.02")
        else {
            panic!("not for the motion filter");
        };
        assert!((preset.joint_error - 1.0f32.to_radians()).abs() < 1e-9);
        assert!(preset.muscle.iter().eq(&[1.0, 2.0, 3.0]));
        assert_eq!((preset.noise.attitude, preset.gate), (0.02, MOTION.gate));
        let Ok(Tuning::Windows(preset)) =
            parse("base = \"turning\"\nprediction_window = 30\nmeasurement_deviation = [0.02]")
        else {
            panic!("not for the filter over windows");
        };
        assert_eq!(preset.prediction_window, 30);
        let channels = preset
            .measurement
            .channels
            .map(|c| c.map(|(_, noise)| noise));
        assert_eq!(channels, [Some(0.02), Some(0.01), Some(0.01), None]);
    }

    #[test]
    fn numbers_that_nothing_has_are_named_with_their_field() {
        for (text, parts) in [
            (
                "joint_error_deg = 500",
                ["p.toml:1: field joint_error_deg", "0.01 to 45, found 500"],
            ),
            ("muscle = [0.3, nan, 0.3]", ["field muscle", "found NaN"]),
            (
                "muscle_time_s = 1e30",
                ["field muscle_time_s", "0.001 to 1000"],
            ),
            (
                "damping_deviation = [1.0, 1.0, -1.0]",
                ["field damping_deviation", "found -1"],
            ),
            (
                "[noise]\nattitude_rad = nan",
                ["p.toml:2: field noise.attitude_rad", "found NaN"],
            ),
            (
                "[noise]\nangular_velocity_radps = -0.1",
                ["field noise.angular_velocity_radps", "found -0.1"],
            ),
        ] {
            let problem = Tuning::parse(text, Path::new("p.toml"))
                .unwrap_err()
                .to_string();
            assert!(problem.starts_with("p.toml"), "{problem}");
            for part in parts {
                assert!(problem.contains(part), "{text}: {problem}");
            }
        }
    }

    #[test]
    fn bad_files_are_named() {
        for (text, part) in [
            (
                "base = \"none\"",
                "preset.toml:1: field base: unknown preset \"none\"",
            ),
            (
                "low = [0, 0, 0, 0, 0, 0]",
                "preset.toml:1: field low: base \"auto\" has no low",
            ),
            (
                "base = \"tracking\"\ngate = 3.0",
                "preset.toml:2: field gate: base \"tracking\" has no gate",
            ),
            (
                "base = \"tracking\"\n\nlow = [9, 9, 9, 9, 9, 9]",
                "preset.toml:3: field low: every lower bound must be below",
            ),
            (
                "base = \"tracking\"\ndeviation = [0, 1, 1, 1, 1, 1]",
                "preset.toml:2: field deviation: every variance",
            ),
            (
                "base = \"tracking\"\nmeasurement_deviation = [1, 1, 1, 1, 1]",
                "preset.toml:2: field measurement_deviation: expected at most",
            ),
            ("gat = 3.0", "preset.toml:1"),
        ] {
            let problem = parse(text).unwrap_err().to_string();
            assert!(problem.contains(part), "{text}: {problem}");
        }
        let problem = Tuning::find("trackin").unwrap_err();
        assert!(problem.help.unwrap_or_default().contains("tracking"));
    }
}
