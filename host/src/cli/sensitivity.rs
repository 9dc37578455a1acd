//! `bodyflight sensitivity`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::comparison::PerChannel;
use bodyflight_replay::flight::Flight;
use bodyflight_verbs::sensitivity::{Parameter, Report, SHOWN, sensitivity};

use super::arguments::Names;
use super::outputs::{Outputs, Plot};
use super::{estimate, several, simulate, terminal};

/// Change each parameter of the model and show how much that changes the motion from the same postures.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  bodyflight sensitivity flight.toml\n  \
                  bodyflight sensitivity flight.toml --preset turning   (re-estimates the inputs each time)\n\n\
                  Changes are root mean squares over the flight, in per cent of the channel's largest size.")]
pub(super) struct Args {
    /// A flight.toml.
    flight: PathBuf,
    /// Share by which each parameter is increased and decreased.
    #[arg(long, default_value_t = 0.3)]
    share: f64,
    /// Also re-estimate the inputs with this preset of the paper's filter, and compare how well the flight is
    /// reconstructed.
    #[arg(long, value_name = "PRESET", value_parser = Names(estimate::window_presets), hide_possible_values = true)]
    preset: Option<String>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: simulate::Reading,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    // Smaller changes drown in rounding, and would say that nothing matters.
    if !(0.001..1.0).contains(&args.share) {
        return Err(Problem::bad_input(format!(
            "expected --share of 0.001 to below 1, found {}",
            args.share
        )));
    }
    let preset = args.preset.as_deref().map(estimate::preset).transpose()?;
    let flight = Flight::read(&args.flight)?;
    args.outputs.check_with([], &args.plot)?;
    let bar = terminal::bar(2 * Parameter::ALL.len() as u64, "variations");
    let report = sensitivity(
        &flight,
        args.share,
        preset,
        args.reading.options(),
        &mut || {
            bar.inc(1);
        },
    );
    bar.finish_and_clear();
    let report = report?;
    let title = || format!("Sensitivity of {}", args.flight.display());
    args.plot
        .write(|| Ok(report.svg(&args.plot.title(title))))?;
    if json {
        terminal::print_json(&report)?;
    } else {
        print_report(&report);
    }
    several::verdict(report.doubt(), &args.flight)
}

fn print_report(report: &Report) {
    terminal::note_warnings(&report.warnings);
    let names = SHOWN.map(|channel| channel.label().0);
    let columns: Vec<&str> = ["parameter", "factor"].into_iter().chain(names).collect();
    let shares = |values: &PerChannel, amplitude: &PerChannel| {
        SHOWN.map(|channel| {
            format!(
                "{:.1} %",
                100.0 * values.get(channel) / amplitude.get(channel).max(1e-9)
            )
        })
    };
    let mut table = terminal::table(&columns);
    for effect in &report.effects {
        let mut row = vec![
            effect.parameter.label().to_owned(),
            format!("{:.2}", effect.factor),
        ];
        row.extend(match effect.diverged {
            Some(_) => SHOWN.map(|_| "diverges".to_owned()),
            None => shares(&effect.change, &report.amplitude),
        });
        table.add_row(row);
    }
    terminal::print("change of a free run with the same postures and inputs");
    terminal::print(&table.to_string());
    let (Some(plain), Some(amplitude)) = (&report.reconstruction, &report.measured_amplitude)
    else {
        return;
    };
    let mut table = terminal::table(&columns);
    let mut row = vec!["none".to_owned(), "1.00".to_owned()];
    row.extend(shares(plain, amplitude));
    table.add_row(row);
    for effect in &report.effects {
        if let Some(rms) = &effect.reconstruction {
            let mut row = vec![
                effect.parameter.label().to_owned(),
                format!("{:.2}", effect.factor),
            ];
            row.extend(shares(rms, amplitude));
            table.add_row(row);
        }
    }
    terminal::print("gap of the reconstruction with re-estimated inputs");
    terminal::print(&table.to_string());
}
