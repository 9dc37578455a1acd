//! The report as a figure: when the model disagrees, and each channel before and after.

use bodyflight_discovery::point;
use bodyflight_discovery::report::{ByName, CHANNEL_NAMES, Outcome, Report};
use bodyflight_discovery::stretch::CHANNELS;

use crate::diagnostic::Result;
use crate::output::plot::{Curve, EXTENDED, FLOOR, Line, PLAIN, Panel, figure_svg};

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

/// The figure for a point: what the model lacks in each window, before and after.
///
/// # Errors
/// Returns an error if it cannot be drawn.
pub fn point_svg(title: &str, report: &point::report::Report) -> Result<String> {
    let spots = &report.residual_map;
    let panel = |component: usize| {
        let gap = &report.gap;
        let curve = |line: Line, value: &dyn Fn(&point::report::Spot) -> f64| Curve {
            line,
            points: spots
                .iter()
                .map(|spot| (spot.time_s, value(spot)))
                .collect(),
        };
        Panel {
            caption: format!(
                "{}: missing over 2 s, RMS {:.2}, after {:.2}, noise and posture {:.2}",
                point::report::COMPONENT_NAMES[component],
                gap.before[component],
                gap.after[component],
                gap.floor[component]
            ),
            curves: vec![
                curve(PLAIN, &|spot| spot.missing[component]),
                curve(EXTENDED, &|spot| spot.missing_after[component]),
            ],
            bands: Vec::new(),
            wraps: false,
        }
    };
    let panels: Vec<Panel> = (0..3).map(panel).collect();
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
        wraps: false,
    }
}
