//! Sensors on the limbs of a unit without a host: power on, the person stands upright, and jumps.

use std::io::Cursor;
use std::path::Path;
use std::sync::LazyLock;

use bodyflight_emulator::sensed::is_consistent;
use bodyflight_emulator::worn::Worn;
use bodyflight_emulator::{Flight, Host, Options};
use bodyflight_unit::monitor::Input;
use bodyflight_unit::sensor_line;

/// What a host would stream; none of it is sent here.
static FLIGHT: LazyLock<Flight> = LazyLock::new(|| Flight::of("tracking", "auto").unwrap());

/// The line is heard from this long before the flight to this long after its begin (s).
const BEFORE: f64 = 8.0;
const AFTER: f64 = 6.0;

#[test]
#[ignore = "needs the image: cargo xtask hil"]
fn power_on_an_upright_pose_and_a_jump_give_the_desktops_estimates() {
    let Worn { line, setup } = Worn::in_exit(AFTER).unwrap();
    let flown: Vec<_> = line
        .into_iter()
        .filter(|(time, _)| *time > -BEFORE)
        .collect();
    let mut host = Host::power(&Options::new(), &FLIGHT).unwrap();
    host.store_and_leave(&setup).unwrap();
    let begin = host.chip.now() + 300_000;
    for (time, bytes) in &flown {
        let due = begin + ((time + BEFORE) * 1e6) as u64;
        host.chip.send(due, "sensor", bytes).unwrap();
        host.listen(due).unwrap();
    }
    host.listen(begin + ((BEFORE + AFTER + 0.5) * 1e6) as u64)
        .unwrap();
    assert_eq!(host.resets.len(), 1, "restarted: {:?}", host.resets);
    let found: Vec<_> = host
        .estimates
        .iter()
        .map(|(_, estimate)| *estimate)
        .collect();
    let bytes: Vec<u8> = flown.iter().flat_map(|(_, bytes)| bytes.clone()).collect();
    let input = Input::new(Cursor::new(bytes), Path::new("a line"));
    let (desk, report) = sensor_line::run(&setup, &input, |_| ()).unwrap();
    let expected: Vec<_> = desk.estimates().map(|(_, estimate)| *estimate).collect();
    assert_eq!(report.missing, 0);
    assert!(expected.len() > 250, "{}", expected.len());
    assert!(
        found.len() + 1 >= expected.len(),
        "{} {}",
        found.len(),
        expected.len()
    );
    // Until the receiver is heard: the age of its solutions is by the board's clock, which differs from the desk's.
    let alone = expected
        .iter()
        .take_while(|e| f64::from(e.sample_sequence) < BEFORE * 100.0);
    for (found, expected) in found.iter().zip(alone) {
        // The time that an update takes is the machine's.
        let found = bodyflight_core::link::Estimate {
            cycles: expected.cycles,
            ..*found
        };
        assert_eq!(found, *expected);
    }
    let last = found.iter().rev().take(50);
    let good = last.filter(|estimate| is_consistent(estimate)).count();
    assert!(good > 25, "{good} of the last 50");
    host.greet().unwrap();
    host.listen(host.chip.now() + 1_200_000).unwrap();
    let status = host.status.unwrap();
    eprintln!(
        "late {} dropped {} overrun {} stack free {} longest update {} cycles",
        status.deadline_missed,
        status.dropped_oldest,
        status.sensor_overrun,
        status.stack_free,
        status.cycles_max
    );
    assert_eq!((status.dropped_oldest, status.sensor_overrun), (0, 0));
    assert_eq!(status.missing, 0);
    assert!(status.stack_free > 8192, "{}", status.stack_free);
}
