//! Figures in the format given by the file name: SVG as drawn, or PDF and PNG converted from it.
//!
//! Text uses a font that ships with the program (`host/data/font`), so figures look the same everywhere; PDFs embed it.

use std::path::Path;
use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use svg2pdf::usvg::{Options, Tree, fontdb::Database};

use super::files::write_file;
use crate::diagnostic::{Problem, Result};

const FONT: &[u8] = include_bytes!("../../data/font/DejaVuSansCondensed-subset.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Pixels of a PNG per unit of the drawing: 300 dpi if 320 units of the figure are 8 cm wide.
const PNG_SCALE: f32 = 3.0;

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
    /// Returns an error if the extension is none of these.
    pub fn of(path: &Path) -> Result<Self> {
        let end = path.extension().unwrap_or_default().to_string_lossy();
        Self::ALL
            .into_iter()
            .find(|format| format.extension().eq_ignore_ascii_case(&end))
            .ok_or_else(|| {
                let found = if end.is_empty() {
                    "no extension".to_owned()
                } else {
                    format!(".{end}")
                };
                Problem::bad_input(format!(
                    "expected a figure whose name ends in .svg, .pdf or .png, found {found}"
                ))
                .in_file(path)
            })
    }

    /// Converts a drawing to this format.
    ///
    /// # Errors
    /// Returns an error if the figure cannot be drawn.
    pub fn encode(self, svg: &str) -> Result<Vec<u8>> {
        let drawn = match self {
            Self::Svg => return Ok(svg.as_bytes().to_vec()),
            Self::Pdf => pdf(svg),
            Self::Png => png(svg),
        };
        drawn.map_err(|why| Problem::internal(format!("cannot draw the figure: {why}")))
    }
}

/// Writes a drawing in the format given by the file name.
///
/// # Errors
/// Returns an error if the extension is unknown or the file cannot be written.
pub fn write_figure(path: &Path, svg: &str) -> Result<()> {
    write_file(path, &Format::of(path)?.encode(svg)?)
}

fn tree(svg: &str) -> core::result::Result<Tree, String> {
    let mut fonts = Database::new();
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family(FAMILY);
    let options = Options {
        font_family: FAMILY.to_owned(),
        fontdb: Arc::new(fonts),
        ..Options::default()
    };
    Tree::from_str(svg, &options).map_err(|error| error.to_string())
}

fn pdf(svg: &str) -> core::result::Result<Vec<u8>, String> {
    let page = svg2pdf::PageOptions::default();
    svg2pdf::to_pdf(&tree(svg)?, svg2pdf::ConversionOptions::default(), page)
        .map_err(|error| error.to_string())
}

fn png(svg: &str) -> core::result::Result<Vec<u8>, String> {
    let tree = tree(svg)?;
    let size = tree.size().to_int_size();
    let size = size.scale_by(PNG_SCALE).ok_or("it has no size")?;
    let mut dots = Pixmap::new(size.width(), size.height()).ok_or("it is too large")?;
    let scale = Transform::from_scale(PNG_SCALE, PNG_SCALE);
    resvg::render(&tree, scale, &mut dots.as_mut());
    dots.encode_png().map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWING: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"100\" height=\"50\">\
        <rect width=\"100\" height=\"50\" fill=\"#ffffff\"/>\
        <text x=\"5\" y=\"30\" font-family=\"sans-serif\" font-size=\"20\">Δv (m/s)</text></svg>";

    #[test]
    fn the_format_follows_from_the_name() {
        let format = |name: &str| Format::of(Path::new(name));
        assert_eq!(format("a/x.PNG").unwrap(), Format::Png);
        assert_eq!(format("x.pdf").unwrap(), Format::Pdf);
        assert_eq!(format("x.svg").unwrap(), Format::Svg);
        for name in ["x.jpg", "x", "png"] {
            let problem = format(name).unwrap_err().to_string();
            assert!(problem.contains(".svg, .pdf or .png"), "{problem}");
        }
    }

    #[test]
    fn letters_are_drawn_and_embedded() {
        let pixels = Pixmap::decode_png(&Format::Png.encode(DRAWING).unwrap()).unwrap();
        assert_eq!((pixels.width(), pixels.height()), (300, 150));
        let dark = pixels.pixels().iter().filter(|dot| dot.red() < 60).count();
        assert!(dark > 500, "{dark} dark dots");
        let pdf = Format::Pdf.encode(DRAWING).unwrap();
        assert!(pdf.starts_with(b"%PDF-"));
        let holds = |word: &[u8]| pdf.windows(word.len()).any(|part| part == word);
        assert!(holds(b"/FontFile") && holds(b"DejaVuSansCondensed"));
        assert_eq!(Format::Svg.encode(DRAWING).unwrap(), DRAWING.as_bytes());
    }
}
