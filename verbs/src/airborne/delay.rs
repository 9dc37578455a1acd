//! Postures that are late: with them the angular momentum of a body in the air changes, and at the right time it does not.

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::State;
use bodyflight_core::{Posture, Segment};
use bodyflight_replay::recorded::Recorded;
use nalgebra::Vector3;

use super::blocks::Part;
use super::verdict::Fault;

/// Step of a derivative by the delay (s), steps of the fit, and the longest delay that is looked for (s).
const STEP: f64 = 0.005;
const STEPS: usize = 8;
const LONGEST: f64 = 0.1;
/// Fewest frames of a part that show it.
const LEAST_FRAMES: usize = 6;
/// Smallest delay that is told (s), three times what a search grants any recording, and in standard errors: the mass
/// distribution of a default person changes the angular momentum too.
const LEAST: f64 = 0.012;
const SURE: f64 = 3.4;
/// What tables of segments miss of a person's own masses (fraction).
const MASS: f64 = 0.1;
/// Largest share of the changes of the angular momentum that is left if a delay is their reason.
const LEFT: f64 = 0.5;

/// What the halves of all parts say about a delay.
struct Fit {
    /// Information of each half, and how far its own delay is from the common one (s).
    halves: Vec<(f64, f64)>,
    /// Changes of the angular momentum that are left, in squares over all frames, and the number of frames.
    left: f64,
    count: f64,
}

/// The posture at a time (s), `None` beyond the frames.
fn posture_at(recorded: &Recorded, time: f64) -> Option<Posture<f64>> {
    let samples = &recorded.samples;
    let next = samples.partition_point(|sample| sample.time <= time);
    let (before, after) = (samples.get(next.checked_sub(1)?)?, samples.get(next)?);
    let share = (time - before.time) / (after.time - before.time);
    Some(before.posture.interpolated(&after.posture, share))
}

/// The angular momentum at a frame if postures are late by `delay` (s); `None` near the ends.
fn momentum(recorded: &Recorded, frame: usize, delay: f64) -> Option<Vector3<f64>> {
    let sample = recorded.samples.get(frame)?;
    let interval = recorded.samples.get(frame + 1)?.time - sample.time;
    let [before, here, after] =
        [-interval, 0.0, interval].map(|apart| posture_at(recorded, sample.time + delay + apart));
    let rate = PostureRate::between(&before?, &after?, 2.0 * interval);
    let posed = recorded.dynamics.sample(&here?, &rate);
    Some(
        State::from_motion(&sample.motion, &posed)
            .angular_momentum
            .components,
    )
}

/// The angular momentum in the frames of a part, and its derivative by the delay.
fn momenta(part: &Part, delay: f64) -> Vec<[Vector3<f64>; 2]> {
    let frames = 0..part.recorded.samples.len();
    let all = frames.filter_map(|frame| {
        let at = |delay| momentum(&part.recorded, frame, delay);
        let slope = (at(delay + STEP)? - at(delay - STEP)?) / (2.0 * STEP);
        Some([at(delay)?, slope])
    });
    all.collect()
}

/// The further delay of parts about one (s), and what they say of it.
fn fitted(parts: &[&Part], delay: f64) -> Option<(f64, Fit)> {
    let mut sums = Vec::new();
    let (mut left, mut count) = (0.0, 0.0);
    for part in parts {
        let momenta = momenta(part, delay);
        if momenta.len() < LEAST_FRAMES {
            continue;
        }
        let frames = momenta.len() as f64;
        let mean = |of: usize| momenta.iter().map(|both| both[of]).sum::<Vector3<f64>>() / frames;
        let [momentum, slope] = [mean(0), mean(1)];
        count += frames;
        for half in momenta.chunks(momenta.len().div_ceil(2)) {
            let (mut information, mut score) = (0.0, 0.0);
            for [own, of_delay] in half {
                let (change, of_delay) = (own - momentum, of_delay - slope);
                information += of_delay.norm_squared();
                score -= of_delay.dot(&change);
                left += change.norm_squared();
            }
            sums.push((information, score));
        }
    }
    let [information, score] =
        [0, 1].map(|of| sums.iter().map(|(one, two)| [one, two][of]).sum::<f64>());
    let further = score / information;
    let halves = sums
        .iter()
        .map(|(own, score)| (*own, score / own - further));
    let halves = halves.collect();
    let fit = Fit {
        halves,
        left,
        count,
    };
    further.is_finite().then_some((further, fit))
}

/// The delay of the postures of parts and its standard error (s), and the share of the changes of the angular momentum that
/// it leaves.
fn delay(parts: &[&Part]) -> Option<[f64; 3]> {
    let (mut further, before) = fitted(parts, 0.0)?;
    let mut delay = 0.0;
    let mut fit = None;
    for _ in 0..STEPS {
        delay += further;
        if delay.abs() > LONGEST {
            return None;
        }
        let found = fitted(parts, delay)?;
        (further, fit) = (found.0, Some(found.1));
    }
    let fit = fit?;
    let count = fit.halves.len() as f64;
    let information: f64 = fit.halves.iter().map(|(own, _)| own).sum();
    // Errors are alike from frame to frame, so only halves of parts are independent.
    let scatter: f64 = (fit.halves.iter())
        .map(|(own, apart)| (own * apart).powi(2))
        .sum();
    let error = (scatter * count / (count - 1.0)).sqrt() / information;
    let error = error.hypot(error_of_masses(parts, delay, further)?);
    let left = (fit.left / fit.count) / (before.left / before.count);
    Some([delay, error, left])
}

/// What the person's own masses may change of the delay (s), whose further estimate about `delay` is `further` by those of the
/// subject.
fn error_of_masses(parts: &[&Part], delay: f64, further: f64) -> Option<f64> {
    let mut squares = 0.0;
    for segment in Segment::ALL {
        let pair = [segment, segment.mirrored()];
        if pair[1] < pair[0] {
            continue;
        }
        let mut heavier: Vec<Part> = parts.iter().map(|part| (*part).clone()).collect();
        for part in &mut heavier {
            let segments = &mut part.recorded.dynamics.body.segments;
            for own in &pair[..if pair[0] == pair[1] { 1 } else { 2 }] {
                segments[*own].mass *= 1.0 + MASS;
                segments[*own].inertia *= 1.0 + MASS;
            }
        }
        let (other, _) = fitted(&heavier.iter().collect::<Vec<_>>(), delay)?;
        squares += (other - further).powi(2);
    }
    Some(squares.sqrt())
}

/// Postures that are late or early, as a fault.
pub(super) fn found(parts: &[&Part]) -> Option<Fault> {
    let [delay, error, left] = delay(parts)?;
    let is_sure = delay.abs() > LEAST.max(SURE * error) && left < LEFT;
    is_sure.then(|| {
        let when = if delay > 0.0 { "late" } else { "early" };
        Fault {
            kind: "delay",
            message: format!(
                "the postures are {when} by {:.1} +- {:.1} ms against the motion of the pelvis: at the right time, {:.0} % of the changes of the angular momentum are left",
                1e3 * delay.abs(),
                1e3 * error,
                100.0 * left.sqrt()
            ),
            segments: Vec::new(),
            time_s: None,
        }
    })
}
