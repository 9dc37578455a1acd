//! `bodyflight fly`.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use bodyflight_core::aerodynamics::load_model::LoadModel;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::{sweep, write_file};
use bodyflight_io::interrupt;
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::view::flown::{FlownFrame, frames, saved, write};
use bodyflight_verbs::view::page::{FlyData, Mode, PageData, Provenance, html};
use bodyflight_verbs::view::server::Server;
use serde::Serialize;

use super::arguments::within;
use super::outputs::Outputs;
use super::terminal;
use super::view::{command, open};

/// Fly by keyboard in a browser. The core runs in the page, and flights can be saved as recordings.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bodyflight fly --open\n  bodyflight fly subject.toml --save flights\n  \
                  bodyflight fly --out fly.html   (a page to send to others; it saves flights as CSV, for --from)\n\n\
                  Runs until Ctrl-C."
)]
pub(super) struct Args {
    /// A subject.toml; by default the default subject with free-fly aerodynamics.
    subject: Option<PathBuf>,
    /// Folder for saved flights, named flown-0, flown-1 and so on.
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    save: PathBuf,
    /// Air density (kg/m3); thinner air makes the fall faster.
    #[arg(long, default_value_t = DEFAULT_DENSITY)]
    density: f64,
    /// Make a recording of the CSV file that a page of --out saved, and exit; the subject is that of the page.
    #[arg(long, value_name = "CSV", conflicts_with_all = ["out", "open", "density"])]
    from: Option<PathBuf>,
    /// Write the page to a file and exit.
    #[arg(long, value_name = "HTML", conflicts_with_all = ["save", "open"])]
    out: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
    /// Open the page in a browser.
    #[arg(long)]
    open: bool,
}

/// Largest relative difference of the masses of a file and its subject.
const SAME_MASS: f64 = 1e-3;

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Opened<'a> {
    url: &'a str,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    within("density", args.density, [0.1, 2.0], "kg/m3")?;
    let subject = match &args.subject {
        Some(path) => Subject::read(path)?,
        None => {
            let mut subject = Subject::default();
            subject.set_load_model(LoadModel::FreeFly);
            subject
        }
    };
    if let Some(path) = &args.from {
        args.outputs.check_in(&args.save, &[])?;
        return convert(path, &subject, &args.save);
    }
    args.outputs.check_as(args.out.as_deref(), "html")?;
    args.outputs.check_in(&args.save, &[])?;
    let files: Vec<&Path> = args.subject.iter().map(PathBuf::as_path).collect();
    let provenance = Provenance::of(command(), &files)?;
    let fly = FlyData::new(&subject, args.density);
    let page = html(&PageData::of(Mode::Fly, "fly".to_owned(), provenance, fly))?;
    if let Some(path) = &args.out {
        write_file(path, page.as_bytes())?;
        terminal::print(&format!("written: {}", path.display()));
        return Ok(());
    }
    // What an earlier run left that was killed while it saved.
    sweep(&args.save);
    let (folder, density) = (args.save.clone(), args.density);
    let saving = Arc::new(Mutex::new(()));
    let busy = Arc::clone(&saving);
    let saved = move |bytes: Vec<u8>| {
        let _busy = busy.lock();
        match save(&bytes, &subject, density, &folder) {
            Ok(path) => {
                terminal::note(&format!("saved: {}", path.display()));
                format!("Saved: {}", path.display())
            }
            Err(problem) => {
                let text = format!("Not saved: {}", problem.with_causes());
                terminal::print_problem(problem, false);
                text
            }
        }
    };
    let server = Server::start(page, Box::new(saved))?;
    let url = server.url();
    if json {
        terminal::json_line(&Opened { url: &url })?;
    } else {
        terminal::print(&format!("fly at {url} (Ctrl-C ends)"));
    }
    let doorway = args.open.then(|| server.doorway()).transpose()?;
    if let Some(doorway) = &doorway {
        open(doorway.path());
    }
    // Ctrl-C is the normal way to end.
    while interrupt::check().is_ok() {
        std::thread::sleep(Duration::from_millis(50));
    }
    // A flight that is being saved is finished, or removed by the handler of Ctrl-C if it takes too long.
    drop(saving.lock());
    Ok(())
}

/// Makes a recording of a file that a page saved.
fn convert(path: &Path, subject: &Subject, folder: &Path) -> Result<()> {
    let saved = saved(path)?;
    let mass = subject.body().mass();
    if (saved.mass / mass - 1.0).abs() > SAME_MASS {
        let message = format!(
            "expected a flight of the subject, whose mass is {mass:.2} kg, found one of {:.2} kg",
            saved.mass
        );
        let problem = Problem::bad_input(message).in_file(path).at_line(1);
        return Err(
            problem.help("give the subject.toml with which bodyflight fly --out made the page")
        );
    }
    let flight = write_to(&saved.frames, subject, saved.density, folder)?;
    terminal::print(&format!("written: {}", flight.display()));
    Ok(())
}

/// Saves a flight of the page in the first free folder.
fn save(bytes: &[u8], subject: &Subject, density: f64, folder: &Path) -> Result<PathBuf> {
    write_to(&frames(bytes)?, subject, density, folder)
}

/// Writes frames to the first free folder.
fn write_to(
    frames: &[FlownFrame],
    subject: &Subject,
    density: f64,
    folder: &Path,
) -> Result<PathBuf> {
    let free = (0..)
        .map(|number: u32| folder.join(format!("flown-{number}")))
        .find(|folder| !folder.exists());
    write(frames, subject, density, &free.unwrap_or_default())
}
