//! The figures of a report, in each format asked for.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::Result;

use super::experiments::{EXPERIMENTS, Experiment, Procedure};
use super::is_wanted;
use crate::output::figure::{Format, write_figure};

/// Where figures go, and in which formats beside SVG, which the report shows.
#[derive(Clone, Copy)]
pub(super) struct Drawings<'a> {
    pub(super) folder: &'a Path,
    pub(super) formats: &'a [Format],
}

impl Drawings<'_> {
    /// Writes a figure, and returns the name of its SVG.
    pub(super) fn write(self, name: &str, svg: &str) -> Result<PathBuf> {
        for path in files(name, self.formats) {
            write_figure(&self.folder.join(path), svg)?;
        }
        Ok(svg_of(name))
    }
}

/// Names of the figures of an experiment: the flight with muscle moments, and the matched one where it is another.
pub(super) fn names(experiment: &Experiment) -> (String, Option<String>) {
    let name = experiment.name.to_owned();
    let matched =
        (experiment.procedure != Procedure::Constant).then(|| format!("{name}-{MATCHED}"));
    (name, matched)
}

/// What is added to the names of matched flights.
pub(super) const MATCHED: &str = "matched";

/// File names of all figures of a report.
pub fn figures(what: &[String], formats: &[Format]) -> Vec<PathBuf> {
    let of_experiments = EXPERIMENTS.iter().flat_map(|experiment| {
        let (moments, matched) = names(experiment);
        [Some(moments), matched].map(|name| (experiment.name, name))
    });
    let of_parts = super::DRAWN_PARTS.map(|part| (part, Some(part.to_owned())));
    of_experiments
        .chain(of_parts)
        .filter(|(wanted, _)| is_wanted(what, wanted))
        .filter_map(|(_, name)| name)
        .flat_map(|name| files(&name, formats))
        .collect()
}

fn svg_of(name: &str) -> PathBuf {
    PathBuf::from(format!("{name}.{}", Format::Svg.extension()))
}

fn files(name: &str, formats: &[Format]) -> Vec<PathBuf> {
    let others = formats.iter().filter(|format| **format != Format::Svg);
    let others = others.map(|format| svg_of(name).with_extension(format.extension()));
    std::iter::once(svg_of(name)).chain(others).collect()
}
