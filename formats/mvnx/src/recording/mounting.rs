//! Segments whose attitude does not fit the places of their joints throughout the recording: a sensor or a cluster of
//! markers is mounted a few degrees off, or a conversion gave one segment other axes.

use nalgebra::Vector3;

use super::warning::Warning;
use crate::closure::Skeleton;
use crate::xsens::MvnSegment;
use crate::{Field, Frame};

/// Fewest frames that show it.
const LEAST_FRAMES: u64 = 10;
/// Smallest angle (rad), and smallest distance (m): rounding gives less, and so do joints that are not quite rigid.
const LEAST: f64 = 0.044;
const LEAST_APART: f64 = 0.006;
/// Largest scatter of the distance about its mean, relative to the mean: it keeps its direction in the segment.
const SCATTER: f64 = 0.35;
/// If more segments than this do not fit, the skeleton of the file is another person's.
const MOST: usize = 4;

/// A segment whose attitude is off by a constant angle.
#[derive(Debug, Clone, PartialEq)]
pub struct Mounting {
    /// The model's segment.
    pub segment: &'static str,
    /// Angle between where its joint is and where its attitude puts it (rad); a turn about the segment's own long axis
    /// does not show.
    pub angle: f64,
    /// Mean distance between the two (m).
    pub apart: f64,
}

impl Mounting {
    /// In a sentence.
    pub fn message(&self) -> String {
        format!(
            "{} is turned by {:.1} degrees against the places of its joints throughout, which leaves {:.3} m between them: \
             its sensor or its markers are mounted that far off, or its axes are wrong",
            self.segment,
            self.angle.to_degrees(),
            self.apart
        )
    }

    /// As something implausible in the recording.
    pub(super) fn warning(&self) -> Warning {
        Warning {
            segment: Some(self.segment.to_owned()),
            ..Warning::new(0, self.message())
        }
    }
}

/// Sums over the frames of one joint.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    frames: u64,
    gap: Vector3<f64>,
    squares: f64,
    lever: Vector3<f64>,
    segment: usize,
}

/// What has been seen of all joints.
#[derive(Debug, Clone, Default)]
pub(super) struct Mountings {
    joints: Vec<Sums>,
}

impl Mountings {
    /// Takes a good frame whose arms have the convention of the T-pose.
    pub(super) fn see_frame(&mut self, skeleton: &Skeleton, frame: &Frame) {
        let numbers = |field| frame.numbers(field);
        if let Some((turned, placed)) = numbers(Field::Orientation).zip(numbers(Field::Position)) {
            self.see(skeleton, turned, placed);
        }
    }

    /// Takes the numbers of a good frame whose arms have the convention of the T-pose.
    fn see(&mut self, skeleton: &Skeleton, orientation: &[f64], position: &[f64]) {
        for (joint, gap) in skeleton.gaps(orientation, position).enumerate() {
            if joint >= self.joints.len() {
                self.joints.resize(joint + 1, Sums::default());
            }
            let sums = &mut self.joints[joint];
            sums.frames += 1;
            sums.gap += gap.gap;
            sums.squares += gap.gap.norm_squared();
            sums.lever = gap.lever;
            sums.segment = gap.segment;
        }
    }

    /// The segments that are off, the worst first; `labels` are those of the file's segments.
    pub(super) fn found<'a>(&self, labels: impl Fn(usize) -> Option<&'a str>) -> Vec<Mounting> {
        let mut found: Vec<Mounting> = Vec::new();
        for sums in &self.joints {
            let count = sums.frames.max(1) as f64;
            let mean = sums.gap / count;
            let apart = mean.norm();
            let scatter = (sums.squares / count - apart * apart).max(0.0).sqrt();
            let angle = sums.lever.angle(&(sums.lever + mean));
            let is_constant = sums.frames >= LEAST_FRAMES && scatter < SCATTER * apart;
            if !is_constant || apart < LEAST_APART || angle < LEAST {
                continue;
            }
            let of = |label: &str| MvnSegment::ALL.into_iter().find(|own| own.label() == label);
            let Some(segment) = labels(sums.segment).and_then(of) else {
                continue;
            };
            let segment = segment.part_of().name();
            match found.iter_mut().find(|known| known.segment == segment) {
                Some(known) if known.angle >= angle => {}
                Some(known) => (known.angle, known.apart) = (angle, apart),
                None => found.push(Mounting {
                    segment,
                    angle,
                    apart,
                }),
            }
        }
        found.sort_by(|a, b| b.angle.total_cmp(&a.angle));
        if found.len() > MOST {
            Vec::new()
        } else {
            found
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Header;
    use crate::header::{PointDefinition, SegmentDefinition};
    use nalgebra::UnitQuaternion;

    fn segment(label: &str, points: &[(&str, [f64; 3])]) -> SegmentDefinition {
        let point = |(label, at): &(&str, [f64; 3])| PointDefinition {
            label: (*label).to_owned(),
            position: Vector3::from(*at),
        };
        SegmentDefinition {
            label: label.to_owned(),
            points: points.iter().map(point).collect(),
        }
    }

    /// What is found if the attitude of the thigh is turned against its joints by angles about its axes (rad).
    fn found(turned: impl Fn(f64) -> [f64; 3]) -> Vec<Mounting> {
        let knee = [0.0, 0.0, -0.4];
        let header = Header {
            segments: vec![
                segment("LeftUpperLeg", &[("jLeftKnee", knee)]),
                segment("LeftLowerLeg", &[("jLeftKnee", [0.0; 3])]),
            ],
            ..Header::default()
        };
        let skeleton = Skeleton::of(&header).unwrap();
        let mut seen = Mountings::default();
        for k in 0..100 {
            let time = f64::from(k) / 100.0;
            let right = UnitQuaternion::from_euler_angles(2.0 * time, time, 0.5 * time);
            let [x, y, z] = turned(time);
            let written = right * UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z));
            let q = written.quaternion();
            let place = right * Vector3::from(knee);
            let orientation = [q.w, q.i, q.j, q.k, 1.0, 0.0, 0.0, 0.0];
            seen.see(
                &skeleton,
                &orientation,
                &[0.0, 0.0, 0.0, place.x, place.y, place.z],
            );
        }
        seen.found(|at| {
            header
                .segments
                .get(at)
                .map(|segment| segment.label.as_str())
        })
    }

    #[test]
    fn a_constant_turn_is_named_with_its_angle_and_others_are_not() {
        for turn in [[0.087, 0.0, 0.0], [0.0, -0.087, 0.0]] {
            let mountings = found(|_| turn);
            assert_eq!(mountings.len(), 1, "{mountings:?}");
            assert_eq!(mountings[0].segment, "l_thigh");
            assert!((mountings[0].angle - 0.087).abs() < 1e-3, "{mountings:?}");
        }
        // None, one within the errors of a skeleton, about the long axis, and one that changes.
        assert_eq!(found(|_| [0.0; 3]), []);
        assert_eq!(found(|_| [0.01, 0.0, 0.0]), []);
        assert_eq!(found(|_| [0.0, 0.0, 0.087]), []);
        assert_eq!(found(|time| [0.1 * (20.0 * time).sin(), 0.0, 0.0]), []);
    }
}
