//! The configuration stored on a unit, with which it starts on its own.

use std::time::Instant;

use bodyflight_core::link::{
    Configure, LimbTable, Message, SegmentTable, Setup, SetupAction, SetupAsk, SetupState, Stored,
    Verdict,
};
use bodyflight_io::diagnostic::{Problem, Result};

use super::log::{greeted, silent};
use super::request::refused;
use super::stream::connection::Target;
use super::stream::line::{ANSWER_TIMEOUT, Line};

/// How often a request is sent before the unit is considered silent.
const ATTEMPTS: u32 = 15;

/// Sends a configuration to a unit and has it stored.
///
/// # Errors
/// Returns an error if the unit does not answer, refuses the configuration, or cannot store it.
pub fn store(target: &Target, setup: &Setup) -> Result<()> {
    let mut line = greeted(target)?;
    configure(&mut line, &setup.configure, &setup.table)?;
    for row in setup.limbs.rows() {
        let frame = line.frame(0, *row);
        line.write(&frame)?;
    }
    match ask(&mut line, SetupAction::Store)?.0 {
        SetupState::Present => {}
        state => return Err(refusal(state)),
    }
    // A unit that did not take what was sent stores what it had.
    match ask(&mut line, SetupAction::Read)? {
        (SetupState::Present, Some(kept)) if kept == *setup => Ok(()),
        (SetupState::Present, _) => Err(Problem::refused(
            "the unit did not take the configuration that was sent, and keeps the one it had",
        )
        .help("repeat the command; `bodyflight unit show` says what is stored")),
        (state, _) => Err(refusal(state)),
    }
}

/// Reads the configuration stored on a unit; `None` if there is none.
///
/// # Errors
/// Returns an error if the unit does not answer, or has no storage.
pub fn read(target: &Target) -> Result<Option<Setup>> {
    let mut line = greeted(target)?;
    match ask(&mut line, SetupAction::Read)? {
        (SetupState::Present, Some(setup)) => Ok(Some(setup)),
        (SetupState::Absent, _) => Ok(None),
        (state, _) => Err(refusal(state)),
    }
}

/// Erases the stored configuration; the unit then waits for a host again.
///
/// # Errors
/// Same as [`read`].
pub fn erase(target: &Target) -> Result<()> {
    let mut line = greeted(target)?;
    match ask(&mut line, SetupAction::Erase)?.0 {
        SetupState::Absent => Ok(()),
        state => Err(refusal(state)),
    }
}

fn refusal(state: SetupState) -> Problem {
    match state {
        SetupState::NoStorage => Problem::refused("the unit has no storage for a configuration")
            .help("a virtual unit has some with --flash; see docs/unit.md for the boards"),
        SetupState::NothingToStore => {
            Problem::refused("the unit has no complete configuration to store")
        }
        SetupState::Present | SetupState::Absent | SetupState::Failed => {
            Problem::refused("the unit's storage failed")
                .help("repeat the command; if it fails again, the memory chip is defective")
        }
    }
}

fn configure(line: &mut Line, configure: &Configure, table: &SegmentTable) -> Result<()> {
    let messages = table.rows().map(|row| Message::from(*row));
    let mut verdict = Verdict::Incomplete;
    for message in messages.chain([Message::from(*configure)]) {
        // A unit answers to a row only once it has a configuration, so rows are not waited for.
        let is_last = matches!(message, Message::Configure(_));
        let attempts = if is_last { ATTEMPTS } else { 1 };
        for _ in 0..attempts {
            let frame = line.frame(0, message);
            line.write(&frame)?;
            if !is_last {
                break;
            }
            let deadline = Instant::now() + ANSWER_TIMEOUT;
            while let Some((_, _, answer)) = line.next(deadline)? {
                if let Message::Configured(answer) = answer {
                    verdict = answer.verdict;
                    if verdict == Verdict::Accepted {
                        return Ok(());
                    }
                }
            }
        }
    }
    Err(refused(verdict))
}

/// The state after an action, and the configuration sent before it.
fn ask(line: &mut Line, action: SetupAction) -> Result<(SetupState, Option<Setup>)> {
    for _ in 0..ATTEMPTS {
        let frame = line.frame(0, SetupAsk { action });
        line.write(&frame)?;
        let (mut found, mut table, mut limbs) = (None, SegmentTable::new(), LimbTable::new());
        let deadline = Instant::now() + ANSWER_TIMEOUT;
        while let Some((_, _, message)) = line.next(deadline)? {
            match message {
                Message::Configure(configure) => found = Some(configure),
                Message::SegmentValues(row) => table.insert(row),
                Message::LimbSensor(row) => {
                    limbs.insert(&row);
                }
                Message::Stored(Stored {
                    state,
                    table_digest,
                }) => {
                    let whole = found.filter(|_| table.digest() == table_digest);
                    let setup = whole.map(|configure| Setup {
                        configure,
                        table,
                        limbs,
                    });
                    // A frame of the answer may have been lost: ask again.
                    let is_missing = state == SetupState::Present
                        && action == SetupAction::Read
                        && setup.is_none();
                    if is_missing {
                        break;
                    }
                    return Ok((state, setup));
                }
                _ => {}
            }
        }
    }
    Err(silent())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bodyflight_replay::flight::Flight;

    use super::*;
    use crate::stream::configuration_at;
    use crate::virtual_unit::VirtualUnit;
    use bodyflight_core::link::{LIMBS, LimbSensor, SensorKind, StreamMode};
    use bodyflight_core::suit::placement::of_size;

    fn setup() -> Setup {
        let flight = Flight::bare(Path::new("none"));
        let (configure, table) = configuration_at(&flight, 0.0, "auto", 100.0).unwrap();
        Setup {
            configure,
            table,
            limbs: LimbTable::new(),
        }
    }

    fn target(unit: &VirtualUnit) -> Target {
        Target::Port {
            path: unit.path().to_path_buf(),
            baud: crate::stream::connection::DEFAULT_BAUD,
        }
    }

    #[test]
    fn a_configuration_is_stored_shown_survives_a_restart_and_is_erased() {
        let folder = tempfile::tempdir().unwrap();
        let flash = folder.path().join("flash.bin");
        let unit = VirtualUnit::start_with_log(&flash).unwrap();
        assert_eq!(read(&target(&unit)).unwrap(), None);
        let mut setup = setup();
        setup.configure.sensor = SensorKind::Chain;
        // As many as there is room for: the longest answer.
        for segment in of_size(LIMBS).unwrap() {
            setup.limbs.insert(&LimbSensor {
                segment: *segment,
                ..LimbSensor::default()
            });
        }
        store(&target(&unit), &setup).unwrap();
        assert_eq!(read(&target(&unit)).unwrap(), Some(setup));
        // Another unit with the same memory starts with it, without a greeting.
        let again = VirtualUnit::start_with_log(&flash).unwrap();
        assert_eq!(again.resumed(), Some(StreamMode::Sensor));
        assert_eq!(read(&target(&again)).unwrap(), Some(setup));
        erase(&target(&again)).unwrap();
        assert_eq!(read(&target(&again)).unwrap(), None);
    }

    #[test]
    fn a_configuration_that_the_unit_did_not_take_is_not_called_stored() {
        let folder = tempfile::tempdir().unwrap();
        let unit = VirtualUnit::start_with_log(&folder.path().join("flash.bin")).unwrap();
        let good = setup();
        store(&target(&unit), &good).unwrap();
        // A unit ignores numbers that the link refuses, and still has its own configuration, which it stores again.
        let mut wrong = good;
        wrong.configure.sample_rate = 0.0;
        let problem = store(&target(&unit), &wrong).unwrap_err();
        assert!(problem.to_string().contains("did not take"), "{problem}");
        assert_eq!(read(&target(&unit)).unwrap(), Some(good));
    }

    #[test]
    fn a_unit_without_storage_says_so() {
        let unit = VirtualUnit::start().unwrap();
        let problem = store(&target(&unit), &setup()).unwrap_err();
        assert!(problem.to_string().contains("no storage"), "{problem}");
    }
}
