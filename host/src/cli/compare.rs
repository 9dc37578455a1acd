//! `bodyflight compare`.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::write_file;
use bodyflight_mvnx::recording::faults;
use bodyflight_replay::flight::{Flight, name_of};
use bodyflight_verbs::compare::align::Align;
use bodyflight_verbs::compare::{
    Compared, Report, Settings, Side, Track, compare, figure, page, table,
};

use bodyflight_verbs::view::page::{PageData, Provenance, html};

use super::arguments::window;
use super::outputs::{Outputs, Plot};
use super::several::{self, file_of, output_of};
use super::simulate::Reading;
use super::terminal::{self, FlightBar};
use super::view::{command, open};

/// Compare recordings of one maneuver with the first: joints, turn and fall, and what the differences do by the model.
#[derive(clap::Args)]
#[command(
    after_help = "A is the first flight, B each of the others; differences are B minus A. They are aligned on the start of the turn \
                  if both turn, else on the exit if both have one, else on their first frames. Joints are named as for \
                  simulate --joint (docs/compare.md). Exit code 4: the flights cannot be aligned; 5: the model misses the \
                  flights by more than their differences do.\n\n\
                  Examples:\n  bodyflight compare student expert\n  \
                  bodyflight compare student expert --align warp --plot compare.pdf --page compare.html\n  \
                  bodyflight compare student expert --align time=2.1,3.4 --from 1.5 --to 6 --out joints.csv\n  \
                  bodyflight compare expert jump-1 jump-2 --out {}.csv   ({} is the name of B)"
)]
pub(super) struct Args {
    /// The flight that others are compared with: a flight.toml, its folder, or an MVNX file on its own.
    #[arg(value_name = "A")]
    first: PathBuf,
    /// The other flights.
    #[arg(required = true, value_name = "B")]
    others: Vec<PathBuf>,
    /// Align on the start of the turn, the exit, the first frames, times in both flights, or by time warping of the movements.
    #[arg(
        long,
        value_name = "auto|turn|exit|start|time=TA,TB|warp",
        default_value = "auto",
        value_parser = Align::parse
    )]
    align: Align,
    /// Compare from this time of A on (s since frame 0).
    #[arg(long, value_name = "S")]
    from: Option<f64>,
    /// Compare up to this time of A (s since frame 0).
    #[arg(long, value_name = "S")]
    to: Option<f64>,
    /// Write channels and joint angles of both flights over time as CSV.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    /// Write a page with both bodies in one picture, joints and channels, as one HTML file.
    #[arg(long, value_name = "HTML")]
    page: Option<PathBuf>,
    /// Open the page in a browser.
    #[arg(long, requires = "page")]
    open: bool,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    window(args.from, args.to)?;
    let read = |path: &PathBuf| Ok((name_of(path), Flight::read(path)?));
    let first = read(&args.first)?;
    let others = args.others.iter().map(read).collect::<Result<Vec<_>>>()?;
    let (mut outs, mut plots, mut pages) = (Vec::new(), Vec::new(), Vec::new());
    for path in &args.others {
        outs.push(output_of(args.out.as_ref(), path, &args.others)?);
        pages.push(output_of(args.page.as_ref(), path, &args.others)?);
        plots.push(args.plot.of(path, &args.others)?);
    }
    for ((out, page), plot) in outs.iter().zip(&pages).zip(&plots) {
        args.outputs.check_with([out], plot)?;
        args.outputs.check_as(page.as_deref(), "html")?;
    }
    let a = track(&first, args)?;
    terminal::note_assumed_subject(&a.flight);
    let settings = Settings {
        align: args.align,
        between: [args.from, args.to],
    };
    let mut report = Report {
        a: Side::of(&a),
        pairs: Vec::new(),
    };
    let mut verdicts = Vec::new();
    for (k, other) in others.iter().enumerate() {
        let b = track(other, args)?;
        let spinner = terminal::spinner("comparing");
        let compared = compare([&a, &b], settings);
        spinner.finish_and_clear();
        let compared = compared?;
        write([&a, &b], &compared, outs[k].as_ref(), &plots[k])?;
        if let Some(page) = &pages[k] {
            let files = [&args.first, &args.others[k]].map(|path| file_of(path));
            write_page(page, files, [&a, &b], &compared)?;
            if args.open {
                open(page);
            }
        }
        let recording = &b.flight.recording;
        for doubt in [faults(&b.warnings), compared.pair.doubt()] {
            verdicts.push(several::verdict(doubt, recording));
        }
        report.pairs.push(compared.pair);
    }
    verdicts.push(several::verdict(faults(&a.warnings), &a.flight.recording));
    if json {
        terminal::print_json(&report)?;
    } else {
        terminal::print(report.to_string().trim_end());
        let others = report.pairs.iter().map(|pair| &pair.b);
        for side in others.chain([&report.a]) {
            terminal::note_warnings(&side.warnings);
        }
        let notes = report.pairs.iter().flat_map(|pair| &pair.notes);
        notes.for_each(|note| terminal::note(&format!("note: {note}")));
        let plots = plots.iter().map(|plot| &plot.path);
        for path in outs.iter().chain(plots).chain(&pages).flatten() {
            terminal::print(&format!("written: {}", path.display()));
        }
    }
    verdicts.into_iter().collect()
}

fn track((name, flight): &(String, Flight), args: &Args) -> Result<Track> {
    let bar = FlightBar::new("reading", flight);
    let track = Track::read(name, flight, args.reading.options(), &mut |time| {
        bar.at(time)
    });
    bar.end();
    track
}

fn write(
    tracks: [&Track; 2],
    compared: &Compared,
    out: Option<&PathBuf>,
    plot: &Plot,
) -> Result<()> {
    if let Some(path) = out {
        table::write(path, tracks, compared)?;
    }
    let [a, b] = tracks.map(|track| track.name.as_str());
    let title = || format!("{b} compared with {a}");
    plot.write(|| figure::svg(&plot.title(title), tracks, compared))
}

/// Writes the page of a comparison.
fn write_page(
    path: &Path,
    files: [PathBuf; 2],
    tracks: [&Track; 2],
    compared: &Compared,
) -> Result<()> {
    let recordings = tracks.map(|track| track.flight.recording.clone());
    let mut inputs: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    inputs.extend(recordings.iter().map(PathBuf::as_path));
    inputs.dedup();
    let provenance = Provenance::of(command(), &inputs)?;
    let title = format!("{} compared with {}", tracks[1].name, tracks[0].name);
    let beside = page::beside(tracks, compared)?;
    let page = html(&PageData::compare(title, provenance, beside))?;
    write_file(path, page.as_bytes())
}
