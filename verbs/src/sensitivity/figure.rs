//! The figure of a sensitivity: a row for each parameter, a column for each channel, and a point for each change.

use std::fmt::Write as _;

use super::{Effect, Report, SHOWN};
use crate::output::figure::escaped;

/// Widths of the names and of a column, height of a row, and space above and below the rows (px).
const NAMES: f64 = 130.0;
const COLUMN: f64 = 180.0;
const ROW: f64 = 26.0;
const HEAD: f64 = 84.0;
const FOOT: f64 = 34.0;
/// Space at the ends of a column (px).
const MARGIN: f64 = 24.0;

const COLOUR: &str = "#9c2f00";

/// A point: hollow for a smaller parameter, filled for a larger one.
fn point(svg: &mut String, [x, y]: [f64; 2], factor: f64) {
    let fill = if factor < 1.0 { "#ffffff" } else { COLOUR };
    let _ = writeln!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{fill}\" stroke=\"{COLOUR}\" stroke-width=\"1.5\"/>"
    );
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, content: &str) {
    let content = escaped(content);
    let _ = writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{content}</text>"
    );
}

/// A round number that is at least this, as the end of an axis.
fn round_above(value: f64) -> f64 {
    let decade = 10_f64.powf(value.max(1e-3).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0];
    let step = steps.into_iter().find(|step| step * decade >= value);
    step.unwrap_or(10.0) * decade
}

impl Report {
    /// The figure, from free runs with the same postures and inputs.
    pub fn svg(&self, title: &str) -> String {
        let mut parameters: Vec<&'static str> = Vec::new();
        for effect in &self.effects {
            let label = effect.parameter.label();
            if !parameters.contains(&label) {
                parameters.push(label);
            }
        }
        let width = NAMES + COLUMN * SHOWN.len() as f64 + MARGIN;
        let bottom = HEAD + ROW * parameters.len() as f64;
        let height = bottom + FOOT;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n<text x=\"8\" y=\"20\" font-size=\"16\">{}</text>\n",
            escaped(title)
        );
        let mut factors: Vec<f64> = self.effects.iter().map(|effect| effect.factor).collect();
        factors.sort_by(f64::total_cmp);
        factors.dedup();
        for (k, factor) in factors.iter().enumerate() {
            let x = 14.0 + 150.0 * k as f64;
            point(&mut svg, [x, 40.0], *factor);
            let percent = 100.0 * (factor - 1.0);
            text(
                &mut svg,
                [x + 10.0, 44.0],
                "start",
                &format!("parameter {percent:+.0} %"),
            );
        }
        text(
            &mut svg,
            [width - 8.0, 44.0],
            "end",
            "change of the motion: RMS, % of the channel's largest size",
        );
        for (row, name) in parameters.iter().enumerate() {
            let y = HEAD + ROW * (row as f64 + 0.5);
            text(&mut svg, [NAMES - 8.0, y + 4.0], "end", name);
            let _ = writeln!(
                svg,
                "<path d=\"M{NAMES} {y:.1}H{width}\" stroke=\"#000000\" stroke-opacity=\"0.1\"/>"
            );
        }
        for (column, channel) in SHOWN.into_iter().enumerate() {
            let amplitude = self.amplitude.get(channel).max(1e-9);
            let share = |effect: &Effect| 100.0 * effect.change.get(channel) / amplitude;
            let most = round_above(self.effects.iter().map(share).fold(0.0, f64::max));
            let left = NAMES + COLUMN * column as f64 + MARGIN;
            let scale = (COLUMN - 2.0 * MARGIN) / most;
            text(
                &mut svg,
                [left + 0.5 * (COLUMN - 2.0 * MARGIN), HEAD - 14.0],
                "middle",
                channel.label().0,
            );
            for tick in [0.0, 0.5 * most, most] {
                let x = left + scale * tick;
                let _ = writeln!(
                    svg,
                    "<path d=\"M{x:.1} {HEAD}V{bottom}\" stroke=\"#000000\" stroke-opacity=\"0.2\"/>"
                );
                text(&mut svg, [x, bottom + 16.0], "middle", &format!("{tick} %"));
            }
            for effect in &self.effects {
                let label = effect.parameter.label();
                let row = parameters.iter().position(|name| *name == label);
                let y = HEAD + ROW * (row.unwrap_or(0) as f64 + 0.5);
                point(&mut svg, [left + scale * share(effect), y], effect.factor);
            }
        }
        svg.push_str("</svg>\n");
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensitivity::Parameter;
    use bodyflight_replay::comparison::PerChannel;

    #[test]
    fn every_change_is_a_point_and_no_line_joins_them() {
        let effect = |factor| Effect {
            parameter: Parameter::ALL[0],
            factor,
            change: PerChannel::default(),
            reconstruction: None,
            diverged: None,
        };
        let report = Report {
            amplitude: PerChannel::default(),
            effects: vec![effect(0.7), effect(1.3)],
            reconstruction: None,
            measured_amplitude: None,
            warnings: Vec::new(),
            diverged: None,
        };
        let svg = report.svg("a < b");
        // Two points in each column, and two in the legend.
        assert_eq!(svg.matches("<circle").count(), 2 * SHOWN.len() + 2);
        assert!(!svg.contains("polyline") && svg.contains("a &lt; b"));
        assert!(svg.contains("parameter -30 %") && svg.contains("parameter +30 %"));
    }

    #[test]
    fn axes_end_at_round_numbers() {
        for (value, end) in [
            (0.0, 0.001),
            (0.9, 1.0),
            (12.0, 20.0),
            (21.0, 50.0),
            (51.0, 100.0),
        ] {
            assert!((round_above(value) / end - 1.0).abs() < 1e-9, "{value}");
        }
    }
}
