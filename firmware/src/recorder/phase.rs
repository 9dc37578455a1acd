//! Detects the phase of a jump from the vertical velocity, measured or that of a barometer; without one, from the load
//! that an accelerometer feels, and from rest.
//!
//! The limits of load were found in 95 real jumps with an accelerometer (short delays, one person): the load falls below
//! 0.75 for a second at 90 of 95 exits and at 2 other moments before one, and exceeds 1.4 for 2 s at 95 of 95 openings
//! and once before one. An exit that is missed costs nothing in the first jump after a start, because the phase is
//! unknown then.

/// Part of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phase {
    /// Unknown, because no vertical velocity was available since the start.
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

/// What a transition looks at. All but the first count only while there is no vertical velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sign {
    /// Mean vertical velocity (m/s, up).
    Climb,
    /// Mean load: the specific force in units of gravity.
    Load,
    /// Mean angular velocity (rad/s).
    Turn,
    /// The same, while there is no accelerometer either.
    TurnAlone,
    /// Nothing: time passes.
    Time,
}

/// Number of signs.
const SIGNS: usize = 5;

/// A transition: the phases before and after, the sign, its range, and for how long (s) it must lie there.
struct Change(Phase, Phase, Sign, f32, f32, f32);

/// Any value.
const ANY: [f32; 2] = [-1e9, 1e9];

/// All transitions. Aircraft climb at 3 to 15 m/s, and dive at up to 25 m/s only with nobody in the door. A fall
/// exceeds 10 m/s within 1 s, and a canopy never stays above that speed. No fall lasts ten minutes, and hardly a canopy.
const CHANGES: [Change; 19] = {
    use Phase::{Canopy, Climb, Fall, Ground, Unknown};
    [
        Change(Unknown, Ground, Sign::Climb, ANY[0], ANY[1], 0.0),
        Change(Ground, Fall, Sign::Climb, ANY[0], -12.0, 1.0),
        Change(Ground, Climb, Sign::Climb, 1.5, ANY[1], 20.0),
        Change(Climb, Fall, Sign::Climb, ANY[0], -12.0, 1.0),
        Change(Climb, Ground, Sign::Climb, -0.5, 0.5, 300.0),
        Change(Fall, Canopy, Sign::Climb, -12.0, ANY[1], 3.0),
        Change(Canopy, Fall, Sign::Climb, ANY[0], -30.0, 3.0),
        Change(Canopy, Ground, Sign::Climb, -1.0, 1.0, 10.0),
        // An exit, from wherever it is seen.
        Change(Unknown, Fall, Sign::Load, ANY[0], 0.75, 1.0),
        Change(Ground, Fall, Sign::Load, ANY[0], 0.75, 1.0),
        Change(Climb, Fall, Sign::Load, ANY[0], 0.75, 1.0),
        // An opening. Without an exit before it, it may be something else: the next exit counts again.
        Change(Fall, Canopy, Sign::Load, 1.4, ANY[1], 2.0),
        Change(Unknown, Ground, Sign::Load, 1.4, ANY[1], 2.0),
        // Rest.
        Change(Unknown, Ground, Sign::Turn, ANY[0], 0.1, 60.0),
        Change(Fall, Ground, Sign::Turn, ANY[0], 0.1, 60.0),
        Change(Canopy, Ground, Sign::Turn, ANY[0], 0.1, 60.0),
        Change(Ground, Unknown, Sign::TurnAlone, 0.5, ANY[1], 2.0),
        // What was missed.
        Change(Fall, Canopy, Sign::Time, ANY[0], ANY[1], 600.0),
        Change(Canopy, Ground, Sign::Time, ANY[0], ANY[1], 600.0),
    ]
};

/// Time over which signs are averaged (s).
const MEMORY: f32 = 0.5;

/// Upper limit of the time step between samples (s).
const LONGEST_STEP: f32 = 1.0;

/// Shortest time over which a barometer's height is differentiated (s): a pascal is 8 cm near the ground.
const CLIMB_TIME: f32 = 0.5;

/// Age (us) beyond which a measurement is not used: a receiver gives a velocity once a second or more often.
const OLDEST: u64 = 3_000_000;

/// Time for which an unknown phase is no flight yet (s): a receiver may only have to answer.
const PATIENCE: f32 = 3.0;

/// A value and when it was measured (us).
type Measured = Option<(u64, f32)>;

/// Tracks the phase of a jump.
#[derive(Debug, Clone, Copy, Default)]
pub struct Watch {
    /// Height (m) from which the barometer's next vertical velocity is taken.
    height: Measured,
    /// Vertical velocities (m/s, up): measured, and of the barometer.
    velocity: Measured,
    climb: Measured,
    /// Load of the accelerometer, in units of gravity.
    load: Measured,
    phase: Phase,
    /// Mean of each sign.
    means: [Option<f32>; SIGNS],
    /// Time for which the condition of each transition has held (s).
    due: [f32; CHANGES.len()],
    /// Time for which the phase has been unknown (s).
    unknown: f32,
    /// Time of the last sample (us).
    last: Option<u64>,
}

/// The value, if it is recent.
fn recent(measured: Measured, time: u64) -> Option<f32> {
    let (taken, value) = measured?;
    (time.saturating_sub(taken) <= OLDEST).then_some(value)
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

    /// Adds the load of an accelerometer, its specific force in units of gravity, at `time` (us).
    pub fn see_load(&mut self, time: u64, load: Option<f32>) {
        self.load = load.map(|load| (time, load)).or(self.load);
    }

    /// Updates with a sample at `time` (us), its vertical velocity (m/s, up) and its angular velocity (rad/s), each
    /// `None` if unknown. Returns the phase.
    pub fn update(&mut self, time: u64, velocity_up: Option<f32>, turn: Option<f32>) -> Phase {
        let elapsed = time.saturating_sub(self.last.unwrap_or(time));
        // Exact: integers below 1e6 fit the mantissa.
        let step = (u32::try_from(elapsed).unwrap_or(u32::MAX) as f32 * 1e-6).min(LONGEST_STEP);
        self.last = Some(time);
        self.velocity = velocity_up.map(|up| (time, up)).or(self.velocity);
        let climb = recent(self.velocity, time).or(recent(self.climb, time));
        let load = recent(self.load, time);
        let blind = |sign: Option<f32>| sign.filter(|_| climb.is_none());
        let signs = [
            climb,
            blind(load),
            blind(turn),
            blind(turn).filter(|_| load.is_none()),
            blind(Some(0.0)),
        ];
        for (mean, sign) in self.means.iter_mut().zip(signs) {
            *mean = sign.map(|value| {
                let mean = mean.unwrap_or(value);
                mean + (value - mean) * step / (MEMORY + step)
            });
        }
        self.unknown += step;
        for (Change(from, to, sign, low, high, lasting), due) in CHANGES.iter().zip(&mut self.due) {
            let mean = self.means.get(*sign as usize).copied().flatten();
            if *from != self.phase || !mean.is_some_and(|mean| (*low..=*high).contains(&mean)) {
                *due = 0.0;
                continue;
            }
            *due += step;
            if *due >= *lasting {
                self.phase = *to;
                self.due = [0.0; CHANGES.len()];
                self.unknown = 0.0;
                break;
            }
        }
        self.phase
    }

    /// The current phase.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether the phase has been unknown for so long that it may be a flight.
    pub fn is_lastingly_unknown(&self) -> bool {
        self.phase == Phase::Unknown && self.unknown >= PATIENCE
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
                let phase = watch.update(time, Some(velocity), None);
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
                let phase = watch.update(time, None, None);
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

    /// Phases of a jump without vertical velocity, given as pieces of load, angular velocity (rad/s) and duration (s),
    /// each with the time at which it begins (s).
    fn felt(pieces: &[(Option<f32>, f32, f32)]) -> Vec<(Phase, f32)> {
        let (mut watch, mut time, mut seen) = (Watch::default(), 0_u64, Vec::new());
        for &(load, turn, seconds) in pieces {
            for _ in 0..(seconds * 100.0) as u32 {
                watch.see_load(time, load);
                let phase = watch.update(time, None, Some(turn));
                if seen.last().is_none_or(|(last, _)| *last != phase) {
                    seen.push((phase, time as f32 * 1e-6));
                }
                time += 10_000;
            }
        }
        seen
    }

    /// Loads of a real jump with a short delay, and of a second one from the same start.
    #[test]
    fn an_accelerometer_tells_exit_and_opening() {
        let jump = [
            (Some(1.0), 0.5, 800.0),
            (Some(0.6), 0.6, 5.0),
            (Some(1.0), 0.8, 30.0),
            (Some(1.9), 1.5, 5.0),
            (Some(1.0), 0.5, 200.0),
            (Some(1.0), 0.01, 90.0),
        ];
        let seen = felt(&[jump, jump].concat());
        let phases: Vec<_> = seen.iter().map(|(phase, _)| *phase).collect();
        let of_one = [Phase::Fall, Phase::Canopy, Phase::Ground];
        assert_eq!(phases, [&[Phase::Unknown][..], &of_one, &of_one].concat());
        let times: Vec<_> = seen.iter().map(|(_, time)| *time).collect();
        assert!((801.0..803.0).contains(&times[1]), "{seen:?}");
        assert!((836.0..839.0).contains(&times[2]), "{seen:?}");
        assert!((1090.0..1110.0).contains(&times[3]), "{seen:?}");
    }

    /// An opening before any exit ends the flight of an unknown phase, which was written.
    #[test]
    fn a_missed_exit_costs_nothing_in_the_first_jump() {
        let seen = felt(&[(Some(0.95), 0.5, 300.0), (Some(1.9), 1.0, 5.0)]);
        let phases: Vec<_> = seen.iter().map(|(phase, _)| *phase).collect();
        assert_eq!(phases, [Phase::Unknown, Phase::Ground]);
        assert!(seen[1].1 > 302.0, "{seen:?}");
    }

    #[test]
    fn a_gyroscope_alone_tells_rest() {
        let seen = felt(&[(None, 0.5, 100.0), (None, 0.02, 100.0), (None, 1.0, 10.0)]);
        let phases: Vec<_> = seen.iter().map(|(phase, _)| *phase).collect();
        assert_eq!(phases, [Phase::Unknown, Phase::Ground, Phase::Unknown]);
        assert!((160.0..165.0).contains(&seen[1].1), "{seen:?}");
    }

    /// A body that never rests: what was missed is over after the longest fall and canopy.
    #[test]
    fn a_flight_without_an_opening_or_a_landing_ends() {
        let seen = felt(&[(Some(0.5), 0.5, 60.0), (Some(1.0), 0.5, 1500.0)]);
        let phases: Vec<_> = seen.iter().map(|(phase, _)| *phase).collect();
        let all = [Phase::Unknown, Phase::Fall, Phase::Canopy, Phase::Ground];
        assert_eq!(phases, all);
        assert!((1200.0..1210.0).contains(&seen[3].1), "{seen:?}");
    }

    /// A receiver with five solutions a second is as good as one velocity with each sample.
    #[test]
    fn solutions_between_samples_count_as_long_as_they_are_recent() {
        let mut watch = Watch::default();
        let mut fall = None;
        for k in 0..1500_u64 {
            let time = k * 10_000;
            let up = if k < 500 { 0.0 } else { -30.0 };
            let phase = watch.update(time, (k % 20 == 0).then_some(up), None);
            if phase == Phase::Fall && fall.is_none() {
                fall = Some(k);
            }
        }
        assert!((600..680).contains(&fall.unwrap()), "{fall:?}");
    }
}
