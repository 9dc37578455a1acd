//! A posed body drawn as lines between its joints, for pictures of a posture.

use core::fmt::Write as _;

use bodyflight_core::body::posture::pose;
use bodyflight_core::frame::{self, Inertial, Rotation};
use bodyflight_core::{Body, Posture, Segment};
use nalgebra::Vector3;

use super::figure::escaped;

/// Size of a view, its margin, and the height of its title (px).
const VIEW: f64 = 250.0;
const EDGE: f64 = 26.0;
const HEAD: f64 = 44.0;

/// Side of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
    /// Trunk and head.
    Middle,
}

/// A line of the picture, body axes (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limb {
    /// The segment it draws.
    pub segment: Segment,
    /// The side of the body it is on.
    pub side: Side,
    /// The joint of the segment.
    pub from: Vector3<f64>,
    /// The joint of a child segment, or the far end of the segment.
    pub to: Vector3<f64>,
    /// Whether the segment has no child.
    pub is_end: bool,
}

/// Lines from each joint to those of the child segments, or to the far end of a segment without children.
pub fn limbs(body: &Body<f64>, posture: &Posture<f64>) -> Vec<Limb> {
    let posed = pose(body, posture);
    let mut limbs = Vec::new();
    for segment in Segment::ALL {
        let own = &posed[segment];
        let limb = |to: Vector3<f64>, is_end: bool| Limb {
            segment,
            side: match segment.name().as_bytes() {
                [b'l', b'_', ..] => Side::Left,
                [b'r', b'_', ..] => Side::Right,
                _ => Side::Middle,
            },
            from: own.joint,
            to,
            is_end,
        };
        let children = Segment::ALL
            .iter()
            .filter(|child| child.parent() == Some(segment));
        let before = limbs.len();
        limbs.extend(children.map(|child| limb(posed[*child].joint, false)));
        if limbs.len() == before {
            limbs.push(limb(own.cg * 2.0 - own.joint, true));
        }
    }
    limbs
}

/// A view: its title, the directions to the right and up, and labels at the edges.
struct View {
    title: &'static str,
    right: Vector3<f64>,
    up: Vector3<f64>,
    edges: [&'static str; 3],
}

/// The body from the front and from its left, in body axes, and as it is oriented in the world, seen from the south and
/// from above.
///
/// The left side is red, the right side is green; L and R mark the hands, O the head.
pub fn svg(
    title: &str,
    body: &Body<f64>,
    posture: &Posture<f64>,
    inertial_from_body: Rotation<f64, Inertial, frame::Body>,
) -> String {
    let body_from_inertial = inertial_from_body.quaternion().inverse();
    let views = [
        View {
            title: "from the front",
            right: Vector3::x(),
            up: Vector3::z(),
            edges: ["its right", "its left", "cranial"],
        },
        View {
            title: "from its left",
            right: Vector3::y(),
            up: Vector3::z(),
            edges: ["front", "back", "cranial"],
        },
        View {
            title: "in the world, from the south",
            right: body_from_inertial * -Vector3::y(),
            up: body_from_inertial * Vector3::z(),
            edges: ["west", "east", "up"],
        },
        View {
            title: "in the world, from above",
            right: body_from_inertial * -Vector3::y(),
            up: body_from_inertial * Vector3::x(),
            edges: ["west", "east", "north"],
        },
    ];
    let (width, height) = (VIEW * views.len() as f64, HEAD + VIEW);
    let plain = escaped(title);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<text x=\"8\" y=\"18\" font-size=\"14\">{plain}</text>\n"
    );
    let limbs = limbs(body, posture);
    for (place, view) in views.iter().enumerate() {
        view.draw(&mut svg, &limbs, VIEW * place as f64);
    }
    svg.push_str("</svg>\n");
    svg
}

impl View {
    fn draw(&self, svg: &mut String, limbs: &[Limb], left: f64) {
        let flat = |point: &Vector3<f64>| [self.right.dot(point), self.up.dot(point)];
        let ends = || {
            limbs
                .iter()
                .flat_map(|limb| [flat(&limb.from), flat(&limb.to)])
        };
        let range = |axis: usize| {
            ends().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), end| {
                (low.min(end[axis]), high.max(end[axis]))
            })
        };
        let (across, along) = (range(0), range(1));
        let size = (across.1 - across.0).max(along.1 - along.0).max(0.1);
        let scale = (VIEW - 2.0 * EDGE) / size;
        let centre = [left + VIEW / 2.0, HEAD + VIEW / 2.0];
        let place = |point: &Vector3<f64>| {
            let [x, y] = flat(point);
            [
                centre[0] + scale * (x - (across.0 + across.1) / 2.0),
                // The y axis of an SVG points down.
                centre[1] - scale * (y - (along.0 + along.1) / 2.0),
            ]
        };
        let [west, east, north] = self.edges;
        // Writing to a String cannot fail.
        let _ = writeln!(
            svg,
            "<text x=\"{:.0}\" y=\"{:.0}\" font-weight=\"bold\">{}</text>\n\
             <g fill=\"#777777\"><text x=\"{:.0}\" y=\"{:.0}\">{west}</text><text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"end\">{east}</text>\
             <text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{north} ↑</text></g>",
            left + 8.0,
            HEAD - 8.0,
            self.title,
            left + 8.0,
            HEAD + VIEW - 8.0,
            left + VIEW - 8.0,
            HEAD + VIEW - 8.0,
            centre[0],
            HEAD + 8.0,
        );
        for limb in limbs {
            let ([x1, y1], [x2, y2]) = (place(&limb.from), place(&limb.to));
            let colour = match limb.side {
                Side::Left => "#c62828",
                Side::Right => "#2e7d32",
                Side::Middle => "#37474f",
            };
            let _ = writeln!(
                svg,
                "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"{colour}\" stroke-width=\"5\" stroke-linecap=\"round\"/>"
            );
            let letter = match limb.segment {
                Segment::Head => "O",
                Segment::LeftHand => "L",
                Segment::RightHand => "R",
                _ => continue,
            };
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\" font-size=\"14\" font-weight=\"bold\">{letter}</text>",
                x2 + 4.0,
                y2 - 4.0
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_mvnx::xsens;
    use bodyflight_replay::subject::Subject;

    /// Positions of the letter in the views.
    fn places(svg: &str, letter: char) -> Vec<[f64; 2]> {
        let number = |line: &str, key: &str| -> f64 {
            let from = line.split(&format!("{key}=\"")).nth(1).unwrap();
            from.split('"').next().unwrap().parse().unwrap()
        };
        svg.lines()
            .filter(|line| line.ends_with(&format!(">{letter}</text>")))
            .map(|line| [number(line, " x"), number(line, " y")])
            .collect()
    }

    #[test]
    fn each_view_shows_what_its_title_says() {
        let body = Subject::default().body();
        let svg = svg("<a>", &body, &xsens::t_pose(), xsens::facing_forward());
        assert!(svg.contains("&lt;a>"));
        let (head, left, right) = (places(&svg, 'O'), places(&svg, 'L'), places(&svg, 'R'));
        assert_eq!((head.len(), left.len()), (4, 4));
        // From the front, the left hand is on the right; when the body faces north and is seen from the south, it is on
        // the left.
        assert!(left[0][0] > head[0][0] && head[0][0] > right[0][0]);
        assert!(left[2][0] < head[2][0] && head[2][0] < right[2][0]);
        assert!(head[0][1] < left[0][1] && head[2][1] < left[2][1]);
    }
}
