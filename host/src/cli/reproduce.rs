//! `bodyflight reproduce`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::Result;
use bodyflight_verbs::output::figure::Format;
use bodyflight_verbs::reproduce::experiments::EXPERIMENTS;
use bodyflight_verbs::reproduce::{LONG_PARTS, PARTS, figures, is_wanted, names, reproduce};

use super::arguments::Names;
use super::figures::FormatName;
use super::outputs::Outputs;
use super::terminal;

/// Fly the experiments of the paper, reconstruct them, and write a report with figures.
#[derive(clap::Args)]
#[command(after_help = experiments_help())]
pub(super) struct Args {
    /// Experiments to run; by default all but the parts that take minutes.
    #[arg(value_parser = Names(|| names().collect()), hide_possible_values = true)]
    what: Vec<String>,
    /// Run everything, also the parts that take minutes.
    #[arg(long, conflicts_with = "what")]
    all: bool,
    /// Formats of the figures beside SVG, which the report shows; separate several by commas.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "svg")]
    format: Vec<FormatName>,
    /// Folder for report.md, figures and flights; created if absent.
    #[arg(long, value_name = "FOLDER", default_value = "reproduction")]
    out: PathBuf,
    #[command(flatten)]
    outputs: Outputs,
}

fn experiments_help() -> String {
    let list = EXPERIMENTS
        .iter()
        .map(|e| format!("  {:30} {}\n", e.name, e.title))
        .collect::<String>();
    format!(
        "Experiments:\n{list}  {}\nMinutes each:\n  {}\n\nExamples:\n  bodyflight reproduce vertical --out reproduction\n  bodyflight reproduce tracking transitions --format pdf",
        PARTS.join("\n  "),
        LONG_PARTS.join("\n  ")
    )
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let what = if args.all {
        names().map(str::to_owned).collect()
    } else {
        args.what.clone()
    };
    let formats: Vec<Format> = args.format.iter().map(|name| name.format()).collect();
    let figures = figures(&what, &formats);
    let files = figures.iter().filter_map(|path| path.to_str());
    let files: Vec<&str> = std::iter::once("report.md").chain(files).collect();
    args.outputs.check_in(&args.out, &files)?;
    let wanted = |name: &&str| is_wanted(&what, name);
    let count = names().filter(wanted).count();
    let bar = terminal::bar(count as u64, "experiments");
    let report = reproduce(&what, &args.out, &formats, &|| bar.inc(1));
    bar.finish_and_clear();
    let report = report?;
    if json {
        return terminal::print_json(&report);
    }
    for outcome in &report.outcomes {
        terminal::print(&outcome.in_words());
    }
    terminal::print(&format!("written: {}", report.report.display()));
    Ok(())
}
