//! The files that need more than text.

use std::path::Path;

use bodyflight_core::{Body, Segment};
use bodyflight_export::about::About;
use bodyflight_export::columns::npz::NpzArchive;
use bodyflight_export::columns::parquet::ParquetTable;
use bodyflight_export::columns::quantity::{Quantity, Sink};
use bodyflight_export::foxglove::recording::{McapRecording, Solid};
use bodyflight_io::diagnostic::Result;
use bodyflight_viewer::frame::half_extents;

use super::format::Format;

/// The file that takes the rows.
pub(super) fn sink(
    body: &Body<f64>,
    (path, format): (&Path, Format),
    quantities: &[Quantity],
    about: &About,
) -> Result<Box<dyn Sink>> {
    Ok(match format {
        Format::Npz => Box::new(NpzArchive::create(path, quantities.to_vec())?),
        Format::Mcap => {
            let solid = |segment: Segment| Solid {
                half_extents: half_extents(&body.segments[segment].area).into(),
                middle: body.segments[segment].cg.into(),
                joint_offset: body.segments[segment].joint_offset.into(),
            };
            let solids = Segment::ALL.map(solid).to_vec();
            Box::new(McapRecording::create(path, quantities, solids, about)?)
        }
        Format::Parquet | Format::Csv => Box::new(ParquetTable::create(path, quantities, about)?),
    })
}
