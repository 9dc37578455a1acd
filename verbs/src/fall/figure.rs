//! A jump over time: its phases, the fall and its simulation, and the drag area.

use bodyflight_falls::Sample;
use bodyflight_falls::fall::Jump;

use crate::output::plot::{
    BORDER, Curve, ESTIMATED_PIECES, FLOWN, Line, MEASURED, Panel, figure_svg,
};
use bodyflight_io::diagnostic::Result;

/// Time shown before and after the fall (s).
const BEFORE: f64 = 15.0;
const AFTER: f64 = 30.0;

/// Panels: downward speed, horizontal speed, height, drag area. Vertical lines mark the borders of the phases.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(title: &str, jump: &Jump, mass: f64) -> Result<String> {
    let begin = jump.times.fall[0];
    let end = jump
        .times
        .canopy
        .map_or(jump.times.fall[1], |canopy| canopy.time);
    let shown = |time: f64| (begin - BEFORE..end + AFTER).contains(&time);
    let part: Vec<&Sample> = jump
        .samples
        .iter()
        .filter(|sample| shown(sample.time))
        .collect();
    let falling = &jump.samples[jump.fall[0]..jump.fall[1]];
    let over_time = |value: &dyn Fn(&Sample) -> f64| -> Vec<(f64, f64)> {
        part.iter()
            .map(|sample| (sample.time - begin, value(sample)))
            .collect()
    };
    let pieces = jump
        .pieces
        .iter()
        .flat_map(|piece| piece.time.map(|time| (time - begin, mass * piece.drag)));
    let panels = [
        (
            "speed downwards (m/s)",
            vec![
                (MEASURED, over_time(&|sample| -sample.velocity.z)),
                (
                    FLOWN,
                    falling
                        .iter()
                        .zip(&jump.flown)
                        .map(|(sample, flown)| (sample.time - begin, -flown.z))
                        .collect(),
                ),
            ],
        ),
        (
            "speed over ground (m/s)",
            vec![(MEASURED, over_time(&Sample::across))],
        ),
        (
            "height above mean sea level (m)",
            vec![(MEASURED, over_time(&Sample::height))],
        ),
        (
            "area times drag coefficient (m2)",
            vec![
                (
                    MEASURED,
                    jump.blocks
                        .iter()
                        .map(|block| (block.time - begin, (mass * block.drag).clamp(-0.2, 3.0)))
                        .collect(),
                ),
                (ESTIMATED_PIECES, pieces.collect()),
            ],
        ),
    ];
    let borders = [
        ("exit", jump.times.exit),
        ("opening", jump.times.opening),
        ("canopy", jump.times.canopy),
    ]
    .map(|(name, boundary)| (name, boundary.map(|boundary| boundary.time)));
    let said: Vec<String> = borders
        .iter()
        .filter_map(|(name, time)| Some(format!("{name} {:.1} s", (*time)? - begin)))
        .collect();
    let borders = borders.map(|(_, time)| time.map(|time| time - begin));
    let panels = panels.map(|(caption, lines)| panel(caption, &lines, &borders));
    figure_svg(&format!("{title}: {}", said.join(", ")), &panels)
}

/// A panel of lines over time, with a vertical line at each border.
fn panel(caption: &str, lines: &[(Line, Vec<(f64, f64)>)], borders: &[Option<f64>]) -> Panel {
    let values = || {
        lines
            .iter()
            .flat_map(|(_, points)| points.iter().map(|point| point.1))
    };
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let upright = borders
        .iter()
        .flatten()
        .map(|&time| (BORDER, vec![(time, low), (time, high)]));
    let curves = upright.chain(lines.iter().cloned());
    Panel {
        caption: caption.to_owned(),
        curves: curves
            .map(|(line, points)| Curve { line, points })
            .collect(),
        bands: Vec::new(),
        shades: Vec::new(),
        wraps: false,
    }
}
