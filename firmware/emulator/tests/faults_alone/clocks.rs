//! What the clock and the counter of a sensor may do.

use bodyflight_emulator::tampered::Sent;

/// A change of the packets from one on.
type Fault = fn(&mut [Sent], usize);

/// Faults of the clock and the counter, which begin at a packet and last; and after how many packets what comes is clean.
pub const CLOCKS: [(&str, Fault, usize); 16] = [
    ("restart at once", |all, first| restart(all, first, 0), 0),
    (
        "restart after 100 packets of silence",
        |all, first| restart(all, first, 100),
        100,
    ),
    (
        "restart after 500 packets of silence",
        |all, first| restart(all, first, 500),
        500,
    ),
    (
        "two restarts",
        |all, first| {
            restart(all, first, 50);
            restart(all, first + 250, 50);
        },
        300,
    ),
    (
        "counter to zero",
        |all, first| {
            (0..)
                .zip(&mut all[first..])
                .for_each(|(k, s)| s.counter = k)
        },
        0,
    ),
    (
        "clock to zero",
        |all, first| {
            let zero = all[first].ticks;
            all[first..].iter_mut().for_each(|s| s.ticks -= zero);
        },
        0,
    ),
    (
        "clock wraps",
        |all, first| {
            let to = u32::MAX - all[first].ticks;
            all.iter_mut()
                .for_each(|s| s.ticks = s.ticks.wrapping_add(to));
        },
        0,
    ),
    (
        "clock of a day wraps",
        |all, first| {
            let to = 864_000_000 - all[first].ticks;
            all.iter_mut()
                .for_each(|s| s.ticks = (s.ticks + to) % 864_000_000);
        },
        0,
    ),
    (
        "counter wraps",
        |all, first| {
            let to = u16::MAX - all[first].counter;
            all.iter_mut()
                .for_each(|s| s.counter = s.counter.wrapping_add(to));
        },
        0,
    ),
    (
        "clock 10 s ahead",
        |all, first| all[first..].iter_mut().for_each(|s| s.ticks += 100_000),
        0,
    ),
    (
        "clock 0.02 s ahead",
        |all, first| all[first..].iter_mut().for_each(|s| s.ticks += 200),
        0,
    ),
    (
        "clock 0.5 s back",
        |all, first| all[first..].iter_mut().for_each(|s| s.ticks -= 5_000),
        0,
    ),
    (
        "clock 5 s back",
        |all, first| all[first..].iter_mut().for_each(|s| s.ticks -= 50_000),
        0,
    ),
    (
        "clock an hour back",
        |all, first| {
            let hour = 36_000_000;
            all.iter_mut().for_each(|s| s.ticks += hour);
            all[first..].iter_mut().for_each(|s| s.ticks -= hour);
        },
        0,
    ),
    ("4 s of silence", |all, first| silence(all, first, 4), 0),
    ("60 s of silence", |all, first| silence(all, first, 60), 0),
];

fn restart(all: &mut [Sent], first: usize, silent: usize) {
    let (ticks, counter) = (all[first + silent].ticks, all[first + silent].counter);
    for (k, sent) in all[first..].iter_mut().enumerate() {
        sent.is_silent = k < silent;
        sent.ticks = sent.ticks.saturating_sub(ticks);
        sent.counter = sent.counter.wrapping_sub(counter);
    }
}

/// The flight goes on as if it had been flown later.
fn silence(all: &mut [Sent], first: usize, seconds: u32) {
    for sent in &mut all[first..] {
        sent.arrives += f64::from(seconds);
        sent.ticks += seconds * 10_000;
        sent.counter = sent.counter.wrapping_add((seconds * 240) as u16);
        if let Some(solution) = &mut sent.solution {
            solution.time_of_week_ms += seconds * 1000;
        }
    }
}

/// Clocks by which the rate is not the configured one, as factors, and whether that is named. 2 % does no harm.
pub const PACES: [(f64, bool); 6] = [
    (0.8, true),
    (0.95, true),
    (0.98, false),
    (1.02, false),
    (1.05, true),
    (1.2, true),
];
