//! Aligns the track of a GNSS receiver with the recording of a suit, and replaces the suit's velocities, which in the
//! air are only a guess, with those of the track.
//!
//! Both observe the same vertical speed and the same turns over ground. The clock shift chosen is the one with the
//! least sum of squares. Velocities are compared after removing a linear trend, because a suit drifts, and horizontal
//! ones up to a constant rotation of the heading, by which magnetic and true north differ.
//!
//! A recording without velocity has nothing to compare: then the file of the flight must say when the track began, and
//! north is taken to be true north.

use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_falls::Sample;
use nalgebra::{Rotation2, Vector2, Vector3};
use serde::Serialize;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::FlightFrame;

/// Interval between compared instants (s).
const EVERY: f64 = 0.1;

/// Step sizes of the shift (s): first over the whole possible range, then around the best.
const COARSE: f64 = 0.1;
const FINE: f64 = 0.005;

/// Shortest time that recording and track must share (s), and the share of the recording that the track must cover.
const SHARED: f64 = 8.0;
const COVERED: f64 = 0.9;

/// Factor by which the misfit at every shift further than [`OTHER`] (s) from the best one must exceed the best misfit.
/// A larger factor refuses more tracks as ambiguous.
const BETTER: f64 = 1.3;
const OTHER: f64 = 1.0;

/// Longest gap between two rows of the track that is bridged (s).
const GAP: f64 = 1.5;

/// The track on the clock of the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Aligned {
    samples: Vec<Sample>,
    /// How it was aligned.
    pub alignment: Alignment,
}

/// One solution of the receiver, on the clock of the recording and in its axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Time (s).
    pub time: f64,
    /// Velocity over ground (m/s).
    pub velocity: Vector<f64, Inertial>,
    /// Its accuracy as the receiver states it (m/s), or what receivers usually reach.
    pub accuracy: f64,
}

/// Accuracy of a velocity (m/s) that states none: as measured by a receiver, and as derived from positions.
const UNSTATED: [f64; 2] = [0.5, 1.0];

/// How a track is aligned with a recording.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Alignment {
    /// Time of the track minus time of the recording (s).
    pub shift_s: f64,
    /// Standard deviation of the shift (s); zero if it was given.
    pub deviation_s: f64,
    /// Rotation from the track's true north to the recording's north (rad, towards west).
    pub heading_rad: f64,
    /// Root mean square of the remaining difference between the vertical speeds (m/s), if the recording has any.
    pub gap_mps: Option<f64>,
}

/// Velocity of a track at a time (m/s), on a smooth curve through its rows; `None` past its ends and in gaps.
fn velocity_at(samples: &[Sample], time: f64) -> Option<Vector3<f64>> {
    let after = samples.partition_point(|sample| sample.time <= time);
    let (from, to) = (samples.get(after.checked_sub(1)?)?, samples.get(after)?);
    let duration = to.time - from.time;
    if duration > GAP {
        return None;
    }
    let share = (time - from.time) / duration;
    // Catmull-Rom slopes, if there are rows on both sides.
    let slope = |before: Option<&Sample>, here: &Sample, next: Option<&Sample>| {
        let (before, next) = (before.unwrap_or(here), next.unwrap_or(here));
        (next.velocity - before.velocity) / (next.time - before.time).max(1e-9)
    };
    let first = slope(
        after.checked_sub(2).and_then(|at| samples.get(at)),
        from,
        Some(to),
    ) * duration;
    let second = slope(Some(from), to, samples.get(after + 1)) * duration;
    let (square, cube) = (share * share, share * share * share);
    Some(
        from.velocity * (2.0 * cube - 3.0 * square + 1.0)
            + first * (cube - 2.0 * square + share)
            + to.velocity * (3.0 * square - 2.0 * cube)
            + second * (cube - square),
    )
}

/// The residuals at one shift.
struct Left {
    vertical: f64,
    horizontal: f64,
    heading: f64,
    count: f64,
}

/// Compares the recording's velocities with those of the track, whose clock is `shift` (s) ahead.
///
/// `None` if they share fewer than `least` instants.
fn left(
    recorded: &[(f64, Vector3<f64>)],
    samples: &[Sample],
    shift: f64,
    least: f64,
) -> Option<Left> {
    let pairs: Vec<(f64, Vector3<f64>, Vector3<f64>)> = recorded
        .iter()
        .filter_map(|(time, velocity)| {
            Some((*time, *velocity, velocity_at(samples, time + shift)?))
        })
        .collect();
    let count = pairs.len() as f64;
    if count < least || pairs.len() < 10 {
        return None;
    }
    // A suit's velocity has an error that grows over time, so a linear trend is removed from both.
    let middle = pairs.iter().map(|pair| pair.0).sum::<f64>() / count;
    let spread: f64 = pairs.iter().map(|pair| (pair.0 - middle).powi(2)).sum();
    let mut means = [Vector3::zeros(); 2];
    let mut slopes = [Vector3::zeros(); 2];
    for (time, of_suit, of_track) in &pairs {
        for (place, velocity) in [of_suit, of_track].into_iter().enumerate() {
            means[place] += velocity / count;
            slopes[place] += velocity * ((time - middle) / spread);
        }
    }
    let (mut vertical, mut both, mut squares) = (0.0, Vector2::zeros(), 0.0);
    for (time, of_suit, of_track) in &pairs {
        let line = |place: usize| means[place] + slopes[place] * (time - middle);
        let (of_suit, of_track) = (of_suit - line(0), of_track - line(1));
        vertical += (of_suit.z - of_track.z).powi(2);
        let (of_suit, of_track) = (of_suit.xy(), of_track.xy());
        both += Vector2::new(of_suit.dot(&of_track), of_track.perp(&of_suit));
        squares += of_suit.norm_squared() + of_track.norm_squared();
    }
    Some(Left {
        vertical,
        // With the rotation that fits best, and no change of scale.
        horizontal: (squares - 2.0 * both.norm()).max(0.0),
        heading: both.y.atan2(both.x),
        count,
    })
}

/// Smallest credible variance of a velocity (m2/s2).
const LEAST_VARIANCE: f64 = 1e-4;

impl Left {
    /// Mean square over all components together (m2/s2).
    fn mean(&self) -> f64 {
        (self.vertical + self.horizontal) / self.count
    }

    /// Variance of the vertical component and of each horizontal one (m2/s2).
    fn noise(&self) -> [f64; 2] {
        [self.vertical, 0.5 * self.horizontal]
            .map(|squares| (squares / self.count).max(LEAST_VARIANCE))
    }

    /// The residuals in units of the noise variances.
    fn misfit(&self, [vertical, horizontal]: [f64; 2]) -> f64 {
        (self.vertical / vertical + self.horizontal / horizontal) / self.count
    }
}

fn refused(what: String) -> Problem {
    Problem::bad_input(what).at("field gnss").help(
        "the track must be of the same flight, and the flight must change its fall rate or turn",
    )
}

/// The shift with the least misfit.
fn least(tried: &[(f64, f64)]) -> Option<(f64, f64)> {
    tried.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1))
}

/// The best shift around a coarse one, and the noise there.
///
/// Vertical and horizontal speeds are weighted by how well they agree. That is known only at the best shift, so it
/// takes two passes.
fn refined(at: impl Fn(f64) -> Option<Left>, coarse: f64) -> Option<(f64, [f64; 2])> {
    let mut best = coarse;
    let mut noise = at(best)?.noise();
    for _ in 0..2 {
        let near: Vec<(f64, f64)> = (-40..=40)
            .filter_map(|step| {
                let shift = best + f64::from(step) * FINE;
                Some((shift, at(shift)?.misfit(noise)))
            })
            .collect();
        best = least(&near).map_or(best, |(shift, _)| shift);
        noise = at(best)?.noise();
    }
    Some((best, noise))
}

/// The minimum of a parabola through the best shift and one on either side, far enough apart to be smooth, and its
/// curvature.
fn lowest(misfit: impl Fn(f64) -> Option<f64>, best: f64) -> (f64, f64) {
    let reach = 8.0 * FINE;
    match (misfit(best - reach), misfit(best), misfit(best + reach)) {
        (Some(before), Some(here), Some(after)) => {
            let curvature = (before + after - 2.0 * here) / (reach * reach);
            let off = (before - after) / (2.0 * reach * curvature);
            (best + off.clamp(-reach, reach), curvature)
        }
        _ => (best, f64::NAN),
    }
}

/// Coarse shifts within a range (s) at which at least `least` instants are shared, each with its mean square.
fn mean_squares(
    recorded: &[(f64, Vector3<f64>)],
    track: &[Sample],
    [from, until]: [f64; 2],
    least: f64,
) -> Vec<(f64, f64)> {
    let mut tried: Vec<(f64, f64)> = Vec::new();
    let mut shift = from;
    while shift <= until {
        tried.extend(left(recorded, track, shift, least).map(|left| (shift, left.mean())));
        shift += COARSE;
    }
    tried
}

/// Aligns a track with the clock of a recording.
///
/// # Errors
/// Returns an error if the recording has no velocities, or if no shift is clearly better than all others.
pub fn aligned(frames: &[FlightFrame], track: &[Sample]) -> Result<Aligned> {
    if without_velocity(frames) {
        return Err(Problem::bad_input(
            "the recording has no velocity, which would tell when the track began",
        )
        .at("field gnss")
        .help("gnss_begin_s = 12.3: by how much (s) the recording begins after the first row of the track; its north must be true north"));
    }
    let recorded = thinned(frames)?;
    let (Some((first, _)), Some((last, _))) = (recorded.first(), recorded.last()) else {
        return Err(refused(
            "the recording is too short to be aligned with a track".into(),
        ));
    };
    let (Some(begin), Some(end)) = (track.first(), track.last()) else {
        return Err(refused("the track is empty".into()));
    };
    let range = [begin.time - last, end.time - first];
    let shifts = |least: f64| mean_squares(&recorded, track, range, least);
    // A few quiet seconds at one end of the track, in the aircraft or on the ground, fit quiet seconds of any recording:
    // only shifts at which the track covers the recording are compared, as long as there are any.
    let all = recorded.len() as f64;
    let mut shared = COVERED * all;
    let mut tried = shifts(shared);
    if tried.is_empty() {
        shared = (SHARED / EVERY).min(0.8 * all);
        tried = shifts(shared);
    }
    let (coarse, _) = least(&tried).ok_or_else(|| {
        refused(format!(
            "track and recording share less than {SHARED} s at any clock shift"
        ))
    })?;
    let at = |shift: f64| left(&recorded, track, shift, shared);
    let ended = || refused("the track ends too early".into());
    let (best, noise) = refined(at, coarse).ok_or_else(ended)?;
    let squares = at(best).ok_or_else(ended)?.mean();
    let others: Vec<(f64, f64)> = tried
        .iter()
        .copied()
        .filter(|(shift, _)| (shift - best).abs() > OTHER)
        .collect();
    // Differences smaller than the credible variance do not distinguish shifts.
    let squares = squares.max(LEAST_VARIANCE);
    if least(&others).is_some_and(|(_, other)| other < BETTER * squares) {
        return Err(refused(
            "the track fits the recording equally well at several clock shifts, so none can be chosen".into(),
        ));
    }
    let (shift, curvature) = lowest(|shift| at(shift).map(|left| left.misfit(noise)), best);
    let here = at(shift).ok_or_else(ended)?;
    let rows = track
        .iter()
        .filter(|sample| (first + shift..=last + shift).contains(&sample.time))
        .count();
    let reaches = |frame: Option<&FlightFrame>| {
        frame.is_some_and(|frame| velocity_at(track, frame.time + shift).is_some())
    };
    if !(reaches(frames.first()) && reaches(frames.last())) {
        return Err(refused(format!(
            "the track does not cover the recording: on the recording's clock it begins at {:.2} s and ends at {:.2} s",
            begin.time - shift,
            end.time - shift
        )));
    }
    let alignment = Alignment {
        shift_s: shift,
        // Only the rows of the track have independent errors; the instants in between repeat them.
        deviation_s: (2.0 / curvature / rows.max(1) as f64).sqrt(),
        heading_rad: here.heading,
        gap_mps: Some((here.vertical / here.count).sqrt()),
    };
    Ok(Aligned::new(track, alignment))
}

/// The track on the clock of a recording that begins `begin_s` (s) after the track's first row.
///
/// # Errors
/// Returns an error if the track is empty or does not cover the recording.
pub fn placed(frames: &[FlightFrame], track: &[Sample], begin_s: f64) -> Result<Aligned> {
    let (Some(first), Some(last), Some(begin)) = (frames.first(), frames.last(), track.first())
    else {
        return Err(refused("the track or the recording is empty".into()));
    };
    let shift = begin.time + begin_s - first.time;
    let is_covered = |frame: &FlightFrame| velocity_at(track, frame.time + shift).is_some();
    if !(is_covered(first) && is_covered(last)) {
        let length = track.last().map_or(0.0, |end| end.time - begin.time);
        return Err(Problem::bad_input(format!(
            "the track of {length:.1} s does not cover the recording of {:.1} s, which begins {begin_s:.1} s after its first row",
            last.time - first.time
        ))
        .at("field gnss_begin_s"));
    }
    let here = match without_velocity(frames) {
        true => None,
        false => left(&thinned(frames)?, track, shift, 1.0),
    };
    let alignment = Alignment {
        shift_s: shift,
        deviation_s: 0.0,
        heading_rad: here.as_ref().map_or(0.0, |here| here.heading),
        gap_mps: here.map(|here| (here.vertical / here.count).sqrt()),
    };
    Ok(Aligned::new(track, alignment))
}

/// Whether no frame has a velocity.
fn without_velocity(frames: &[FlightFrame]) -> bool {
    frames.iter().all(|frame| frame.pelvis.velocity.is_none())
}

/// The recording's velocities, averaged over [`EVERY`].
fn thinned(frames: &[FlightFrame]) -> Result<Vec<(f64, Vector3<f64>)>> {
    let mut thinned = Vec::new();
    let mut from = 0;
    for index in 0..frames.len() {
        if frames[index].time - frames[from].time < EVERY {
            continue;
        }
        let (mut time, mut velocity) = (0.0, Vector3::zeros());
        for frame in &frames[from..index] {
            time += frame.time;
            velocity += frame.rates()?.0.components;
        }
        let count = (index - from) as f64;
        thinned.push((time / count, velocity / count));
        from = index;
    }
    Ok(thinned)
}

impl Aligned {
    fn new(track: &[Sample], alignment: Alignment) -> Self {
        let samples = track.iter().map(|sample| Sample {
            time: sample.time - alignment.shift_s,
            ..*sample
        });
        Self {
            samples: samples.collect(),
            alignment,
        }
    }

    /// Velocity over ground at a time of the recording (m/s), in its axes; `None` if the track does not reach it.
    pub fn velocity_at(&self, time: f64) -> Option<Vector<f64, Inertial>> {
        Some(self.in_axes(&velocity_at(&self.samples, time)?))
    }

    /// The solutions of the receiver. `stated` are the accuracies that it states, row by row as far as it does, and
    /// `is_measured` whether it measured velocities, rather than positions alone.
    pub fn solutions(&self, stated: &[Option<f64>], is_measured: bool) -> Vec<Solution> {
        let usual = UNSTATED[usize::from(!is_measured)];
        let rows = self.samples.iter().enumerate();
        rows.map(|(row, sample)| Solution {
            time: sample.time,
            velocity: self.in_axes(&sample.velocity),
            accuracy: stated.get(row).copied().flatten().unwrap_or(usual),
        })
        .collect()
    }

    /// A velocity of the track in the recording's axes.
    fn in_axes(&self, velocity: &Vector3<f64>) -> Vector<f64, Inertial> {
        let turned = Rotation2::new(self.alignment.heading_rad) * velocity.xy();
        Vector::new(turned.x, turned.y, velocity.z)
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::Posture;
    use bodyflight_core::frame::Rotation;

    use super::*;
    use bodyflight_mvnx::recording::PelvisMotion;

    fn flown(time: f64) -> Vector3<f64> {
        Vector3::new(
            6.0 * (0.4 * time).sin() + 0.05 * time,
            4.0 * (0.23 * time).cos(),
            -50.0 + 3.0 * (0.5 * time + 0.002 * time * time).sin(),
        )
    }

    fn frames(duration: f64) -> Vec<FlightFrame> {
        (0u32..)
            .map(|index| (u64::from(index), f64::from(index) / 120.0))
            .take_while(|(_, time)| *time <= duration)
            .map(|(index, time)| {
                let velocity = flown(time);
                // Magnetic north is 0.1 rad west of true north.
                let seen = Rotation2::new(-0.1) * velocity.xy();
                FlightFrame {
                    index,
                    time,
                    posture: Posture::h_pose(),
                    pelvis: PelvisMotion {
                        inertial_from_body: Rotation::identity(),
                        position: Vector::zero(),
                        // The suit's own velocity has drifted.
                        velocity: Some(Vector::new(seen.x + 2.0, seen.y - 1.0, velocity.z + 4.0)),
                        angular_velocity: Some(Vector::zero()),
                    },
                    centre_of_mass: None,
                    bridged: false,
                }
            })
            .collect()
    }

    fn track(shift: f64, from: f64, until: f64) -> Vec<Sample> {
        (0u32..)
            .map(|row| from + f64::from(row) * 0.2)
            .take_while(|time| *time <= until)
            .map(|time| {
                let wobble = 0.07 * (97.0 * time).sin();
                Sample {
                    time,
                    position: Vector3::zeros(),
                    velocity: flown(time - shift) + Vector3::repeat(wobble),
                }
            })
            .collect()
    }

    /// Without velocities in the recording the begin is asked for, and taken as given.
    #[test]
    fn a_recording_without_velocity_takes_a_track_whose_begin_is_given() {
        let mut blind = frames(20.0);
        for frame in &mut blind {
            frame.pelvis.velocity = None;
        }
        let track = track(0.0, 100.0, 130.0);
        let asked = aligned(&blind, &track).unwrap_err();
        let help = asked.help.as_deref().unwrap_or_default();
        assert!(help.contains("gnss_begin_s"), "{asked}");
        let placed = |begin_s| placed(&blind, &track, begin_s);
        let found = placed(3.0).unwrap();
        assert!((found.alignment.shift_s - 103.0).abs() < 1e-9);
        assert_eq!(found.alignment.gap_mps, None);
        let velocity = found.velocity_at(5.0).unwrap().components;
        assert!((velocity - flown(108.0)).norm() < 0.3, "{velocity}");
        for wrong in [-1.0, 15.0] {
            let said = placed(wrong).unwrap_err().to_string();
            assert!(said.contains("does not cover"), "{said}");
        }
    }

    #[test]
    fn the_clocks_of_a_suit_and_a_receiver_are_aligned_to_ten_milliseconds() {
        for shift in [41.237, 12.0, 77.719] {
            let aligned = aligned(&frames(40.0), &track(shift, 0.0, 150.0)).unwrap();
            let found = aligned.alignment;
            assert!((found.shift_s - shift).abs() < 0.01, "{shift}: {found:?}");
            assert!(
                (found.shift_s - shift).abs() < 4.0 * found.deviation_s,
                "{found:?}"
            );
            assert!((found.heading_rad + 0.1).abs() < 0.01, "{found:?}");
            let velocity = aligned.velocity_at(20.0).unwrap().components;
            let expected = flown(20.0);
            assert!((velocity.z - expected.z).abs() < 0.15);
            assert!((velocity.xy().norm() - expected.xy().norm()).abs() < 0.15);
            assert!(aligned.velocity_at(1e4).is_none());
        }
    }

    #[test]
    fn time_in_the_aircraft_and_on_the_ground_is_no_other_shift() {
        for before in [60.0, 300.0] {
            let shift = before;
            let quiet = |from: f64, until: f64, velocity: Vector3<f64>| {
                let rows = (0u32..).map(move |row| from + f64::from(row) * 0.2);
                let rows = rows.take_while(move |time| *time < until);
                rows.map(move |time| Sample {
                    time,
                    position: Vector3::zeros(),
                    velocity: velocity + Vector3::repeat(0.07 * (91.0 * time).sin()),
                })
            };
            let aircraft = quiet(0.0, before - 3.0, Vector3::new(30.0, -25.0, 0.0));
            let fall = track(shift, before - 3.0, before + 45.0);
            let ground = quiet(before + 45.2, before + 400.0, Vector3::zeros());
            let track: Vec<Sample> = aircraft.chain(fall).chain(ground).collect();
            let found = aligned(&frames(40.0), &track).unwrap().alignment;
            assert!((found.shift_s - shift).abs() < 0.01, "{found:?}");
        }
    }

    #[test]
    fn a_track_of_another_flight_or_a_fall_without_events_is_refused() {
        let short = aligned(&frames(40.0), &track(1000.0, 0.0, 4.0)).unwrap_err();
        assert!(short.to_string().contains("share less than"), "{short}");
        let mut still = frames(40.0);
        for frame in &mut still {
            frame.pelvis.velocity = Some(Vector::new(0.0, 0.0, -50.0));
        }
        let steady: Vec<Sample> = track(0.0, 0.0, 100.0)
            .into_iter()
            .map(|sample| Sample {
                velocity: Vector3::new(0.0, 0.0, -50.0 + 0.02 * (31.0 * sample.time).sin()),
                ..sample
            })
            .collect();
        let alike = aligned(&still, &steady).unwrap_err();
        assert!(
            alike.to_string().contains("several clock shifts"),
            "{alike}"
        );
    }
}
