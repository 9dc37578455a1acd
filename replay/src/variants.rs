//! Many variants of a flight over the same frames, four side by side.
//!
//! Variants that differ in coefficients, areas or inputs have postures, masses and measurements in common, which are
//! computed once for all of them. Each variant has the bits that it has alone ([`Replay`](crate::steps::Replay)).

mod bunch;

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::free_run::crossed;
use bodyflight_core::dynamics::{Dynamics, PostureSample, middle_of};
use bodyflight_core::four::FourDouble;
use bodyflight_core::observation::Observation;
use nalgebra::SimdValue;

use self::bunch::{Bunch, Member, Posed, bunches};
use crate::Precision;
use crate::comparison::Pair;
use crate::flight::Flight;
use crate::side_by_side::{SideBySide, motion_of};
use crate::steps::{Divergence, first_frames};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::FlightFrame;

/// Variants that are worth flying at once: what they have in common is then a small part of the work, and they still spread
/// over the cores.
pub const TOGETHER: usize = 16;

/// Frames after which Ctrl-C is looked for.
const FRAMES_WITHOUT_CHECK: usize = 1024;

/// A flight with a model of its own.
#[derive(Debug, Clone)]
pub struct Variant {
    /// The flight: its inputs and effects.
    pub flight: Flight,
    /// Its dynamics, before effects are applied.
    pub dynamics: Dynamics<f64>,
}

/// Flies variants of a flight over the same frames, in double precision. `see` is called with the index of a variant and
/// what is compared, in the order of the frames.
///
/// Not generic, so that the formulas are compiled here, for speed, and not in each crate that calls this.
///
/// Returns for each variant why its simulation means nothing, if it diverges; it is then compared with its last plausible
/// motion.
///
/// # Errors
/// Returns an error if there are fewer than two frames, if one has no velocity or angular velocity, or on Ctrl-C.
pub fn fly(
    frames: &[FlightFrame],
    variants: &[Variant],
    see: &mut dyn FnMut(usize, Pair),
) -> Result<Vec<Option<String>>> {
    let (mut together, mut alone) = (Vec::new(), Vec::new());
    for (index, variant) in variants.iter().enumerate() {
        let member = Member {
            index,
            beside: begun(variant, frames)?,
        };
        let first = together.first().unwrap_or(&member);
        if member.is_like(first) {
            together.push(member);
        } else {
            alone.push(member);
        }
    }
    fly_together(&mut together, frames, see)?;
    for member in &mut alone {
        fly_alone(member, frames, see)?;
    }
    let mut diverged = vec![None; variants.len()];
    for member in together.iter().chain(&alone) {
        diverged[member.index] = member.beside.diverged();
    }
    Ok(diverged)
}

fn begun<'a>(variant: &'a Variant, frames: &[FlightFrame]) -> Result<SideBySide<'a>> {
    let flight = &variant.flight;
    let mut first = first_frames(flight, &mut frames.iter().copied().map(Ok))?;
    let first = first.make_contiguous();
    let dynamics = variant.dynamics;
    let mut beside = SideBySide::new(flight, Precision::Double, first, dynamics, &[], None)?;
    beside.divergence = Divergence::Held;
    Ok(beside)
}

impl Member<'_> {
    /// Whether the variant can be flown side by side with another one.
    fn is_like(&self, other: &Self) -> bool {
        let [own, others] = [self, other].map(|member| &member.beside.model);
        let (mut alike, to) = (own.dynamics, &others.dynamics);
        alike.aerodynamics.coefficients = to.aerodynamics.coefficients;
        for (segment, parameters) in alike.body.segments.iter_mut() {
            parameters.area = to.body.segments[segment].area;
        }
        let muscles = match [self, other].map(|member| &member.beside.flight.inputs) {
            [None, None] => true,
            [Some(own), Some(others)] => own.has_muscles_of(others),
            _ => false,
        };
        alike == *to
            && alike.stream.lag == 0.0
            && muscles
            && self.beside.flight.muscles == other.beside.flight.muscles
            && own.applied.is_empty()
            && others.applied.is_empty()
            && self.beside.run.state().is_some()
    }
}

fn fly_alone(
    member: &mut Member<'_>,
    frames: &[FlightFrame],
    see: &mut dyn FnMut(usize, Pair),
) -> Result<()> {
    for (k, frame) in frames.iter().enumerate().skip(1) {
        if k.is_multiple_of(FRAMES_WITHOUT_CHECK) {
            interrupt::check()?;
        }
        let step = member.beside.advance(frame, frames.get(k + 1))?;
        see(member.index, step.pair);
        member.beside.last = step;
    }
    Ok(())
}

fn fly_together(
    members: &mut [Member<'_>],
    frames: &[FlightFrame],
    see: &mut dyn FnMut(usize, Pair),
) -> Result<()> {
    let (Some(first), Some(start)) = (members.first(), frames.first()) else {
        return Ok(());
    };
    let reference = first.beside.model.dynamics;
    let in_fours = members.len() - members.len() % FourDouble::LANES;
    let mut fours: Vec<Bunch<FourDouble>> = bunches(&members[..in_fours]);
    let mut rest: Vec<Bunch<f64>> = bunches(&members[in_fours..]);
    let mut posed = (Posed::<FourDouble>::none(), Posed::<f64>::none());
    let mut sample = PostureSample::blank();
    let mut now: Posture<f64> = start.posture.cast();
    let mut next: Posture<f64> = frames.get(1).map_or(now, |frame| frame.posture.cast());
    for (k, pair) in frames.windows(2).enumerate() {
        if k.is_multiple_of(FRAMES_WITHOUT_CHECK) {
            interrupt::check()?;
        }
        let (last, frame, ahead) = (&pair[0], &pair[1], frames.get(k + 2));
        let before = now;
        now = next;
        next = ahead.map_or(now, |frame| frame.posture.cast());
        let duration = frame.time - last.time;
        let (in_four, others) = members.split_at_mut(in_fours);
        let middle = last.time + 0.5 * duration;
        for (four, members) in fours.iter_mut().zip(in_four.chunks(FourDouble::LANES)) {
            four.take_inputs(members, last.time, middle);
        }
        for (one, member) in rest.iter_mut().zip(others.chunks(1)) {
            one.take_inputs(member, last.time, middle);
        }
        crossed(&before, &now, duration, |step| {
            let (posture, rate) = middle_of(&step.from, &step.to, step.duration);
            let segments = reference.pose_into(&posture, &rate, &mut sample);
            posed.0.take(&segments, &sample);
            posed.1.take(&segments, &sample);
            fours
                .iter_mut()
                .for_each(|four| four.step(&mut posed.0, step.duration));
            rest.iter_mut()
                .for_each(|one| one.step(&mut posed.1, step.duration));
        });
        // Central difference if there are frames on both sides.
        let until = ahead.unwrap_or(frame).time;
        let rate = PostureRate::between(&before, &next, until - last.time);
        let segments = reference.pose_into(&now, &rate, &mut sample);
        posed.0.take(&segments, &sample);
        posed.1.take(&segments, &sample);
        let measured = motion_of(members[0].beside.flight, frame)?;
        let measured = (frame.time, Observation::of(&measured));
        let (in_four, others) = members.split_at_mut(in_fours);
        for (four, members) in fours.iter_mut().zip(in_four.chunks_mut(FourDouble::LANES)) {
            four.compare(&posed.0, members, measured, see)?;
        }
        for (one, member) in rest.iter_mut().zip(others.chunks_mut(1)) {
            one.compare(&posed.1, member, measured, see)?;
        }
    }
    Ok(())
}
