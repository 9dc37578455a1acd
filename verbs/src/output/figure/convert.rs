//! Converts drawings from SVG to PDF and PNG.

use std::sync::Arc;

use resvg::tiny_skia::{Pixmap, Transform};
use svg2pdf::usvg::{Options, Tree, fontdb::Database};

const FONT: &[u8] = include_bytes!("../../../data/font/DejaVuSansCondensed-subset.ttf");
const FAMILY: &str = "DejaVu Sans";

/// Pixels of a PNG per unit of the drawing: 300 dpi if 320 units of the figure are 8 cm wide.
const PNG_SCALE: f32 = 3.0;

fn tree(svg: &str) -> Result<Tree, String> {
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

pub(super) fn pdf(svg: &str) -> Result<Vec<u8>, String> {
    let page = svg2pdf::PageOptions::default();
    svg2pdf::to_pdf(&tree(svg)?, svg2pdf::ConversionOptions::default(), page)
        .map_err(|error| error.to_string())
}

pub(super) fn png(svg: &str) -> Result<Vec<u8>, String> {
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
    use super::super::Format;
    use super::*;

    const DRAWING: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"100\" height=\"50\">\
        <rect width=\"100\" height=\"50\" fill=\"#ffffff\"/>\
        <text x=\"5\" y=\"30\" font-family=\"sans-serif\" font-size=\"20\">Δv (m/s)</text></svg>";

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
