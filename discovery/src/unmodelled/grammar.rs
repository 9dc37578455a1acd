//! Building blocks of a description: the directions of a load and the factors that multiply it.

use bodyflight_core::Segment;
use bodyflight_core::dynamics::applied_load::factor::{FACTORS, Factor};
use bodyflight_core::dynamics::applied_load::{AppliedLoad, Axis, Direction, Kind, Point};

/// Range of frequencies searched (Hz): from a few periods in a flight to what averages over a tenth of a second can
/// resolve.
pub(crate) const FREQUENCIES: [f64; 2] = [0.12, 4.9];

/// Airspeed (m/s), angular velocity (rad/s), height above the start (m) and joint angle (rad) at which the respective
/// factor is one.
const SPEED: f64 = 50.0;
const TURN: f64 = 1.0;
const DOWN: f64 = -1000.0;
const BEND: f64 = 1.0;

/// Grid of pulses (s): the step of start and period, the durations tried, and the limits of the period.
const PULSE_STEP: f64 = 0.2;
const PULSE_DURATIONS: [f64; 5] = [0.4, 0.8, 1.2, 1.6, 2.2];
const PULSE_PERIODS: [f64; 2] = [2.0, 9.0];

/// Factors of a load.
pub(crate) type Factors = [Option<Factor<f64>>; FACTORS];

/// Direction of a load, and whether it is a force or a moment.
pub(crate) type Pointing = (Kind, Direction);

/// All directions searched: moments and forces along the axes of body and world, drag of the body and of each segment,
/// and forces on thorax, forearms and shanks along the body axes.
pub(crate) fn directions() -> Vec<Pointing> {
    let mut all = Vec::new();
    let body = Kind::Force(Point::Body);
    for axis in Axis::ALL {
        all.push((Kind::Moment, Direction::Body(axis)));
    }
    for axis in Axis::ALL {
        all.push((body, Direction::World(axis)));
        all.push((body, Direction::Body(axis)));
    }
    all.push((body, Direction::Stream));
    for segment in Segment::ALL.into_iter().skip(1) {
        all.push((Kind::Force(Point::Segment(segment)), Direction::Stream));
    }
    for segment in ENDS {
        for axis in Axis::ALL {
            let on = Kind::Force(Point::Segment(segment));
            all.push((on, Direction::Body(axis)));
        }
    }
    all
}

/// Segments on which forces along the body axes are searched: the ends of the limbs, and the trunk, where equipment is
/// worn.
const ENDS: [Segment; 5] = [
    Segment::Thorax,
    Segment::LeftForearm,
    Segment::RightForearm,
    Segment::LeftShank,
    Segment::RightShank,
];

/// A load of size one.
pub(crate) const fn unit((kind, direction): Pointing, factors: Factors) -> AppliedLoad<f64> {
    AppliedLoad {
        kind,
        direction,
        size: 1.0,
        factors,
    }
}

/// A single factor.
pub(crate) const fn single(factor: Factor<f64>) -> Factors {
    [Some(factor), None, None]
}

/// The factors with one more. Returns `None` if there is no slot left.
pub(crate) fn times(mut factors: Factors, factor: Factor<f64>) -> Option<Factors> {
    *factors.iter_mut().find(|place| place.is_none())? = Some(factor);
    Some(factors)
}

/// Factors that do not depend explicitly on time: motion and posture. `height` (m) is the height at the start.
pub(crate) fn states(height: f64) -> Vec<Factor<f64>> {
    let mut all = vec![
        Factor::SpeedSquared { reference: SPEED },
        Factor::Height {
            from: height,
            reference: DOWN,
        },
    ];
    for axis in Axis::ALL {
        all.push(Factor::Turn {
            axis,
            reference: TURN,
        });
    }
    for segment in Segment::ALL.into_iter().skip(1) {
        for axis in Axis::ALL {
            all.push(Factor::Joint {
                segment,
                axis,
                from: 0.0,
                reference: BEND,
            });
        }
    }
    all
}

/// Frequencies to try: three for each that a flight of this duration (s) can resolve.
pub(crate) fn frequencies(duration: f64) -> Vec<f64> {
    let [low, high] = FREQUENCIES;
    let step = 1.0 / (3.0 * duration.max(1.0));
    let mut all = Vec::new();
    let mut frequency = low;
    while frequency < high {
        all.push(frequency);
        frequency += step;
    }
    all
}

/// A sine in time.
pub(crate) const fn sine(frequency: f64, phase: f64) -> Factor<f64> {
    Factor::Sine { frequency, phase }
}

/// Periodic and single pulses for a flight of this duration (s).
pub(crate) fn pulses(flight: f64) -> Vec<Factor<f64>> {
    let mut all = Vec::new();
    let mut add = |begin: f64, end: f64, duration: f64, period: f64| {
        let mut start = begin;
        while start < end {
            all.push(Factor::Pulse {
                start,
                duration,
                period,
            });
            start += PULSE_STEP;
        }
    };
    for duration in PULSE_DURATIONS {
        add(0.0, flight - duration, duration, 0.0);
        let mut period = PULSE_PERIODS[0];
        while period < PULSE_PERIODS[1] {
            if period > 1.4 * duration {
                add(duration - period, duration, duration, period);
            }
            period += PULSE_STEP;
        }
    }
    all
}

/// Variations of a pulse's start, length and period, for a finer search.
pub(crate) fn near(pulse: Factor<f64>, step: f64) -> Vec<Factor<f64>> {
    let Factor::Pulse {
        start,
        duration,
        period,
    } = pulse
    else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let periods: &[f64] = if period > 0.0 {
        &[-1.0, 0.0, 1.0]
    } else {
        &[0.0]
    };
    for begin in [-2.0, -1.0, 0.0, 1.0, 2.0] {
        for longer in [-2.0, -1.0, 0.0, 1.0, 2.0] {
            for later in periods {
                let duration = duration + longer * step;
                // The period is known more precisely, since it accumulates over many pulses.
                let period = period + later * step * 0.2;
                if duration > step && (period <= 0.0 || period > duration) {
                    all.push(Factor::Pulse {
                        start: start + begin * step,
                        duration,
                        period,
                    });
                }
            }
        }
    }
    all
}

/// Names of the axes of body, world and segments.
const BODY: [&str; 3] = ["left", "dorsal", "cranial"];
const WORLD: [&str; 3] = ["north", "west", "up"];
const SEGMENT: [&str; 3] = ["x", "y", "z"];

fn name(names: [&'static str; 3], axis: Axis) -> &'static str {
    let [x, y, z] = names;
    match axis {
        Axis::X => x,
        Axis::Y => y,
        Axis::Z => z,
    }
}

/// Type and direction of a load in words: `moment about left`, `force on l_foot along the stream`.
pub(crate) fn pointing_in_words((kind, direction): Pointing) -> String {
    let along = match direction {
        Direction::Body(axis) => name(BODY, axis).to_owned(),
        Direction::World(axis) => name(WORLD, axis).to_owned(),
        Direction::Segment(segment, axis) => {
            format!("{} of {}", name(SEGMENT, axis), segment.name())
        }
        Direction::Stream => "the stream".to_owned(),
    };
    match kind {
        Kind::Moment => format!("moment about {along}"),
        Kind::Force(Point::Body) => format!("force along {along}"),
        Kind::Force(Point::Segment(segment)) => {
            format!("force on {} along {along}", segment.name())
        }
    }
}

/// A factor in words, with the standard error of a frequency.
pub(crate) fn factor_in_words(factor: &Factor<f64>, frequency_error: Option<f64>) -> String {
    match *factor {
        Factor::Speed { reference } => format!("with the speed, as given at {reference:.0} m/s"),
        Factor::SpeedSquared { reference } => {
            format!("with the square of the speed, as given at {reference:.0} m/s")
        }
        Factor::Joint {
            segment,
            axis,
            reference,
            ..
        } => format!(
            "with the turn of {} about {}, as given at {reference:.1} rad",
            segment.name(),
            name(SEGMENT, axis)
        ),
        Factor::Turn { axis, reference } => format!(
            "with the angular velocity about {}, as given at {reference:.1} rad/s",
            name(BODY, axis)
        ),
        Factor::Height { from, reference } => format!(
            "with the height, none at {from:.0} m, as given at {:.0} m",
            from + reference
        ),
        Factor::Sine { frequency, .. } => match frequency_error {
            Some(error) => format!("{frequency:.3} +- {error:.3} Hz"),
            None => format!("{frequency:.2} Hz"),
        },
        Factor::Pulse {
            start,
            duration,
            period,
        } if period > 0.0 => {
            let first = (start + 0.05).rem_euclid(period) - 0.05;
            format!(
                "for {duration:.1} s every {period:.1} s, first at {:.1} s",
                first.max(0.0)
            )
        }
        Factor::Pulse {
            start, duration, ..
        } => format!("for {duration:.1} s from {start:.1} s on"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pulses_begin_within_the_flight_and_end_before_they_repeat() {
        let all = pulses(30.0);
        let refined = all.iter().flat_map(|pulse| near(*pulse, 0.1));
        for pulse in all.iter().copied().chain(refined) {
            let Factor::Pulse {
                start,
                duration,
                period,
            } = pulse
            else {
                panic!("{pulse:?}");
            };
            assert!(duration > 0.0 && start < 30.0, "{pulse:?}");
            assert!(period <= 0.0 || period > duration, "{pulse:?}");
        }
        assert!(all.len() > 1000);
    }

    #[test]
    fn frequencies_leave_no_gap_that_a_flight_could_resolve() {
        for duration in [4.0, 30.0, 120.0] {
            let all = frequencies(duration);
            assert!(all.windows(2).all(|two| two[1] - two[0] < 0.5 / duration));
            assert!(all[0] <= FREQUENCIES[0] && all[all.len() - 1] > FREQUENCIES[1] - 0.1);
        }
    }

    #[test]
    fn loads_are_described_in_plain_words() {
        let moment = (Kind::Moment, Direction::Body(Axis::X));
        assert_eq!(pointing_in_words(moment), "moment about left");
        let drag = (
            Kind::Force(Point::Segment(Segment::LeftFoot)),
            Direction::Stream,
        );
        assert_eq!(pointing_in_words(drag), "force on l_foot along the stream");
        let words = factor_in_words(&sine(3.1, 0.2), Some(0.011));
        assert_eq!(words, "3.100 +- 0.011 Hz");
        let pulse = Factor::Pulse {
            start: -3.0,
            duration: 1.25,
            period: 5.0,
        };
        let words = factor_in_words(&pulse, None);
        assert_eq!(words, "for 1.2 s every 5.0 s, first at 2.0 s");
    }
}
