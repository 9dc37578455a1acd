//! The stored configuration, beside the log on the same chip.

use bodyflight_core::link::{Configure, LimbTable, Setup, SetupState};

use super::*;
use crate::test_flight::{configure, table};

/// The states and configurations that the host hears after requests, with an end of power after `power` bytes.
fn kept(chip: &Chip, requests: &[SetupRequest]) -> Vec<(SetupState, Option<Setup>)> {
    kept_at_once(chip, requests.chunks(1))
}

/// The same; the requests of a group come before the memory has time for the first one.
fn kept_at_once<'a>(
    chip: &Chip,
    groups: impl Iterator<Item = &'a [SetupRequest]>,
) -> Vec<(SetupState, Option<Setup>)> {
    let recorder = Recorder::new(vec![Block::EMPTY; 8].leak());
    let heard = RefCell::new(Vec::new());
    let answer = |answer: Answer<'_>| {
        if let Answer::Setup(state, setup) = answer {
            heard.borrow_mut().push((state, setup.copied()));
        }
    };
    let mut storage = chip.log(&recorder);
    let mut log = core::pin::pin!(storage.run(answer));
    for requests in groups {
        for (action, record) in requests {
            recorder.ask_setup(*action, *record);
        }
        let _ = poll_once(log.as_mut());
    }
    heard.take()
}

fn setup(height: f32) -> Setup {
    Setup {
        configure: Configure {
            height,
            ..configure()
        },
        table: table(),
        limbs: LimbTable::new(),
    }
}

#[test]
fn a_configuration_is_stored_beside_the_log() {
    let chip = Chip::new(usize::MAX, 1);
    let record = |height| setup(height).encode();
    let heard = kept(
        &chip,
        &[
            (SetupAction::Read, None),
            (SetupAction::Store, record(1.7)),
            (SetupAction::Store, record(1.8)),
            (SetupAction::Read, None),
        ],
    );
    let states: Vec<_> = heard.iter().map(|(state, _)| *state).collect();
    let present = SetupState::Present;
    assert_eq!(states, [SetupState::Absent, present, present, present]);
    assert_eq!(heard[3].1, Some(setup(1.8)));
    // It survives a restart, many replacements and its removal.
    let many: Vec<_> = (0..40_u8)
        .map(|k| (SetupAction::Store, record(1.5 + f32::from(k) * 0.01)))
        .collect();
    assert!(
        kept(&chip, &many)
            .iter()
            .all(|(state, _)| *state == present)
    );
    let heard = kept(
        &chip,
        &[(SetupAction::Read, None), (SetupAction::Erase, None)],
    );
    assert_eq!(heard[0].1, Some(setup(1.89)));
    assert_eq!(heard[1].0, SetupState::Absent);
}

/// The unit stores a calibration by itself, and a host may ask what is stored before the memory has time for it.
#[test]
fn a_question_does_not_replace_what_is_to_be_stored() {
    let chip = Chip::new(usize::MAX, 1);
    let requests = [
        (SetupAction::Store, setup(1.7).encode()),
        (SetupAction::Read, None),
    ];
    let heard = kept_at_once(&chip, [&requests[..]].into_iter());
    assert_eq!(heard, [(SetupState::Present, None)]);
    assert_eq!(height(&chip), Some(1.7));
}

/// Power fails at every tenth byte while a configuration replaces another: one of the two is there afterwards.
#[test]
fn a_loss_of_power_leaves_the_old_configuration_or_the_new_one() {
    for power in (0..4_000).step_by(10) {
        let chip = Chip::new(usize::MAX, power);
        let first: Vec<_> = (0..3)
            .map(|_| (SetupAction::Store, setup(1.7).encode()))
            .collect();
        kept(&chip, &first);
        chip.0.borrow_mut().power = power as usize;
        kept(&chip, &[(SetupAction::Store, setup(1.8).encode())]);
        chip.0.borrow_mut().power = usize::MAX;
        let heard = kept(&chip, &[(SetupAction::Read, None)]);
        let height = heard[0].1.map(|setup| setup.configure.height);
        assert!(
            matches!(height, Some(1.7 | 1.8)),
            "after {power} bytes: {height:?}"
        );
    }
}

/// Stores a configuration with a subject of this height (m).
pub(super) fn store(chip: &Chip, height: f32) {
    kept(chip, &[(SetupAction::Store, setup(height).encode())]);
}

/// Height of the subject in the stored configuration (m), if there is one.
pub(super) fn height(chip: &Chip) -> Option<f32> {
    let heard = kept(chip, &[(SetupAction::Read, None)]);
    heard[0].1.map(|setup| setup.configure.height)
}
