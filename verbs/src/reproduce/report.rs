//! The outcome of an experiment, and the report as Markdown.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde::Serialize;

use super::experiments::{EXPERIMENTS, Experiment, Procedure};
use crate::sensitivity;
use bodyflight_core::dynamics::muscle_input::FITTED_LEVER_ARMS;
use bodyflight_laboratory::synthesize::Tunnel;
use bodyflight_replay::comparison::{Channel, PerChannel};

/// One experiment, flown and reconstructed.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Outcome {
    /// Name of the experiment.
    pub name: &'static str,
    /// Length (s).
    pub duration_s: f64,
    /// Largest absolute value of each measured channel.
    pub amplitude: PerChannel,
    /// RMS gap with constant damping and no muscle input.
    pub constant: PerChannel,
    /// RMS gap with inputs estimated by the paper's filter and settings.
    pub paper_filter: PerChannel,
    /// RMS gap with inputs estimated by the motion filter.
    pub motion_filter: PerChannel,
    /// Why the motion filter's estimate should not be trusted.
    pub doubt: Option<String>,
    /// Largest absolute value of each channel of the matched flight, which has the paper's muscle forces.
    pub matched_amplitude: PerChannel,
    /// RMS gap of the matched flight by the paper's own procedure.
    pub matched: PerChannel,
    /// Events in the tunnel, for experiments in one.
    pub tunnel: Option<Tunnel>,
    /// File name of the figure of the matched flight, as SVG.
    pub figure: PathBuf,
}

/// The paper's accuracy, sections "Model Validation in Experiments" and "Discussion", for the channels that it gives.
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

/// Parts of the report that are not flights.
#[derive(Debug, Default)]
pub(super) struct Parts {
    /// Table of the poses.
    pub poses: Option<String>,
    /// Whether there is a map of the oscillation.
    pub map: bool,
    /// Sensitivity to the parameters.
    pub sensitivity: Option<sensitivity::Report>,
    /// Rows of the table of lever arms.
    pub levers: Option<String>,
    /// Tables of the filter's settings.
    pub settings: Option<String>,
}

pub(super) fn markdown(outcomes: &[Outcome], parts: &Parts) -> String {
    let mut text = String::from(
        "# The paper's experiments\n\n\
         Made by `bodyflight reproduce`; `--all` adds the parts that take minutes. **Same model**: the flights below are scripts flown by the model itself, seen through the \
         paper's sensor noise, and reconstructed by the same model without knowing the inputs. They show what the method \
         recovers if the model is right. The paper's results are for people; its accuracy (RMS over all experiments; results \
         of single experiments appear only in its figures) is given as a scale, and numbers above it are **bold**.\n",
    );
    let any = !outcomes.is_empty();
    if any {
        text.push_str(
            "\nEach experiment is flown twice.\n\n\
             - **Matched**: the paper's muscle moments and forces (eqs. `eq1`, `eq1_1`) act in the flight as they do in its filter, and the \
             flight is reconstructed by the paper's own procedure for this experiment: constant damping for basic maneuvers, its filter \
             with its settings for advanced ones, and a simulation with known inputs where the paper only simulates. The lever arms of \
             the forces, which the paper leaves open, are ten times those of a body: its vertical velocity of 1.5 m/s is met \
             with three times in turns, and nearly with ten times in the track (1.7 m/s).\n\
             - **Moments**: muscle input without forces, which is the default of this program (docs/equations.md), reconstructed with \
             constant damping of 3, 0.5, 6 and no input (constant), by the paper's filter, which still believes in the forces, and by the \
             motion filter, the default.\n\n\
             The paper reports one accuracy for all experiments. Its velocities are for amplitudes of 15 m/s horizontally, which its \
             track of 33 m/s exceeds, and its transitions had no receiver, so it does not say how well the velocities of these two are \
             reconstructed. The figures show the matched flights. The last table lists what is not reconstructed, and why.\n",
        );
    }
    for outcome in outcomes {
        section(&mut text, outcome);
    }
    if let Some(table) = &parts.poses {
        let _ = write!(
            text,
            "\n## Speeds of every pose\n\nBeyond the paper, see docs/poses.md.\n\n{table}"
        );
    }
    if parts.map {
        text.push_str(
            "\n## Where belly flight oscillates\n\n\
             ![growth over arms and damping](oscillation-map.svg)\n\n\
             Eigenvalues of the linearised step about the steady fall, default subject, see docs/equations.md.\n",
        );
    }
    if let Some(found) = &parts.sensitivity {
        sensitivity_section(&mut text, found);
    }
    if let Some(rows) = &parts.levers {
        let _ = write!(text, "{LEVERS}{rows}");
    }
    if let Some(tables) = &parts.settings {
        let _ = write!(text, "{SETTINGS}{tables}");
    }
    if any {
        summary(&mut text, outcomes);
    }
    text
}

const LEVERS: &str = "
## Which lever arms fit the paper

The paper divides moments by lever arms l1 to l4 (eq. `eq1_1`) and gives no values. Those of a body are 0.28, 0.12, 0.18 and 0.22 of \
the stature. Each row multiplies them in the flight and in the filter. The track holds a pitch input of 1.34 for 17 s, between the paper's 1 \
and 2, and the paper's skydiver reached 33 m/s over ground; its vertical velocity was within 1.5 m/s.

| times a body's | fastest over ground, track (m/s) | pitch, track (rad) | horizontal velocity, track (m/s) | vertical velocity, track (m/s) \
| yaw rate, turns (rad/s) | horizontal velocity, turns (m/s) | vertical velocity, turns (m/s) |
|---|---|---|---|---|---|---|---|
";

const SETTINGS: &str = "
## Which setting is to blame

RMS gaps of the matched flights that the paper's filter misses, with one of its settings changed at a time.
";

/// How 30 % in a parameter changes a free run of turns, and their reconstruction.
fn sensitivity_section(text: &mut String, found: &sensitivity::Report) {
    text.push_str(
        "\n## What 30 % in a parameter changes\n\n\
         The flight with turns in free fall. Free run: same postures and inputs, change relative to the channel's largest value. \
         Reconstructed: inputs re-estimated by the paper's filter, gap relative to the largest value; the inputs absorb errors of a \
         coefficient. The paper's \"less than 1 %\" applies to the second, see docs/equations.md.\n\n\
         | parameter | yaw rate, free run | vertical velocity, free run | yaw rate, reconstructed |\n|---|---|---|---|\n",
    );
    let per_cent = |value: f64, of: f64| format!("{:.1} %", 100.0 * value / of.max(1e-9));
    let rebuilt = |gap: Option<&PerChannel>| {
        gap.zip(found.measured_amplitude.as_ref()).map_or_else(
            || "-".to_owned(),
            |(gap, size)| per_cent(gap.get(Channel::YawRate), size.get(Channel::YawRate)),
        )
    };
    let plain = rebuilt(found.reconstruction.as_ref());
    let _ = writeln!(text, "| nothing | 0 | 0 | {plain} |");
    for effect in &found.effects {
        let free = |channel| per_cent(effect.change.get(channel), found.amplitude.get(channel));
        let _ = writeln!(
            text,
            "| {}, {:+.0} % | {} | {} | {} |",
            effect.parameter.label(),
            100.0 * (effect.factor - 1.0),
            free(Channel::YawRate),
            free(Channel::VerticalVelocity),
            rebuilt(effect.reconstruction.as_ref()),
        );
    }
    text.push_str("\n![change of every channel](sensitivity.svg)\n");
}

/// The table at the end, with the worst channel of each filter.
fn summary(text: &mut String, outcomes: &[Outcome]) {
    text.push_str(
        "\n## What is not reconstructed, and why\n\n\
         The worst channel of each experiment, as a multiple of the paper's accuracy.\n\n\
         | experiment | matched | why | moments, paper's filter | moments, motion filter | why |\n|---|---|---|---|---|---|\n",
    );
    for outcome in outcomes {
        let Some(experiment) = EXPERIMENTS.iter().find(|e| e.name == outcome.name) else {
            continue;
        };
        let [matched, paper, motion] = [
            &outcome.matched,
            &outcome.paper_filter,
            &outcome.motion_filter,
        ]
        .map(worst);
        let cell = |(channel, times): (Channel, f64)| format!("{}: {times:.1}", channel.label().0);
        let why = if paper.1 <= 1.0 && motion.1 <= 1.0 {
            "Both are within it."
        } else {
            experiment.why
        };
        let matched_why = if matched.1 <= 1.0 {
            "It is within it."
        } else {
            experiment.matched_why
        };
        let _ = writeln!(
            text,
            "| {} | {} | {matched_why} | {} | {} | {why} |",
            experiment.title,
            cell(matched),
            cell(paper),
            cell(motion),
        );
    }
}

impl Outcome {
    /// How well the experiment is reconstructed, in a line: the worst channel of the matched flight and of the motion
    /// filter.
    pub fn in_words(&self) -> String {
        let told = |gaps: &PerChannel| {
            let (channel, times) = worst(gaps);
            let (name, _) = channel.label();
            if times <= 1.0 {
                "within the paper's accuracy".to_owned()
            } else {
                format!("{name} {times:.1} times the paper's accuracy")
            }
        };
        let [matched, motion] = [&self.matched, &self.motion_filter].map(told);
        let doubt = self
            .doubt
            .as_ref()
            .map(|doubt| format!(", doubtful: {doubt}"));
        format!(
            "{}: matched, {matched}; motion filter, {motion}{}",
            self.name,
            doubt.unwrap_or_default()
        )
    }
}

/// The channel with the largest ratio of gap to the paper's accuracy, and that ratio.
fn worst(gaps: &PerChannel) -> (Channel, f64) {
    let over = PAPER.map(|(channel, accuracy)| (channel, gaps.get(channel) / accuracy));
    over.into_iter()
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((Channel::Roll, 0.0))
}

/// The commands that fly an experiment.
fn commands(experiment: &Experiment) -> String {
    let tunnel = if experiment.tunnel { " --tunnel" } else { "" };
    let synth = |maneuver: &str| format!("bodyflight synth {maneuver}{tunnel} --seed 1");
    if experiment.procedure == Procedure::Constant {
        return format!(
            "`{}`; without muscle input the matched flight is the same.",
            synth(experiment.maneuver)
        );
    }
    let arms = FITTED_LEVER_ARMS.map(|arm| arm.to_string()).join(",");
    format!(
        "Matched: `{} --muscle-forces paper --lever-arms {arms}`. Moments: `{}`.",
        synth(experiment.matched),
        synth(experiment.maneuver)
    )
}

fn section(text: &mut String, outcome: &Outcome) {
    let Some(experiment) = EXPERIMENTS.iter().find(|e| e.name == outcome.name) else {
        return;
    };
    let figures = if experiment.figures.is_empty() {
        "The paper has no figure of it.".to_owned()
    } else {
        format!(
            "Figures of the paper: {}, which show {}.",
            experiment.figures, experiment.shows
        )
    };
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "\n## {}\n\n{figures} {:.0} s; preset `{}`. Matched by {}.\n\n{}\n",
        experiment.title,
        outcome.duration_s,
        experiment.preset,
        experiment.procedure.in_words(),
        commands(experiment),
    );
    text.push_str(
        "| channel | paper | matched: largest | matched: gap | moments: largest | constant | paper's filter | motion filter |\n\
         |---|---|---|---|---|---|---|---|\n",
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
            "| {label} ({unit}) | {} | {:.2} | {} | {:.2} | {} | {} | {} |",
            scale.map_or_else(|| "-".to_owned(), |scale| scale.to_string()),
            outcome.matched_amplitude.get(channel),
            cell(&outcome.matched),
            outcome.amplitude.get(channel),
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
