//! What came of an experiment, and the report as Markdown.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde::Serialize;

use super::experiments::EXPERIMENTS;
use crate::replay::comparison::{Channel, PerChannel};
use crate::verbs::synthesize::Tunnel;

/// One experiment, flown and reconstructed.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// Which experiment.
    pub name: &'static str,
    /// Length (s).
    pub duration_s: f64,
    /// Largest size of each measured channel.
    pub amplitude: PerChannel,
    /// RMS gap with constant damping and no muscle input.
    pub constant: PerChannel,
    /// With inputs estimated by the paper's filter and settings.
    pub paper_filter: PerChannel,
    /// With inputs estimated by the motion filter.
    pub motion_filter: PerChannel,
    /// What happened in the tunnel, for experiments there.
    pub tunnel: Option<Tunnel>,
    /// The picture.
    pub figure: PathBuf,
}

/// The paper's accuracy, sections "Model Validation in Experiments" and "Discussion"; none for the channels it does not give.
const PAPER: [(Channel, f64); 6] = [
    (Channel::Roll, 0.15),
    (Channel::Pitch, 0.15),
    (Channel::YawRate, 0.15),
    (Channel::AngularVelocity, 0.15),
    (Channel::HorizontalVelocity, 0.45),
    (Channel::VerticalVelocity, 1.5),
];

fn paper(channel: Channel) -> Option<f64> {
    let mut known = PAPER.into_iter();
    known
        .find(|(of, _)| *of == channel)
        .map(|(_, accuracy)| accuracy)
}

pub(super) fn markdown(outcomes: &[Outcome], poses: Option<&str>, map: bool) -> String {
    let mut text = String::from(
        "# The paper's experiments\n\n\
         Made by `bodyflight reproduce`. **Same model**: the flights below are scripts flown by the model itself, seen through the \
         paper's sensor noise, and reconstructed by the same model without knowing the inputs. They show what the method \
         recovers when the model is right. The paper's figures are of people; its accuracy (RMS of all experiments together; \
         single figures are printed in pictures only) stands beside as a scale, and a number above it is **bold**.\n",
    );
    let any = !outcomes.is_empty();
    if any {
        text.push_str(
            "\nConstant: damping 3, 0.5, 6 and no muscle input, as for the paper's basic maneuvers. Paper's filter: its windows, bounds \
             and noise. Motion filter: this program's default.\n\n\
             Most of what the paper's filter misses has one cause: with its muscle forces (eq. `eq1_1`, in its presets) an input is also \
             a force of hundreds of newtons, the flights here have none, and where its preset does not measure the speed \
             nothing corrects what the force does to it: vertical velocities go wrong by up to 45 m/s, and rates with them. The \
             motion filter has moments only and measures speeds, and attitudes at once (docs/equations.md).\n",
        );
    }
    for outcome in outcomes {
        section(&mut text, outcome);
    }
    if let Some(table) = poses {
        let _ = write!(
            text,
            "\n## Speeds of every pose\n\nBeyond the paper, see docs/poses.md.\n\n{table}"
        );
    }
    if map {
        text.push_str(
            "\n## Where belly flight oscillates\n\n\
             ![growth over arms and damping](oscillation-map.svg)\n\n\
             Eigenvalues of the linearised step about the steady fall, default subject, see docs/equations.md.\n",
        );
    }
    text
}

fn section(text: &mut String, outcome: &Outcome) {
    let Some(experiment) = EXPERIMENTS.iter().find(|e| e.name == outcome.name) else {
        return;
    };
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "\n## {}\n\nFigures of the paper: {}. `bodyflight synth {}{} --seed 1`, {:.0} s; preset `{}`.\n",
        experiment.title,
        experiment.figures,
        experiment.maneuver,
        if experiment.tunnel { " --tunnel" } else { "" },
        outcome.duration_s,
        experiment.preset,
    );
    text.push_str(
        "| channel | largest | paper | constant | paper's filter | motion filter |\n|---|---|---|---|---|---|\n",
    );
    for channel in Channel::ALL {
        let (label, unit) = channel.label();
        let scale = paper(channel);
        let cell = |values: &PerChannel| {
            let value = values.get(channel);
            match scale {
                Some(scale) if value > scale => format!("**{value:.3}**"),
                _ => format!("{value:.3}"),
            }
        };
        let _ = writeln!(
            text,
            "| {label} ({unit}) | {:.2} | {} | {} | {} | {} |",
            outcome.amplitude.get(channel),
            scale.map_or_else(|| "-".to_owned(), |scale| scale.to_string()),
            cell(&outcome.constant),
            cell(&outcome.paper_filter),
            cell(&outcome.motion_filter),
        );
    }
    let _ = writeln!(text, "\n{}", experiment.differs);
    if let Some(tunnel) = &outcome.tunnel {
        let _ = writeln!(text, "\nTunnel: {tunnel}.");
    }
    let _ = writeln!(text, "\n![reconstruction]({})", outcome.figure.display());
}
