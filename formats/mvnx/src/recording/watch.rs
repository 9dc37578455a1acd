//! Plausibility checks on a recording while it is read, frame by frame, in constant memory.
//!
//! Attitudes and angular velocities are redundant, and so are positions and velocities. If they disagree, a unit, an
//! order or an axis differs from the format, and a simulation would be silently wrong.

use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{UnitQuaternion, Vector3};

use super::agreement::Agreement;
use super::anatomy::Anatomy;
use super::bridge::BRIDGE_LIMIT;
use super::clock::Clock;
use super::frame::FlightFrame;
use super::limbs::{Limbs, Moving, Snapshot};
use super::paths::Paths;
use super::plausibility::{Attitudes, OpenJoint, Plausibility, changes};
use super::spins::Spins;
use super::warning::Warning;
use crate::xsens;

/// Shortest flight worth judging (s).
const SHORTEST: f64 = 2.0;

/// Time over which rotations are compared (s), long enough that the noise of single attitudes is small in comparison,
/// and the fewest such comparisons that are judged.
const TURN: f64 = 0.2;
const LEAST_TURNS: u64 = 4;

/// Rotation (rad) that ends a comparison before that time: in a somersault the axis moves, and the axis of a half turn
/// is ambiguous.
const FAR: f64 = 1.0;

/// Smallest angular velocity (rad/s, root mean square) that the attitudes show clearly.
const TURNS: f64 = 0.2;

/// Angular velocity of attitudes and of rates (rad/s, root mean square) that no bias explains.
const TURNS_FAST: f64 = 1.0;

/// Smallest correlation of two angular velocities that differ only in their unit.
const SAME: f64 = 0.7;

/// Correlation above which two angular velocities are taken to be the same except for noise.
const ALIKE: f64 = 0.95;

/// Ratios of two angular velocities that are explained by degrees in place of radians (57.3), with a margin for noise.
const DEGREES: core::ops::Range<f64> = 40.0..75.0;

/// Relative difference of two angular velocities that are the same except for noise: beyond it, unit or rate differ.
const RATES_APART: f64 = 0.3;

/// Correlation of two angular velocities that are the same but for rounding, their largest relative difference then, and the
/// angular velocity (rad/s) from which on it is a jump that would outweigh all else.
const EVEN: f64 = 0.995;
const EVEN_APART: f64 = 0.05;
const JUMPS: f64 = 20.0;
/// Shortest recording whose postures and rates are judged frame by frame (s).
pub(super) const JUDGED: f64 = 0.5;

/// What is said if velocities and angular velocities are both opposite to the motion. The two explanations give the same
/// numbers: gravity does not tell the direction of time.
const BACKWARDS: &str = "velocities and angular velocities are opposite to the motion of positions and attitudes: the \
    frames run backwards in time, or all velocities have the opposite sign";

/// Rotation since a frame, according to the angular velocities (rad).
#[derive(Debug, Clone, Copy)]
struct Turn {
    begin: f64,
    from: UnitQuaternion<f64>,
    global: Vector3<f64>,
    of_segment: Vector3<f64>,
}

/// Converts a recorded vector to body axes, assuming that it was written in the axes of MVN's pelvis instead of global
/// ones.
fn as_of_pelvis(recorded: &Vector3<f64>) -> Vector3<f64> {
    let xsens_from_pelvis = xsens::xsens_from_segment(Segment::Pelvis);
    xsens_from_pelvis.quaternion().inverse() * recorded
}

/// What has been read so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Watch {
    first: Option<FlightFrame>,
    last: Option<(FlightFrame, Attitudes, SegmentArray<Moving>)>,
    clock: Clock,
    gaps: u64,
    largest_gap: Option<(u64, f64)>,
    /// Angular velocity in global axes, and as if it were in segment axes.
    global: Agreement,
    /// The same without jumps.
    even: Agreement,
    of_segment: Agreement,
    turn: Option<Turn>,
    turns: u64,
    fastest: Option<(u64, f64)>,
    pub(super) spins: Spins,
    paths: Paths,
    anatomy: Anatomy,
    segments: Plausibility,
    limbs: Limbs,
}

impl Watch {
    pub(super) fn new(frame_rate: f64) -> Self {
        Self {
            clock: Clock::new(frame_rate),
            ..Self::default()
        }
    }

    /// Velocities are those of another sensor, which has slow errors of its own.
    pub(super) fn velocities_of_another_sensor(&mut self) {
        self.paths.compare_coarsely();
    }

    /// The air moves at this velocity (m/s, inertial).
    pub(super) fn in_air(&mut self, [.., up]: [f64; 3]) {
        self.paths.in_air(up);
    }

    /// Takes a good frame, its time as written, its joint that closes worst, and how its segments move.
    pub(super) fn see(
        &mut self,
        frame: &FlightFrame,
        written: Option<f64>,
        joint: Option<OpenJoint>,
        moving: &SegmentArray<Moving>,
    ) {
        let attitude = *frame.pelvis.inertial_from_body.quaternion();
        let turned = frame.posture.body_from_segments();
        let here = (frame.index, frame.time);
        self.anatomy.see(here, &frame.posture, &turned);
        let attitudes = turned.map(|_, turned| attitude * turned);
        let last = self.last.replace((*frame, attitudes, *moving));
        let before = (last.as_ref()).map(|(last, turned, _)| (last, changes(turned, &attitudes)));
        let change = before.as_ref().map(|(last, changes)| {
            let moved = frame.pelvis.position.components - last.pelvis.position.components;
            changes.values().copied().fold(moved.amax(), f64::max)
        });
        self.clock.see((frame.index, frame.time), written, change);
        let before = before.as_ref().map(|(last, changes)| (*last, changes));
        self.segments.see(frame, before, joint);
        if let Some((last, turned, moved)) = &last {
            self.compare(last, frame);
            let snapshot = |of: &FlightFrame, attitudes, moving| Snapshot {
                index: of.index,
                time: of.time,
                attitudes,
                moving,
            };
            if (0.0..BRIDGE_LIMIT).contains(&(frame.time - last.time)) {
                self.limbs.see(
                    snapshot(last, turned, moved),
                    snapshot(frame, &attitudes, moving),
                );
            } else {
                self.limbs.interrupt();
            }
        }
        self.first.get_or_insert(*frame);
    }

    fn compare(&mut self, last: &FlightFrame, frame: &FlightFrame) {
        let duration = frame.time - last.time;
        if duration <= 0.0 {
            return;
        }
        if duration > BRIDGE_LIMIT {
            self.gaps += 1;
            if self
                .largest_gap
                .is_none_or(|(_, largest)| duration > largest)
            {
                self.largest_gap = Some((frame.index, duration));
            }
            self.turn = None;
            self.spins.interrupt();
            self.paths.interrupt();
            return;
        }
        let mean = |a: Option<Vector<f64, Inertial>>, b: Option<Vector<f64, Inertial>>| {
            Some((a?.components + b?.components) * 0.5)
        };
        let (before, now) = (&last.pelvis, &frame.pelvis);
        if let (Some(first), Some(second)) = (before.angular_velocity, now.angular_velocity) {
            let from = before.inertial_from_body.quaternion();
            let turn = (now.inertial_from_body.quaternion() * from.inverse()).scaled_axis();
            let rates = [&first.components, &second.components];
            let attitude = now.inertial_from_body.quaternion();
            self.spins.see(frame.time, duration, &turn, rates, attitude);
        }
        if let Some(recorded) = mean(before.angular_velocity, now.angular_velocity) {
            if self
                .fastest
                .is_none_or(|(_, fastest)| recorded.norm() > fastest)
            {
                self.fastest = Some((frame.index, recorded.norm()));
            }
            let from = *before.inertial_from_body.quaternion();
            let turn = self.turn.get_or_insert_with(|| Turn {
                begin: last.time,
                from,
                global: Vector3::zeros(),
                of_segment: Vector3::zeros(),
            });
            turn.global += recorded * duration;
            turn.of_segment += from * as_of_pelvis(&recorded) * duration;
            let time = frame.time - turn.begin;
            let to = now.inertial_from_body.quaternion();
            if time >= TURN || turn.from.angle_to(to) >= FAR {
                let turned: UnitQuaternion<f64> = to * turn.from.inverse();
                let expected = turned.scaled_axis() / time;
                self.global.add(&expected, &(turn.global / time));
                if expected.norm() < JUMPS {
                    self.even.add(&expected, &(turn.global / time));
                }
                self.of_segment.add(&expected, &(turn.of_segment / time));
                self.turns += 1;
                self.turn = None;
            }
        }
        if let (Some(from), Some(to)) = (before.velocity, now.velocity) {
            let moved = now.position.components - before.position.components;
            let velocities = [&from.components, &to.components];
            self.paths.see(frame.time, duration, &moved, velocities);
        }
    }

    /// The implausible findings so far. Postures are judged from this length (s) on.
    pub(super) fn warnings(&self, postures_from_s: f64) -> Vec<Warning> {
        let (Some(first), Some((last, ..))) = (&self.first, &self.last) else {
            return Vec::new();
        };
        let whole = [first.time, last.time];
        let mut warnings = self.of_length(last.index, last.time - first.time);
        let of_clock = self.of_clock(whole);
        let is_clock_wrong = of_clock
            .iter()
            .any(|warning| warning.is_fault && warning.span_s == Some(whole));
        warnings.extend(of_clock);
        let is_backwards = self.is_backwards();
        let (rates, directions) = (self.rates(), self.directions());
        let are_rates_sound = rates.is_none() && directions.is_none();
        if is_backwards {
            warnings.push(Warning::fault(last.index, whole, BACKWARDS.to_owned()));
        } else if let Some((frame, message)) = rates {
            warnings.push(Warning::fault(frame, whole, message));
        } else if let Some((frame, message, is_fault)) = directions {
            warnings.push(Warning {
                is_fault,
                ..Warning::fault(frame, whole, message)
            });
        } else if whole[1] - whole[0] >= JUDGED {
            warnings.extend(self.of_spin(last.index, whole));
        }
        warnings.extend(self.of_path(last.index, whole));
        let contradiction = self.paths.contradiction();
        let sound = [
            are_rates_sound,
            contradiction.is_none() && !self.paths.is_coarse(),
        ];
        if let Some((message, span)) = contradiction.filter(|_| !is_backwards && !is_clock_wrong) {
            warnings.push(Warning::fault(last.index, span.unwrap_or(whole), message));
        }
        if whole[1] - whole[0] >= postures_from_s {
            let (last, travels) = ((last.index, last.time), self.paths.is_far());
            warnings.extend(self.anatomy.warnings(last, travels));
        }
        warnings.extend(self.segments.warnings());
        warnings.extend(self.limbs.warnings((last.index, last.time), sound));
        warnings
    }

    /// What is wrong with the length of the flight (s) up to frame `last`, and its gaps.
    fn of_length(&self, last: u64, duration: f64) -> Vec<Warning> {
        let short = (duration < SHORTEST).then(|| {
            let message = format!(
                "the flight ends after {duration:.2} s; less than {SHORTEST} s is too short to judge"
            );
            Warning::new(last, message)
        });
        let gap = self.largest_gap.map(|(frame, length)| {
            let message = format!(
                "{length:.2} s without frames before it, {} gaps over {BRIDGE_LIMIT} s in all; limbs are assumed to move \
                 evenly across them",
                self.gaps
            );
            Warning::new(frame, message)
        });
        short.into_iter().chain(gap).collect()
    }

    /// What is wrong with the frame times. A clock that is wrong throughout is a fault over the `whole` flight (s).
    fn of_clock(&self, whole: [f64; 2]) -> Vec<Warning> {
        let rates = self.clock.rates(self.paths.scale());
        let rates = rates.map(|(frame, message, is_wrong)| {
            if is_wrong {
                Warning::fault(frame, whole, message)
            } else {
                Warning::new(frame, message)
            }
        });
        let backwards = self.clock.backwards().or_else(|| self.clock.stands());
        let backwards = backwards.map(|(frame, message)| Warning::new(frame, message));
        let repeated = self.clock.repetitions();
        let repeated = repeated.map(|(frame, from, message, is_fault)| Warning {
            is_fault,
            ..Warning::fault(frame, [from, whole[1]], message)
        });
        rates.into_iter().chain(backwards).chain(repeated).collect()
    }

    /// Where attitudes and angular velocities disagree that agree on the whole.
    fn of_spin(&self, last: u64, whole: [f64; 2]) -> Vec<Warning> {
        let parted = self.spins.parted();
        let parted = parted.map(|(message, span)| Warning::fault(last, span, message));
        let empty = self.spins.empty();
        let empty = empty.map(|(message, first)| Warning::fault(last, [first, whole[1]], message));
        let scatters = self.spins.scatters();
        let scatters = scatters.map(|message| Warning::fault(last, whole, message));
        let biased = self.spins.of_gyroscope().filter(|_| empty.is_none());
        let biased = biased.map(|message| Warning::new(last, message));
        let opposite = self.spins.opposite();
        let opposite = opposite.map(|message| Warning::fault(last, whole, message));
        let biased = biased.filter(|_| opposite.is_none());
        // What is wrong is told once.
        let wrong = empty.or(opposite).or(parted);
        wrong.into_iter().chain(biased).chain(scatters).collect()
    }

    /// What no fall of a person does over the `whole` flight (s), up to frame `last`.
    fn of_path(&self, last: u64, whole: [f64; 2]) -> Vec<Warning> {
        let rises = self.paths.rises(whole[1] - whole[0]);
        let rises = rises.map(|message| Warning::fault(last, whole, message));
        let fast = self.paths.too_fast().map(|(message, is_fault)| Warning {
            is_fault,
            ..Warning::fault(last, whole, message)
        });
        let jump = self
            .paths
            .velocity_jump()
            .map(|(message, time, is_fault)| Warning {
                span_s: Some([time, time]),
                is_fault,
                ..Warning::new(last, message)
            });
        rises.into_iter().chain(fast).chain(jump).collect()
    }

    fn is_turning(&self) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "counts of turns")]
        let count = self.turns.max(1) as f64;
        self.turns >= LEAST_TURNS && (self.global.expected / count).sqrt() > TURNS
    }

    /// Whether both kinds of velocity are those of the same motion the other way round. One of them alone would mean
    /// reversed axes or inverse quaternions.
    fn is_backwards(&self) -> bool {
        let spin = &self.global;
        let turns_back = spin.correlation() < -SAME && (spin.scale() + 1.0).abs() < RATES_APART;
        self.is_turning() && turns_back && self.paths.are_opposite()
    }

    /// Angular velocities in the wrong unit.
    fn rates(&self) -> Option<(u64, String)> {
        let (frame, fastest) = self.fastest.filter(|_| self.is_turning())?;
        let (scale, correlation) = (self.global.scale(), self.global.correlation());
        let is_even = self.even.correlation() > EVEN;
        let scale = if is_even { self.even.scale() } else { scale };
        let is_near = if is_even {
            (scale - 1.0).abs() < EVEN_APART
        } else if correlation > ALIKE {
            (scale - 1.0).abs() < RATES_APART
        } else {
            (0.5..2.0).contains(&scale)
        };
        if correlation < SAME || is_near {
            return None;
        }
        let what = if DEGREES.contains(&scale) {
            "they seem to be degrees per second; expected rad/s"
        } else {
            "expected rad/s at the frame rate of the header"
        };
        Some((
            frame,
            format!(
                "the angular velocities, up to {fastest:.1}, are {scale:.2} times those of the attitudes: {what}"
            ),
        ))
    }

    /// Angular velocities about other axes than those that the attitudes rotate about, and whether it is known why. A bias
    /// of a body that hardly turns has no axis in common with its attitudes either.
    fn directions(&self) -> Option<(u64, String, bool)> {
        let (frame, _) = self.fastest.filter(|_| self.is_turning())?;
        let correlation = self.global.correlation();
        let of_segment = self.of_segment.correlation();
        let fits_segment = of_segment > ALIKE && of_segment > correlation + 0.1;
        if correlation > 0.5 && !fits_segment {
            return None;
        }
        let (what, is_known) = if self.global.is_empty() {
            ("they are empty", true)
        } else if fits_segment {
            ("they match in segment axes; expected global axes", true)
        } else if correlation < -SAME {
            (
                "they rotate the other way: expected quaternions w x y z from segment to global axes",
                true,
            )
        } else {
            let turns = f64::from(u32::try_from(self.turns).unwrap_or(u32::MAX).max(1));
            let slowest = self.global.expected.min(self.global.found);
            (
                "expected quaternions w x y z, and rates in global axes and of the same time",
                (slowest / turns).sqrt() > TURNS_FAST,
            )
        };
        Some((
            frame,
            format!(
                "the angular velocities do not match the attitudes (correlation {correlation:.2}): {what}"
            ),
            is_known,
        ))
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::Rotation;

    use super::super::frame::PelvisMotion;
    use super::*;

    const RATE: f64 = 100.0;

    /// A falling body that rotates about two axes in turn, changed by `change`.
    fn flight(frames: u64, change: impl Fn(&mut FlightFrame)) -> Vec<FlightFrame> {
        let mut flight = Vec::new();
        let mut attitude = UnitQuaternion::identity();
        for index in 0..frames {
            let time = index as f64 / RATE;
            let spin = Vector3::new(1.5 * (2.0 * time).sin(), 0.3, 2.0 * (1.3 * time).cos());
            let mut frame = FlightFrame {
                index,
                time,
                posture: Posture::h_pose(),
                pelvis: PelvisMotion {
                    inertial_from_body: Rotation::from_quaternion(attitude),
                    position: Vector::new(3.0 * time, 0.0, 3000.0 - 50.0 * time),
                    velocity: Some(Vector::new(3.0, 0.0, -50.0)),
                    angular_velocity: Some(Vector::from_components(spin)),
                },
                centre_of_mass: None,
                bridged: false,
            };
            attitude = UnitQuaternion::from_scaled_axis(spin / RATE) * attitude;
            change(&mut frame);
            flight.push(frame);
        }
        flight
    }

    /// No velocities of segments.
    fn nothing() -> SegmentArray<Moving> {
        SegmentArray::from_fn(|_| Moving::default())
    }

    fn seen(flight: &[FlightFrame]) -> Vec<Warning> {
        let mut watch = Watch::new(RATE);
        for frame in flight {
            let written = (frame.index as f64 * 1000.0 / RATE).round();
            watch.see(frame, Some(written), None, &nothing());
        }
        watch.warnings(JUDGED)
    }

    fn watched(frames: u64, change: impl Fn(&mut FlightFrame)) -> Vec<Warning> {
        seen(&flight(frames, change))
    }

    fn says(warnings: &[Warning], what: &str) -> bool {
        warnings
            .iter()
            .any(|warning| warning.to_string().contains(what))
    }

    #[test]
    fn a_good_flight_has_no_warnings() {
        assert_eq!(watched(300, |_| {}), []);
    }

    /// In a wind tunnel the body moves less than the velocities' noise, which lengthens the path.
    #[test]
    fn noise_of_a_slow_path_is_no_wrong_unit() {
        let drifts = |scale: f64| {
            watched(1000, |frame| {
                let time = frame.time;
                frame.pelvis.position = Vector::new(0.2 * time, 0.0, 10.0);
                let noise = Vector3::new(
                    (20.0 * time).sin(),
                    (17.0 * time).sin(),
                    (23.0 * time).cos(),
                );
                let velocity = Vector3::new(0.2, 0.0, 0.0) + 0.2 * noise;
                frame.pelvis.velocity = Some(Vector::from_components(scale * velocity));
            })
        };
        for (scale, is_doubted) in [(1.0, false), (3.6, true), (0.3, true)] {
            let warnings = drifts(scale);
            assert_eq!(
                says(&warnings, "units or frame rate"),
                is_doubted,
                "{scale}: {warnings:?}"
            );
        }
    }

    #[test]
    fn each_impossibility_is_reported() {
        let degrees = watched(300, |frame| {
            let spin = &mut frame.pelvis.angular_velocity.as_mut().unwrap().components;
            *spin *= 57.295_779_5;
        });
        assert!(says(&degrees, "degrees"), "{degrees:?}");

        let in_segment = watched(300, |frame| {
            let to_body = frame.pelvis.inertial_from_body.quaternion().inverse();
            let to_pelvis = xsens::xsens_from_segment(Segment::Pelvis);
            let spin = frame.pelvis.angular_velocity.as_mut().unwrap();
            let of_pelvis = to_pelvis.quaternion() * (to_body * spin.components);
            *spin = Vector::from_components(of_pelvis);
        });
        assert!(says(&in_segment, "axes"), "{in_segment:?}");

        let swapped = watched(300, |frame| {
            let [w, x, y, z] = frame.pelvis.inertial_from_body.wxyz();
            frame.pelvis.inertial_from_body = Rotation::from_wxyz([x, y, z, w]).unwrap();
        });
        assert!(says(&swapped, "w x y z"), "{swapped:?}");

        let upside_down = watched(300, |frame| {
            frame.pelvis.velocity.as_mut().unwrap().components.z = 50.0;
            frame.pelvis.position.components.z *= -1.0;
        });
        assert!(says(&upside_down, "rises by 50.0 m/s"), "{upside_down:?}");

        // Who tracks in a tunnel falls slower than its air rises, and so rises against the earth.
        let rising = |air: f64| {
            let mut watch = Watch::new(RATE);
            watch.in_air([0.0, 0.0, air]);
            for mut frame in flight(300, |_| {}) {
                frame.pelvis.velocity.as_mut().unwrap().components.z = 15.0;
                frame.pelvis.position.components.z = 15.0 * frame.time;
                watch.see(&frame, None, None, &nothing());
            }
            watch.warnings(JUDGED)
        };
        assert_eq!(rising(55.0), []);
        assert!(says(&rising(0.0), "rises by 15.0 m/s on average;"));
        assert!(says(&rising(2.0), "13.0 m/s on average against the air"));

        let against = watched(300, |frame| {
            frame.pelvis.velocity.as_mut().unwrap().components *= -1.0;
        });
        assert!(says(&against, "opposite directions"), "{against:?}");

        let exchanged = watched(300, |frame| {
            let velocity = &mut frame.pelvis.velocity.as_mut().unwrap().components;
            velocity.swap_rows(0, 2);
        });
        assert!(says(&exchanged, "different directions"), "{exchanged:?}");

        let jumps = watched(300, |frame| {
            if frame.index >= 150 {
                frame.pelvis.position.components.x += 1.0;
            }
        });
        assert!(
            says(&jumps, "in one frame at 1.500 s, 1 times"),
            "{jumps:?}"
        );

        let half = watched(300, |frame| {
            frame.pelvis.angular_velocity.as_mut().unwrap().components *= 0.5;
        });
        assert!(says(&half, "0.50 times") && half[0].is_fault, "{half:?}");

        let sideways = watched(300, |frame| {
            let time = frame.time;
            let velocity = &mut frame.pelvis.velocity.as_mut().unwrap().components;
            velocity.swap_rows(0, 1);
            velocity.z = -50.0;
            frame.pelvis.position.components.x = 8.0 * time;
            velocity.y = 8.0;
        });
        assert!(says(&sideways, "part by up to"), "{sideways:?}");

        let kicked = watched(300, |frame| {
            if frame.index >= 150 {
                frame.pelvis.velocity.as_mut().unwrap().components.x += 20.0;
            }
        });
        assert!(
            says(
                &kicked,
                "velocity jumps by 20.0 m/s in one frame at 1.500 s"
            ),
            "{kicked:?}"
        );
        assert!(says(&kicked, "part by up to 10"), "{kicked:?}");

        let fast = watched(300, |frame| {
            frame.pelvis.velocity.as_mut().unwrap().components *= 1.05;
        });
        assert!(says(&fast, "1.050 times"), "{fast:?}");

        let empty = watched(300, |frame| {
            frame.pelvis.angular_velocity = Some(Vector::zero());
        });
        assert!(says(&empty, "they are empty"), "{empty:?}");
        assert!(empty.iter().any(|warning| warning.is_fault), "{empty:?}");

        let lost = watched(300, |frame| {
            if frame.index >= 150 {
                frame.index += 37;
                frame.time += 0.37;
            }
        });
        assert!(says(&lost, "frame 187: 0.38 s without frames"), "{lost:?}");

        assert!(says(&watched(120, |_| {}), "ends after 1.19 s"));
    }

    #[test]
    fn frames_that_repeat_others_are_counted_while_the_body_moves() {
        let every = |second: usize| {
            let good = flight(300, |_| {});
            let mut twice = good.clone();
            for (index, frame) in twice.iter_mut().enumerate() {
                let from = &good[index - index % second];
                (frame.pelvis, frame.posture) = (from.pelvis, from.posture);
            }
            seen(&twice)
        };
        let twice = every(2);
        assert!(
            says(&twice, "recorded at about 50 frames a second") && twice[0].is_fault,
            "{twice:?}"
        );
        assert_eq!(every(1), []);

        let at_rest = watched(300, |frame| {
            frame.pelvis.inertial_from_body = Rotation::identity();
            frame.pelvis.position = Vector::zero();
            frame.pelvis.velocity = Some(Vector::zero());
            frame.pelvis.angular_velocity = Some(Vector::zero());
        });
        assert_eq!(at_rest, []);
    }

    #[test]
    fn the_motion_decides_between_header_and_frame_times() {
        let clocks = |real: f64| {
            let mut watch = Watch::new(RATE);
            for index in 0..300 {
                let mut frame = flight(1, |_| {})[0];
                frame.index = index;
                frame.time = index as f64 / RATE;
                frame.pelvis.position = Vector::new(0.0, 0.0, -50.0 * index as f64 / real);
                frame.pelvis.velocity = Some(Vector::new(0.0, 0.0, -50.0));
                let written = (index as f64 * 1000.0 / 105.0).round();
                watch.see(&frame, Some(written), None, &nothing());
            }
            watch.warnings(JUDGED)
        };
        let header = clocks(RATE);
        assert!(
            says(&header, "with which positions") && !header[0].is_fault,
            "{header:?}"
        );
        let times = clocks(105.0);
        assert!(
            says(&times, "set frameRate") && times[0].is_fault,
            "{times:?}"
        );
    }

    #[test]
    fn frames_that_run_backwards_are_called_that_and_nothing_else() {
        let forwards = flight(300, |_| {});
        let mut backwards: Vec<FlightFrame> = forwards.iter().rev().copied().collect();
        for (frame, right) in backwards.iter_mut().zip(&forwards) {
            (frame.index, frame.time) = (right.index, right.time);
        }
        let said = seen(&backwards);
        assert!(says(&said, "run backwards in time"), "{said:?}");
        assert!(
            said.len() == 1 && said[0].is_fault && said[0].span_s == Some([0.0, 2.99]),
            "{said:?}"
        );

        // One kind of velocity alone does not tell of time.
        let only_velocity = watched(300, |frame| {
            frame.pelvis.velocity.as_mut().unwrap().components *= -1.0;
        });
        assert!(
            says(&only_velocity, "opposite directions"),
            "{only_velocity:?}"
        );
        assert!(!says(&only_velocity, "backwards"), "{only_velocity:?}");
        let only_spin = watched(300, |frame| {
            let spin = frame.pelvis.angular_velocity.as_mut().unwrap();
            spin.components *= -1.0;
        });
        assert!(says(&only_spin, "rotate the other way"), "{only_spin:?}");
        assert!(!says(&only_spin, "backwards"), "{only_spin:?}");
    }

    #[test]
    fn frame_times_at_another_rate_are_reported_but_not_those_in_seconds() {
        let mut watch = Watch::new(RATE);
        let mut seconds = Watch::new(RATE);
        for index in 0..300 {
            let frame = FlightFrame {
                index,
                time: index as f64 / RATE,
                posture: Posture::h_pose(),
                pelvis: PelvisMotion {
                    inertial_from_body: Rotation::identity(),
                    position: Vector::zero(),
                    velocity: None,
                    angular_velocity: None,
                },
                centre_of_mass: None,
                bridged: false,
            };
            let written = (index as f64 * 1000.0 / 240.0).round();
            watch.see(&frame, Some(written), None, &nothing());
            seconds.see(&frame, Some(index as f64 / RATE), None, &nothing());
        }
        let warnings = watch.warnings(JUDGED);
        assert!(
            says(&warnings, "240.0 frames per second, the header 100.0"),
            "{warnings:?}"
        );
        assert_eq!(seconds.warnings(JUDGED), []);
    }
}
