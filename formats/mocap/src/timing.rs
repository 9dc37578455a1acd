//! Evenly spaced frames from the times of rows.

/// Fraction of a frame by which a row may be off its time.
const UNEVEN: f64 = 0.25;

/// Largest relative rounding error of a rate: 0.008333 s per frame is 120 Hz.
const ROUNDING: f64 = 1e-3;

/// Whole rates over those of video, such as 30 over 29.97.
const VIDEO: f64 = 1.001;

/// A constant rate, and the frame index of each row.
#[derive(Debug, Clone, PartialEq)]
pub struct Timing {
    /// Frames per second (Hz).
    pub rate: f64,
    /// Frame index of each row, from 0.
    pub indices: Vec<u64>,
}

/// A row whose time cannot be used.
#[derive(Debug, Clone, PartialEq)]
pub struct Uneven {
    /// Its index among the rows.
    pub row: usize,
    /// What is wrong with it.
    pub message: String,
}

/// Rounds a rate (Hz) to that of a clock if they differ by no more than the rounding of a file: to a whole number, or
/// to one of video, 1000/1001 of a whole number, if that is nearer.
pub fn clock_rate(rate: f64) -> f64 {
    let video = (rate * VIDEO).round() / VIDEO;
    let clocks = [rate.round(), video];
    let nearest = clocks
        .into_iter()
        .min_by(|a, b| (rate - a).abs().total_cmp(&(rate - b).abs()));
    nearest
        .filter(|clock| *clock > 0.0 && (rate - clock).abs() < ROUNDING * clock)
        .unwrap_or(rate)
}

/// The rate (Hz) of frames whose interval is written as this decimal number of seconds. A whole number is preferred if
/// the number rounds to it, as 0.0417 does to 24 Hz.
pub fn rate_of_interval(interval: f64, written: &str) -> f64 {
    let rate = 1.0 / interval;
    let decimals = written.split_once('.').map_or("", |(_, decimals)| decimals);
    let half_digit = 0.51 * 10.0_f64.powf(-(decimals.len() as f64));
    let whole = rate.round();
    if whole > 0.0 && !written.contains(['e', 'E']) && (1.0 / whole - interval).abs() < half_digit {
        return whole;
    }
    clock_rate(rate)
}

/// Assigns frames to rows at these times (s).
///
/// # Errors
/// Returns an error if times do not increase, or are not evenly spaced apart from missing frames.
pub fn frames(times: &[f64]) -> Result<Timing, Uneven> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if let Some(back) = steps.iter().position(|step| *step <= 0.0) {
        return Err(Uneven {
            row: back + 1,
            message: format!(
                "expected a time above {}, found {}",
                times[back],
                times[back + 1]
            ),
        });
    }
    steps.sort_by(f64::total_cmp);
    let Some(step) = steps.get(steps.len() / 2).copied() else {
        return Err(Uneven {
            row: 0,
            message: "expected at least two rows".to_owned(),
        });
    };
    // The median suffers from rounded times; the mean of the steps without a gap does not.
    let (sum, count) = (steps
        .iter()
        .filter(|other| (0.6 * step..1.5 * step).contains(*other)))
    .fold((0.0, 0.0), |(sum, count), step| (sum + step, count + 1.0));
    let duration = times[times.len() - 1] - times[0];
    let frames = (duration * count / sum).round().max(1.0);
    let mut rate = frames / duration;
    let whole = clock_rate(rate);
    if (frames / whole - duration).abs() < UNEVEN / whole {
        rate = whole;
    }
    let mut indices = Vec::with_capacity(times.len());
    for (row, time) in times.iter().enumerate() {
        let frame = (time - times[0]) * rate;
        if (frame - frame.round()).abs() > UNEVEN {
            return Err(Uneven {
                row,
                message: format!(
                    "expected even times: {time} s is {frame:.2} frames after the first row at {rate:.3} Hz"
                ),
            });
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count of frames, rising from 0"
        )]
        let index = frame.round() as u64;
        if indices.last().is_some_and(|last| *last >= index) {
            return Err(Uneven {
                row,
                message: format!(
                    "expected one row per frame at {rate:.3} Hz, found two near {time} s"
                ),
            });
        }
        indices.push(index);
    }
    Ok(Timing { rate, indices })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_times_give_whole_rates_and_missing_rows_are_gaps() {
        let times: Vec<f64> = (0..500)
            .filter(|k| !(100..110).contains(k))
            .map(|k| (f64::from(k) / 120.0 * 1000.0).round() / 1000.0)
            .collect();
        let timing = frames(&times).unwrap();
        assert!((timing.rate - 120.0).abs() < 1e-9, "{}", timing.rate);
        assert_eq!(timing.indices[99..101], [99, 110]);
        assert_eq!(timing.indices.last(), Some(&499));
        let film: Vec<f64> = (0..300).map(|k| f64::from(k) / 29.97).collect();
        assert!((frames(&film).unwrap().rate - 30.0 / 1.001).abs() < 1e-6);
    }

    #[test]
    fn rates_are_those_of_clocks_as_far_as_the_digits_tell() {
        for (written, rate) in [
            ("0.008333", 120.0),
            ("0.0333667", 30.0 / 1.001),
            ("0.033367", 30.0 / 1.001),
            ("0.0333333", 30.0),
            ("0.0333", 30.0),
            ("0.0417", 24.0),
            ("0.041708", 24.0 / 1.001),
            ("0.016683", 60.0 / 1.001),
            ("0.01", 100.0),
            (".0083333", 120.0),
            ("0.0125786", 1.0 / 0.012_578_6),
        ] {
            let found = rate_of_interval(written.parse().unwrap(), written);
            assert!((found - rate).abs() < 1e-9, "{written}: {found}");
        }
    }

    #[test]
    fn invalid_times_are_refused_with_their_row() {
        assert_eq!(frames(&[0.0, 0.1, 0.05]).unwrap_err().row, 2);
        assert_eq!(frames(&[0.0, 0.1, 0.2, 0.25, 0.3]).unwrap_err().row, 3);
        assert!(frames(&[0.0]).is_err());
    }
}
