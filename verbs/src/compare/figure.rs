//! Two flights in one figure: their bodies at times that belong together, joints that differ, channels over each other.

use core::fmt::Write as _;

use bodyflight_core::Segment;
use bodyflight_core::body::posture::pose;
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::comparison::Channel;
use nalgebra::Vector3;

use super::joints::WINDOW;
use super::words::joint;
use super::{Compared, Track};
use crate::output::bodies::{BACK, LEFT, View, posed, seen};
use crate::output::figure::escaped;
use crate::output::plot::{Band, CHANGED, Curve, Line, Panel, UNCHANGED, figure_svg};

/// Width of the figure, of the square of a body, and heights of title and captions (px).
const WIDTH: f64 = 1000.0;
const COUNT: usize = 5;
const SQUARE: f64 = WIDTH / COUNT as f64;
const HEAD: f64 = 46.0;
const FOOT: f64 = 22.0;
/// Width of the square (m).
const METRES: f64 = 2.3;
/// Most joints marked and drawn over time.
const JOINTS: usize = 4;

const A: Line = Line {
    label: "A",
    ..UNCHANGED
};
const B: Line = Line {
    label: "B",
    ..CHANGED
};
const STYLE_A: &str = "fill=\"#d6e4f2\" stroke=\"#2b5f94\" stroke-width=\"0.8\"";
const STYLE_B: &str =
    "fill=\"#ffffff\" stroke=\"#9c2f00\" stroke-width=\"1.1\" stroke-dasharray=\"4 2\"";

/// Draws a comparison.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(title: &str, [a, b]: [&Track; 2], compared: &Compared) -> Result<String> {
    let plots = figure_svg("", &panels([a, b], compared))?;
    let top = HEAD + 2.0 * SQUARE + FOOT;
    let height: f64 = plots
        .split_once("height=\"")
        .and_then(|(_, rest)| rest.split_once('"')?.0.parse().ok())
        .unwrap_or(0.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n",
        top + height
    );
    let _ = writeln!(
        svg,
        "<text x=\"60\" y=\"20\" font-size=\"18\">{}</text>\n<text x=\"60\" y=\"38\">A {} is filled, B {} dashed over it; \
         circles mark joints that differ, with what B has more in degrees</text>",
        escaped(title),
        escaped(&a.name),
        escaped(&b.name)
    );
    bodies(&mut svg, [a, b], compared);
    svg.push_str(&plots.replacen("<svg ", &format!("<svg y=\"{top}\" "), 1));
    svg.push_str("</svg>\n");
    Ok(svg)
}

/// Angles to draw: those that are told, by effect, or those that differ most for their errors.
pub(super) fn drawn(compared: &Compared) -> Vec<usize> {
    let pair = &compared.pair;
    let place = |name: &str| pair.joints.iter().position(|joint| joint.joint == name);
    let told = pair.by_effect.iter();
    let mut drawn: Vec<usize> = told
        .filter_map(|told| place(&pair.differences[*told].joint))
        .collect();
    if drawn.is_empty() {
        let ratio = |k: &usize| pair.joints[*k].rms_difference_rad / pair.joints[*k].deviation_rad;
        drawn = (0..pair.joints.len()).collect();
        drawn.sort_by(|x, y| ratio(y).total_cmp(&ratio(x)));
        drawn.truncate(2);
    }
    drawn.truncate(JOINTS);
    drawn
}

/// Instants to draw, in A (s since frame 0): evenly over the time in which differences begin, or all of it.
fn instants(compared: &Compared) -> [f64; COUNT] {
    let [begin, end] = compared.matched.span();
    let origin = compared.matched.alignment.a_s;
    let starts = compared.pair.differences.iter().map(|told| told.time_s[0]);
    let (first, last) = starts.fold((f64::INFINITY, f64::NEG_INFINITY), |(first, last), at| {
        (first.min(at), last.max(at))
    });
    let [from, to] = if first.is_finite() {
        [
            (first + origin).max(begin),
            (last + origin + WINDOW).min(end),
        ]
    } else {
        [begin, end]
    };
    core::array::from_fn(|k| from + (to - from) * k as f64 / (COUNT - 1) as f64)
}

/// The joints that differ at an instant: the segment, and the largest difference of its angles (degrees).
fn marks(compared: &Compared, time: f64) -> Vec<(Segment, f64)> {
    let origin = compared.matched.alignment.a_s;
    let differences = &compared.differences;
    let row = differences.times.partition_point(|(at, _)| *at < time);
    let Some(row) = differences
        .rows
        .get(row.min(differences.rows.len().saturating_sub(1)))
    else {
        return Vec::new();
    };
    let mut marks: Vec<(Segment, f64)> = Vec::new();
    for told in &compared.pair.differences {
        let [from, to] = told.time_s.map(|at| at + origin);
        let angle = differences
            .angles
            .iter()
            .position(|angle| angle.to_string() == told.joint);
        let Some(angle) = angle.filter(|_| (from - 1e-6..=to + 1e-6).contains(&time)) else {
            continue;
        };
        let (segment, by) = (
            differences.angles[angle].segment,
            row[angle][2].to_degrees(),
        );
        match marks.iter_mut().find(|(own, _)| *own == segment) {
            Some((_, most)) if most.abs() < by.abs() => *most = by,
            Some(_) => {}
            None => marks.push((segment, by)),
        }
    }
    marks
}

fn bodies(svg: &mut String, [a, b]: [&Track; 2], compared: &Compared) {
    let scale = SQUARE / METRES;
    let origin = compared.matched.alignment.a_s;
    let [body_a, body_b] = [a, b].map(|track| track.flight.subject.body());
    for (k, time) in instants(compared).into_iter().enumerate() {
        let postures = [a.posture(time), b.posture(compared.matched.b_at(time))];
        let solids = [posed(&body_a, &postures[0]), posed(&body_b, &postures[1])];
        let joints = pose(&body_a, &postures[0]);
        for (row, view) in [BACK, LEFT].iter().enumerate() {
            let centre = [
                SQUARE * (k as f64 + 0.5),
                HEAD + SQUARE * (row as f64 + 0.5),
            ];
            for ellipse in seen(view, &solids[0]) {
                ellipse.write(svg, centre, scale, STYLE_A);
            }
            // As one layer, so that it hides its own lines and not those of the other.
            svg.push_str("<g opacity=\"0.55\">\n");
            for ellipse in seen(view, &solids[1]) {
                ellipse.write(svg, centre, scale, STYLE_B);
            }
            svg.push_str("</g>\n");
            for (segment, by) in marks(compared, time) {
                let joint = &joints[segment].joint;
                mark(svg, view, (centre, scale), joint, (segment, by));
            }
            if k == 0 {
                let _ = writeln!(
                    svg,
                    "<text x=\"6\" y=\"{:.1}\" font-size=\"10\">{}</text>",
                    centre[1] - 0.5 * SQUARE + 12.0,
                    view.name
                );
            }
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{:.2} s</text>",
            SQUARE * (k as f64 + 0.5),
            HEAD + 2.0 * SQUARE + 14.0,
            time - origin
        );
    }
}

/// A circle around a joint, with degrees beside it.
fn mark(
    svg: &mut String,
    view: &View,
    (centre, scale): ([f64; 2], f64),
    joint: &Vector3<f64>,
    (segment, by): (Segment, f64),
) {
    let [right, up] = view.place(joint);
    let (x, y) = (centre[0] + right * scale, centre[1] - up * scale);
    let _ = writeln!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"8\" fill=\"none\" stroke=\"#000000\" stroke-width=\"1.6\"/>\
         <text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" font-weight=\"bold\">{by:+.0}</text>",
        x + 9.0,
        // Joints of both sides may coincide in the picture.
        if segment.name().starts_with("r_") {
            y + 14.0
        } else {
            y - 6.0
        }
    );
}

fn panels(tracks: [&Track; 2], compared: &Compared) -> Vec<Panel> {
    let shown = [
        Channel::YawRate,
        Channel::VerticalVelocity,
        Channel::Pitch,
        Channel::HorizontalVelocity,
    ];
    let angles = drawn(compared).into_iter();
    let angles = angles.map(|angle| angle_panel(tracks[0], compared, angle));
    let channels = shown.into_iter();
    channels
        .map(|channel| channel_panel(tracks, compared, channel))
        .chain(angles)
        .collect()
}

fn channel_panel([a, b]: [&Track; 2], compared: &Compared, channel: Channel) -> Panel {
    let origin = compared.matched.alignment.a_s;
    let times = &compared.differences.times;
    let (label, (unit, factor)) = (channel.titled(), channel.drawn());
    let apart = factor * compared.pair.channels.rms_difference.get(channel);
    let curve = |line: Line, value: &dyn Fn(&(f64, f64)) -> f64| Curve {
        line,
        points: (times.iter())
            .map(|pair| (pair.0 - origin, factor * value(pair)))
            .collect(),
    };
    Panel {
        caption: format!("{label} ({unit}): RMS of B - A {apart:.1}"),
        curves: vec![
            curve(A, &|pair| a.channel(channel, pair.0)),
            curve(B, &|pair| b.channel(channel, pair.1)),
        ],
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: channel.is_angle(),
    }
}

/// An angle of A, and how much further B is turned, with what the suits explain around A.
fn angle_panel(a: &Track, compared: &Compared, k: usize) -> Panel {
    let origin = compared.matched.alignment.a_s;
    let differences = &compared.differences;
    let angle = differences.angles[k];
    let first = a.posture(compared.matched.span()[0]);
    let own: Vec<(f64, f64)> = (differences.times.iter())
        .map(|(at, _)| {
            (
                at - origin,
                angle.since(&first, &a.posture(*at)).to_degrees(),
            )
        })
        .collect();
    let apart = differences.rows.iter().map(|row| row[k][2].to_degrees());
    let other = own.iter().zip(apart);
    let other = other
        .map(|((time, own), apart)| (*time, own + apart))
        .collect();
    let least = compared.pair.joints[k].least_named_rad.to_degrees();
    let mut told = compared.pair.differences.iter();
    let said = told
        .find(|told| told.joint == angle.to_string())
        .map_or_else(
            || "B within the assumed errors of the suits".to_owned(),
            |told| {
                format!(
                    "B {:+.0} +- {:.0} from {:.2} s",
                    told.difference_rad.to_degrees(),
                    told.deviation_rad.to_degrees(),
                    told.time_s[0]
                )
            },
        );
    let name = joint(angle.segment);
    let bounds = own
        .iter()
        .map(|(time, own)| (*time, own - least, own + least));
    Panel {
        caption: format!("{name}, {angle} (degrees): {said}; band: what the suits explain"),
        shades: Vec::new(),
        bands: vec![Band {
            line: A,
            bounds: bounds.collect(),
        }],
        curves: vec![
            Curve {
                line: A,
                points: own,
            },
            Curve {
                line: B,
                points: other,
            },
        ],
        wraps: false,
    }
}
