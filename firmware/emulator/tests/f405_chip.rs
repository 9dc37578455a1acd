//! How the image configures its chip, what its line costs and tolerates, and what the unit reports about itself.

use bodyflight_core::link::StreamMode;
use bodyflight_emulator::{Chip, Flight, Host, Options, RATE};

/// Mean cycles per instruction of the emulator's clock, the default of `stm32f405/__main__.py`.
const CYCLES: f64 = 2.3;

/// Least part of the 64 KiB for the stack that a flight leaves unused (bytes).
const STACK_MARGIN: u32 = 24 * 1024;

/// Numbers of the interrupts of the receivers, the transmitter and the clock.
const RECEIVERS: [&str; 4] = ["12", "57", "39", "71"];
const TRANSMITTER: &str = "14";
const CLOCK: &str = "28";

fn flying(options: &Options, samples: u32) -> Host {
    let flight = Flight::of("tracking", "auto").unwrap();
    let mut host = Host::power(options, &flight).unwrap();
    // The unit first looks for the end of its log.
    host.listen(500_000).unwrap();
    host.connect(StreamMode::Paced).unwrap();
    host.fly(samples).unwrap();
    assert_eq!(host.resets.len(), 1, "restarted: {:?}", host.resets);
    host
}

fn greeting(options: &Options) -> bodyflight_core::link::HelloAcknowledge {
    flying(options, 0).greeting.unwrap()
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn one_noise_error_costs_what_it_hits_and_no_more() {
    let mut host = flying(&Options::new(), 120);
    let at = host.chip.now() + 1_000;
    host.chip
        .send_broken(at, "host", &[0x55], "noise", true)
        .unwrap();
    host.fly(240).unwrap();
    let status = host.stop().unwrap();
    let agreement = host.agreement();
    let overruns = host.chip.look().unwrap().overruns[0];
    eprintln!(
        "one noise error: {} of {} estimates, {} samples missing, {overruns} overruns",
        agreement.received, agreement.expected, status.missing
    );
    assert!(status.missing <= 2, "{} samples missing", status.missing);
    assert!(
        agreement.received + 2 >= agreement.expected,
        "{agreement:?}"
    );
    assert!(overruns <= 60, "{overruns} overruns: the receiver was off");
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn the_load_at_240_hz_is_below_45_percent_by_the_cycle_model() {
    let mut host = flying(&Options::new(), 120);
    let samples = 48;
    let (cost, time) = host.fly_traced(samples).unwrap();
    let status = host.stop().unwrap();
    assert_eq!((status.used, status.missing), (120 + samples, 0));
    assert!(status.stack_free > STACK_MARGIN, "{} B", status.stack_free);
    let load = |cycles: f64| cycles / 168.0 / time as f64;
    let clock = CYCLES * cost.instructions as f64;
    let mean = |cycles: u64| cycles as f64 / cost.instructions as f64;
    eprintln!(
        "stm32f405 at {RATE} Hz: {:.2} M instructions a second; cycles of an instruction {:.2} without waits for flash, \
         {:.2} accelerated, {:.2} plain; load {:.1} % accelerated, {:.1} % plain, {:.1} % by the emulator's clock",
        cost.instructions as f64 / time as f64,
        mean(cost.cycles),
        mean(cost.accelerated),
        mean(cost.plain),
        100.0 * load(cost.accelerated as f64),
        100.0 * load(cost.plain as f64),
        100.0 * load(clock),
    );
    // The emulator's clock is slower than the model, on the safe side.
    assert!(mean(cost.accelerated) <= CYCLES, "{cost:?}");
    assert!(load(cost.accelerated as f64) <= 0.45, "{cost:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn a_second_of_waiting_costs_less_than_a_thousandth_of_the_processor() {
    let mut host = flying(&Options::new(), 0);
    host.listen(host.chip.now() + 1_000_000).unwrap();
    let before = host.chip.look().unwrap();
    host.listen(host.chip.now() + 1_000_000).unwrap();
    let after = host.chip.look().unwrap();
    let instructions = after.instructions - before.instructions;
    eprintln!("a second of waiting: {instructions} instructions");
    assert!(instructions < 100_000, "{instructions}");
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn flash_is_accelerated_and_what_is_received_goes_first() {
    let look = flying(&Options::new(), 0).chip.look().unwrap();
    assert_eq!(look.frequency, 168_000_000);
    assert_eq!(
        look.flash_control & 0x707,
        0x705,
        "{:#x}: prefetch, both caches, 5 waits",
        look.flash_control
    );
    let priority = |irq: &str| look.priorities[irq];
    for receiver in RECEIVERS {
        assert!(
            priority(receiver) < priority(TRANSMITTER),
            "{receiver}: {:?}",
            look.priorities
        );
    }
    assert!(
        priority(TRANSMITTER) < priority(CLOCK),
        "{:?}",
        look.priorities
    );
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn without_its_crystal_the_unit_flies_from_the_chips_own_oscillator() {
    let options = Options {
        crystal: false,
        ..Options::new()
    };
    let mut host = flying(&options, 120);
    assert_eq!(host.stop().unwrap().missing, 0);
    assert!(host.agreement().holds());
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn the_watchdog_runs_before_the_clocks() {
    let options = Options {
        crystal: false,
        ..Options::new()
    };
    let mut chip = Chip::start(&options).unwrap();
    // The start zeroes memory, which takes 20 ms, and then waits for the crystal.
    chip.run(30_000).unwrap();
    let look = chip.look().unwrap();
    assert_eq!(look.frequency, 16_000_000);
    assert!(look.watchdog.started, "{look:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn each_power_on_has_its_own_number_and_the_build_its_name() {
    let [one, other] = [1, 2].map(|seed| {
        greeting(&Options {
            seed,
            ..Options::new()
        })
    });
    assert_ne!(one.boot_id, other.boot_id);
    assert_eq!(one.build, other.build);
    assert!(
        one.build.iter().all(|byte| byte.is_ascii_graphic()),
        "{:?}",
        one.build
    );
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn a_panic_is_reported_with_its_file_and_line() {
    let mut host = flying(&Options::new(), 70);
    host.chip.provoke("panic", "").unwrap();
    host.listen(host.chip.now() + 100_000).unwrap();
    host.connect(StreamMode::Paced).unwrap();
    let place = host.status.unwrap().fault_place;
    assert_eq!(&place, b"are/src/provoked.rs:1234");
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn errors_on_the_sensors_line_are_distinguished_from_the_hosts() {
    let mut host = flying(&Options::new(), 70);
    let at = host.chip.now();
    host.chip
        .send_broken(at, "sensor", &[0x55], "noise", true)
        .unwrap();
    host.fly(120).unwrap();
    let status = host.stop().unwrap();
    assert_eq!((status.uart_framing, status.missing), (0, 0));
    assert_eq!((status.sensor_framing, status.sensor_overrun), (1, 0));
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn the_voltage_of_the_battery_is_reported() {
    for battery in [3300, 3712, 4200] {
        let options = Options {
            battery,
            ..Options::new()
        };
        let found = flying(&options, 20).stop().unwrap().battery;
        // One count of the converter is 1.6 mV.
        assert!(found.abs_diff(battery) <= 3, "{found} of {battery} mV");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn flights_are_kept_in_the_memory_chip_through_a_loss_of_power() {
    let samples = 3 * RATE as u32;
    let mut host = flying(&Options::new(), samples);
    let status = host.stop().unwrap();
    assert_eq!(status.missing, 0);
    assert!(status.deadline_missed <= 1 && host.late_in_flight() == 0);
    assert!(host.agreement().holds(), "{:?}", host.agreement());
    let estimates = host.estimates.len();
    // The next flight ends when the power fails.
    host.listen(host.chip.now() + 200_000).unwrap();
    host.connect(StreamMode::Paced).unwrap();
    host.fly(samples).unwrap();
    host.chip.power("power-on", false).unwrap();
    host.listen(host.chip.now() + 100_000).unwrap();
    host.connect(StreamMode::Paced).unwrap();
    let (flights, damaged) = host.log().unwrap();
    assert_eq!(damaged, 0);
    let [whole, cut] = &flights[..] else {
        panic!("{} flights", flights.len());
    };
    assert_eq!(whole.lengths(), [samples as usize, estimates]);
    let [read, _] = cut.lengths();
    eprintln!("cut at sample {samples}: {read} are in the log");
    assert!(
        (read..=read + RATE as usize).contains(&(samples as usize)),
        "{read}"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask f405"]
fn restarts_by_the_watchdog_are_counted() {
    let mut host = flying(&Options::new(), 70);
    for resets in 1..=3 {
        host.chip.provoke("hang", "task").unwrap();
        host.listen(host.chip.now() + 1_200_000).unwrap();
        host.connect(StreamMode::Paced).unwrap();
        assert_eq!(host.status.unwrap().watchdog_resets, resets);
        assert_eq!(host.greeting.unwrap().reset_cause, 2);
    }
}
