//! Verbs about files: what a recording contains, the jumps of a logger, motion of other systems, figures, and pages.

use std::path::{Path, PathBuf};

use bodyflight_io::destination;
use bodyflight_io::diagnostic::{Kind, Problem};
use bodyflight_io::files::write_file;
use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::systems::is_of_another_system;
use bodyflight_replay::flight::name_of;
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::preset_file::AUTO;
use bodyflight_tracks::{self as tracks, folder};
use bodyflight_verbs::fall::answer::Answer;
use bodyflight_verbs::fall::{Conditions, DEFAULT_MASS, Stated, logbook};
use bodyflight_verbs::output::bodies::{FRONT, SIDE, TOP, View};
use bodyflight_verbs::output::figure::Format;
use bodyflight_verbs::validate::inputs::Inputs;
use bodyflight_verbs::view::estimated::estimated;
use bodyflight_verbs::view::page::{PageData, Provenance, html};
use bodyflight_verbs::view::run::fly;
use bodyflight_verbs::{
    figures as drawn, import as imports, inspect as inspects, inspect_imported,
};
use pyo3::prelude::*;

use crate::estimate::request;
use crate::flight::Flight;
use crate::long::{long, told};
use crate::problem::{dictionary, raise, unknown, value, warn_of_doubt};
use crate::subject::Subject;

/// Describes a recording, or a file of another system. Returns the dictionary of `bodyflight inspect --json`; issues a
/// DoubtWarning if the recording contradicts itself.
///
/// `mapping` is the path of a mapping, for files of other systems; `subject` is compared with the recorded person. `progress` is
/// called with the flight time reached (s).
#[pyfunction]
#[pyo3(signature = (file, *, mapping = None, subject = None, progress = None))]
pub(crate) fn inspect(
    py: Python<'_>,
    file: PathBuf,
    mapping: Option<PathBuf>,
    subject: Option<Subject>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let report = told(py, progress, || {
        let mapping = mapping.as_deref().map(Mapping::read).transpose()?;
        let subject = subject.as_ref().map(|subject| &subject.inner);
        if mapping.is_some() || is_of_another_system(&file) {
            inspect_imported::inspect_imported(&file, mapping.as_ref(), subject)
        } else {
            let body = subject.map(bodyflight_replay::subject::Subject::body);
            inspects::inspect(&file, body.as_ref())
        }
    })?;
    warn_of_doubt(py, report.doubt().as_deref())?;
    dictionary(py, &report)
}

/// Converts the motion of another system to a recording in the folder `out`. Returns the dictionary of `bodyflight import
/// --json`; look at the picture that it names before you trust the result. `progress` is called with the share done.
#[pyfunction]
#[pyo3(signature = (file, out, *, mapping = None, subject = None, force = false, progress = None))]
pub(crate) fn import_recording(
    py: Python<'_>,
    file: PathBuf,
    out: PathBuf,
    mapping: Option<PathBuf>,
    subject: Option<Subject>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let mapping = mapping.as_deref().map(Mapping::read).transpose();
    let mapping = mapping.map_err(raise)?;
    let has_subject = subject.is_some();
    let subject = Subject::or_default(subject);
    destination::check_in(&out, imports::FILES, force).map_err(raise)?;
    let report = long(py, progress, |progress| {
        let request = imports::Request {
            file: &file,
            mapping: mapping.as_ref(),
            subject: &subject,
            has_subject,
            folder: &out,
        };
        imports::import(&request, &mut |share| progress(share))
    })?;
    dictionary(py, &report)
}

/// Analyses the jumps on a logger's track. Returns the dictionary of `bodyflight fall --json`; for a folder of tracks, that of
/// its logbook. Issues a DoubtWarning if the fall is not certain, and raises a Disagreement if it is not explained.
///
/// `mass` is that of skydiver and equipment (kg), `beside` the track of another jumper from the same load. `progress` is called
/// with the share of a folder's tracks.
#[pyfunction]
#[pyo3(
    signature = (track, *, mass = DEFAULT_MASS, ground_pressure_hpa = None, ground_temperature_celsius = None, reference_height_m = None, beside = None, progress = None),
    text_signature = "(track, *, mass=80.0, ground_pressure_hpa=None, ground_temperature_celsius=None, reference_height_m=None, beside=None, progress=None)"
)]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn fall(
    py: Python<'_>,
    track: PathBuf,
    mass: f64,
    ground_pressure_hpa: Option<f64>,
    ground_temperature_celsius: Option<f64>,
    reference_height_m: Option<f64>,
    beside: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let names = [
        "mass",
        "ground_pressure_hpa",
        "ground_temperature_celsius",
        "reference_height_m",
    ];
    let stated = Stated {
        mass,
        ground_pressure: ground_pressure_hpa,
        ground_temperature: ground_temperature_celsius,
        reference_height: reference_height_m.unwrap_or(Conditions::default().reference_height),
    };
    let conditions = stated.checked(names).map_err(raise)?;
    if track.is_dir() {
        if beside.is_some() {
            let problem = Problem::bad_input("a folder of tracks has no jump beside another");
            return Err(raise(problem.at("beside").help("give the track itself")));
        }
        let book = told(py, progress, || {
            logbook::logbook(&folder::tracks(&track)?, &conditions)
        })?;
        return dictionary(py, &book);
    }
    let answer = told(py, progress, || {
        let read = tracks::read(&track)?;
        Ok(Answer::of(read, &track, &conditions, beside.as_deref())?.0)
    })?;
    let report = dictionary(py, &answer)?;
    match answer.failure(&track, beside.as_deref()) {
        None => Ok(report),
        Some(problem) if problem.kind == Kind::Doubt => {
            warn_of_doubt(py, Some(&problem.message)).map(|()| report)
        }
        Some(problem) => Err(with_report(py, problem, report)?),
    }
}

/// Creates the exception of a run that finished with a report.
fn with_report(py: Python<'_>, problem: Problem, report: Py<PyAny>) -> PyResult<PyErr> {
    let error = raise(problem);
    error.value(py).setattr("report", report)?;
    Ok(error)
}

/// Compares the model with real flights: those bundled with the program, or the flights, loggers' tracks and tables of captures
/// in `paths`. Returns the dictionary of `bodyflight validate --json`; raises a Disagreement, whose `report` it is, if a check
/// fails. `progress` is called with the share done of each of its stages.
#[pyfunction]
#[pyo3(signature = (paths = vec![], *, progress = None), text_signature = "(paths=(), *, progress=None)")]
pub(crate) fn validate(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let report = told(py, progress, || Inputs::read(&paths)?.validate())?;
    let found = dictionary(py, &report)?;
    match report.failure() {
        None => Ok(found),
        Some(failure) => Err(with_report(py, Problem::disagreement(failure), found)?),
    }
}

/// Views of the bodies by name.
const VIEWS: [(&str, View); 3] = [("front", FRONT), ("side", SIDE), ("top", TOP)];

fn view_named(name: &String) -> PyResult<View> {
    let found = VIEWS.iter().find(|(known, _)| known == name);
    let view = found.map(|(_, view)| *view);
    view.ok_or_else(|| unknown("view", name, &VIEWS.map(|(name, _)| name)))
}

/// Draws the figures of a paper into the folder `out`: reconstruction, inputs, path over ground, and rows of bodies, of one
/// flight or of several on the same axes. Returns their paths.
///
/// `preset`, `method` and `filter` are those of `estimate`; `between` are two times (s), either of which may be None, outside of
/// which nothing is drawn. Issues a DoubtWarning if an estimate should not be trusted. `views` are one or several of "front",
/// "side" and "top", `formats` of "svg", "pdf" and "png"; `title` is by default made of the flights' names.
#[pyfunction]
#[pyo3(
    signature = (flights, out, *, preset = "auto", method = "filter", filter = None, between = (None, None), snapshots = 6, views = Several::One("side".to_owned()), formats = Several::One("svg".to_owned()), title = None, force = false, progress = None),
    text_signature = "(flights, out, *, preset='auto', method='filter', filter=None, between=(None, None), snapshots=6, views='side', formats='svg', title=None, force=False, progress=None)"
)]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn figures(
    py: Python<'_>,
    flights: Several<Flight>,
    out: PathBuf,
    preset: &str,
    method: &str,
    filter: Option<&str>,
    between: (Option<f64>, Option<f64>),
    snapshots: usize,
    views: Several<String>,
    formats: Several<String>,
    title: Option<String>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Vec<PathBuf>> {
    let flights = flights.all();
    let format = |name: &String| {
        let found = Format::ALL
            .into_iter()
            .find(|known| known.extension() == name);
        found.ok_or_else(|| unknown("format", name, &Format::ALL.map(Format::extension)))
    };
    let settings = drawn::Settings {
        request: request(preset, method, filter)?,
        between: [between.0, between.1],
        snapshots,
        views: views
            .all()
            .iter()
            .map(view_named)
            .collect::<PyResult<_>>()?,
        formats: formats.all().iter().map(format).collect::<PyResult<_>>()?,
    };
    settings.check(flights.len()).map_err(raise)?;
    let names = drawn::files(flights.len(), &settings.formats);
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    destination::check_in(&out, &names, force).map_err(raise)?;
    let (figures, doubt) = long(py, progress, |progress| {
        let progress = &mut |time| progress(time);
        let mut all = Vec::new();
        for flight in &flights {
            let (inner, options) = (&flight.inner, flight.options);
            let name = name_of(&inner.recording);
            all.push(drawn::Drawn::of(inner, name, &settings, options, progress)?);
        }
        let figures = drawn::write(&all, title.as_deref(), &settings, &out)?;
        Ok((figures, all.into_iter().find_map(|drawn| drawn.doubt)))
    })?;
    warn_of_doubt(py, doubt.as_deref())?;
    Ok(figures)
}

/// Writes a page that replays flights, with body, plots and forces, to the file `out`. Returns its path, its size in bytes and
/// the number of runs; issues a DoubtWarning if a recording contradicts itself.
///
/// `model` is the path of a model.toml, for a second run of each flight; `estimates` is None, "filter" or "smooth"; `discovery`
/// is a dictionary that `discover` returned.
#[pyfunction]
#[pyo3(signature = (flights, out, *, model = None, estimates = None, discovery = None, force = false, progress = None))]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn view(
    py: Python<'_>,
    flights: Several<Flight>,
    out: PathBuf,
    model: Option<PathBuf>,
    estimates: Option<&str>,
    discovery: Option<&Bound<'_, PyAny>>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let flights = flights.all();
    let Some(first) = flights.first() else {
        let problem = Problem::bad_input("expected at least one flight");
        return Err(raise(problem.at("flights")));
    };
    let title = name_of(&first.inner.recording);
    let effects = model.as_deref().map(Effects::read).transpose();
    let effects = effects.map_err(raise)?;
    let estimates = estimates.map(|method| request(AUTO, method, None));
    let estimates = estimates.transpose()?;
    let discovery = discovery.map(value).transpose()?;
    destination::check([&out], force).map_err(raise)?;
    let (bytes, runs, doubt) = long(py, progress, |progress| {
        let progress = &mut |time| progress(time);
        let mut runs = Vec::new();
        for flight in &flights {
            let (inner, options) = (&flight.inner, flight.options);
            let name = name_of(&inner.recording);
            let mut run = fly(&name, inner, options, true, progress)?;
            if let Some(request) = &estimates {
                run.estimated = Some(estimated(inner, request, options, progress)?);
            }
            runs.push(run);
            if let Some(effects) = &effects {
                let mut extended = inner.clone();
                extended.effects = effects.clone();
                let name = format!("{name}, extended model");
                runs.push(fly(&name, &extended, options, true, progress)?);
            }
        }
        let mut files: Vec<&Path> = Vec::new();
        for flight in &flights {
            files.push(&flight.inner.recording);
        }
        files.extend(model.as_deref());
        let provenance = Provenance::of("bodyflight.view".to_owned(), &files)?;
        let doubt = runs.iter().find_map(|run| run.doubt.clone());
        let count = runs.len();
        let mut page = PageData::replay(title, provenance, runs);
        page.discovery = discovery;
        let text = html(&page)?;
        write_file(&out, text.as_bytes())?;
        Ok((text.len(), count, doubt))
    })?;
    warn_of_doubt(py, doubt.as_deref())?;
    let written = serde_json::json!({ "page": out, "bytes": bytes, "runs": runs });
    dictionary(py, &written)
}

/// One, or several.
#[derive(FromPyObject)]
pub(crate) enum Several<T> {
    One(T),
    All(Vec<T>),
}

impl<T> Several<T> {
    fn all(self) -> Vec<T> {
        match self {
            Self::One(one) => vec![one],
            Self::All(all) => all,
        }
    }
}
