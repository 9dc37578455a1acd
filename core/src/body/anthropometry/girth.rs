//! Girths of a person.

use crate::math::Real;

/// A circumference measured with a tape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Girth {
    /// Largest circumference, above the brows.
    Head,
    /// Around the fullest part.
    Chest,
    /// At the navel.
    Waist,
    /// Around the fullest part of the buttocks.
    Hips,
    /// Upper arm, flexed.
    Biceps,
    /// Largest circumference, flexed.
    Forearm,
    /// Smallest circumference.
    Wrist,
    /// Highest position, at the groin.
    Thigh,
    /// Lower thigh, just above the knee.
    Knee,
    /// Largest circumference.
    Calf,
    /// Smallest circumference.
    Ankle,
}

impl Girth {
    /// All girths, from head to foot.
    pub const ALL: [Self; 11] = [
        Self::Head,
        Self::Chest,
        Self::Waist,
        Self::Hips,
        Self::Biceps,
        Self::Forearm,
        Self::Wrist,
        Self::Thigh,
        Self::Knee,
        Self::Calf,
        Self::Ankle,
    ];

    /// Name used in files, without the unit.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Head => "head",
            Self::Chest => "chest",
            Self::Waist => "waist",
            Self::Hips => "hips",
            Self::Biceps => "biceps",
            Self::Forearm => "forearm",
            Self::Wrist => "wrist",
            Self::Thigh => "thigh",
            Self::Knee => "knee",
            Self::Calf => "calf",
            Self::Ankle => "ankle",
        }
    }

    /// Returns the girth with this [name](Girth::name), or `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|girth| girth.name() == name)
    }
}

/// The known girths of a person.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Girths<T: Real>([Option<T>; Girth::ALL.len()]);

impl<T: Real> Girths<T> {
    /// Returns the girth (m), or `None` if it is not known.
    pub fn get(&self, girth: Girth) -> Option<T> {
        self.0[girth as usize]
    }

    /// Sets a girth (m).
    pub fn set(&mut self, girth: Girth, value: T) {
        self.0[girth as usize] = Some(value);
    }

    /// Returns the girths with one of them set (m).
    #[must_use]
    pub fn with(mut self, girth: Girth, value: T) -> Self {
        self.set(girth, value);
        self
    }
}
