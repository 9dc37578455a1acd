//! The figures of a report, in each format asked for.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::Result;

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

fn svg_of(name: &str) -> PathBuf {
    PathBuf::from(format!("{name}.{}", Format::Svg.extension()))
}

/// File names of a figure: SVG, and what else is asked for.
pub(super) fn files(name: &str, formats: &[Format]) -> Vec<PathBuf> {
    let others = formats.iter().filter(|format| **format != Format::Svg);
    let others = others.map(|format| svg_of(name).with_extension(format.extension()));
    std::iter::once(svg_of(name)).chain(others).collect()
}
