//! Figures in the format given by the file name: SVG as drawn, or PDF and PNG converted from it.
//!
//! Text uses a font that ships with the program (`verbs/data/font`), so figures look the same everywhere; PDFs embed it.

#[cfg(feature = "figures")]
mod convert;

use std::path::Path;

use bodyflight_io::destination::ending;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;

/// Text that is not markup.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// A figure format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Vector graphics, for the web and for editing.
    Svg,
    /// Vector graphics with the font embedded, for papers.
    Pdf,
    /// Pixels, for slides.
    Png,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Svg, Self::Pdf, Self::Png];

    /// The file name extension.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }

    /// The format given by a file name.
    ///
    /// # Errors
    /// Returns an error if the extension is none of these, or if the format was not built in.
    pub fn of(path: &Path) -> Result<Self> {
        let end = ending(path, &Self::ALL.map(Self::extension), "a figure")?;
        let format = Self::ALL
            .into_iter()
            .find(|format| format.extension() == end);
        format
            .unwrap_or(Self::Svg)
            .available()
            .map_err(|problem| problem.in_file(path))
    }

    /// The format itself, if this program can write it.
    ///
    /// # Errors
    /// Returns an error if the format was not built in.
    pub fn available(self) -> Result<Self> {
        if self == Self::Svg || cfg!(feature = "figures") {
            return Ok(self);
        }
        let name = self.extension().to_uppercase();
        Err(Problem::not_built_in(&format!("figures as {name}")))
    }

    /// Converts a drawing to this format.
    ///
    /// # Errors
    /// Returns an error if the figure cannot be drawn.
    pub fn encode(self, svg: &str) -> Result<Vec<u8>> {
        match self {
            Self::Svg => Ok(svg.as_bytes().to_vec()),
            #[cfg(feature = "figures")]
            Self::Pdf => convert::pdf(svg).map_err(not_drawn),
            #[cfg(feature = "figures")]
            Self::Png => convert::png(svg).map_err(not_drawn),
            #[cfg(not(feature = "figures"))]
            Self::Pdf | Self::Png => self.available().map(|_| Vec::new()),
        }
    }
}

#[cfg(feature = "figures")]
fn not_drawn(why: String) -> Problem {
    Problem::internal(format!("cannot draw the figure: {why}"))
}

/// Writes a drawing in the format given by the file name.
///
/// # Errors
/// Returns an error if the extension is unknown or the file cannot be written.
pub fn write_figure(path: &Path, svg: &str) -> Result<()> {
    write_file(path, &Format::of(path)?.encode(svg)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_format_follows_from_the_name() {
        let format = |name: &str| Format::of(Path::new(name));
        if cfg!(feature = "figures") {
            assert_eq!(format("a/x.PNG").unwrap(), Format::Png);
            assert_eq!(format("x.pdf").unwrap(), Format::Pdf);
        } else {
            let problem = format("x.pdf").unwrap_err();
            assert!(problem.help.unwrap().contains("--features full"));
        }
        assert_eq!(format("x.svg").unwrap(), Format::Svg);
        for name in ["x.jpg", "x", "png"] {
            let problem = format(name).unwrap_err().to_string();
            assert!(problem.contains(".svg, .pdf or .png"), "{problem}");
        }
    }
}
