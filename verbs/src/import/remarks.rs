//! What an import says of its source.

use bodyflight_core::Segment;
use bodyflight_mocap::source::Source;
use bodyflight_replay::person::{disproportionate, uneven};
use bodyflight_replay::subject::Subject;

/// Relative difference allowed between the thigh lengths of source and subject.
const THIGH: f64 = 0.15;
/// Lowest frame rate that can follow a body in flight (Hz).
const SLOW: f64 = 50.0;

/// Remarks about the source, and those among them that contradict it.
pub(super) fn warnings(
    (subject, is_known): (&Subject, bool),
    source: &Source,
    has_places: bool,
) -> (Vec<String>, Vec<String>) {
    let mut warnings = source.warnings.clone();
    let slips = source.slips.iter().map(ToString::to_string);
    let mut doubts: Vec<String> = slips.chain(source.contradictions.iter().cloned()).collect();
    warnings.extend(doubts.iter().cloned());
    if !has_places {
        warnings.push(
            "the source has no positions, so the recording has no velocity; add a receiver's track for it: \
             gnss = \"TRACK.CSV\" in flight.toml, and gnss_begin_s = 12.3, by how much (s) the recording begins after the first row of the track"
                .to_owned(),
        );
    }
    if source.timing.rate < SLOW {
        warnings.push(format!(
            "only {:.1} frames per second: rotation between frames is assumed to be uniform",
            source.timing.rate
        ));
    }
    warnings.extend(no_subject(is_known, subject));
    let own = subject.body().segments[Segment::LeftThigh].length;
    if let Some(thigh) = source.lengths_m[Segment::LeftThigh]
        && ((thigh / own) - 1.0).abs() > THIGH
    {
        let said = format!(
            "the thigh of the source is {thigh:.3} m long, that of the subject {own:.3} m: is it the same person?"
        );
        doubts.extend(is_known.then(|| said.clone()));
        warnings.push(said);
    }
    if is_known {
        // What is written has the limbs of the subject: only the source shows that one of them is wrong.
        let uneven = uneven(&subject.body(), |segment| source.lengths_m[segment]);
        warnings.extend(uneven.into_iter().map(|(_, said)| said));
    }
    if let Some((_, said)) = disproportionate(|segment| source.lengths_m[segment]) {
        doubts.push(said.clone());
        warnings.push(said);
    }
    (warnings, doubts)
}

pub(super) fn no_subject(has_subject: bool, subject: &Subject) -> Option<String> {
    (!has_subject).then(|| {
        format!(
            "no subject was given: a person of {:.0} kg with equipment is written to subject.toml",
            subject.body().mass()
        )
    })
}
