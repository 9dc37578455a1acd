//! Girths of a person.

use crate::math::Real;

/// A measure taken with a tape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Girth {
    /// Largest, above the brows.
    Head,
    /// Around the fullest part.
    Chest,
    /// At the navel.
    Waist,
    /// Around the fullest part of the buttocks.
    Hips,
    /// Upper arm, flexed.
    Biceps,
    /// Largest, flexed.
    Forearm,
    /// Smallest.
    Wrist,
    /// Highest, at the groin.
    Thigh,
    /// Lower thigh, just above the knee.
    Knee,
    /// Largest.
    Calf,
    /// Smallest.
    Ankle,
}

impl Girth {
    /// All girths, head to foot.
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

    /// Name in files, without unit.
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

    /// The girth of that name, see [`Girth::name`].
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|girth| girth.name() == name)
    }
}

/// The girths of a person that are known.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Girths<T: Real>([Option<T>; Girth::ALL.len()]);

impl<T: Real> Girths<T> {
    /// The girth (m), where known.
    pub fn get(&self, girth: Girth) -> Option<T> {
        self.0[girth as usize]
    }

    /// Sets a girth (m).
    pub fn set(&mut self, girth: Girth, value: T) {
        self.0[girth as usize] = Some(value);
    }

    /// The same girths with one set (m).
    #[must_use]
    pub fn with(mut self, girth: Girth, value: T) -> Self {
        self.set(girth, value);
        self
    }
}
