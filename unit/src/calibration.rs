//! The calibration of sensors on the limbs, by a unit that has them on its own port.

use std::time::{Duration, Instant};

use bodyflight_core::link::{
    Calibrate, Calibration, CalibrationStage, CalibrationVerdict, Message, Setup,
};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;

use super::log::{greeted, silent};
use super::setup;
use super::stream::connection::Target;
use super::stream::line::ANSWER_TIMEOUT;

/// How often a calibration is asked for before the unit is considered silent.
const ATTEMPTS: u32 = 15;

/// What a calibration needs.
const POSES: &str = "stand upright with the arms down, still for 3 s; bend forward until the back is level, still for 3 s; march \
                     on the spot for 6 s; stand upright again, still for 3 s";

/// Begins a calibration, follows it for up to `patience`, and returns what the unit has stored. `look` is called with
/// each state.
///
/// # Errors
/// Returns an error if the unit does not answer, no calibration was seen, it was refused, or it could not be stored.
pub fn calibrate(
    target: &Target,
    patience: Duration,
    mut look: impl FnMut(&Calibration),
) -> Result<Setup> {
    let mut line = greeted(target)?;
    let mut found = None;
    for _ in 0..ATTEMPTS {
        let frame = line.frame(0, Calibrate {});
        line.write(&frame)?;
        let deadline = Instant::now() + ANSWER_TIMEOUT;
        while let Some((_, _, message)) = line.next(deadline)? {
            if let Message::Calibration(answer) = message {
                found = Some(answer);
                break;
            }
        }
        if found.is_some() {
            break;
        }
    }
    let mut state = found.ok_or_else(silent)?;
    if state.stage == CalibrationStage::Absent {
        return Err(
            Problem::refused("the unit was built without sensors on the limbs")
                .help("docs/suit.md says which boards have them"),
        );
    }
    look(&state);
    let end = Instant::now() + patience;
    while Instant::now() < end && !interrupt::requested() {
        let until = end.min(Instant::now() + ANSWER_TIMEOUT);
        let Some((_, _, Message::Calibration(next))) = line.next(until)? else {
            continue;
        };
        state = next;
        look(&state);
        match state.verdict {
            CalibrationVerdict::Nothing => {}
            CalibrationVerdict::Good => {
                drop(line);
                return stored(target);
            }
            _ => return Err(refused(&state)),
        }
    }
    Err(refused(&state))
}

/// What the unit has stored after a good calibration.
fn stored(target: &Target) -> Result<Setup> {
    let kept = setup::read(target)?.filter(|setup| !setup.limbs.is_empty());
    kept.ok_or_else(|| {
        Problem::refused("the calibration is good, but the unit has not stored it")
            .help("it stores a calibration with its configuration: bodyflight unit configure first")
    })
}

/// Why sensors on the limbs are not calibrated.
pub(crate) fn refused(calibration: &Calibration) -> Problem {
    let what = match calibration.verdict {
        CalibrationVerdict::NoHeading => {
            "neither leaned in the bend nor swung to one side in the march"
        }
        CalibrationVerdict::Contradiction => {
            "is on another segment, or was turned between bend and march"
        }
        CalibrationVerdict::NoPelvis => "is missing, which all others are relative to",
        CalibrationVerdict::TooMany => "is one of more sensors than a unit has room for",
        CalibrationVerdict::Nothing | CalibrationVerdict::Good => {
            let problem = format!(
                "{} sensors on the limbs are not calibrated: of the rests of a calibration {} were seen",
                calibration.heard.count_ones(),
                calibration.rests
            );
            return Problem::bad_input(problem).help(POSES);
        }
    };
    let name = calibration.segment.name();
    Problem::bad_input(format!(
        "the calibration was refused: the sensor {name} {what}"
    ))
    .help(POSES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::Segment;

    #[test]
    fn a_refusal_names_the_sensor_and_what_to_do() {
        let refusal = |verdict| {
            let problem = refused(&Calibration {
                stage: CalibrationStage::Poses,
                verdict,
                segment: Segment::LeftShank,
                rests: 2,
                heard: 0x3ff,
                turned: 0,
            });
            problem.to_string()
        };
        assert!(refusal(CalibrationVerdict::Contradiction).contains("l_shank is on another"));
        let unseen = refusal(CalibrationVerdict::Nothing);
        assert!(
            unseen.contains("10 sensors") && unseen.contains("2 were seen"),
            "{unseen}"
        );
    }
}
