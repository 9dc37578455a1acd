//! Height, speeds and drag area over time, with the phases as coloured backgrounds.

use bodyflight_falls::Sample;
use bodyflight_falls::fall::Jump;

use super::drawing::{Axis, PHASES, line, parts, phases, shown};
use crate::fall::units::Units;

/// Size of a chart and its margins (pixels).
const WIDTH: f64 = 920.0;
const HEIGHT: f64 = 170.0;
const LEFT: f64 = 58.0;
const TOP: f64 = 20.0;
const BOTTOM: f64 = 18.0;

/// Colours of lines that are not coloured by phase.
const DOWN: &str = "#c8352c";
const ACROSS: &str = "#1f6fb2";
const PIECE: &str = "#222222";
const SECOND: &str = "#c98a00";

/// Largest drag area that is drawn for a body (m2).
const LARGEST: f64 = 2.5;

/// All charts of a jump.
pub(super) fn charts(jump: &Jump, mass: f64, units: Units) -> String {
    let times = shown(jump);
    let (length, speed) = (units.length_factor(), units.speed_factor());
    let height = chart(
        jump,
        times,
        &format!("height above mean sea level ({})", units.length_name()),
        &[(PIECE, parts(jump, times, |sample| length * sample.height()))],
    );
    let speeds = chart(
        jump,
        times,
        &format!(
            "speed ({}): <tspan fill=\"{DOWN}\">downwards</tspan>, <tspan fill=\"{ACROSS}\">over ground</tspan>",
            units.speed_name()
        ),
        &[
            (ACROSS, parts(jump, times, |sample| speed * sample.across())),
            (
                DOWN,
                parts(jump, times, |sample| -speed * sample.velocity.z),
            ),
        ],
    );
    height + &speeds + &drag(jump, mass)
}

/// A small drawing of the height over time, for a table.
pub(super) fn small(jump: &Jump) -> String {
    let times = shown(jump);
    let lines = parts(jump, times, Sample::height);
    let heights = || lines.iter().flatten().map(|[_, height]| *height);
    let range = [
        heights().fold(f64::MAX, f64::min),
        heights().fold(f64::MIN, f64::max),
    ];
    let (x, y) = (
        Axis::new(times, [1.0, 119.0]),
        Axis::new(range, [27.0, 1.0]),
    );
    let mut svg = "<svg width=\"120\" height=\"28\" viewBox=\"0 0 120 28\">".to_owned();
    for (phase, [from, to]) in phases(jump) {
        let own: Vec<[f64; 2]> = lines
            .iter()
            .flatten()
            .filter(|[time, _]| (from..=to).contains(time))
            .map(|[time, height]| [x.at(*time), y.at(*height)])
            .collect();
        svg += &line(&own, PHASES[phase].1, 1.5);
    }
    svg + "</svg>"
}

/// Drag area of the fall: each second with its standard deviation, and the pieces of constant posture with theirs.
fn drag(jump: &Jump, mass: f64) -> String {
    let [begin, end] = jump.times.fall;
    let times = [begin - 1.0, end + 1.0];
    let pieces: Vec<Vec<[f64; 2]>> = jump
        .pieces
        .iter()
        .map(|piece| piece.time.map(|time| [time, mass * piece.drag]).to_vec())
        .collect();
    if pieces.is_empty() {
        return String::new();
    }
    let largest = pieces
        .iter()
        .flatten()
        .map(|[_, area]| *area)
        .fold(0.0, f64::max);
    let high = (1.6 * largest).clamp(0.1, LARGEST);
    let mut frame = Frame::new(
        jump,
        times,
        [0.0, high],
        "drag area (m2): each second and each posture, with one standard deviation",
    );
    for block in &jump.blocks {
        let bounds = [-1.0, 1.0].map(|side| {
            [
                frame.x.at(block.time),
                frame.y.at(mass * (block.drag + side * block.deviation)),
            ]
        });
        frame.svg += &line(&bounds, SECOND, 1.0);
        frame.svg += &format!(
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.6\" fill=\"{SECOND}\"/>",
            frame.x.at(block.time),
            frame.y.at(mass * block.drag)
        );
    }
    for piece in &jump.pieces {
        let [from, to] = piece.time.map(|time| frame.x.at(time));
        let [low, high] =
            [-1.0, 1.0].map(|side| frame.y.at(mass * (piece.drag + side * piece.deviation)));
        frame.svg += &format!(
            "<rect x=\"{from:.1}\" y=\"{high:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{PIECE}\" opacity=\"0.25\"/>",
            to - from,
            low - high
        );
    }
    frame.lines(PIECE, &pieces);
    frame.end()
}

fn chart(
    jump: &Jump,
    times: [f64; 2],
    caption: &str,
    curves: &[(&str, Vec<Vec<[f64; 2]>>)],
) -> String {
    let values = || {
        curves
            .iter()
            .flat_map(|(_, parts)| parts.iter().flatten())
            .map(|[_, value]| *value)
    };
    let low = values().fold(f64::MAX, f64::min);
    let high = values().fold(f64::MIN, f64::max);
    if low > high {
        return String::new();
    }
    let mut frame = Frame::new(jump, times, [low, high], caption);
    for (colour, parts) in curves {
        frame.lines(colour, parts);
    }
    frame.end()
}

/// A chart that is being drawn.
struct Frame {
    x: Axis,
    y: Axis,
    svg: String,
}

impl Frame {
    fn new(jump: &Jump, times: [f64; 2], range: [f64; 2], caption: &str) -> Self {
        let x = Axis::new(times, [LEFT, WIDTH - 8.0]);
        let y = Axis::new(range, [HEIGHT - BOTTOM, TOP]);
        let mut svg = format!(
            "<svg width=\"{WIDTH}\" height=\"{HEIGHT}\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\"><text x=\"{LEFT}\" \
             y=\"13\">{caption}</text>"
        );
        for (phase, [from, to]) in phases(jump) {
            let [from, to] = [from, to].map(|time| x.at(time));
            let (name, colour, background) = PHASES[phase];
            svg += &format!(
                "<rect x=\"{from:.1}\" y=\"{TOP}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{background}\"/>",
                to - from,
                HEIGHT - BOTTOM - TOP
            );
            if phase > 0 && to - from > 45.0 {
                svg += &format!(
                    "<text x=\"{:.1}\" y=\"{:.1}\" style=\"fill:{colour}\">{name}</text>",
                    from + 4.0,
                    TOP + 12.0
                );
            }
        }
        for tick in y.ticks(4.0) {
            let place = y.at(tick);
            svg += &line(&[[LEFT, place], [WIDTH - 8.0, place]], "#dddddd", 0.7);
            svg += &format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 5.0,
                place + 4.0,
                number(tick)
            );
        }
        let begin = jump.times.fall[0];
        for tick in Axis::new(times.map(|time| time - begin), [0.0, 1.0]).ticks(9.0) {
            svg += &format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{} s</text>",
                x.at(tick + begin),
                HEIGHT - 4.0,
                number(tick)
            );
        }
        Self { x, y, svg }
    }

    fn lines(&mut self, colour: &str, parts: &[Vec<[f64; 2]>]) {
        for part in parts {
            let places: Vec<[f64; 2]> = part
                .iter()
                .map(|[time, value]| [self.x.at(*time), self.y.at(*value)])
                .collect();
            self.svg += &line(&places, colour, 1.5);
        }
    }

    fn end(self) -> String {
        self.svg + "</svg>\n"
    }
}

/// A number at an axis, with decimals only if it has some.
fn number(value: f64) -> String {
    if (value - value.round()).abs() < 1e-6 {
        // A rounded negative value has the sign too.
        format!("{:.0}", value.round() + 0.0)
    } else {
        format!("{:.2}", value).trim_end_matches('0').to_owned()
    }
}
