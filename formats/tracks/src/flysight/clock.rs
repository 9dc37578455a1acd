//! The clock of a FlySight 2's sensors, and how it relates to GPS time.

use bodyflight_falls::median;

use super::table::Tables;

/// Drift from which a clock is named: quartz is better (parts per million).
const NAMED: f64 = 20.0;

/// Fewest rows that determine a drift.
const FEWEST: usize = 30;

/// The relation of the sensors' clock, which starts at an arbitrary value, to the time of week.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SensorClock {
    /// Time of week (s) at time zero of the sensors.
    offset: f64,
    /// Seconds of GPS time in a second of the sensors' clock.
    rate: f64,
}

impl SensorClock {
    /// From the `$TIME` rows, which have both times. The first of them may be a second off, so medians are used.
    pub(super) fn of(tables: &Tables<'_>) -> Self {
        let [time, week] = tables.columns("TIME", ["time", "tow"]);
        let pairs = tables
            .rows("TIME")
            .filter_map(|row| Some([row.number(time).ok()?, row.number(week).ok()?]));
        Self::fitted(&pairs.collect::<Vec<_>>())
    }

    fn fitted(pairs: &[[f64; 2]]) -> Self {
        let half = pairs.len() / 2;
        let slopes = pairs.iter().zip(&pairs[half..]).filter_map(|(from, to)| {
            let [time, week] = [0, 1].map(|place| to[place] - from[place]);
            (time > 0.0 && week > 0.0).then_some(week / time)
        });
        let rate = if pairs.len() < FEWEST {
            None
        } else {
            median(slopes)
        };
        let rate = rate.filter(|rate| (rate - 1.0).abs() < 1e-3).unwrap_or(1.0);
        let offsets = pairs.iter().map(|[time, week]| week - rate * time);
        Self {
            offset: median(offsets).unwrap_or(0.0),
            rate,
        }
    }

    /// GPS time of the week (s) at a time of the sensors (s).
    pub(super) fn time_of_week(&self, time: f64) -> f64 {
        self.offset + self.rate * time
    }

    /// The drift in a sentence, if there is one.
    pub(super) fn drift(&self) -> Option<String> {
        let fast = (1.0 / self.rate - 1.0) * 1e6;
        (fast.abs() > NAMED).then(|| {
            format!(
                "the clock of the sensors runs {:.0} ppm {} against GPS time, which is corrected",
                fast.abs(),
                if fast > 0.0 { "fast" } else { "slow" }
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drifting_clock_is_named_and_a_wrong_first_row_is_ignored() {
        let pairs = |rate: f64| {
            let mut pairs: Vec<[f64; 2]> = (0..600)
                .map(|row| [f64::from(row) * rate, 1000.0 + f64::from(row)])
                .collect();
            // As in half of public recordings.
            pairs[0][1] -= 0.95;
            pairs
        };
        let good = SensorClock::fitted(&pairs(1.0));
        assert!((good.time_of_week(300.0) - 1300.0).abs() < 1e-3, "{good:?}");
        assert_eq!(good.drift(), None);
        let fast = SensorClock::fitted(&pairs(1.0001));
        let said = fast.drift().unwrap();
        assert!(said.contains("100 ppm fast"), "{said}");
        assert!((fast.time_of_week(500.05) - 1500.0).abs() < 1e-3);
        assert_eq!(
            SensorClock::fitted(&[]),
            SensorClock {
                offset: 0.0,
                rate: 1.0
            }
        );
    }
}
