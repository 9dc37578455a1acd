//! `bodyflight estimate` as a figure. The work itself is done by bodyflight-estimation.

use bodyflight_core::estimator::motion::watch::{Consistency, MEAN_SQUARE};

use crate::output::plot::{
    AXES, Band, CONSTANT, Curve, ESTIMATED, LIMITS, Panel, Shade, UNTRUSTED, WATCHED, figure_svg,
    measured_curve, simulated_curve,
};
use bodyflight_estimation::Estimation;
use bodyflight_estimation::report::Point;
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::input_history::InputRow;

/// Mean squares above this are drawn at the edge of the consistency panel.
const HIGHEST: f64 = 10.0;

/// The times in which the filter itself does not trust its estimates.
pub fn shades(points: &[Point]) -> Vec<Shade> {
    let mut shades: Vec<Shade> = Vec::new();
    let mut last = points.first().map_or(0.0, |point| point.time);
    for point in points {
        let begin = std::mem::replace(&mut last, point.time);
        let line = match point.consistency {
            None | Some(Consistency::Consistent) => continue,
            Some(Consistency::Doubtful) => UNTRUSTED[0],
            Some(Consistency::Lost) => UNTRUSTED[1],
        };
        match shades.last_mut() {
            Some(Shade { line: same, during }) if *same == line && during[1] >= begin => {
                during[1] = point.time;
            }
            _ => shades.push(Shade {
                line,
                during: [begin, point.time],
            }),
        }
    }
    shades
}

/// Panels of muscle input and damping over time.
pub fn input_panels(estimation: &Estimation) -> [Panel; 2] {
    let shades = shades(&estimation.points);
    let axes = |caption: &str, value: fn(&InputRow) -> [f64; 3]| Panel {
        caption: caption.to_owned(),
        curves: AXES
            .iter()
            .enumerate()
            .map(|(axis, line)| Curve {
                line: *line,
                points: estimation
                    .points
                    .iter()
                    .map(|p| (p.time, value(&p.inputs)[axis]))
                    .collect(),
            })
            .collect(),
        bands: AXES
            .iter()
            .enumerate()
            .map(|(axis, line)| Band {
                line: *line,
                bounds: estimation
                    .points
                    .iter()
                    .map(|point| {
                        let middle = value(&point.inputs)[axis];
                        let spread = 2.0 * value(&point.deviation)[axis];
                        (point.time, middle - spread, middle + spread)
                    })
                    .collect(),
            })
            .collect(),
        shades: shades.clone(),
        wraps: false,
    };
    let joints = estimation.report.joint_error_in_words();
    let joints = joints.map_or_else(String::new, |words| format!("; {words}"));
    [
        axes(
            &format!("muscle input coefficients, with bands of two standard deviations{joints}"),
            |row| [row.pitch, row.yaw, row.roll],
        ),
        axes(
            "damping coefficients, with bands of two standard deviations",
            |row| [row.damp_pitch, row.damp_yaw, row.damp_roll],
        ),
    ]
}

/// The figure as SVG: coefficients over time, and below them reconstructed and measured channels.
///
/// # Errors
/// Returns an error if the figure cannot be drawn.
pub fn svg(estimation: &Estimation, title: &str) -> Result<String> {
    let channels = [
        Channel::Roll,
        Channel::Pitch,
        Channel::HorizontalVelocity,
        Channel::VerticalVelocity,
        Channel::YawRate,
    ];
    let shades = shades(&estimation.points);
    let reconstructed = channels.map(|channel| {
        let (label, (unit, factor)) = (channel.titled(), channel.drawn());
        let (rms, constant) = (&estimation.report.rms, &estimation.report.rms_constant);
        let gaps = [rms, constant].map(|gaps| factor * gaps.get(channel));
        let is_measured = gaps[0].is_finite();
        let measured = is_measured.then(|| measured_curve(channel, estimation.estimated.series()));
        let simulated = [
            simulated_curve(channel, estimation.constant.series(), CONSTANT),
            simulated_curve(channel, estimation.estimated.series(), ESTIMATED),
        ];
        Panel {
            caption: if is_measured {
                let [with, without] = gaps;
                format!("{label} ({unit}): RMS gap {with:.2} with estimation, {without:.2} without")
            } else {
                format!("{label} ({unit}): not measured")
            },
            curves: measured.into_iter().chain(simulated).collect(),
            bands: Vec::new(),
            shades: shades.clone(),
            wraps: channel.is_angle(),
        }
    });
    let mut panels = input_panels(estimation).to_vec();
    panels.extend(reconstructed);
    panels.push(consistency_panel(estimation));
    figure_svg(title, &panels)
}

/// What the filter monitors over time, ideally 1, with the limits above which it is doubtful and lost.
fn consistency_panel(estimation: &Estimation) -> Panel {
    let curve = |line, value: &dyn Fn(&Point) -> f64| Curve {
        line,
        points: estimation
            .points
            .iter()
            .map(|point| (point.time, value(point).min(HIGHEST)))
            .filter(|(_, value)| value.is_finite())
            .collect(),
    };
    let of = |k: usize| move |point: &Point| point.watched.values()[k];
    let mut curves: Vec<Curve> = WATCHED
        .into_iter()
        .enumerate()
        .map(|(k, line)| curve(line, &of(k)))
        .filter(|curve| !curve.points.is_empty())
        .collect();
    for (line, limit) in LIMITS.into_iter().zip(MEAN_SQUARE) {
        curves.push(curve(line, &|_| f64::from(limit)));
    }
    let caption = estimation.report.consistency.as_ref().map(|found| {
        format!(
            ": consistent {:.0} %, doubtful {:.0} %, lost {:.0} % of the time",
            100.0 * found.consistent,
            100.0 * found.doubtful,
            100.0 * found.lost
        )
    });
    Panel {
        caption: format!(
            "mean square of normalised innovations (ideally 1){}",
            caption.unwrap_or_default()
        ),
        curves,
        bands: Vec::new(),
        shades: shades(&estimation.points),
        wraps: false,
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::dynamics::Inputs;
    use bodyflight_estimation::report::Watched;
    use bodyflight_replay::input_history::InputRow;

    use super::*;

    #[test]
    fn times_without_trust_are_shaded_as_long_as_they_last() {
        use Consistency::{Consistent, Doubtful, Lost};
        let states = [Consistent, Doubtful, Doubtful, Lost, Consistent, Doubtful];
        let inputs = InputRow::of(0.0, &Inputs::belly_turn());
        let points: Vec<Point> = (0u8..)
            .zip(states)
            .map(|(k, state)| Point {
                time: 0.5 * f64::from(k),
                inputs,
                deviation: inputs,
                normalised_innovation: 1.0,
                consistency: Some(state),
                watched: Watched::of_all(1.0),
                motion: None,
                velocity_deviation: [f64::NAN; 3],
            })
            .collect();
        let found: Vec<(&str, [f64; 2])> = shades(&points)
            .iter()
            .map(|shade| (shade.line.label, shade.during))
            .collect();
        let right = [
            ("doubtful", [0.0, 1.0]),
            ("lost", [1.0, 1.5]),
            ("doubtful", [2.0, 2.5]),
        ];
        assert_eq!(found, right);
        // The filter over windows tells nothing at some times.
        let silent = points.iter().map(|point| Point {
            consistency: None,
            ..*point
        });
        assert_eq!(shades(&silent.collect::<Vec<_>>()), []);
    }
}
