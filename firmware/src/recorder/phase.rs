//! Detects the phase of a jump from the vertical velocity alone: the measured one or that of a barometer.

/// Part of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phase {
    /// Unknown, because no vertical velocity was ever available.
    #[default]
    Unknown,
    /// On the ground, or in level flight.
    Ground,
    /// Climbing in the aircraft.
    Climb,
    /// In free fall, until the canopy is open.
    Fall,
    /// Under canopy.
    Canopy,
}

/// A transition: the phases before and after, the range of mean vertical velocity that triggers it (m/s, up), and for
/// how long (s).
struct Change(Phase, Phase, f32, f32, f32);

/// All transitions. Aircraft climb at 3 to 15 m/s, and dive at up to 25 m/s only with nobody in the door. A fall
/// exceeds 10 m/s within 1 s, and a canopy never stays above that speed.
const CHANGES: [Change; 8] = [
    Change(Phase::Unknown, Phase::Ground, -1e9, 1e9, 0.0),
    Change(Phase::Ground, Phase::Fall, -1e9, -12.0, 1.0),
    Change(Phase::Ground, Phase::Climb, 1.5, 1e9, 20.0),
    Change(Phase::Climb, Phase::Fall, -1e9, -12.0, 1.0),
    Change(Phase::Climb, Phase::Ground, -0.5, 0.5, 300.0),
    Change(Phase::Fall, Phase::Canopy, -12.0, 1e9, 3.0),
    Change(Phase::Canopy, Phase::Fall, -1e9, -30.0, 3.0),
    Change(Phase::Canopy, Phase::Ground, -1.0, 1.0, 10.0),
];

/// Time over which the vertical velocity is averaged (s).
const MEMORY: f32 = 0.5;

/// Upper limit of the time step between samples (s).
const LONGEST_STEP: f32 = 1.0;

/// Shortest time over which a barometer's height is differentiated (s): a pascal is 8 cm near the ground.
const CLIMB_TIME: f32 = 0.5;

/// Age (us) beyond which a barometer's vertical velocity is not used.
const OLDEST_CLIMB: u64 = 3_000_000;

/// Tracks the phase of a jump.
#[derive(Debug, Clone, Copy, Default)]
pub struct Watch {
    /// Time (us) and height (m) from which the barometer's next vertical velocity is taken.
    height: Option<(u64, f32)>,
    /// Its vertical velocity (m/s, up) and when it was taken (us).
    climb: Option<(u64, f32)>,
    phase: Phase,
    /// Mean vertical velocity (m/s, up).
    mean: Option<f32>,
    /// Time for which the condition of each transition has held (s).
    due: [f32; CHANGES.len()],
    /// Time of the last sample (us).
    last: Option<u64>,
}

impl Watch {
    /// Adds the height of a barometer (m) at `time` (us).
    pub fn see_height(&mut self, time: u64, height: Option<f32>) {
        let Some(height) = height else {
            return;
        };
        let Some((before, from)) = self.height.filter(|(before, _)| *before <= time) else {
            self.height = Some((time, height));
            return;
        };
        let elapsed = u32::try_from(time - before).unwrap_or(u32::MAX) as f32 * 1e-6;
        if elapsed >= CLIMB_TIME {
            self.climb = Some((time, (height - from) / elapsed));
            self.height = Some((time, height));
        }
    }

    /// The barometer's vertical velocity (m/s, up), if it is recent.
    fn climb(&self, time: u64) -> Option<f32> {
        let (taken, climb) = self.climb?;
        (time.saturating_sub(taken) <= OLDEST_CLIMB).then_some(climb)
    }

    /// Updates with a sample at `time` (us) and its vertical velocity (m/s, up), `None` if unknown. Returns the phase.
    pub fn update(&mut self, time: u64, velocity_up: Option<f32>) -> Phase {
        let elapsed = time.saturating_sub(self.last.unwrap_or(time));
        // Exact: integers below 1e6 fit the mantissa.
        let step = (u32::try_from(elapsed).unwrap_or(u32::MAX) as f32 * 1e-6).min(LONGEST_STEP);
        self.last = Some(time);
        let Some(velocity) = velocity_up.or(self.climb(time)) else {
            return self.phase;
        };
        let mean = self.mean.unwrap_or(velocity);
        let mean = mean + (velocity - mean) * step / (MEMORY + step);
        self.mean = Some(mean);
        for (Change(from, to, low, high, lasting), due) in CHANGES.iter().zip(&mut self.due) {
            if *from != self.phase || !(*low..=*high).contains(&mean) {
                *due = 0.0;
                continue;
            }
            *due += step;
            if *due >= *lasting {
                self.phase = *to;
                self.due = [0.0; CHANGES.len()];
                break;
            }
        }
        self.phase
    }

    /// The current phase.
    pub const fn phase(&self) -> Phase {
        self.phase
    }
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]
mod tests {
    use std::vec::Vec;

    use super::*;

    /// Phases of a flight given as pieces of constant vertical velocity and duration (s). Returns each phase with its
    /// start time (s).
    fn phases(pieces: &[(f32, f32)]) -> Vec<(Phase, f32)> {
        let mut watch = Watch::default();
        let (mut time, mut seen) = (0_u64, Vec::new());
        let mut velocity = 0.0_f32;
        for &(target, seconds) in pieces {
            for _ in 0..(seconds * 240.0) as u32 {
                // Limits acceleration to that of a canopy opening.
                velocity += (target - velocity).clamp(-9.8 / 240.0, 30.0 / 240.0);
                let phase = watch.update(time, Some(velocity));
                if seen.last().is_none_or(|(last, _)| *last != phase) {
                    seen.push((phase, time as f32 * 1e-6));
                }
                time += 4167;
            }
        }
        seen
    }

    #[test]
    fn a_jump_is_climb_fall_canopy_and_ground() {
        let seen = phases(&[
            (0.0, 30.0),
            (6.0, 600.0),
            (0.0, 60.0),
            (-53.0, 60.0),
            (-5.0, 180.0),
            (0.0, 60.0),
        ]);
        let order: Vec<_> = seen.iter().map(|(phase, _)| *phase).collect();
        assert_eq!(
            order,
            [
                Phase::Ground,
                Phase::Climb,
                Phase::Fall,
                Phase::Canopy,
                Phase::Ground
            ]
        );
        let exit = 690.0;
        let fall = seen[2].1 - exit;
        assert!((1.0..4.0).contains(&fall), "told {fall} s after the exit");
        let landing = seen[4].1 - (exit + 60.0 + 180.0);
        assert!(
            (10.0..13.0).contains(&landing),
            "told {landing} s after the landing"
        );
    }

    #[test]
    fn a_descending_aircraft_and_an_elevator_are_not_a_fall() {
        for pieces in [[(6.0, 600.0), (-8.0, 300.0)], [(2.0, 15.0), (-2.0, 15.0)]] {
            let seen = phases(&pieces);
            assert!(
                seen.iter().all(|(phase, _)| *phase != Phase::Fall),
                "{seen:?}"
            );
        }
    }

    /// The same jump with nothing but a barometer at 50 Hz with 2 Pa of noise.
    #[test]
    fn a_barometer_is_enough() {
        let (mut watch, mut time, mut height) = (Watch::default(), 0_u64, 0.0_f32);
        let (mut seen, mut noise) = (Vec::new(), 1_u32);
        for (speed, seconds) in [
            (0.0, 30),
            (6.0, 600),
            (0.0, 60),
            (-53.0, 60),
            (-5.0, 80),
            (0.0, 60),
        ] {
            for _ in 0..seconds * 50 {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                height += speed / 50.0;
                let read = height + (noise >> 16) as f32 / 65_536.0 * 0.34 - 0.17;
                watch.see_height(time, Some(read));
                let phase = watch.update(time, None);
                if seen.last() != Some(&phase) {
                    seen.push(phase);
                }
                time += 20_000;
            }
        }
        let jump = [
            Phase::Unknown,
            Phase::Ground,
            Phase::Climb,
            Phase::Fall,
            Phase::Canopy,
            Phase::Ground,
        ];
        assert_eq!(seen, jump);
    }

    #[test]
    fn without_vertical_velocity_the_phase_is_unknown() {
        let mut watch = Watch::default();
        for k in 0..1000 {
            assert_eq!(watch.update(k * 4167, None), Phase::Unknown);
        }
    }
}
