//! How late the clocks of the sensors are: by the turns of the tray, in which all turn as one, or as they are worn.

use bodyflight_core::Segment;
use bodyflight_core::suit::set::Fitted;

use super::stream::Stream;

/// Delay from which a clock is named (s), by the tray; as it is worn, and by how many standard deviations it must be more.
const LATE: f64 = 0.018;
const LATE_WORN: f64 = 0.02;
const DEVIATIONS: f64 = 1.5;
/// Largest delay that is found (s).
const LARGEST: f64 = 0.3;
/// Least change of the rate in turns of the tray, root of its mean square (rad/s2).
const LEAST_CHANGE: f64 = 0.3;
/// Rounds in which a delay is found.
const ROUNDS: usize = 4;

/// A sensor whose clock is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Late {
    pub(super) segment: Segment,
    /// By how much more than most others (s).
    pub(super) by_s: f64,
}

impl Late {
    /// In a sentence.
    pub(super) fn said(&self) -> String {
        let (way, name) = (
            if self.by_s > 0.0 { "late" } else { "early" },
            self.segment.name(),
        );
        format!(
            "the clock of the sensor {name} is {:.1} ms {way}, expected within {:.0} ms of the others: synchronise them, or give late_s = {:.3} in [sensors.{name}]",
            1e3 * self.by_s.abs(),
            1e3 * LATE,
            self.by_s
        )
    }
}

/// The sensors that are late in the turns of the tray; `None` if there are none that show it.
pub(super) fn in_tray(
    turns: &[[f64; 2]],
    sensors: &[(Segment, &Stream)],
    fitted: &[Fitted<f64>],
) -> Option<Vec<Late>> {
    let (reference, of_reference) = (sensors.first()?.1, fitted.first()?);
    let mut delays = Vec::new();
    for ((segment, stream), of_stream) in sensors.iter().zip(fitted) {
        let mut delay = 0.0;
        for _ in 0..ROUNDS {
            let (mut product, mut square, mut time) = (0.0, 0.0, 0.0);
            for turn in turns {
                let mut before: Option<f64> = None;
                for (at, step, reading) in reference.timed(*turn) {
                    let size = of_reference
                        .gyroscope
                        .corrected(&reading.angular_velocity)
                        .norm();
                    let change = before.map(|before| (size - before) / step);
                    before = Some(size);
                    // Half a step back, where the change is.
                    let middle = at - 0.5 * step;
                    let (Some(change), Some(seen)) = (change, stream.at(middle + delay)) else {
                        continue;
                    };
                    let own = of_stream.gyroscope.corrected(&seen.angular_velocity).norm();
                    product += (own - (size - 0.5 * change * step)) * change * step;
                    square += change * change * step;
                    time += step;
                }
            }
            if square <= LEAST_CHANGE * LEAST_CHANGE * time || time <= 0.0 {
                return None;
            }
            delay = (delay - product / square).clamp(-LARGEST, LARGEST);
        }
        delays.push((*segment, delay, 0.0));
    }
    Some(late(&delays, LATE))
}

/// The sensors that are late as they are worn: their delays relative to the pelvis' (s) with their standard deviations.
pub(super) fn worn(delays: &[(Segment, f64, f64)]) -> Vec<Late> {
    late(delays, LATE_WORN)
}

fn late(delays: &[(Segment, f64, f64)], least: f64) -> Vec<Late> {
    let mut sorted: Vec<f64> = delays.iter().map(|(_, delay, _)| *delay).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(usual) = sorted.get(sorted.len() / 2) else {
        return Vec::new();
    };
    let each = delays.iter().map(|(segment, delay, deviation)| {
        let late = Late {
            segment: *segment,
            by_s: delay - usual,
        };
        (late, least + DEVIATIONS * deviation)
    });
    each.filter(|(late, least)| late.by_s.abs() > *least)
        .map(|(late, _)| late)
        .collect()
}
