//! `bodyflight estimate` as a figure. The work itself is done by bodyflight-estimation.

use bodyflight_core::estimator::motion::watch::MEAN_SQUARE;

use crate::output::plot::{
    AXES, Band, CONSTANT, Curve, ESTIMATED, LIMITS, Panel, WATCHED, figure_svg, measured_curve,
    simulated_curve,
};
use bodyflight_estimation::Estimation;
use bodyflight_estimation::report::Point;
use bodyflight_io::diagnostic::Result;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::input_history::InputRow;

/// Mean squares above this are drawn at the edge of the consistency panel.
const HIGHEST: f64 = 10.0;

/// Panels of muscle input and damping over time.
pub fn input_panels(estimation: &Estimation) -> [Panel; 2] {
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
    let reconstructed = channels.map(|channel| {
        let ((label, _), (unit, factor)) = (channel.label(), channel.drawn());
        let (rms, constant) = (&estimation.report.rms, &estimation.report.rms_constant);
        Panel {
            caption: format!(
                "{label} ({unit}): RMS gap {:.2} with estimation, {:.2} without",
                factor * rms.get(channel),
                factor * constant.get(channel)
            ),
            curves: vec![
                measured_curve(channel, estimation.estimated.series()),
                simulated_curve(channel, estimation.constant.series(), CONSTANT),
                simulated_curve(channel, estimation.estimated.series(), ESTIMATED),
            ],
            bands: Vec::new(),
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
        wraps: false,
    }
}
