//! Builds the segment table of a person from stature, mass, sex and, where known, girths.
//!
//! All mass fractions and lengths come from one source, de Leva 1996 (Zatsiorsky's subjects, with lengths between
//! joint centres), in which the hip joint separates thigh and trunk. Shapes are those of Hanavan and `Kwon3D`;
//! breadths and girths that are not given are linear in stature and mass (ANSUR II).

mod form;
mod girth;
mod tables;

use core::fmt;

use nalgebra::Vector3;

use super::solid::Solid;
use super::{Body, Segment, SegmentArray};
use crate::math::Real;

use form::Form;
use tables::{ANKLE_HEIGHT, Breadth, Proportions};

pub(super) use form::ANKLE_FROM_HEEL;
pub use form::MomentArm;
pub use girth::{Girth, Girths};
pub use tables::Sex;

/// Height of the shoulder joint above the sole, as a share of the stature; two percent of the stature below the
/// acromion.
const SHOULDER_HEIGHT: f64 = 0.80;
/// Distance by which the shoulder joint lies inwards of the acromion, as a share of the stature.
const SHOULDER_INSET: f64 = 0.004;
/// Half the distance between the hip joints, as a share of the stature.
const HIP_HALF_DISTANCE: f64 = 0.050;
/// Girth of the relaxed upper arm as a share of the flexed one.
const RELAXED_BICEPS: f64 = 0.94;
/// Thickness of the hand as a share of its breadth.
const HAND_THICKNESS: f64 = 0.33;
/// Height of the toes as a share of the height of the ankle, chosen to place the foot's centre of gravity where de
/// Leva has it.
const TOE_HEIGHT: f64 = 0.5;
/// Accepted range of statures (m).
const HEIGHT_RANGE: (f64, f64) = (1.2, 2.3);
/// Accepted range of masses (kg).
const MASS_RANGE: (f64, f64) = (25.0, 220.0);
/// Accepted range of the body mass index (kg/m2); beyond it the regressions do not hold.
const BODY_MASS_INDEX_RANGE: (f64, f64) = (9.0, 75.0);
/// Accepted range of girths, as a share of the expected girth.
const GIRTH_RANGE: (f64, f64) = (0.5, 2.0);
/// Accepted range of moment arms, as a share of the segment's length.
const MOMENT_ARM_RANGE: (f64, f64) = (0.001, 10.0);

/// Measurements of a person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Person<T: Real> {
    /// Stature (m), 1.2 to 2.3.
    pub height: T,
    /// Mass without clothing (kg), 25 to 220.
    pub mass: T,
    /// Sex, which selects the column of the tables.
    pub sex: Sex,
    /// Known girths; the others are predicted from stature and mass.
    pub girths: Girths<T>,
    /// Which length scales the aerodynamic moments.
    pub moment_arm: MomentArm<T>,
}

/// A measurement outside the human range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PersonError {
    /// Which measurement is out of range.
    pub measure: Measure,
    /// Value found, in the unit of the measurement.
    pub found: f64,
    /// Smallest accepted value.
    pub low: f64,
    /// Largest accepted value.
    pub high: f64,
}

/// A measurement named by [`PersonError`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Stature (m).
    Height,
    /// Mass (kg).
    Mass,
    /// Mass divided by stature squared (kg/m2).
    BodyMassIndex,
    /// Girth (m).
    Girth(Girth),
    /// Moment arm as a share of the segment's length.
    MomentArm,
}

impl fmt::Display for PersonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = match self.measure {
            Measure::Height => ("height", " m"),
            Measure::Mass => ("mass", " kg"),
            Measure::BodyMassIndex => ("mass / height^2", " kg/m2"),
            Measure::Girth(girth) => (girth.name(), " m"),
            Measure::MomentArm => ("moment arm", " of the length"),
        };
        let Self {
            found, low, high, ..
        } = self;
        write!(
            f,
            "{name} is {found}{unit}, expected {low:.4} to {high:.4}{unit}"
        )
    }
}

impl core::error::Error for PersonError {}

impl<T: Real> Person<T> {
    /// Creates a person from stature (m), mass (kg) and sex alone.
    pub fn new(height: T, mass: T, sex: Sex) -> Self {
        Self {
            height,
            mass,
            sex,
            girths: Girths::default(),
            moment_arm: MomentArm::default(),
        }
    }

    /// Returns the girth (m) if known, or the value predicted from stature, mass and sex.
    pub fn girth(&self, girth: Girth) -> T {
        self.girths
            .get(girth)
            .unwrap_or_else(|| self.expected_girth(girth))
    }

    fn expected_girth(&self, girth: Girth) -> T {
        tables::girth(girth, self.sex).value(self.height, self.mass)
    }

    fn breadth(&self, breadth: Breadth) -> T {
        tables::breadth(breadth, self.sex).value(self.height, self.mass)
    }

    fn check(&self) -> Result<(), PersonError> {
        let within = |measure, found: f64, (low, high): (f64, f64)| {
            if found >= low && found <= high {
                Ok(())
            } else {
                Err(PersonError {
                    measure,
                    found,
                    low,
                    high,
                })
            }
        };
        let (height, mass) = (self.height.to_f64(), self.mass.to_f64());
        within(Measure::Height, height, HEIGHT_RANGE)?;
        within(Measure::Mass, mass, MASS_RANGE)?;
        within(
            Measure::BodyMassIndex,
            mass / (height * height),
            BODY_MASS_INDEX_RANGE,
        )?;
        for girth in Girth::ALL {
            if let Some(found) = self.girths.get(girth) {
                let expected = self.expected_girth(girth).to_f64();
                let (low, high) = GIRTH_RANGE;
                let range = (low * expected, high * expected);
                within(Measure::Girth(girth), found.to_f64(), range)?;
            }
        }
        match self.moment_arm {
            MomentArm::FractionOfLength(share) => {
                within(Measure::MomentArm, share.to_f64(), MOMENT_ARM_RANGE)
            }
            MomentArm::Width | MomentArm::Length => Ok(()),
        }
    }

    /// Builds the segment table of the person, without clothing or equipment.
    ///
    /// # Errors
    /// Returns an error if a measurement is not a number or outside the range of human bodies.
    pub fn body(&self) -> Result<Body<T>, PersonError> {
        self.check()?;
        let proportions = tables::proportions(self.sex);
        let share = self.mass / T::of(proportions.total_mass());
        Ok(Body {
            segments: SegmentArray::from_fn(|segment| {
                let form = self.form(segment, proportions);
                let mass = share * T::of(proportions.of(segment).mass);
                let joint_offset = self.joint_offset(segment, proportions);
                form.parameters(mass, joint_offset, self.moment_arm)
            }),
            height: self.height,
        })
    }

    /// Length of a segment (m).
    fn length(&self, segment: Segment, proportions: &Proportions) -> T {
        let published = T::of(proportions.of(segment).length);
        self.height * published * T::of(proportions.stacking(segment))
    }

    /// Position of the proximal joint in the parent's frame (m).
    fn joint_offset(&self, segment: Segment, proportions: &Proportions) -> Vector3<T> {
        let length = |segment| self.length(segment, proportions);
        let side = match segment {
            Segment::RightUpperArm | Segment::RightThigh => -T::one(),
            _ => T::one(),
        };
        let zero = T::zero();
        match segment {
            Segment::Pelvis => Vector3::zeros(),
            Segment::LeftThigh | Segment::RightThigh => {
                Vector3::new(side * self.height * T::of(HIP_HALF_DISTANCE), zero, zero)
            }
            Segment::LeftUpperArm | Segment::RightUpperArm => {
                let legs = [Segment::LeftThigh, Segment::LeftShank].map(length);
                let below = [Segment::Pelvis, Segment::Abdomen].map(length);
                let base = self.height * T::of(ANKLE_HEIGHT) + sum(legs) + sum(below);
                let inwards = self.height * T::of(SHOULDER_INSET);
                let half_breadth = self.breadth(Breadth::Biacromial) * T::of(0.5);
                let up = self.height * T::of(SHOULDER_HEIGHT) - base;
                Vector3::new(side * (half_breadth - inwards), zero, up)
            }
            Segment::Abdomen | Segment::Thorax | Segment::Head => {
                Vector3::new(zero, zero, segment.parent().map_or(zero, length))
            }
            _ => Vector3::new(zero, zero, segment.parent().map_or(zero, |p| -length(p))),
        }
    }

    /// Semi-axes of a section of trunk or head (m), both scaled by the ratio of actual to expected girth.
    fn section(&self, breadth: Breadth, depth: Breadth, girth: Girth) -> [T; 2] {
        let half = T::of(0.5) * self.girth(girth) / self.expected_girth(girth);
        [self.breadth(breadth) * half, self.breadth(depth) * half]
    }

    fn form(&self, segment: Segment, proportions: &Proportions) -> Form<T> {
        let length = self.length(segment, proportions);
        let radius = |girth| self.girth(girth) / T::two_pi();
        let hips = || self.section(Breadth::Hips, Breadth::ButtockDepth, Girth::Hips);
        let waist = || self.section(Breadth::Waist, Breadth::WaistDepth, Girth::Waist);
        let chest = || self.section(Breadth::Chest, Breadth::ChestDepth, Girth::Chest);
        let half = T::of(0.5);
        match segment {
            Segment::Pelvis => Form::Up(Solid::TruncatedEllipticCone {
                base: hips(),
                top: waist(),
                length,
            }),
            Segment::Abdomen => Form::Up(Solid::TruncatedEllipticCone {
                base: waist(),
                top: chest(),
                length,
            }),
            Segment::Thorax => Form::Up(Solid::elliptic_cylinder(chest(), length)),
            Segment::Head => {
                let [a, b] = self.section(Breadth::Head, Breadth::HeadLength, Girth::Head);
                Form::Up(Solid::Ellipsoid {
                    semi_axes: [a, b, length * half],
                })
            }
            Segment::LeftUpperArm | Segment::RightUpperArm => Form::Down(Solid::cone(
                radius(Girth::Biceps) * T::of(RELAXED_BICEPS),
                radius(Girth::Forearm),
                length,
            )),
            Segment::LeftForearm | Segment::RightForearm => Form::Down(Solid::cone(
                radius(Girth::Forearm),
                radius(Girth::Wrist),
                length,
            )),
            Segment::LeftHand | Segment::RightHand => {
                // The hand is flat in the frontal plane, because the palms face that way in the model's H-pose.
                let half_breadth = self.breadth(Breadth::Hand) * half;
                Form::Down(Solid::SemiEllipsoid {
                    semi_axes: [half_breadth, half_breadth * T::of(HAND_THICKNESS), length],
                })
            }
            Segment::LeftThigh | Segment::RightThigh => Form::Down(Solid::cone(
                radius(Girth::Thigh),
                radius(Girth::Knee),
                length,
            )),
            Segment::LeftShank | Segment::RightShank => Form::Down(Solid::cone(
                radius(Girth::Calf),
                radius(Girth::Ankle),
                length,
            )),
            Segment::LeftFoot | Segment::RightFoot => {
                let half_height = self.height * T::of(ANKLE_HEIGHT) * half;
                let half_breadth = self.breadth(Breadth::Foot) * half;
                Form::Foot(Solid::TruncatedEllipticCone {
                    base: [half_breadth, half_height],
                    top: [half_breadth, half_height * T::of(TOE_HEIGHT)],
                    length,
                })
            }
        }
    }
}

fn sum<T: Real>(lengths: [T; 2]) -> T {
    lengths[0] + lengths[1]
}

#[cfg(test)]
mod tests;
