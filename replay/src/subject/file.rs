//! The tables of a `subject.toml`, as written in the file.

use std::collections::BTreeMap;
use std::path::PathBuf;

use bodyflight_core::aerodynamics::{BELLY_TURN_DAMPING, Coefficients, PAPER_COEFFICIENTS};
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SubjectFile {
    pub(super) height_m: f64,
    pub(super) mass_kg: f64,
    pub(super) sex: SexName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) moment_arm: Option<MomentArmChoice>,
    #[serde(default, skip_serializing_if = "is_paper")]
    pub(super) aerodynamics: LoadModelName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) segments: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) girths: BTreeMap<String, f64>,
    #[serde(default)]
    pub(super) gear: GearTable,
    #[serde(default)]
    pub(super) coefficients: CoefficientTable,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum LoadModelName {
    #[default]
    Paper,
    FreeFly,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "the signature that serde asks for"
)]
fn is_paper(name: &LoadModelName) -> bool {
    *name == LoadModelName::Paper
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum SexName {
    Male,
    Female,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"width\", \"length\" or a share of the segment's length"
)]
pub(super) enum MomentArmChoice {
    Named(MomentArmName),
    /// Fraction of the segment's length.
    Share(f64),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum MomentArmName {
    Width,
    Length,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct GearTable {
    pub(super) helmet: bool,
    pub(super) shoes: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) shoe_size_eu: Option<f64>,
    pub(super) rig_kg: f64,
    pub(super) weight_belt_kg: f64,
    pub(super) suit: SuitName,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum SuitName {
    Tight,
    Standard,
    Rw,
}

impl Default for GearTable {
    fn default() -> Self {
        Self {
            helmet: true,
            shoes: true,
            shoe_size_eu: None,
            rig_kg: 0.0,
            weight_belt_kg: 0.0,
            suit: SuitName::Standard,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CoefficientTable {
    pub(super) cl: f64,
    pub(super) cd: f64,
    pub(super) cm: f64,
    /// In the order of [`AxisCoefficients`]: pitch, yaw, roll.
    pub(super) damp: [f64; 3],
    pub(super) f_arch: ArchChoice,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) segment: BTreeMap<String, SegmentCoefficients>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected \"posture\" or a number")]
pub(super) enum ArchChoice {
    Fixed(f64),
    Named(ArchName),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum ArchName {
    Posture,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SegmentCoefficients {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cl: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cd: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cm: Option<f64>,
}

impl Default for CoefficientTable {
    fn default() -> Self {
        let Coefficients { drag, lift, moment } = PAPER_COEFFICIENTS;
        Self {
            cl: lift,
            cd: drag,
            cm: moment,
            damp: BELLY_TURN_DAMPING.to_array(),
            f_arch: ArchChoice::Named(ArchName::Posture),
            segment: BTreeMap::new(),
        }
    }
}
