//! A unit that is built without sensors on the limbs, which need more memory than the smallest board has.

use bodyflight_core::link::{
    Calibration, CalibrationStage, CalibrationVerdict, ChainReport, LimbSensor, LimbTable,
    SegmentErrors,
};
use bodyflight_core::{Body, Posture, Segment};
use nalgebra::Vector3;

/// Whether this build has sensors on the limbs.
pub const IS_BUILT_IN: bool = false;

/// What the node on the pelvis measured, in body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PelvisReading {
    /// Number of the cycle.
    pub cycle: u16,
    /// Time in ticks of 0.1 ms; wraps.
    pub fine_time: u32,
    /// Angular velocity (rad/s).
    pub angular_velocity: Vector3<f32>,
    /// Specific force (m/s2).
    pub specific_force: Vector3<f32>,
}

/// No sensors on the limbs: nothing that is asked of them has an effect.
#[derive(Debug, Default)]
pub struct Limbs {
    table: LimbTable,
}

#[expect(missing_docs, reason = "as in a build with sensors on the limbs")]
impl Limbs {
    pub const fn new() -> Self {
        Self {
            table: LimbTable::new(),
        }
    }

    pub const fn table(&self) -> &LimbTable {
        &self.table
    }

    pub const fn set_table(&mut self, _: &LimbTable) {}

    pub const fn insert(&mut self, _: &LimbSensor) {}

    pub const fn calibrate(&mut self) {}

    pub const fn next(&mut self, _: &mut &[u8], _: Option<&Body<f32>>) -> Option<PelvisReading> {
        None
    }

    pub const fn posture(&self) -> Option<Posture<f32>> {
        None
    }

    pub const fn new_errors(&mut self) -> Option<SegmentErrors> {
        None
    }

    pub const fn calibration(&self) -> Calibration {
        Calibration {
            stage: CalibrationStage::Absent,
            verdict: CalibrationVerdict::Nothing,
            segment: Segment::Pelvis,
            rests: 0,
            heard: 0,
            turned: 0,
        }
    }

    pub const fn news(&mut self) -> Option<Calibration> {
        None
    }

    pub const fn is_to_store(&mut self) -> bool {
        false
    }

    pub const fn report(&self) -> Option<ChainReport> {
        None
    }
}
