//! A recording as a flight: implausible values, and MVN's centre of mass compared with that of the model's body.

use core::fmt;
use std::path::Path;

use bodyflight_core::Body;
use bodyflight_core::body::mass_properties::MassProperties;
use bodyflight_core::body::posture::pose;
use nalgebra::Vector3;
use serde::Serialize;

use super::activity::Activities;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::progress;
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording, Warning};
use bodyflight_replay::person::compared;
use bodyflight_replay::subject::Subject;
use bodyflight_replay::support::Support;

/// Difference between MVN's centre of mass and the model's, in body axes: left, dorsal, cranial.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct CentreOfMass {
    /// Number of frames compared.
    pub frames: u64,
    /// Mean (m).
    pub mean_m: [f64; 3],
    /// Root mean square of the distance (m).
    pub rms_m: f64,
    /// Root mean square about the mean (m), which no other segment table can remove.
    pub spread_m: f64,
    /// Whether the body is the person's rather than the default one.
    pub of_person: bool,
}

/// Information about a flight before it is simulated.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FlightReport {
    /// Values that are implausible for a flight.
    pub warnings: Vec<Warning>,
    /// What the body does for most of the time; null if the file has no positions.
    pub activity: Option<&'static str>,
    /// Centres of mass; null if the file has none.
    pub centre_of_mass: Option<CentreOfMass>,
    /// The first frame as text art, from the front and from the left.
    #[serde(skip)]
    pub picture: String,
}

/// Reads a recording as a flight.
///
/// # Errors
/// Returns an error if it is not a flight.
pub(crate) fn inspected(path: &Path, person: Option<&Body<f64>>) -> Result<FlightReport> {
    let options = Options {
        allow_truncated: true,
        ..Options::default()
    };
    let body = person.copied().unwrap_or_else(|| Subject::default().body());
    let mut recording = Recording::open(path, options)?;
    let mut picture = None;
    let mut centres = Centres::default();
    let mut activities = Activities::default();
    let mut support = Support::default();
    for frame in recording.by_ref() {
        let frame = frame?;
        picture.get_or_insert_with(|| super::picture::first_frame(&body, &frame));
        centres.add(&body, &frame);
        activities.see(&frame);
        support.see(&frame);
        if frame.index.is_multiple_of(1024) {
            progress::at(frame.time)?;
        }
    }
    let mut warnings = recording.warnings();
    // A recording of something else than a fall is sound, but no flight.
    warnings.extend(support.warnings().into_iter().map(|warning| Warning {
        is_fault: false,
        ..warning
    }));
    warnings.extend(
        person
            .iter()
            .flat_map(|body| compared(recording.header(), body, true)),
    );
    Ok(FlightReport {
        warnings,
        activity: activities.most(),
        centre_of_mass: centres.compared(person.is_some()),
        picture: picture.ok_or_else(|| {
            Problem::bad_input("expected at least one usable frame, found none").in_file(path)
        })?,
    })
}

/// Sums over distances.
#[derive(Default)]
struct Centres {
    count: u64,
    sum: Vector3<f64>,
    squares: f64,
}

impl Centres {
    fn add(&mut self, body: &Body<f64>, frame: &FlightFrame) {
        let Some(recorded) = frame.centre_of_mass.filter(|_| !frame.bridged) else {
            return;
        };
        let model = MassProperties::of(body, &pose(body, &frame.posture)).cg;
        let from_pelvis = recorded.components - frame.pelvis.position.components;
        let to_body = frame.pelvis.inertial_from_body.quaternion().inverse();
        let apart = to_body * from_pelvis - model;
        self.count += 1;
        self.sum += apart;
        self.squares += apart.norm_squared();
    }

    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    fn compared(&self, of_person: bool) -> Option<CentreOfMass> {
        let count = self.count as f64;
        let mean = self.sum / count;
        let square = self.squares / count;
        (self.count > 0).then(|| CentreOfMass {
            frames: self.count,
            mean_m: mean.into(),
            rms_m: square.sqrt(),
            spread_m: (square - mean.norm_squared()).max(0.0).sqrt(),
            of_person,
        })
    }
}

impl fmt::Display for FlightReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(centre) = &self.centre_of_mass {
            let [left, dorsal, cranial] = centre.mean_m.map(|part| 100.0 * part);
            writeln!(
                f,
                "centre of mass  {:.1} cm from that of {} (rms over {} frames); on average {left:+.1} cm left, \
                 {dorsal:+.1} dorsal, {cranial:+.1} cranial; {:.1} cm about that mean",
                100.0 * centre.rms_m,
                if centre.of_person {
                    "the subject's body"
                } else {
                    "a default body; --subject names another"
                },
                centre.frames,
                100.0 * centre.spread_m
            )?;
        }
        for warning in &self.warnings {
            writeln!(f, "warning         {warning}")?;
        }
        writeln!(
            f,
            "first frame     from the front, and from the left; R is the right hand\n{}",
            self.picture
        )
    }
}
