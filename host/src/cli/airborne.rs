//! `bodyflight airborne`.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::systems::is_of_another_system;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::airborne::verdict::Verdict;
use bodyflight_verbs::airborne::{Capture, Report, airborne, figure, together};
use bodyflight_verbs::import::{Request, import};
use bodyflight_verbs::validate::windows::MODELS;

use serde::Serialize;

use super::outputs::{Outputs, Plot};
use super::several::{Outcome, all, each};
use super::terminal::{self, Stages};

/// Find the parts of a recording in the air, and judge the capture by them: the centre of mass must fall with g, and
/// the angular momentum must not change.
#[derive(clap::Args)]
#[command(
    after_help = "Several recordings should be of one set-up: its vertical and its clock are judged by all of them together.\n\n\
                  Exit code 4: the capture has a fault; 5: nothing is in the air, so it cannot be judged.\n\n\
                  Examples:\n  bodyflight airborne somersault.mvnx --plot somersault.svg\n  bodyflight airborne jump.csv --mapping mapping.toml --subject athlete.toml"
)]
pub(super) struct Args {
    /// MVNX files, flight.toml files or their folders; files of other systems, as import reads them.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// A mapping, for files of other systems (docs/import.md).
    #[arg(long, value_name = "TOML")]
    mapping: Option<PathBuf>,
    /// The person in files of other systems: a subject.toml.
    #[arg(long, value_name = "TOML")]
    subject: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let mapping = args.mapping.as_deref().map(Mapping::read).transpose()?;
    let subject = args.subject.as_deref().map(Subject::read).transpose()?;
    let work = |file: &Path| {
        let plot = args.plot.of(file, &args.files)?;
        args.outputs.check_with([], &plot)?;
        let stages = Stages::new("reading");
        let capture = read(file, mapping.as_ref(), subject.as_ref())?;
        let report = airborne(&capture)?;
        stages.end();
        let title = || format!("{}: in the air", file.display());
        plot.write(|| figure::svg(&plot.title(title), &capture, &report))?;
        if !json {
            print(&report);
        }
        let sentence = report.verdict.sentence.clone();
        let verdict = if !report.verdict.faults.is_empty() {
            Err(Problem::disagreement(sentence).in_file(file))
        } else if report.phases.is_empty() {
            Err(Problem::doubt(sentence).in_file(file))
        } else {
            Ok(())
        };
        Ok((report, verdict))
    };
    if args.files.len() == 1 {
        return each(&args.files, json, work);
    }
    let (flights, end) = all(&args.files, json, work)?;
    let reports: Vec<&Report> = flights.iter().flat_map(|flight| &flight.report).collect();
    let together = together(&reports);
    let sentence = |verdict: &Verdict| {
        let count = reports.len();
        format!("{count} recordings together: {}", verdict.sentence)
    };
    let told = together.as_ref().map(|verdict| {
        let is_faulty = !verdict.faults.is_empty();
        (sentence(verdict), is_faulty)
    });
    if json {
        terminal::print_json(&Set { flights, together })?;
    } else if let Some((sentence, _)) = &told {
        terminal::print(sentence);
    }
    end?;
    match told {
        Some((sentence, true)) => Err(Problem::disagreement(sentence)),
        _ => Ok(()),
    }
}

/// Results for several recordings.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Set {
    flights: Vec<Outcome<Report>>,
    /// What all phases say of the set-up, its vertical and its clock or scale; null unless at least two recordings of the
    /// same frame rate are in the air.
    together: Option<Verdict>,
}

/// Reads a recording; files of other systems are converted first, into a folder that is deleted.
fn read(file: &Path, mapping: Option<&Mapping>, subject: Option<&Subject>) -> Result<Capture> {
    if mapping.is_none() && !is_of_another_system(file) {
        return Capture::read(file);
    }
    let folder = bodyflight_verbs::validate::bundled::temporary()?;
    let default = Subject::default();
    let request = Request {
        file,
        mapping,
        subject: subject.unwrap_or(&default),
        has_subject: subject.is_some(),
        folder: folder.path(),
    };
    let imported = import(&request, &mut |_| {})?;
    for warning in &imported.warnings {
        terminal::note(&format!("warning: {warning}"));
    }
    Ok(Capture::read(&imported.flight)?.with_faults(imported.faults()))
}

fn print(report: &Report) {
    let mut table = terminal::table(&[
        "begin",
        "length",
        "g",
        "drift of angular momentum",
        "attitude error over 0.25 s, degrees",
    ]);
    for phase in &report.phases {
        let errors = MODELS.iter().filter_map(|model| {
            let rows = phase
                .predictions
                .iter()
                .filter(|row| row.model == model.key);
            let row = rows.min_by(|a, b| {
                (a.length_s - 0.25)
                    .abs()
                    .total_cmp(&(b.length_s - 0.25).abs())
            })?;
            Some(format!(
                "{} {:.1}",
                model.key,
                row.smoothed.median_rad.to_degrees()
            ))
        });
        let momentum = &phase.momentum;
        table.add_row([
            format!("{:.2} s", phase.begin_s),
            format!("{:.2} s", phase.length_s),
            format!(
                "{:.2} +- {:.2}",
                phase.fall.g_mps2, phase.fall.standard_error_mps2
            ),
            match momentum.drift_percent {
                Some(percent) => format!("{:.2} kg m2/s, {percent:.0} %", momentum.drift_nms),
                None => format!("{:.2} kg m2/s", momentum.drift_nms),
            },
            errors.collect::<Vec<_>>().join("; "),
        ]);
    }
    terminal::print(&table.to_string());
    if !report.has_subject {
        terminal::print("no subject was given: the mass distribution is that of a default person");
    }
    terminal::print(&format!("verdict: {}", report.verdict.sentence));
}
