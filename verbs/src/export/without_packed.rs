//! Stands for the files that need more than text in a program that was built without them.

use std::path::Path;

use bodyflight_core::Body;
use bodyflight_export::about::About;
use bodyflight_export::columns::quantity::{Quantity, Sink};
use bodyflight_io::diagnostic::{Problem, Result};

use super::format::Format;

/// Says that this program cannot write the format.
pub(super) fn sink(
    _: &Body<f64>,
    (_, format): (&Path, Format),
    _: &[Quantity],
    _: &About,
) -> Result<Box<dyn Sink>> {
    let what = format!("the format {}", format.name());
    Err(Problem::not_built_in(&what))
}
