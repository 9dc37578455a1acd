//! The unit in QEMU without a host: a stored configuration, power, and the bytes of its sensors and of a receiver.
//!
//! The flight is one of the independent simulator (`shared/flights`): its person differs from the one that is configured,
//! and flies in postures that the unit, which assumes the H-pose, does not know.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bodyflight_core::link::{EstimateFlags, Setup};
use bodyflight_emulator::sensed::{Sensed, is_consistent};
use bodyflight_emulator::worn::Worn;
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use bodyflight_unit::log::{self, LoggedFlight};
use bodyflight_unit::monitor::Input;
use bodyflight_unit::sensor_line;
use bodyflight_unit::setup;
use bodyflight_unit::stream::connection::{DEFAULT_BAUD, Target};
use bodyflight_unit::stream::qemu::Qemu;
use bodyflight_unit::stream::twin::{self, Agreement};
use bodyflight_unit::virtual_unit::VirtualUnit;

/// Length of the flight (s), and the moment of what happens in it.
const LENGTH: f64 = 5.5;
const MIDDLE: f64 = 2.7;
/// Longest time for a flight whose pace is the machine's.
const PATIENCE: Duration = Duration::from_secs(60);
/// What is still in memory when the power is cut is not in the log (s).
const BLOCK: f64 = 0.35;

/// The image for the `mps2-an505`.
fn image() -> PathBuf {
    std::env::var_os("BODYFLIGHT_QEMU_IMAGE")
        .map(PathBuf::from)
        .expect("BODYFLIGHT_QEMU_IMAGE names the image: cargo xtask hil")
}

/// The flight and, in a file of the folder, the memory of a unit that has its configuration.
fn configured(folder: &Path) -> Option<(Sensed, PathBuf)> {
    let sensed = Sensed::of("none-slow-101/flight-0", LENGTH, &SensorBytes::TYPICAL).unwrap()?;
    let flash = remembered(folder, &sensed.setup);
    Some((sensed, flash))
}

/// A file of the folder: the memory of a unit that has a configuration.
fn remembered(folder: &Path, setup: &Setup) -> PathBuf {
    let flash = folder.join("memory");
    let (_unit, target) = at(&flash);
    setup::store(&target, setup).unwrap();
    flash
}

/// A virtual unit with a memory, and its address.
fn at(flash: &Path) -> (VirtualUnit, Target) {
    let unit = VirtualUnit::start_with_log(flash).unwrap();
    let path = unit.path().to_path_buf();
    let baud = DEFAULT_BAUD;
    (unit, Target::Port { path, baud })
}

/// Sends the bytes from one time of the flight (s) to another at the pace at which they were sent.
fn play(sensed: &Sensed, line: &mut impl std::io::Write, [from, to]: [f64; 2]) {
    let begin = Instant::now();
    let all = sensed.bytes.iter();
    for (time, bytes) in all.filter(|(time, _)| (from..to).contains(time)) {
        let due = Duration::from_secs_f64(time - from);
        std::thread::sleep(due.saturating_sub(begin.elapsed()));
        line.write_all(bytes).unwrap();
    }
}

/// Waits until the unit writes no more: on a busy host the machine may be behind.
fn wait(flash: &Path) {
    let written = || std::fs::metadata(flash).unwrap().modified().unwrap();
    let mut last = None;
    while last.replace(written()) != Some(written()) {
        std::thread::sleep(Duration::from_millis(700));
    }
}

/// Cuts the power, and reads the log.
fn landed(machine: Qemu, flash: &Path) -> (Vec<LoggedFlight>, Agreement) {
    wait(flash);
    machine.stop();
    logged(flash)
}

/// Reads the log.
fn logged(flash: &Path) -> (Vec<LoggedFlight>, Agreement) {
    let (_unit, target) = at(flash);
    let blocks = log::read(&target, &mut |_| ()).unwrap();
    let (flights, damaged) = log::flights(&blocks);
    assert_eq!(damaged, 0);
    (flights, twin::in_log(&blocks))
}

/// Checks the estimates of a logged flight that began at a time of the true one (s), from `settled` after that on.
fn is_right(sensed: &Sensed, flight: &LoggedFlight, begin: f64, settled: f64) {
    let all = flight.estimates().filter(|(time, _)| *time > settled);
    let found = sensed.errors(all.map(|(time, estimate)| (begin + time, estimate)));
    eprintln!("{found:?}");
    assert!(found.count > 30.0, "{found:?}");
    assert!(found.consistent > 0.95, "{found:?}");
    assert!(found.horizontal < 0.4 && found.vertical < 0.8, "{found:?}");
    assert!(found.attitude < 0.02, "{found:?}");
}

fn are_equal(agreement: Agreement, least: u64) {
    eprintln!("{agreement:?}");
    assert!(agreement.received > least, "{agreement:?}");
    assert_eq!(agreement.equal, agreement.received, "{agreement:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask hil"]
fn power_and_a_sensor_are_all_that_the_unit_needs() {
    let folder = tempfile::tempdir().unwrap();
    let Some((sensed, flash)) = configured(folder.path()) else {
        return;
    };
    let (machine, mut line) = Qemu::start_alone(&image(), &flash).unwrap();
    play(&sensed, &mut line, [0.0, LENGTH]);
    let (flights, agreement) = landed(machine, &flash);
    assert_eq!(flights.len(), 1);
    let flight = &flights[0];
    let logged = flight.duration();
    assert!(logged > LENGTH - BLOCK, "{logged}");
    is_right(&sensed, flight, 0.0, 2.0);
    are_equal(agreement, 100);
}

/// How long the person stands upright after power-on, and falls (s).
const STANDING: f64 = 6.0;
const FALLING: f64 = 4.0;

/// The person stands upright after power-on, as in the first pose of the calibration that is stored, and jumps.
#[test]
#[ignore = "needs the image: cargo xtask hil"]
fn ten_sensors_on_the_limbs_and_an_upright_pose_give_the_desktops_estimates() {
    let folder = tempfile::tempdir().unwrap();
    let Worn { line, setup } = Worn::in_exit(FALLING).unwrap();
    let since_power_on = line
        .into_iter()
        .map(|(time, bytes)| (time + STANDING, bytes));
    let line: Vec<_> = since_power_on.filter(|(time, _)| *time > 0.0).collect();
    let flash = remembered(folder.path(), &setup);
    Qemu::run_alone(&image(), &flash, &line, PATIENCE).unwrap();
    let (flights, agreement) = logged(&flash);
    are_equal(agreement, 200);
    let bytes: Vec<u8> = line.into_iter().flat_map(|(_, bytes)| bytes).collect();
    let input = Input::new(Cursor::new(bytes), Path::new("a line"));
    let (desk, _) = sensor_line::run(&setup, &input, |_| ()).unwrap();
    let postures = |flight: &LoggedFlight| flight.postures().map(|(_, p)| p).collect::<Vec<_>>();
    let [found, expected] = [&flights[0], &desk].map(postures);
    eprintln!("{} of {} postures", found.len(), expected.len());
    // The log begins some seconds before the exit, and leaves nothing out from then on.
    assert!(found.len() as f64 > 100.0 * (FALLING + 2.0));
    assert!(expected.windows(found.len()).any(|part| part == found));
    let (_, last) = flights[0].estimates().next_back().unwrap();
    assert!(last.flags.contains(EstimateFlags::MOTION), "{last:?}");
    assert!(!last.flags.contains(EstimateFlags::LIMB), "{last:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask hil"]
fn a_reset_in_flight_goes_on_with_the_stored_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let Some((sensed, flash)) = configured(folder.path()) else {
        return;
    };
    let (mut machine, mut line) = Qemu::start_alone(&image(), &flash).unwrap();
    play(&sensed, &mut line, [0.0, MIDDLE]);
    wait(&flash);
    machine.reset().unwrap();
    play(&sensed, &mut line, [MIDDLE, LENGTH]);
    let (flights, agreement) = landed(machine, &flash);
    assert_eq!(flights.len(), 2, "one session before the reset, one after");
    let [before, after] = [&flights[0], &flights[1]];
    let logged = [before.duration(), after.duration()];
    assert!(logged[0] > MIDDLE - BLOCK, "{logged:?}");
    assert!(logged[1] > LENGTH - MIDDLE - BLOCK, "{logged:?}");
    let mut good = after.estimates().filter(|(_, found)| is_consistent(found));
    let (back, _) = good.next().expect("a good estimate");
    eprintln!("back {back} s after the sensor");
    assert!(back < 2.0, "{back}");
    is_right(&sensed, after, MIDDLE, 1.5);
    are_equal(agreement, 100);
}

#[test]
#[ignore = "needs the image: cargo xtask hil"]
fn power_is_cut_and_the_sensor_is_silent() {
    let folder = tempfile::tempdir().unwrap();
    let Some((sensed, flash)) = configured(folder.path()) else {
        return;
    };
    let (machine, mut line) = Qemu::start_alone(&image(), &flash).unwrap();
    play(&sensed, &mut line, [0.0, 1.0]);
    machine.stop();
    // The second start hears nothing of its sensor for 0.7 s.
    let (machine, mut line) = Qemu::start_alone(&image(), &flash).unwrap();
    play(&sensed, &mut line, [1.0, MIDDLE]);
    std::thread::sleep(Duration::from_millis(700));
    play(&sensed, &mut line, [MIDDLE + 0.7, LENGTH]);
    let (flights, agreement) = landed(machine, &flash);
    let after = flights.last().unwrap();
    let logged = after.duration();
    assert!(logged > LENGTH - 1.0 - BLOCK, "{logged}");
    is_right(&sensed, after, 1.0, MIDDLE + 0.7 - 1.0 + 0.3);
    are_equal(agreement, 100);
}

#[test]
#[ignore = "needs the image: cargo xtask hil"]
fn a_damaged_configuration_starts_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let Some((sensed, flash)) = configured(folder.path()) else {
        return;
    };
    // A bit of each byte of the record, which is in one of the last two sectors.
    let mut bytes = std::fs::read(&flash).unwrap();
    let sectors = bytes.len() - 2 * 4096;
    let written = bytes[sectors..].iter_mut().filter(|byte| **byte != 0xff);
    written.for_each(|byte| *byte ^= 4);
    std::fs::write(&flash, bytes).unwrap();
    let (machine, mut line) = Qemu::start_alone(&image(), &flash).unwrap();
    play(&sensed, &mut line, [0.0, 1.5]);
    let (flights, _) = landed(machine, &flash);
    assert!(flights.is_empty());
    let (_unit, target) = at(&flash);
    assert!(setup::read(&target).unwrap().is_none());
}
