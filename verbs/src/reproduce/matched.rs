//! Flights that belong to the model of the paper's filter: the muscle forces that the filter believes in act in them
//! too, with lever arms that fit what the paper reports.

use std::fmt::Write as _;
use std::path::Path;

use bodyflight_core::dynamics::muscle_input::{FITTED_LEVER_ARMS, LEVER_ARMS, MuscleForces};
use bodyflight_core::estimator::measurement::{Quantity, TRANSITIONS_WITH_GNSS};
use bodyflight_core::estimator::preset::{NEGATIVE_DAMPING_BOUND, Preset};
use bodyflight_estimation::windows::estimate;
use bodyflight_estimation::{Estimation, Filter};
use bodyflight_io::diagnostic::Result;
use bodyflight_laboratory::synthesize::Additions;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::comparison::{Channel, PerChannel};
use bodyflight_replay::flight::Flight;
use rayon::prelude::*;

use super::experiments::{Experiment, Procedure};
use super::flown::{fly, preset};
use crate::estimate::svg;
use crate::output::plot::comparison_svg;
use crate::simulate::simulate;

/// The matched flight of an experiment.
pub(super) struct Matched {
    /// Largest value of each channel.
    pub(super) amplitude: PerChannel,
    /// RMS gap of the paper's own procedure.
    pub(super) gap: PerChannel,
    /// Its reconstruction as SVG; `None` if the plain flight is the same.
    pub(super) figure: Option<String>,
}

/// Flies and reconstructs the matched flight of an experiment.
pub(super) fn run(experiment: &Experiment, plain: &Estimation, folder: &Path) -> Result<Matched> {
    if experiment.procedure == Procedure::Constant {
        // Without muscle input the flights with and without its forces are the same.
        return Ok(Matched {
            amplitude: plain.report.amplitude,
            gap: plain.report.rms_constant,
            figure: None,
        });
    }
    let flights = folder
        .join("flights")
        .join(format!("{}-matched", experiment.name));
    let title = format!("{}, with the paper's muscle forces", experiment.title);
    let arms = FITTED_LEVER_ARMS;
    let flight = flown(experiment.matched, experiment.tunnel, arms, &flights)?;
    if experiment.procedure == Procedure::Simulation {
        let (options, precision) = (Options::default(), Precision::Double);
        let run = simulate(&flight, options, precision, &mut |_| Ok(()), &mut |_| {})?;
        return Ok(Matched {
            amplitude: run.comparison.amplitude(),
            gap: run.comparison.rms(),
            figure: Some(comparison_svg(&title, &run.comparison)?),
        });
    }
    let found = filtered(&flight, &with_arms(preset(experiment.preset)?, arms))?;
    Ok(Matched {
        amplitude: found.report.amplitude,
        gap: found.report.rms,
        figure: Some(svg(&found, &title)?),
    })
}

/// A flight of a script with the paper's muscle forces and these lever arms (shares of the stature).
fn flown(maneuver: &str, tunnel: bool, arms: [f32; 4], folder: &Path) -> Result<Flight> {
    let additions = Additions {
        muscle_forces: MuscleForces::Paper,
        lever_arms: Some(arms),
        ..Additions::default()
    };
    Flight::read(&fly(maneuver, tunnel, additions, folder)?.flight)
}

/// A preset of the paper with other lever arms, and nothing else changed.
fn with_arms(preset: &Preset, arms: [f32; 4]) -> Preset {
    Preset {
        muscles: preset.muscles.with_lever_arms(arms),
        ..*preset
    }
}

/// Reconstruction by the paper's filter, which does not know the inputs that were flown.
fn filtered(flight: &Flight, preset: &Preset) -> Result<Estimation> {
    let flight = Flight {
        inputs: None,
        muscles: preset.muscles,
        ..flight.clone()
    };
    estimate(
        &flight,
        preset,
        Filter::Paper,
        Options::default(),
        Precision::Double,
        &mut |_| {},
    )
}

/// Multiples of a body's lever arms that are tried.
const MULTIPLES: [f32; 6] = [1.0, 2.0, 3.0, 5.0, 10.0, 30.0];
/// When the track is steady (s).
const TRACKING: [f64; 2] = [10.0, 28.0];

/// What the paper's reports say about its lever arms, which it does not give: one row for each multiple of a body's.
pub(super) fn levers(folder: &Path) -> Result<String> {
    let rows = MULTIPLES
        .par_iter()
        .map(|&multiple| {
            let arms = LEVER_ARMS.map(|arm| arm * multiple);
            let at = folder.join(format!("flights/levers/{multiple}"));
            let found = ["paper-tracking", "aggressive-turns"]
                .into_iter()
                .zip(["tracking", "turning"])
                .map(|(maneuver, name)| {
                    let flight = flown(maneuver, false, arms, &at.join(maneuver))?;
                    filtered(&flight, &with_arms(preset(name)?, arms))
                })
                .collect::<Result<Vec<_>>>()?;
            let gap = |which: usize, channel| {
                let found: &Estimation = &found[which];
                found.report.rms.get(channel)
            };
            let [from, to] = TRACKING;
            let steady = found[0].constant.series().iter();
            let fastest = steady
                .filter(|pair| (from..to).contains(&pair.time))
                .map(|pair| pair.measured.horizontal_speed)
                .fold(0.0, f64::max);
            let mut row = format!("| {multiple} | {fastest:.1} |");
            for (which, channel) in [
                (0, Channel::Pitch),
                (0, Channel::HorizontalVelocity),
                (0, Channel::VerticalVelocity),
                (1, Channel::YawRate),
                (1, Channel::HorizontalVelocity),
                (1, Channel::VerticalVelocity),
            ] {
                let _ = write!(row, " {:.2} |", gap(which, channel));
            }
            row.push('\n');
            Ok(row)
        })
        .collect::<Result<Vec<_>>>()?;
    Ok(rows.concat())
}

/// A change of the filter's settings.
struct Change {
    what: &'static str,
    apply: fn(&mut Preset),
}

/// What could be the cause of a gap, one at a time; the first is the paper's choice.
const CHANGES: [Change; 10] = [
    Change {
        what: "nothing, as in the paper",
        apply: |_| {},
    },
    Change {
        what: "window: prediction over 0.083 s instead of 0.25 s",
        apply: |preset| preset.prediction_window = 20,
    },
    Change {
        what: "window: a new solution every 12 samples instead of 4",
        apply: |preset| preset.solution_window = 12,
    },
    Change {
        what: "bounds: damping down to -0.25, muscle input from -6.5",
        apply: |preset| {
            preset.low = [
                -6.5,
                -6.5,
                -6.5,
                NEGATIVE_DAMPING_BOUND,
                NEGATIVE_DAMPING_BOUND,
                NEGATIVE_DAMPING_BOUND,
            ]
        },
    },
    Change {
        what: "Q: 16 times the process noise",
        apply: |preset| preset.scale(16.0, 1.0, 1.0),
    },
    Change {
        what: "Q: a 16th of the process noise",
        apply: |preset| preset.scale(1.0 / 16.0, 1.0, 1.0),
    },
    Change {
        what: "Q: a 64th of the process noise",
        apply: |preset| preset.scale(1.0 / 64.0, 1.0, 1.0),
    },
    Change {
        what: "heading measured to 0.05 rad, as in tracking",
        apply: |preset| {
            for (quantity, deviation) in preset.measurement.channels.iter_mut().flatten() {
                if *quantity == Quantity::Heading {
                    *deviation = 0.05;
                }
            }
        },
    },
    Change {
        what: "start: a deviation of damping of 1 instead of 6",
        apply: |preset| preset.deviation = [0.25, 0.25, 0.25, 1.0, 1.0, 1.0],
    },
    Change {
        what: "both velocities measured, heading not",
        apply: |preset| preset.measurement = TRANSITIONS_WITH_GNSS,
    },
];

/// Which setting is to blame where the matched filter misses: one table for each flight.
pub(super) fn settings(folder: &Path) -> Result<String> {
    let mut text = String::new();
    for (maneuver, name) in [
        ("paper-tracking", "tracking"),
        ("paper-transitions", "transitions"),
    ] {
        let at = folder.join("flights/settings").join(maneuver);
        let flight = flown(maneuver, false, FITTED_LEVER_ARMS, &at)?;
        let plain = with_arms(preset(name)?, FITTED_LEVER_ARMS);
        let rows = CHANGES
            .par_iter()
            .map(|change| {
                let mut preset = plain;
                (change.apply)(&mut preset);
                let rms = filtered(&flight, &preset)?.report.rms;
                let mut row = format!("| {} |", change.what);
                for channel in Channel::ALL {
                    let _ = write!(row, " {:.2} |", rms.get(channel));
                }
                row.push('\n');
                Ok(row)
            })
            .collect::<Result<Vec<_>>>()?;
        let _ = write!(
            text,
            "\nMatched `{maneuver}`, preset `{name}`:\n\n| changed | {} |\n|---|{}\n{}",
            Channel::ALL
                .map(|channel| {
                    let (label, unit) = channel.label();
                    format!("{label} ({unit})")
                })
                .join(" | "),
            "---|".repeat(Channel::ALL.len()),
            rows.concat(),
        );
    }
    Ok(text)
}
