//! Patterns of the unit's status light, in steps of [`STEP_MS`].
//!
//! | light | meaning |
//! |---|---|
//! | a short flash every 2 s | waiting for a host or a sensor |
//! | two short flashes every 2 s | the same, and the last reset was caused by a fault |
//! | three short flashes every 2 s | the same, and the battery is nearly empty |
//! | slow, half on and half off | estimates are settling |
//! | on | estimates agree with the measurements |
//! | on with short gaps | the same, and measurements were rejected |
//! | two times a second | estimates are doubtful or inconsistent with the measurements |
//! | on, but for half a second every 2 s | estimates agree, but a sensor on a limb is missing, has failed or has slipped |
//! | half a second every 2 s | sensors on the limbs wait for the poses of a calibration |
//! | twice a fifth of a second every 2 s | they are calibrated, and wait for the person to stand upright and still |
//! | five times a second | the reconstruction is lost, the filter has failed, or a calibration was refused |

use bodyflight_core::link::{CalibrationStage, CalibrationVerdict, EstimateFlags};

/// Duration of one step (ms).
pub const STEP_MS: u64 = 100;

/// Length of a pattern (steps).
pub(crate) const STEPS: u32 = 20;

/// Steps without an estimate after which the unit counts as waiting.
const SILENCE: u32 = 20;

/// Steps for which a rejected measurement is shown.
const REMEMBERED: u32 = 20;

/// The pattern for each flag; the first flag that is set decides. Each bit of a pattern is a step, lowest bit first,
/// and the light is on where the bit is set.
const PATTERNS: [(EstimateFlags, u32); 7] = [
    (EstimateFlags::FAULT, FAST),
    (EstimateFlags::LOST, FAST),
    (EstimateFlags::INCONSISTENT, TWICE),
    (EstimateFlags::DOUBTFUL, TWICE),
    (EstimateFlags::SETTLING, SLOW),
    (EstimateFlags::LIMB, LIMB),
    (EstimateFlags::VALID, ON),
];

pub(crate) const FLASH: u32 = 0b1;
const TWO_FLASHES: u32 = 0b1001;
const THREE_FLASHES: u32 = 0b100_1001;
pub(crate) const SLOW: u32 = 0b0000_0000_0011_1111_1111;
const ON: u32 = 0b1111_1111_1111_1111_1111;
const GAPS: u32 = 0b1111_0111_1111_1111_0111;
pub(crate) const TWICE: u32 = 0b0001_1000_1100_0110_0011;
const LIMB: u32 = 0b0000_0111_1111_1111_1111;
const POSES: u32 = 0b1_1111;
const UPRIGHT: u32 = 0b11_0011;
pub(crate) const FAST: u32 = 0b0101_0101_0101_0101_0101;

/// Below the first voltage (mV) a lithium cell has minutes left; above the second it counts as charged again.
const EMPTY: u16 = 3500;
const CHARGED: u16 = 3600;

/// Tracks the state of the unit and controls the light.
#[derive(Debug, Clone, Copy)]
pub struct Light {
    flags: EstimateFlags,
    /// Steps since the last estimate, and since the last rejected measurement.
    silent: u32,
    taken_in: u32,
    /// Whether the last start came after a fault.
    after_fault: bool,
    battery_low: bool,
    /// Pattern of sensors on the limbs that do not give postures yet.
    limbs: Option<u32>,
    step: u32,
}

impl Light {
    /// Creates a light that shows waiting.
    pub const fn new(after_fault: bool) -> Self {
        Self {
            flags: EstimateFlags::empty(),
            silent: SILENCE,
            taken_in: REMEMBERED,
            after_fault,
            battery_low: false,
            limbs: None,
            step: 0,
        }
    }

    /// Updates with the flags of an estimate.
    pub fn see(&mut self, flags: EstimateFlags) {
        self.flags = flags;
        self.silent = 0;
        if flags.contains(EstimateFlags::NOT_TAKEN_IN) {
            self.taken_in = 0;
        }
    }

    /// Updates with the voltage of the battery (mV), 0 if not measured.
    pub fn see_battery(&mut self, voltage: u16) {
        let limit = if self.battery_low { CHARGED } else { EMPTY };
        self.battery_low = voltage > 0 && voltage < limit;
    }

    /// Updates with the state of sensors on the limbs.
    pub const fn see_calibration(&mut self, stage: CalibrationStage, verdict: CalibrationVerdict) {
        self.limbs = match (stage, verdict) {
            (CalibrationStage::Absent | CalibrationStage::Worn, _) => None,
            (CalibrationStage::Waiting, _) => Some(UPRIGHT),
            (CalibrationStage::Poses, CalibrationVerdict::Nothing | CalibrationVerdict::Good) => {
                Some(POSES)
            }
            (CalibrationStage::Poses, _) => Some(FAST),
        };
    }

    /// Advances by a step; returns whether the light is on.
    pub fn advance(&mut self) -> bool {
        let pattern = self.pattern();
        let is_on = pattern >> self.step & 1 != 0;
        self.step = (self.step + 1) % STEPS;
        self.silent = self.silent.saturating_add(1);
        self.taken_in = self.taken_in.saturating_add(1);
        is_on
    }

    fn pattern(&self) -> u32 {
        let is_silent = self.silent >= SILENCE;
        // Without postures good estimates are not what was configured.
        let is_bad = !is_silent
            && self
                .flags
                .intersects(EstimateFlags::FAULT | EstimateFlags::LOST);
        if let Some(pattern) = self.limbs.filter(|_| !is_bad && !self.battery_low) {
            return pattern;
        }
        if is_silent {
            return match (self.battery_low, self.after_fault) {
                (true, _) => THREE_FLASHES,
                (false, true) => TWO_FLASHES,
                (false, false) => FLASH,
            };
        }
        let set = PATTERNS.iter().find(|(flag, _)| self.flags.contains(*flag));
        match set {
            Some((_, ON)) if self.taken_in < REMEMBERED => GAPS,
            Some((_, pattern)) => *pattern,
            None => SLOW,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::string::String;

    use super::*;

    /// Two seconds of light, `#` for on, with a constant stream of estimates with these flags.
    fn shown(light: &mut Light, flags: Option<EstimateFlags>) -> String {
        (0..STEPS)
            .map(|_| {
                if let Some(flags) = flags {
                    light.see(flags);
                }
                if light.advance() { '#' } else { '.' }
            })
            .collect()
    }

    #[test]
    fn each_state_has_its_own_pattern() {
        let valid = EstimateFlags::VALID;
        let mut seen = std::collections::BTreeSet::new();
        for (flags, expected) in [
            (valid, "####################"),
            (valid | EstimateFlags::SETTLING, "##########.........."),
            (valid | EstimateFlags::NOT_TAKEN_IN, "###.###########.####"),
            (valid | EstimateFlags::INCONSISTENT, "##...##...##...##..."),
            (valid | EstimateFlags::LOST, "#.#.#.#.#.#.#.#.#.#."),
            (valid | EstimateFlags::LIMB, "###############....."),
        ] {
            let found = shown(&mut Light::new(false), Some(flags));
            assert_eq!(found, expected, "{flags:?}");
            assert!(seen.insert(found));
        }
        assert!(seen.insert(shown(&mut Light::new(false), None)));
        assert!(seen.insert(shown(&mut Light::new(true), None)));
        let mut light = Light::new(true);
        light.see_battery(3400);
        assert!(seen.insert(shown(&mut light, None)));
        light.see_battery(3700);
        for (stage, expected) in [
            (CalibrationStage::Poses, "#####..............."),
            (CalibrationStage::Waiting, "##..##.............."),
        ] {
            light.see_calibration(stage, CalibrationVerdict::Good);
            assert_eq!(shown(&mut light, Some(valid)), expected);
            assert!(seen.insert(shown(&mut light, None)));
        }
        light.see_calibration(CalibrationStage::Poses, CalibrationVerdict::NoHeading);
        assert_eq!(shown(&mut light, None), "#.#.#.#.#.#.#.#.#.#.");
        light.see_calibration(CalibrationStage::Worn, CalibrationVerdict::Good);
        assert_eq!(shown(&mut light, Some(valid)), "####################");
    }

    #[test]
    fn the_worst_state_is_shown_and_a_lost_host_is_noticed() {
        let mut light = Light::new(false);
        let worst = EstimateFlags::VALID | EstimateFlags::SETTLING | EstimateFlags::LOST;
        assert_eq!(shown(&mut light, Some(worst)), "#.#.#.#.#.#.#.#.#.#.");
        shown(&mut light, None);
        assert_eq!(shown(&mut light, None), "#...................");
    }

    #[test]
    fn a_nearly_empty_battery_is_flagged_until_it_is_charged() {
        let mut light = Light::new(false);
        let mut waiting = |voltage| {
            light.see_battery(voltage);
            shown(&mut light, None)
        };
        let [full, low] = ["#...................", "#..#..#............."];
        for (voltage, expected) in [
            (0, full),
            (3510, full),
            (3490, low),
            (3590, low),
            (3610, full),
        ] {
            assert_eq!(waiting(voltage), expected, "{voltage} mV");
        }
    }

    #[test]
    fn a_rejected_measurement_is_shown_for_two_seconds() {
        let mut light = Light::new(false);
        light.see(EstimateFlags::VALID | EstimateFlags::NOT_TAKEN_IN);
        assert_eq!(
            shown(&mut light, Some(EstimateFlags::VALID)),
            "###.###########.####"
        );
        assert_eq!(
            shown(&mut light, Some(EstimateFlags::VALID)),
            "####################"
        );
    }
}
