//! The way over ground, seen from above, north up.

use bodyflight_falls::fall::Jump;

use super::drawing::{Axis, PHASES, line, phases, round_step, shown, thinned};
use crate::fall::units::Units;

/// Size of the map (pixels), and its margin.
const SIZE: f64 = 460.0;
const MARGIN: f64 = 24.0;

/// Smallest extent that makes a map (m): a track of heights alone has none.
const LEAST: f64 = 20.0;

/// The map of a jump; nothing if the track has no positions.
pub(super) fn map(jump: &Jump, units: Units) -> String {
    let [from, to] = shown(jump);
    let places: Vec<(f64, [f64; 2])> = (jump.samples.iter())
        .filter(|sample| (from..=to).contains(&sample.time))
        .map(|sample| (sample.time, [-sample.position.y, sample.position.x]))
        .collect();
    let range = |axis: usize| {
        let values = || places.iter().map(|(_, place)| place[axis]);
        [
            values().fold(f64::MAX, f64::min),
            values().fold(f64::MIN, f64::max),
        ]
    };
    let (east, north) = (range(0), range(1));
    let extent = (east[1] - east[0]).max(north[1] - north[0]);
    if !extent.is_finite() || extent < LEAST {
        return String::new();
    }
    let around = |[low, high]: [f64; 2]| {
        let middle = 0.5 * (low + high);
        [middle - 0.5 * extent, middle + 0.5 * extent]
    };
    let x = Axis::new(around(east), [MARGIN, SIZE - MARGIN]);
    let y = Axis::new(around(north), [SIZE - MARGIN, MARGIN]);
    let mut svg = format!(
        "<svg width=\"{SIZE}\" height=\"{SIZE}\" viewBox=\"0 0 {SIZE} {SIZE}\" role=\"img\"><rect width=\"{SIZE}\" \
         height=\"{SIZE}\" fill=\"#f7f7f4\"/>"
    );
    for (phase, [begin, end]) in phases(jump) {
        let own: Vec<[f64; 2]> = (places.iter())
            .filter(|(time, _)| (begin..=end).contains(time))
            .map(|(_, [east, north])| [x.at(*east), y.at(*north)])
            .collect();
        svg += &line(&thinned(&own), PHASES[phase].1, 2.0);
    }
    let moments = [
        ("exit", jump.times.exit),
        ("opening", jump.times.opening),
        ("landing", jump.times.landing),
    ];
    for (name, moment) in moments {
        let Some(sample) = moment.and_then(|moment| jump.sample_at(moment.time)) else {
            continue;
        };
        let (x, y) = (x.at(-sample.position.y), y.at(sample.position.x));
        svg += &format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"#222\"/><text x=\"{:.1}\" y=\"{:.1}\">{name}</text>",
            x + 7.0,
            y - 5.0
        );
    }
    let factor = units.length_factor();
    let bar = round_step(0.2 * extent * factor);
    let width = bar / factor / extent * (SIZE - 2.0 * MARGIN);
    svg += &line(
        &[[MARGIN, SIZE - 10.0], [MARGIN + width, SIZE - 10.0]],
        "#222",
        2.0,
    );
    svg += &format!(
        "<text x=\"{:.1}\" y=\"{:.1}\">{bar:.0} {}</text><text x=\"{:.1}\" y=\"16\">N &#8593;</text></svg>\n",
        MARGIN + width + 6.0,
        SIZE - 6.0,
        units.length_name(),
        SIZE - 40.0
    );
    svg
}
