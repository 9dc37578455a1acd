//! Several flights in one figure: the same axes, a colour for each, and each with its own error bars.

use super::drawn::Drawn;
use super::top_view;
use crate::output::plot::{
    Band, Curve, FLIGHTS, Line, Panel, figure_svg, measured_curve, simulated_curve,
};
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::input_history::InputRow;

/// What flights are called in legends and file names.
pub(super) const LETTERS: [&str; FLIGHTS.len()] = ["A", "B", "C", "D", "E"];

/// The inputs, each with its place among the columns after the time.
const INPUT_NAMES: [&str; 6] = [
    "muscle input, pitch",
    "muscle input, yaw",
    "muscle input, roll",
    "damping, pitch",
    "damping, yaw",
    "damping, roll",
];

/// Reconstruction, inputs and top view of several flights.
pub(super) fn figures(flights: &[Drawn], title: Option<&str>) -> Result<[String; 3]> {
    let title = titled(flights, title);
    let each = || FLIGHTS.into_iter().zip(flights);
    let first = flights.first().map_or(&[][..], |flight| flight.channels);
    let channels = first.iter().map(|channel| of_channel(*channel, each()));
    let inputs = INPUT_NAMES.iter().enumerate();
    let inputs = inputs.map(|(place, name)| of_input(place, name, each()));
    let paths: Vec<([Line; 2], _)> = each().map(|(lines, f)| (lines, &f.series)).collect();
    Ok([
        figure_svg(&title, &channels.collect::<Vec<_>>())?,
        figure_svg(&title, &inputs.collect::<Vec<_>>())?,
        top_view::svg(&title, &paths)?,
    ])
}

/// Which letter is which flight, unless another title is given, and which are doubtful in either case.
fn titled(flights: &[Drawn], title: Option<&str>) -> String {
    let each = LETTERS.iter().zip(flights);
    let Some(title) = title else {
        let names =
            each.map(|(letter, flight)| flight.titled(&format!("{letter}: {}", flight.name)));
        return names.collect::<Vec<_>>().join(", ");
    };
    let doubted = each.filter(|(_, flight)| flight.doubt.is_some());
    let doubted: Vec<&str> = doubted.map(|(letter, _)| *letter).collect();
    match doubted.as_slice() {
        [] => title.to_owned(),
        letters => format!("{title} ({} doubtful)", letters.join(", "))
            .trim_start()
            .to_owned(),
    }
}

/// A channel of each flight, measured and with estimated inputs.
fn of_channel<'a>(
    channel: Channel,
    flights: impl Iterator<Item = ([Line; 2], &'a Drawn)>,
) -> Panel {
    let (label, (unit, factor)) = (channel.titled(), channel.drawn());
    let (mut curves, mut gaps) = (Vec::new(), Vec::new());
    for ([measured, estimated], flight) in flights {
        curves.push(Curve {
            line: measured,
            ..measured_curve(channel, &flight.pairs)
        });
        curves.push(simulated_curve(channel, &flight.pairs, estimated));
        let gap = factor * flight.estimation.report.rms.get(channel);
        gaps.push(format!("{gap:.2}"));
    }
    Panel {
        caption: format!("{label} ({unit}): RMS gap {}", gaps.join(", ")),
        curves,
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: channel.is_angle(),
    }
}

/// An input of each flight, with a band of two standard deviations.
fn of_input<'a>(
    place: usize,
    name: &str,
    flights: impl Iterator<Item = ([Line; 2], &'a Drawn)>,
) -> Panel {
    // The first column is the time.
    let of = |row: &InputRow| row.columns().get(place + 1).copied().unwrap_or(f64::NAN);
    let (mut curves, mut bands) = (Vec::new(), Vec::new());
    for ([_, line], flight) in flights {
        let points = &flight.estimation.points;
        let values = points.iter().map(|point| (point.time, of(&point.inputs)));
        let bounds = points.iter().map(|point| {
            let (middle, spread) = (of(&point.inputs), 2.0 * of(&point.deviation));
            (point.time, middle - spread, middle + spread)
        });
        bands.push(Band {
            line,
            bounds: bounds.collect(),
        });
        curves.push(Curve {
            line,
            points: values.collect(),
        });
    }
    Panel {
        caption: format!("{name}, with bands of two standard deviations"),
        curves,
        bands,
        shades: Vec::new(),
        wraps: false,
    }
}
