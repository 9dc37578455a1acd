//! What the body does for most of a recording, from positions and attitudes alone.

use bodyflight_core::Segment;
use nalgebra::{UnitQuaternion, Vector3};

use bodyflight_mvnx::recording::FlightFrame;

/// Length of the pieces that are judged (s).
const PIECE: f64 = 0.1;
/// Downward speed of a fall, which no jump from the ground reaches (m/s).
const FALLS: f64 = 8.0;
/// Speeds below which a body stands, walks, and above which it runs (m/s).
const STILL: f64 = 0.15;
const WALKS: f64 = 0.4;
const RUNS: f64 = 2.6;
/// Speed that no runner reaches (m/s).
const RIDES: f64 = 13.0;
/// Rotation of the pelvis that no walk or run has (rad/s).
const TUMBLES: f64 = 4.0;
/// Cosine of the angle to the vertical below which a trunk is not upright, and bend of the knees that sit (rad).
const UPRIGHT: f64 = 0.7;
const SITS: f64 = 1.2;

/// Names of activities, in the order of [`Activities::times`].
const NAMES: [&str; 10] = [
    "tumbles",
    "falls",
    "stands",
    "sits",
    "lies",
    "moves in place",
    "walks",
    "runs",
    "travels level",
    "rises",
];

/// Time spent on each activity.
#[derive(Debug, Clone, Default)]
pub(crate) struct Activities {
    begin: Option<(f64, Vector3<f64>, UnitQuaternion<f64>)>,
    times: [f64; NAMES.len()],
    moved: bool,
}

impl Activities {
    pub(crate) fn see(&mut self, frame: &FlightFrame) {
        let here = frame.pelvis.position.components;
        let attitude = *frame.pelvis.inertial_from_body.quaternion();
        let (time, from, turned) = *(self.begin).get_or_insert((frame.time, here, attitude));
        let duration = frame.time - time;
        if duration < PIECE {
            return;
        }
        self.moved |= here != from;
        self.begin = Some((frame.time, here, attitude));
        let velocity = (here - from) / duration;
        let level = velocity.xy().norm();
        let up = attitude * Vector3::z();
        let turns = attitude.angle_to(&turned) / duration;
        let bent = |shank: Segment| frame.posture.parent_from_segment(shank).angle();
        let at = if velocity.z < -FALLS {
            1
        } else if velocity.z > FALLS {
            9
        } else if level > RIDES {
            8
        } else if turns > TUMBLES {
            0
        } else if velocity.norm() < STILL && up.z < UPRIGHT {
            4
        } else if velocity.norm() < STILL {
            let sits = bent(Segment::LeftShank).min(bent(Segment::RightShank)) > SITS;
            if sits { 3 } else { 2 }
        } else if level < WALKS {
            5
        } else if level < RUNS {
            6
        } else {
            7
        };
        self.times[at] += duration;
    }

    /// The activity that takes most of the time; `None` if the recording has no positions.
    pub(crate) fn most(&self) -> Option<&'static str> {
        let longest = self
            .times
            .iter()
            .zip(NAMES)
            .max_by(|a, b| a.0.total_cmp(b.0));
        longest
            .filter(|(time, _)| self.moved && **time > 0.0)
            .map(|(_, name)| name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::Posture;
    use bodyflight_core::frame::{Rotation, Vector};
    use bodyflight_mvnx::recording::PelvisMotion;

    fn does(velocity: Vector3<f64>, lean: f64, knees: f64) -> Option<&'static str> {
        turning(velocity, lean, knees, 0.0)
    }

    fn turning(velocity: Vector3<f64>, lean: f64, knees: f64, rate: f64) -> Option<&'static str> {
        let mut activities = Activities::default();
        for index in 0..200_u64 {
            let time = index as f64 / 100.0;
            let sway = Vector3::new(0.01 * time.sin(), 0.0, 0.0);
            activities.see(&FlightFrame {
                index,
                time,
                posture: Posture::h_pose()
                    .with_angles(Segment::LeftShank, 0.0, 0.0, knees)
                    .with_angles(Segment::RightShank, 0.0, 0.0, knees),
                pelvis: PelvisMotion {
                    inertial_from_body: Rotation::from_quaternion(UnitQuaternion::from_axis_angle(
                        &Vector3::x_axis(),
                        lean + rate * time,
                    )),
                    position: Vector::from_components(velocity * time + sway),
                    velocity: None,
                    angular_velocity: None,
                },
                centre_of_mass: None,
                bridged: false,
            });
        }
        activities.most()
    }

    #[test]
    fn what_a_body_does_is_called_by_its_name() {
        for (velocity, lean, knees, name) in [
            (Vector3::new(0.0, 0.0, -50.0), 1.5, 0.5, "falls"),
            (Vector3::zeros(), 0.1, 0.1, "stands"),
            (Vector3::zeros(), 0.1, 1.5, "sits"),
            (Vector3::zeros(), 1.5, 0.1, "lies"),
            (Vector3::new(1.3, 0.0, 0.0), 0.1, 0.3, "walks"),
            (Vector3::new(0.0, 4.0, 0.0), 0.1, 0.3, "runs"),
            (Vector3::new(0.0, 50.0, 1.0), 1.5, 0.3, "travels level"),
            (Vector3::new(0.0, 0.0, 50.0), 1.5, 0.3, "rises"),
        ] {
            assert_eq!(does(velocity, lean, knees), Some(name));
        }
        let level = Vector3::new(1.0, 0.0, 1.0);
        assert_eq!(turning(level, 0.1, 0.3, 6.0), Some("tumbles"));
    }
}
