//! The first frame as text art, in which an arm that points the wrong way is easy to see.

use bodyflight_core::{Body, Segment};
use nalgebra::Vector3;

use crate::output::limbs::{Limb, Side, limbs};
use bodyflight_mvnx::recording::FlightFrame;

/// Size of each of the two views (characters); a character is twice as high as wide.
const WIDTH: usize = 36;
const HEIGHT: usize = 20;

/// Number of points drawn along a limb.
const POINTS: usize = 24;

/// Draws the body in body axes, from the front (its left is on the right) and from its left (its front is on the left).
pub(crate) fn first_frame(body: &Body<f64>, frame: &FlightFrame) -> String {
    let limbs = limbs(body, &frame.posture);
    let ends = || limbs.iter().flat_map(|limb| [limb.from, limb.to]);
    let (low, high) = ends().fold(
        (
            Vector3::repeat(f64::INFINITY),
            Vector3::repeat(f64::NEG_INFINITY),
        ),
        |(low, high), end| (low.inf(&end), high.sup(&end)),
    );
    let middle = (low + high) * 0.5;
    let width = (high - low).xy().max().max(0.1);
    let scale = (WIDTH as f64 - 3.0) / 2.0 / width;
    let scale = scale.min((HEIGHT as f64 - 2.0) / (high.z - low.z).max(0.1));
    let mut views = [[[' '; WIDTH]; HEIGHT]; 2];
    for (view, axis) in views.iter_mut().zip([Vector3::x(), Vector3::y()]) {
        for limb in &limbs {
            for step in 0..=POINTS {
                let point = limb.from.lerp(&limb.to, step as f64 / POINTS as f64) - middle;
                let across = WIDTH as f64 / 2.0 + 2.0 * scale * axis.dot(&point);
                let down = HEIGHT as f64 / 2.0 - scale * point.z;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "an index within the picture"
                )]
                let place = (down.max(0.0) as usize, across.max(0.0) as usize);
                if let Some(letter) = view.get_mut(place.0).and_then(|row| row.get_mut(place.1)) {
                    *letter = letter_of(limb, step == POINTS);
                }
            }
        }
    }
    let [front, left] = views;
    let rows = front.iter().zip(&left).map(|(front, left)| {
        let text = |row: &[char]| row.iter().collect::<String>();
        format!("    {}  {}", text(front), text(left))
            .trim_end()
            .to_owned()
    });
    rows.collect::<Vec<_>>().join("\n")
}

/// The character for a limb, along it and at its free end.
fn letter_of(limb: &Limb, at_end: bool) -> char {
    match (limb.segment, limb.side) {
        (Segment::Head, _) if limb.is_end && at_end => 'O',
        (Segment::RightHand, _) if limb.is_end && at_end => 'R',
        (Segment::LeftHand, _) if limb.is_end && at_end => 'L',
        (_, Side::Left) => '/',
        (_, Side::Right) => '\\',
        (_, Side::Middle) => '|',
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::{Rotation, Vector};

    use super::*;
    use bodyflight_mvnx::recording::PelvisMotion;
    use bodyflight_replay::subject::Subject;

    #[test]
    fn standing_with_arms_down_has_the_head_on_top_and_the_hands_at_the_sides() {
        let frame = FlightFrame {
            index: 0,
            time: 0.0,
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
        let picture = first_frame(&Subject::default().body(), &frame);
        let rows: Vec<&str> = picture.lines().collect();
        let row_of = |letter: char| rows.iter().position(|row| row.contains(letter)).unwrap();
        assert!(row_of('O') < 3, "{picture}");
        assert!(
            (8..14).contains(&row_of('R')) && row_of('R') == row_of('L'),
            "{picture}"
        );
        let row = rows[row_of('R')];
        assert!(row.find('R') < row.find('L'), "{picture}");
    }
}
