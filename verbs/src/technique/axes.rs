//! The angles of the joints as coordinates of a movement.
//!
//! A joint's rotation is compared with its mean over the recording. The difference, a rotation vector about the axes of the
//! parent, has no jump and no gimbal lock, and for small angles its components are the changes of the paper's angles, as
//! `simulate --joint` adds them.

use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::{Posture, Segment};
use nalgebra::DVector;

/// Changes of the joint angles from `mean` to `posture` (rad), in the order of `axes`.
pub fn deviation(axes: &[JointAngle], mean: &Posture<f64>, posture: &Posture<f64>) -> DVector<f64> {
    DVector::from_iterator(
        axes.len(),
        axes.iter().map(|axis| {
            let from = mean.parent_from_segment(axis.segment);
            let turn = (posture.parent_from_segment(axis.segment) * from.inverse()).scaled_axis();
            let [psi, theta, phi] = axis.shares();
            // The paper's angles are passive.
            -(psi * turn.z + theta * turn.y + phi * turn.x)
        }),
    )
}

/// A pattern for [`bodyflight_core::body::pattern::moved`], from weights in the order of `axes`.
pub fn pattern(axes: &[JointAngle], weights: &DVector<f64>) -> Vec<(Segment, [f64; 3])> {
    let mut joints: Vec<(Segment, [f64; 3])> = Vec::new();
    for (axis, weight) in axes.iter().zip(weights.iter()) {
        let by = axis.shares().map(|share| share * weight);
        match joints.last_mut() {
            Some((segment, sum)) if *segment == axis.segment => {
                for (sum, by) in sum.iter_mut().zip(by) {
                    *sum += by;
                }
            }
            _ => joints.push((axis.segment, by)),
        }
    }
    joints.retain(|(_, angles)| angles.iter().any(|angle| angle.abs() > 0.0));
    joints
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::body::pattern::{moved, neutral};

    #[test]
    fn a_change_by_a_pattern_is_found_in_its_angle_and_no_other() {
        let axes: Vec<JointAngle> = JointAngle::all().collect();
        let neutral = neutral::<f64>();
        assert_eq!(axes.len(), 45);
        for (k, axis) in axes.iter().enumerate() {
            let mut weights = DVector::zeros(axes.len());
            weights[k] = 0.3;
            let to = moved(&neutral, &pattern(&axes, &weights), 1.0);
            let found = deviation(&axes, &neutral, &to);
            assert!((found - weights).norm() < 1e-9, "{axis}");
        }
        assert!(axes.iter().any(|axis| axis.to_string() == "l_shank.bend"));
    }
}
