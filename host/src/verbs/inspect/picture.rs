//! The first frame as a picture of letters: an arm that points the wrong way is seen at once.

use bodyflight_core::body::posture::pose;
use bodyflight_core::{Body, Segment};
use nalgebra::Vector3;

use crate::formats::recording::FlightFrame;

/// Size of each of the two views (letters); a letter is twice as high as wide.
const WIDTH: usize = 36;
const HEIGHT: usize = 20;

/// Points along a limb.
const POINTS: usize = 24;

/// The body in body axes, from the front (its left is right) and from its left (its front is left).
pub(super) fn first_frame(body: &Body<f64>, frame: &FlightFrame) -> String {
    let limbs = limbs(body, frame);
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
                    reason = "a place in a picture"
                )]
                let place = (down.max(0.0) as usize, across.max(0.0) as usize);
                if let Some(letter) = view.get_mut(place.0).and_then(|row| row.get_mut(place.1)) {
                    *letter = if step == POINTS { limb.end } else { limb.line };
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

/// A line of the picture, body axes (m).
struct Limb {
    from: Vector3<f64>,
    to: Vector3<f64>,
    line: char,
    end: char,
}

/// From each joint to the next, and to the far side of what has none.
fn limbs(body: &Body<f64>, frame: &FlightFrame) -> Vec<Limb> {
    let posed = pose(body, &frame.posture);
    let mut limbs = Vec::new();
    for segment in Segment::ALL {
        let name = segment.name();
        let line = match name.as_bytes() {
            [b'l', b'_', ..] => '/',
            [b'r', b'_', ..] => '\\',
            _ => '|',
        };
        let end = match segment {
            Segment::Head => 'O',
            Segment::RightHand => 'R',
            Segment::LeftHand => 'L',
            _ => line,
        };
        let own = &posed[segment];
        let far = own.cg * 2.0 - own.joint;
        let children = Segment::ALL
            .iter()
            .filter(|child| child.parent() == Some(segment));
        let mut joints = children.map(|child| posed[*child].joint).peekable();
        if joints.peek().is_none() {
            limbs.push(Limb {
                from: own.joint,
                to: far,
                line,
                end,
            });
        }
        limbs.extend(joints.map(|to| Limb {
            from: own.joint,
            to,
            line,
            end: line,
        }));
    }
    limbs
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::{Rotation, Vector};

    use super::*;
    use crate::formats::recording::PelvisMotion;
    use crate::formats::subject::Subject;

    #[test]
    fn standing_arms_down_the_head_is_on_top_and_the_hands_are_beside() {
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
