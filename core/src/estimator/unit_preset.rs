//! The presets that a unit supports, by the numbers that the link uses for them.

use super::motion::settings::{MOTION, MotionPreset, Slopes};
use super::preset::{PRESETS, Preset};
use crate::dynamics::muscle_input::{MODELS, MuscleForces, MuscleModel};

/// A filter that a unit can be asked to run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UnitPreset {
    /// The reduced form of the paper's filter.
    Windows(Preset),
    /// The reduced motion filter, with the limbs that produce the muscle input.
    Motion(MotionPreset, MuscleModel),
}

/// Common name of the motion filter's presets.
pub const MOTION_NAME: &str = "auto";

/// The same with derivatives by sigma points.
pub const SIGMA_POINTS_NAME: &str = "sigma-points";

impl UnitPreset {
    /// Returns the preset with this number, or `None` if there is none: first come those of [`PRESETS`], then the
    /// motion filter with each of the limb groups of [`MODELS`], then the same with sigma points. New presets must be
    /// appended.
    pub fn of(number: usize) -> Option<Self> {
        if let Some(preset) = PRESETS.get(number) {
            return Some(Self::Windows(*preset));
        }
        let place = number.checked_sub(PRESETS.len())?;
        let slopes = match place / MODELS.len() {
            0 => Slopes::Differences,
            1 => Slopes::SigmaPoints,
            _ => return None,
        };
        let (_, muscles) = MODELS.get(place % MODELS.len())?;
        Some(Self::Motion(
            MotionPreset { slopes, ..MOTION },
            muscles.with_forces(MuscleForces::Moment),
        ))
    }

    /// Returns the number of the preset with this name; `auto` and `sigma-points` are the motion filter with `muscles`.
    /// Returns `None` if there is no such preset, or if the motion filter has none for these limb groups.
    pub fn number(name: &str, muscles: &MuscleModel) -> Option<usize> {
        let block = match name {
            MOTION_NAME => Some(0),
            SIGMA_POINTS_NAME => Some(1),
            _ => None,
        };
        if let Some(block) = block {
            let mut models = MODELS.iter();
            let place = models.position(|(known, _)| *known == muscles.name())?;
            return Some(PRESETS.len() + block * MODELS.len() + place);
        }
        PRESETS.iter().position(|preset| preset.name == name)
    }

    /// Name used in commands.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Windows(preset) => preset.name,
            Self::Motion(preset, _) => match preset.slopes {
                Slopes::Differences => MOTION_NAME,
                Slopes::SigmaPoints => SIGMA_POINTS_NAME,
            },
        }
    }

    /// Limbs that produce the muscle input.
    pub const fn muscles(&self) -> &MuscleModel {
        match self {
            Self::Windows(preset) => &preset.muscles,
            Self::Motion(_, muscles) => muscles,
        }
    }

    /// Maximum number of samples from one update to the next.
    pub const fn longest_solution_window(&self) -> usize {
        match self {
            Self::Windows(preset) => preset.prediction_window,
            Self::Motion(..) => LONGEST_SOLUTION_WINDOW,
        }
    }

    /// Default number of samples from one update to the next.
    pub const fn solution_window(&self) -> usize {
        match self {
            Self::Windows(preset) => preset.solution_window,
            Self::Motion(preset, _) => preset.solution_window,
        }
    }

    /// Returns the preset with another sample rate (Hz) and solution window (samples).
    #[must_use]
    pub const fn at_rates(mut self, sample_rate: f32, solution_window: usize) -> Self {
        match &mut self {
            Self::Windows(preset) => {
                preset.sample_rate = sample_rate;
                preset.solution_window = solution_window;
            }
            Self::Motion(preset, _) => {
                preset.sample_rate = sample_rate;
                preset.solution_window = solution_window;
            }
        }
        self
    }

    /// Returns the preset for a body whose posture is not measured but assumed. The paper's filters know no errors of
    /// the posture, so theirs stay as they are.
    #[must_use]
    pub const fn with_assumed_posture(mut self) -> Self {
        if let Self::Motion(preset, _) = &mut self {
            *preset = preset.with_assumed_posture();
        }
        self
    }
}

/// Longest solution window of the motion filter: a quarter of a second at 240 Hz.
const LONGEST_SOLUTION_WINDOW: usize = 60;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_correspond() {
        let mut number = 0;
        while let Some(preset) = UnitPreset::of(number) {
            assert_eq!(
                UnitPreset::number(preset.name(), preset.muscles()),
                Some(number)
            );
            number += 1;
        }
        assert_eq!(number, PRESETS.len() + 2 * MODELS.len());
        assert_eq!(UnitPreset::number("none", &MODELS[0].1), None);
    }
}
