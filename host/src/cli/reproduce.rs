//! `bodyflight reproduce`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::Result;
use bodyflight_verbs::reproduce::experiments::EXPERIMENTS;
use bodyflight_verbs::reproduce::{PARTS, is_wanted, names, reproduce};

use super::arguments::Names;
use super::outputs::Outputs;
use super::terminal;

/// Fly the experiments of the paper, reconstruct them, and write a report with figures.
#[derive(clap::Args)]
#[command(after_help = experiments_help())]
pub(super) struct Args {
    /// Experiments to run; by default all of them.
    #[arg(value_parser = Names(|| names().collect()), hide_possible_values = true)]
    what: Vec<String>,
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
        "Experiments:\n{list}  {}\n\nExample: bodyflight reproduce vertical --out reproduction",
        PARTS.join("\n  ")
    )
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    args.outputs.check_in(&args.out, &["report.md"])?;
    let wanted = |name: &&str| is_wanted(&args.what, name);
    let count = names().filter(wanted).count();
    let bar = terminal::bar(count as u64, "experiments");
    let report = reproduce(&args.what, &args.out, &|| bar.inc(1));
    bar.finish_and_clear();
    let report = report?;
    if json {
        return terminal::print_json(&report);
    }
    terminal::print(&format!("written: {}", report.report.display()));
    Ok(())
}
