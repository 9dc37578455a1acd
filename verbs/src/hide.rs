//! `bodyflight hide`: simulated flights as files that do not mention the effects acting in them.

use std::path::{Path, PathBuf};

use bodyflight_core::flight_sample::FlightSample;
use bodyflight_discovery::named_effect::by_name;
use bodyflight_laboratory::Hidden;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::model_file::model_toml;
use bodyflight_replay::subject::Subject;

/// Files of a flight.
pub const FILES: &[&str] = &["flight.toml", "subject.toml", "flight.mvnx"];

/// Writes a flight of `rate` frames a second as `flight.toml`, `subject.toml` and `flight.mvnx` into `folder`, without
/// any hint of what is hidden.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub fn write(
    frames: &[FlightSample],
    subject: &Subject,
    rate: f64,
    folder: &Path,
) -> Result<PathBuf> {
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let description = Description {
        subject_label: "Laboratory".to_owned(),
        frame_rate: rate,
        start_unix_ms: 0,
        comment: "bodyflight hide".to_owned(),
        origin: Origin::Simulated,
    };
    let recording = folder.join("flight.mvnx");
    let mut writer = Writer::create(&recording, description, &subject.body())?;
    for (index, frame) in (0..).zip(frames) {
        interrupt::check()?;
        writer.write(&FlightFrame::from_motion(
            index,
            frame.time,
            frame.posture,
            &frame.motion,
        ))?;
    }
    writer.finish()?;
    write_file(&folder.join("subject.toml"), subject.to_toml()?.as_bytes())?;
    let path = folder.join("flight.toml");
    let text = format!(
        "recording = \"flight.mvnx\"\nsubject = \"subject.toml\"\n\n[air]\ndensity = {DEFAULT_DENSITY:?}\n"
    );
    write_file(&path, text.as_bytes())?;
    Ok(path)
}

/// What is hidden, as a `model.toml`; effects that are not in the library become comments.
pub fn truth_toml(hidden: &[Hidden]) -> String {
    let mut comment = "# Hidden in these flights by bodyflight hide.\n".to_owned();
    let (mut effects, mut loads) = (Vec::new(), Vec::new());
    for hidden in hidden {
        match hidden {
            Hidden::Outside(outside) => {
                comment += &format!("# {}, which is not in the library\n", outside.name());
            }
            Hidden::Effect(effect, values) => effects.push(by_name(*effect, values)),
            Hidden::Load(load) => loads.push(*load),
        }
    }
    model_toml(&comment, &effects, &loads)
}
