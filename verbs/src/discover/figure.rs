//! The report as a figure: when the model disagrees, and each channel before and after.

use bodyflight_discovery::CHANNELS;
use bodyflight_discovery::named_effect::{ByName, Outcome};
use bodyflight_discovery::output::report::{CHANNEL_NAMES, Report};

use crate::output::plot::{Curve, EXTENDED, FLOOR, Line, PLAIN, Panel, figure_svg};
use bodyflight_io::diagnostic::Result;

/// The figure as SVG.
///
/// # Errors
/// Returns an error if it cannot be drawn.
pub fn svg(title: &str, report: &Report) -> Result<String> {
    let panels: Vec<Panel> = (0..CHANNELS)
        .map(|channel| panel(report, channel))
        .collect();
    figure_svg(&titled(title, report.verdict, &report.model), &panels)
}

/// The title, with the result appended.
fn titled(title: &str, verdict: Outcome, model: &[ByName]) -> String {
    let effects: Vec<&str> = model.iter().map(|(name, _)| *name).collect();
    let found = if effects.is_empty() {
        format!("{verdict:?}").to_lowercase()
    } else {
        effects.join(" + ")
    };
    format!("{title}: {found}")
}

fn panel(report: &Report, channel: usize) -> Panel {
    let gap = &report.gap;
    let floor = gap.floor[channel];
    let curve = |line: Line, value: &dyn Fn(usize) -> f64| Curve {
        line,
        points: report
            .residual_map
            .iter()
            .enumerate()
            .map(|(k, spot)| (spot.time_s, value(k)))
            .collect(),
    };
    let spots = &report.residual_map;
    Panel {
        caption: format!(
            "{}: RMS over 0.6 s, in all {:.3}, after {:.3}, floor {floor:.3}",
            CHANNEL_NAMES[channel], gap.before[channel], gap.after[channel]
        ),
        curves: vec![
            curve(FLOOR, &|_| floor),
            curve(PLAIN, &|k| spots[k].over_floor[channel] * floor),
            curve(EXTENDED, &|k| spots[k].over_floor_after[channel] * floor),
        ],
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: false,
    }
}
