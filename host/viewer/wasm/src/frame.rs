//! A frame as a list of numbers in single precision.

use bodyflight_core::air::{REFERENCE_HEIGHT, normalised_fall_rate, standard_density};
use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::body::posture::pose;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::frame::{Body, Vector};
use bodyflight_core::math::Real;
use bodyflight_core::observation::Observation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{UnitQuaternion, Vector3};

/// Parts of a frame and their lengths, in order.
///
/// Inertial axes are north, west, up; quaternions are w, x, y, z.
pub const LAYOUT: [(&str, usize); 14] = [
    ("time_s", 1),
    ("position_m", 3),
    ("inertial_from_body", 4),
    ("velocity_mps", 3),
    ("angular_velocity_radps", 3),
    // Roll, pitch, heading (rad), yaw rate, angular velocity (rad/s), horizontal and vertical velocity (m/s).
    ("observation", 7),
    ("cg_m", 3),
    ("air_velocity_mps", 3),
    // About the axes of the body: pitch, yaw, roll.
    ("muscle", 3),
    ("damping", 3),
    // Total aerodynamic force (N), inertial axes.
    ("air_force_n", 3),
    // That force over the weight.
    ("load_factor", 1),
    // Fall rate normalised to the standard atmosphere at the reference height.
    ("normalised_fall_rate_mps", 1),
    ("segments", SEGMENT_COUNT * SEGMENT_NUMBERS),
];

/// Parts of a segment and their lengths, in order.
pub const SEGMENT_LAYOUT: [(&str, usize); 4] = [
    ("parent_from_segment", 4),
    ("body_from_segment", 4),
    // Body axes, from the pelvic joint.
    ("cg_m", 3),
    // Body axes.
    ("force_n", 3),
];

/// Numbers per segment.
pub const SEGMENT_NUMBERS: usize = sum(&SEGMENT_LAYOUT);

/// Numbers per frame.
pub const NUMBERS: usize = sum(&LAYOUT);

const fn sum(parts: &[(&str, usize)]) -> usize {
    match parts {
        [] => 0,
        [(_, count), rest @ ..] => *count + sum(rest),
    }
}

/// Returns the offset of a part of a frame.
pub fn place(name: &str) -> Option<usize> {
    let mut begin = 0;
    for (part, count) in LAYOUT {
        if part == name {
            return Some(begin);
        }
        begin += count;
    }
    None
}

/// A frame.
pub type Frame = [f32; NUMBERS];

/// Writes numbers one after another.
struct Pen<'a> {
    frame: &'a mut Frame,
    next: usize,
}

impl Pen<'_> {
    fn write<T: Real>(&mut self, numbers: impl IntoIterator<Item = T>) {
        for number in numbers {
            if let Some(place) = self.frame.get_mut(self.next) {
                #[expect(clippy::cast_possible_truncation, reason = "precise enough to show")]
                let single = number.to_f64() as f32;
                *place = single;
            }
            self.next += 1;
        }
    }

    fn vector<T: Real, F>(&mut self, vector: Vector<T, F>) {
        self.write(vector.to_array());
    }

    fn rotation<T: Real>(&mut self, rotation: &UnitQuaternion<T>) {
        self.write([rotation.w, rotation.i, rotation.j, rotation.k]);
    }
}

/// Returns the frame of a moving body `time` (s) after the start.
pub fn frame<T: Real>(
    dynamics: &Dynamics<T>,
    inputs: &Inputs<T>,
    posture: &Posture<T>,
    motion: &Motion<T>,
    time: T,
) -> Frame {
    let mut frame = [0.0; NUMBERS];
    let pen = &mut Pen {
        frame: &mut frame,
        next: 0,
    };
    let posed = pose(&dynamics.body, posture);
    let loads = dynamics.segment_loads(posture, motion);
    let turned = posture.body_from_segments();
    let (mut moment, mut force) = (Vector::<T, Body>::zero(), Vector::zero());
    for segment in Segment::ALL {
        let cg = Vector::from_components(posed[segment].cg);
        moment += cg * dynamics.body.segments[segment].mass;
        force += Vector::from_components(loads[segment].force);
    }
    let observation = Observation::of(motion);
    pen.write([time]);
    pen.vector(motion.position);
    pen.rotation(motion.inertial_from_body.quaternion());
    pen.vector(motion.velocity_inertial());
    pen.vector(motion.angular_velocity);
    pen.write([
        observation.angles.roll,
        observation.angles.pitch,
        observation.angles.heading,
        observation.yaw_rate,
        observation.angular_velocity.norm(),
        observation.horizontal_speed,
        observation.vertical_velocity,
    ]);
    pen.vector(moment / dynamics.body.mass());
    pen.vector(dynamics.air.velocity_at(&motion.position));
    pen.write(inputs.muscle.to_array());
    pen.write(inputs.damping.to_array());
    pen.vector(motion.inertial_from_body * force);
    pen.write([
        dynamics.load_factor(&force),
        normalised(dynamics, motion, &observation),
    ]);
    for segment in Segment::ALL {
        pen.rotation(posture.parent_from_segment(segment));
        pen.rotation(&turned[segment]);
        pen.write(posed[segment].cg.iter().copied());
        pen.write(loads[segment].force.iter().copied());
    }
    frame
}

/// Returns the fall rate normalised to the standard atmosphere at [`REFERENCE_HEIGHT`] (m/s).
pub fn normalised<T: Real>(
    dynamics: &Dynamics<T>,
    motion: &Motion<T>,
    observation: &Observation<T>,
) -> T {
    let density = dynamics.air.density.at(motion.position.up());
    let reference = standard_density(T::of(REFERENCE_HEIGHT));
    normalised_fall_rate(-observation.vertical_velocity, density, reference)
}

/// Returns the half extents (m) along X, Y, Z of a rounded solid with the silhouettes of a segment, which the
/// aerodynamic model uses.
pub fn half_extents<T: Real>(area: &Vector3<T>) -> Vector3<T> {
    // Fraction of its bounding rectangle that a superellipse of exponent 2.5 covers.
    let rectangle = area / T::of(4.0 * 0.8446);
    let side = |own: usize, others: [usize; 2]| {
        let [a, b] = others;
        (rectangle[a] * rectangle[b] / rectangle[own]).root()
    };
    // Areas are normal to X, Y and Z: each is the product of the other two extents.
    Vector3::new(side(0, [1, 2]), side(1, [0, 2]), side(2, [0, 1]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cockpit::tests::cockpit;

    #[test]
    fn a_frame_holds_what_its_table_says() {
        let cockpit = cockpit();
        let frame = cockpit.frame();
        let part = |name: &str, count: usize| {
            let from = place(name).unwrap();
            &frame[from..from + count]
        };
        assert!((part("velocity_mps", 3)[2] + 50.0).abs() < 10.0);
        let quaternion = part("inertial_from_body", 4);
        assert!((quaternion.iter().map(|q| q * q).sum::<f32>() - 1.0).abs() < 1e-5);
        // Near the trim, aerodynamic forces balance the weight.
        let mass = cockpit.dynamics().body.mass();
        let lift = part("air_force_n", 3)[2];
        assert!(
            (lift / (mass * 9.81) - 1.0).abs() < 0.5,
            "{lift} for {mass}"
        );
        let [north, west, up] = [0, 1, 2].map(|k| part("air_force_n", 3)[k] / (mass * 9.81));
        let factor = part("load_factor", 1)[0];
        assert!(
            (factor - north.hypot(west).hypot(up)).abs() < 1e-4,
            "{factor}"
        );
        // Air of 1 kg/m3 is almost that of the reference height, 1.007 kg/m3.
        let rate = part("normalised_fall_rate_mps", 1)[0];
        assert!(
            (rate / -part("velocity_mps", 3)[2] - 0.9967).abs() < 1e-3,
            "{rate}"
        );
        assert!(place("segments").unwrap() + SEGMENT_COUNT * SEGMENT_NUMBERS == NUMBERS);
        assert!(place("nothing").is_none());
        assert!(frame.iter().all(|number| number.is_finite()));
    }

    #[test]
    fn solids_have_the_silhouettes_of_the_table() {
        let area = Vector3::new(0.02, 0.03, 0.01);
        let half = half_extents(&area);
        let share = 4.0 * 0.8446;
        let seen = Vector3::new(half.y * half.z, half.x * half.z, half.x * half.y) * share;
        assert!((seen - area).norm() < 1e-12, "{seen}");
    }
}
