//! The calibration on the ground: sensors in their tray, then worn: upright, bent, marching, upright again, and into the
//! attitude in which the flight begins.

use bodyflight_core::body::posture::Posture;
use bodyflight_core::frame::facing_north;
use bodyflight_core::math::rotation_by;
use bodyflight_core::{Segment, SegmentArray};
use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use super::errors::{Sizes, normal};
use super::instant::Instant;

/// Time from the first sample to the flight (s).
pub(super) const DURATION: f64 = 66.0;
/// Windows of the calibration by their names in the mapping (s).
pub(super) const WINDOWS: [(&str, [f64; 2]); 4] = [
    ("tray_s", [0.5, 9.5]),
    ("upright_s", [40.5, 43.5]),
    ("bent_s", [46.5, 49.5]),
    ("march_s", [52.0, 58.0]),
];
/// Three full turns of the tray about each of its axes (s).
pub(super) const TURNS: [[f64; 2]; 3] = [[10.0, 18.0], [18.0, 26.0], [26.0, 34.0]];
/// When the sensors are taken from the tray, and when they are worn (s).
const TAKEN: f64 = 34.5;
const WORN: f64 = 38.0;

/// Tilt of each segment about the left axis, forwards positive (degrees), and the errors of a person's upright pose: tilt
/// and heading, standard deviation (degrees).
struct Stance {
    bent: f64,
    /// In the march: mean, and swing with the left leg's step.
    march: [f64; 2],
    tilt: f64,
    heading: f64,
}

const fn stance(bent: f64, march: [f64; 2], tilt: f64, heading: f64) -> Stance {
    Stance {
        bent,
        march,
        tilt,
        heading,
    }
}

const STANCES: SegmentArray<Stance> = SegmentArray::new([
    stance(75.0, [0.0, 2.0], 3.0, 0.0),
    stance(82.0, [0.0, 2.0], 4.0, 2.0),
    stance(88.0, [1.0, 2.0], 4.0, 3.0),
    stance(75.0, [0.0, 2.0], 6.0, 5.0),
    stance(0.0, [-14.0, 12.0], 5.0, 8.0),
    stance(0.0, [-55.0, 30.0], 6.0, 12.0),
    stance(0.0, [-55.0, 30.0], 10.0, 15.0),
    stance(0.0, [-14.0, -12.0], 5.0, 8.0),
    stance(0.0, [-55.0, -30.0], 6.0, 12.0),
    stance(0.0, [-55.0, -30.0], 10.0, 15.0),
    stance(-28.0, [-22.0, -25.0], 3.0, 4.0),
    stance(20.0, [14.0, 16.0], 3.0, 5.0),
    stance(0.0, [16.0, 16.0], 5.0, 8.0),
    stance(-28.0, [-22.0, 25.0], 3.0, 4.0),
    stance(20.0, [14.0, -16.0], 3.0, 5.0),
    stance(0.0, [16.0, -16.0], 5.0, 8.0),
]);

/// Steps a second in the march.
const STEPS: f64 = 0.9;
/// Amplitude of the rise and fall of the body with each step (m).
const BOB: f64 = 0.02;

/// A person on the ground.
pub(super) struct Ground {
    /// Errors of the poses.
    off: SegmentArray<UnitQuaternion<f64>>,
    bent: SegmentArray<f64>,
    swing: SegmentArray<f64>,
    last: Instant,
}

impl Ground {
    pub(super) fn new(random: &mut ChaCha8Rng, sizes: &Sizes, last: Instant) -> Self {
        let off = SegmentArray::from_fn(|segment| {
            let stance = &STANCES[segment];
            let axes = Vector3::new(stance.tilt, stance.tilt, stance.heading);
            let degrees = normal(random).component_mul(&axes) * sizes.poses;
            rotation_by(&degrees.map(f64::to_radians))
        });
        let mut varied = |size: f64| random.random_range(1.0 - size..1.0 + size);
        Self {
            off,
            bent: SegmentArray::from_fn(|s| STANCES[s].bent.to_radians() * varied(0.15)),
            swing: SegmentArray::from_fn(|_| varied(0.25)),
            last,
        }
    }

    pub(super) fn at(&self, time: f64) -> Instant {
        let rise = |from: f64, to: f64| smooth((time - from) / (to - from));
        let bend = rise(44.0, 46.0) - rise(50.0, 52.0);
        let march = rise(52.0, 52.35) - rise(57.2, 58.0);
        let (step, _) = (std::f64::consts::TAU * STEPS * (time - 52.0)).sin_cos();
        let (_, double) = (2.0 * std::f64::consts::TAU * STEPS * (time - 52.0)).sin_cos();
        let tilts = SegmentArray::from_fn(|segment| {
            let [mean, swing] = STANCES[segment].march.map(f64::to_radians);
            bend * self.bent[segment] + march * self.swing[segment] * (mean + swing * step)
        });
        let turned = SegmentArray::from_fn(|segment: Segment| {
            rotation_by(&(Vector3::x() * tilts[segment])) * self.off[segment]
        });
        let upright = *facing_north::<f64>(0.0).quaternion();
        let pelvis = turned[Segment::Pelvis];
        let body_from_segment = turned.map(|_, turn| pelvis.inverse() * turn);
        let standing = Instant {
            inertial_from_body: upright * pelvis,
            position: self.last.position + Vector3::z() * (BOB * march * (1.0 - double)),
            posture: Posture::from_body_rotations(&body_from_segment),
        };
        let share = rise(62.0, 65.5);
        Instant {
            inertial_from_body: standing
                .inertial_from_body
                .slerp(&self.last.inertial_from_body, share),
            position: standing.position,
            posture: standing.posture.interpolated(&self.last.posture, share),
        }
    }
}

/// Angular velocity of the tray and its attitude (sensors lie in its axes), until they are worn.
pub(super) fn tray(time: f64) -> Option<(Vector3<f64>, UnitQuaternion<f64>)> {
    if time >= WORN {
        return None;
    }
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let turns = TURNS.into_iter().zip(axes);
    let turning = turns
        .into_iter()
        .find(|([from, to], _)| (*from..*to).contains(&time));
    let Some(([from, to], axis)) = turning else {
        // Handled while they are put on.
        let angle = 2.0 * (time - TAKEN).max(0.0);
        let rate = if time > TAKEN { 2.0 } else { 0.0 };
        return Some((Vector3::y() * rate, rotation_by(&(Vector3::y() * angle))));
    };
    // Rests a second at either end.
    let (begin, length) = (from + 1.0, to - from - 2.0);
    let place = ((time - begin) / length).clamp(0.0, 1.0);
    let full = 3.0 * std::f64::consts::TAU;
    let rate = full * 6.0 * place * (1.0 - place) / length;
    Some((axis * rate, rotation_by(&(axis * (full * smooth(place))))))
}

/// Share of the usual motion of soft tissue: little while the person stands still, and on the bones of the trunk.
pub(super) fn liveliness(segment: Segment, time: f64) -> f64 {
    let share = match segment {
        Segment::Pelvis | Segment::Abdomen | Segment::Thorax | Segment::Head => 0.2,
        _ => 1.0,
    };
    let moves = smooth(time - 52.0) - smooth(time - 57.0) + smooth(time - 62.0);
    share * (0.03 + 0.97 * moves)
}

/// From 0 to 1 with steady rates at both ends.
fn smooth(place: f64) -> f64 {
    let place = place.clamp(0.0, 1.0);
    place * place * (3.0 - 2.0 * place)
}
