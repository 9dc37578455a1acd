//! A flight in real time: everything arrives in time, and every estimate equals the desktop's.

use bodyflight_core::link::StreamMode;
use bodyflight_emulator::{Flight, Host, Options, RATE};

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn a_paced_flight_loses_nothing_and_every_estimate_is_the_desktops() {
    let seconds: u64 = std::env::var("BODYFLIGHT_F405_SECONDS").map_or(3, |s| s.parse().unwrap());
    for preset in ["auto", "tracking"] {
        paced(preset, seconds);
    }
}

fn paced(preset: &str, seconds: u64) {
    let flight = Flight::of("tracking", preset).unwrap();
    let mut host = Host::power(&Options::new(), &flight).unwrap();
    // In the first tenths of a second the unit also looks for the end of its log.
    host.listen(500_000).unwrap();
    host.connect(StreamMode::Paced).unwrap();
    let before = host.chip.look().unwrap();
    host.fly(u32::try_from(seconds * RATE).unwrap()).unwrap();
    let after = host.chip.look().unwrap();
    let status = host.stop().unwrap();
    let agreement = host.agreement();
    let load = (after.busy - before.busy) as f64 / 168.0 / (after.now - before.now) as f64;
    eprintln!(
        "stm32f405, {preset}: {seconds} s of flight; {} samples, {} missing, {} dropped; {} of {} estimates equal, \
         {} deadline misses; {:.2} M instructions a second, load {:.1} %; stack free {} B",
        host.sent(),
        status.missing,
        status.dropped_oldest,
        agreement.equal,
        agreement.expected,
        status.deadline_missed,
        (after.instructions - before.instructions) as f64 / (after.now - before.now) as f64,
        100.0 * load,
        status.stack_free,
    );
    assert!(
        agreement.expected >= 45 * seconds && agreement.holds(),
        "{agreement:?}"
    );
    assert_eq!([status.missing, status.dropped_oldest], [0; 2]);
    assert!(status.deadline_missed <= 1 && host.late_in_flight() == 0);
    assert_eq!([status.uart_overrun, status.uart_framing], [0; 2]);
}
