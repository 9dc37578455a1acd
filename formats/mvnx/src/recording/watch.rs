//! Plausibility checks on a recording while it is read, frame by frame, in constant memory.
//!
//! Attitudes and angular velocities are redundant, and so are positions and velocities. If they disagree, a unit, an
//! order or an axis differs from the format, and a simulation would be silently wrong.

use bodyflight_core::Segment;
use bodyflight_core::frame::{Inertial, Vector};
use nalgebra::{UnitQuaternion, Vector3};

use super::bridge::BRIDGE_LIMIT;
use super::frame::FlightFrame;
use super::plausibility::{OpenJoint, Plausibility};
use super::warning::Warning;
use crate::xsens;

/// Shortest flight worth judging (s).
const SHORTEST: f64 = 2.0;

/// Fewest frames for which rates are compared.
const LEAST_FRAMES: u64 = 10;

/// Largest relative difference between the rate of the frame times, written in whole milliseconds, and the frame rate.
const RATE_TOLERANCE: f64 = 0.03;

/// Time over which rotations are compared (s), long enough that the noise of single attitudes is small in comparison,
/// and the fewest such comparisons that are judged.
const TURN: f64 = 0.2;
const LEAST_TURNS: u64 = 4;

/// Rotation (rad) that ends a comparison before that time: in a somersault the axis moves, and the axis of a half turn
/// is ambiguous.
const FAR: f64 = 1.0;

/// Smallest angular velocity (rad/s, root mean square) that the attitudes show clearly.
const TURNS: f64 = 0.2;

/// Smallest correlation of two angular velocities that differ only in their unit.
const SAME: f64 = 0.7;

/// Correlation above which two angular velocities are taken to be the same except for noise.
const ALIKE: f64 = 0.95;

/// Ratios of two angular velocities that are explained by degrees in place of radians (57.3), with a margin for noise.
const DEGREES: core::ops::Range<f64> = 40.0..75.0;

/// Upward speed that no fall reaches (m/s).
const RISES: f64 = 10.0;

/// Shortest path (m), by positions or by velocities, for which the two are compared, and their largest relative
/// difference: beyond it, units or the frame rate are wrong.
const MOVES: f64 = 1.0;
const WAYS_APART: f64 = 0.3;
/// Ratio of the two below which one of them does not show the motion at all.
const NONE: f64 = 0.02;

/// Sums over a vector that is recorded in two ways.
#[derive(Debug, Clone, Copy, Default)]
struct Agreement {
    expected: f64,
    found: f64,
    both: f64,
}

impl Agreement {
    fn add(&mut self, expected: &Vector3<f64>, found: &Vector3<f64>) {
        self.expected += expected.norm_squared();
        self.found += found.norm_squared();
        self.both += expected.dot(found);
    }

    fn correlation(&self) -> f64 {
        self.both / (self.expected * self.found).sqrt().max(f64::MIN_POSITIVE)
    }

    /// Ratio of the found to the expected size.
    fn scale(&self) -> f64 {
        self.both / self.expected.max(f64::MIN_POSITIVE)
    }
}

/// What is said if velocities and angular velocities are both opposite to the motion. The two explanations give the same
/// numbers: gravity does not tell the direction of time.
const BACKWARDS: &str = "velocities and angular velocities are opposite to the motion of positions and attitudes: the \
    frames run backwards in time, or all velocities have the opposite sign";

/// Correlation of displacements and velocities below which they do not belong together.
const ASKEW: f64 = 0.5;
/// Distance between displacement and velocity in one frame that is a jump (m), and the least number of frames for each.
const JUMPS: f64 = 0.3;
const SELDOM: u64 = 30;

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
    last: Option<FlightFrame>,
    frames: u64,
    /// Written time (ms or s) of the first and the last frame that have one, with their indices.
    written: Option<[(u64, f64); 2]>,
    frame_rate: f64,
    gaps: u64,
    largest_gap: Option<(u64, f64)>,
    /// Angular velocity in global axes, and as if it were in segment axes.
    global: Agreement,
    of_segment: Agreement,
    turn: Option<Turn>,
    turns: u64,
    fastest: Option<(u64, f64)>,
    ways: Agreement,
    /// Path length according to the positions, and to the velocities (m).
    lengths: [f64; 2],
    up: f64,
    /// Time (s) and size (m) of the first jump of the pelvis that its velocity does not explain, and their number.
    jump: Option<(f64, f64)>,
    jumps: u64,
    segments: Plausibility,
}

impl Watch {
    pub(super) fn new(frame_rate: f64) -> Self {
        Self {
            frame_rate,
            ..Self::default()
        }
    }

    /// Takes a good frame, its time as written, and its joint that closes worst.
    pub(super) fn see(
        &mut self,
        frame: &FlightFrame,
        written: Option<f64>,
        joint: Option<OpenJoint>,
    ) {
        self.segments.see(frame, joint);
        if let Some(time) = written {
            let here = (frame.index, time);
            self.written = Some([self.written.map_or(here, |[first, _]| first), here]);
        }
        if let Some(last) = self.last {
            self.compare(&last, frame);
        }
        self.first.get_or_insert(*frame);
        self.last = Some(*frame);
        self.frames += 1;
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
            return;
        }
        let mean = |a: Option<Vector<f64, Inertial>>, b: Option<Vector<f64, Inertial>>| {
            Some((a?.components + b?.components) * 0.5)
        };
        let (before, now) = (&last.pelvis, &frame.pelvis);
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
                self.of_segment.add(&expected, &(turn.of_segment / time));
                self.turns += 1;
                self.turn = None;
            }
        }
        if let Some(velocity) = mean(before.velocity, now.velocity) {
            let moved = now.position.components - before.position.components;
            self.ways.add(&moved, &(velocity * duration));
            let jump = (moved - velocity * duration).norm();
            if jump > JUMPS {
                self.jumps += 1;
                self.jump.get_or_insert((frame.time, moved.norm()));
            }
            self.lengths[0] += moved.norm();
            self.lengths[1] += velocity.norm() * duration;
            self.up += velocity.z * duration;
        }
    }

    /// The implausible findings so far.
    pub(super) fn warnings(&self) -> Vec<Warning> {
        let (Some(first), Some(last)) = (&self.first, &self.last) else {
            return Vec::new();
        };
        let mut warnings = Vec::new();
        let mut warn = |frame: u64, message: String| warnings.push(Warning::new(frame, message));
        let duration = last.time - first.time;
        if duration < SHORTEST {
            warn(
                last.index,
                format!(
                    "the flight ends after {duration:.2} s; less than {SHORTEST} s is too short to judge"
                ),
            );
        }
        if let Some((frame, length)) = self.largest_gap {
            warn(
                frame,
                format!(
                    "{length:.2} s without frames before it, {} gaps over {BRIDGE_LIMIT} s in all; limbs are assumed to \
                     move evenly across them",
                    self.gaps
                ),
            );
        }
        if let Some((frame, rate)) = self.rate_written() {
            warn(
                frame,
                format!(
                    "the frame times give {rate:.1} frames per second, the header {:.1}; the header is used",
                    self.frame_rate
                ),
            );
        }
        let is_backwards = self.is_backwards();
        if is_backwards {
            warnings.push(Warning {
                span_s: Some([first.time, last.time]),
                is_fault: true,
                ..Warning::new(last.index, BACKWARDS.to_owned())
            });
        } else if let Some((frame, message)) = self.rates().or_else(|| self.directions()) {
            warnings.push(Warning {
                is_fault: self.rates_are_useless(),
                ..Warning::new(frame, message)
            });
        }
        let mut warn = |frame: u64, message: String| warnings.push(Warning::new(frame, message));
        if duration > 0.0 && self.up / duration > RISES {
            warn(
                last.index,
                format!(
                    "the body rises by {:.1} m/s on average; expected a fall, with upward velocities positive",
                    self.up / duration
                ),
            );
        }
        if let Some(message) = self.paths().filter(|_| !is_backwards) {
            warnings.push(Warning {
                span_s: Some([first.time, last.time]),
                is_fault: true,
                ..Warning::new(last.index, message)
            });
        }
        warnings.extend(self.segments.warnings());
        warnings
    }

    /// Frames per second according to the frame times, if they disagree with the header, and the frame that shows it.
    fn rate_written(&self) -> Option<(u64, f64)> {
        let [(first, from), (last, to)] = self.written?;
        if last < first + LEAST_FRAMES || to <= from {
            return None;
        }
        #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
        let frames = (last - first) as f64;
        // MVN writes milliseconds; some programs write seconds.
        let rates = [1000.0, 1.0].map(|unit| frames * unit / (to - from));
        let near = |rate: &f64| (rate / self.frame_rate - 1.0).abs() < RATE_TOLERANCE;
        (!rates.iter().any(near)).then_some((last, rates[0]))
    }

    fn is_turning(&self) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "counts of turns")]
        let count = self.turns.max(1) as f64;
        self.turns >= LEAST_TURNS && (self.global.expected / count).sqrt() > TURNS
    }

    /// Whether both kinds of velocity are those of the same motion the other way round. One of them alone would mean
    /// reversed axes or inverse quaternions.
    fn is_backwards(&self) -> bool {
        let against =
            |of: &Agreement| of.correlation() < -SAME && (of.scale() + 1.0).abs() < WAYS_APART;
        let moves = self.lengths[0] > MOVES && self.frames >= LEAST_FRAMES;
        moves && self.is_turning() && against(&self.global) && against(&self.ways)
    }

    /// Whether the angular velocities are empty or in degrees: nothing computed from them is right.
    fn rates_are_useless(&self) -> bool {
        self.global.found < NONE * NONE * self.global.expected
            || DEGREES.contains(&self.global.scale())
    }

    /// Angular velocities in the wrong unit.
    fn rates(&self) -> Option<(u64, String)> {
        let (frame, fastest) = self.fastest.filter(|_| self.is_turning())?;
        let (scale, correlation) = (self.global.scale(), self.global.correlation());
        if correlation < SAME || (0.5..2.0).contains(&scale) {
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
                "the angular velocities, up to {fastest:.1}, are {scale:.1} times those of the attitudes: {what}"
            ),
        ))
    }

    /// Angular velocities about other axes than those that the attitudes rotate about.
    fn directions(&self) -> Option<(u64, String)> {
        let (frame, _) = self.fastest.filter(|_| self.is_turning())?;
        let correlation = self.global.correlation();
        let of_segment = self.of_segment.correlation();
        let fits_segment = of_segment > ALIKE && of_segment > correlation + 0.1;
        if correlation > 0.5 && !fits_segment {
            return None;
        }
        let what = if self.rates_are_useless() {
            "they are empty"
        } else if fits_segment {
            "they match in segment axes; expected global axes"
        } else if correlation < -SAME {
            "they rotate the other way: expected quaternions w x y z from segment to global axes"
        } else {
            "expected quaternions w x y z and rates in global axes"
        };
        Some((
            frame,
            format!(
                "the angular velocities do not match the attitudes (correlation {correlation:.2}): {what}"
            ),
        ))
    }

    /// Positions and velocities that do not match.
    fn paths(&self) -> Option<String> {
        let [by_positions, by_velocities] = self.lengths;
        if by_positions.max(by_velocities) < MOVES || self.frames < LEAST_FRAMES {
            return None;
        }
        let correlation = self.ways.correlation();
        if correlation < -0.5 {
            return Some(
                "positions and velocities point in opposite directions: the axes of one of them are reversed"
                    .to_owned(),
            );
        }
        if by_velocities < NONE * by_positions || by_positions < NONE * by_velocities {
            return Some(format!(
                "the body moves {by_positions:.1} m by positions, {by_velocities:.1} m by velocities: one of them is empty"
            ));
        }
        if let Some((time, jump)) = self.jump.filter(|_| SELDOM * self.jumps < self.frames) {
            return Some(format!(
                "the body jumps by {jump:.2} m in one frame at {time:.3} s, {} times in all, against its velocity",
                self.jumps
            ));
        }
        if correlation < ASKEW {
            return Some(format!(
                "positions and velocities point in different directions (correlation {correlation:.2}): two axes of one of them are exchanged, or they are not of the same time"
            ));
        }
        let apart = by_velocities / by_positions.max(f64::MIN_POSITIVE);
        ((apart - 1.0).abs() > WAYS_APART && correlation > 0.5).then(|| {
            format!(
                "path of {by_positions:.1} m by positions, {by_velocities:.1} m by velocities: units or frame rate are wrong"
            )
        })
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

    fn seen(flight: &[FlightFrame]) -> Vec<Warning> {
        let mut watch = Watch::new(RATE);
        for frame in flight {
            let written = (frame.index as f64 * 1000.0 / RATE).round();
            watch.see(frame, Some(written), None);
        }
        watch.warnings()
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
            watch.see(&frame, Some((index as f64 * 1000.0 / 240.0).round()), None);
            seconds.see(&frame, Some(index as f64 / RATE), None);
        }
        let warnings = watch.warnings();
        assert!(
            says(&warnings, "240.0 frames per second, the header 100.0"),
            "{warnings:?}"
        );
        assert_eq!(seconds.warnings(), []);
    }
}
