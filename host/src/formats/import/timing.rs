//! Evenly spaced frames from the times of rows.

/// Fraction of a frame by which a row may be off its time.
const UNEVEN: f64 = 0.25;

/// Largest relative rounding error of a rate: 0.008333 s per frame is 120 Hz.
const ROUNDING: f64 = 1e-3;

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

/// Rounds a rate to a whole number if they differ by no more than the rounding of a file.
pub fn whole_rate(rate: f64) -> f64 {
    let whole = rate.round();
    if whole > 0.0 && (rate - whole).abs() < ROUNDING * whole {
        whole
    } else {
        rate
    }
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
    let whole = whole_rate(rate);
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
        assert!((frames(&film).unwrap().rate - 29.97).abs() < 1e-6);
    }

    #[test]
    fn invalid_times_are_refused_with_their_row() {
        assert_eq!(frames(&[0.0, 0.1, 0.05]).unwrap_err().row, 2);
        assert_eq!(frames(&[0.0, 0.1, 0.2, 0.25, 0.3]).unwrap_err().row, 3);
        assert!(frames(&[0.0]).is_err());
    }
}
