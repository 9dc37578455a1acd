//! Hours of streaming in virtual time: the unit's application on a bad line, with restarts on both sides.
//!
//! The host keeps a ledger of every sample: each is used, rejected, dropped, late, missing, or was sent in a session
//! that a restart cut off. `cargo xtask soak --hours H` runs for hours, this test for minutes.

mod soak {
    pub mod host;
    pub mod memory;
}

use bodyflight_core::link::fault::{Faults, Random};
use bodyflight_tests::arm_swing::RATE;
use soak::host::{Host, Totals};
use soak::memory::resident;

/// Probabilities that in a given minute the unit restarts, the host restarts, and the line's faults change.
const UNIT_RESTARTS: f32 = 0.2;
const HOST_RESTARTS: f32 = 0.2;
const NEW_FAULTS: f32 = 0.5;

/// Minutes after which memory use should no longer grow.
const WARM_UP: u32 = 10;

/// Faults for a minute: none, a few of all kinds, or a barely usable line.
fn faults(random: &mut Random) -> Faults {
    let most = [0.0, 0.001, 0.01, 0.05][random.below(4)];
    let mut share = || {
        #[expect(clippy::cast_precision_loss, reason = "numbers below 1000 are exact")]
        let share = random.below(1000) as f32 * 1e-3;
        share * most
    };
    Faults {
        drop: share(),
        corrupt: share(),
        duplicate: share(),
        reorder: share(),
        burst: share(),
        truncate: share(),
        slip: share(),
    }
}

/// Runs for this many minutes; returns the totals, and the memory use (bytes) after the warm-up and at its peak.
fn fly(
    minutes: u32,
    seed: u64,
    mut each_hour: impl FnMut(u32, &Totals, u64),
) -> (Totals, [u64; 2]) {
    let mut random = Random::new(seed);
    let mut host = Host::new(seed);
    let mut memory = [0; 2];
    for minute in 0..minutes {
        if random.chance(NEW_FAULTS) {
            host.set_faults(faults(&mut random));
        }
        // At a random time within the minute.
        let unit_at = random
            .chance(UNIT_RESTARTS)
            .then(|| random.below(60 * RATE as usize));
        let host_at = random
            .chance(HOST_RESTARTS)
            .then(|| random.below(60 * RATE as usize));
        for tick in 0..60 * RATE as usize {
            if unit_at == Some(tick) {
                host.restart_unit();
            }
            if host_at == Some(tick) {
                host.restart_host();
            }
            host.tick();
        }
        let now = resident();
        if minute < WARM_UP {
            memory[0] = now;
        }
        memory[1] = memory[1].max(now);
        if (minute + 1) % 60 == 0 {
            each_hour((minute + 1) / 60, host.totals(), now);
        }
    }
    (host.finish(), memory)
}

fn check(totals: &Totals) {
    assert_eq!(totals.accounted(), totals.sent, "{totals:?}");
    assert_eq!(totals.different, 0, "{totals:?}");
    assert_eq!(totals.not_finite, 0, "{totals:?}");
    assert!(totals.used * 10 > totals.sent * 8, "{totals:?}");
}

#[test]
fn every_loss_is_counted_in_minutes_of_faults_and_restarts() {
    let (totals, _) = fly(3, 8, |_, _, _| {});
    check(&totals);
    // Everything happened at least once: lost frames, repeated frames, restarts on both sides.
    let happened = [
        totals.missing,
        totals.repeated,
        totals.unit_restarts,
        totals.host_restarts,
    ];
    assert!(happened.iter().all(|count| *count > 0), "{totals:?}");
    assert!(
        totals.sent > 3 * 60 * u64::from(RATE) * 9 / 10,
        "{totals:?}"
    );
}

#[test]
#[ignore = "hours: cargo xtask soak"]
fn hours_of_faults_and_restarts() {
    let hours: u32 = std::env::var("BODYFLIGHT_SOAK_HOURS")
        .expect("hours of flight")
        .parse()
        .expect("a number");
    println!(
        "| hours | samples | used | rejected | late | missing | cut off | restarts of unit, host | estimates equal | MiB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let (totals, memory) = fly(60 * hours, 2026, |hour, totals, bytes| {
        println!(
            "| {hour} {totals} {:.2} |",
            bytes as f64 / f64::from(1 << 20)
        );
    });
    println!("{totals:?}");
    println!("memory {memory:?} bytes");
    check(&totals);
    let [start, most] = memory;
    assert!(
        most * 100 <= start * 105,
        "memory has grown from {start} to {most} bytes"
    );
}
