//! The body in the intervals of a stretch: its postures, and what of the loads and masses depends on these alone.

use std::cell::OnceCell;
use std::rc::Rc;

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::posture::joint_between;
use bodyflight_core::dynamics::sample_parts::{Difference, SampleParts};
use bodyflight_core::dynamics::{Dynamics, PostureSample};
use bodyflight_core::{Posture, Segment};
use nalgebra::UnitQuaternion;

/// A posture as recorded and as corrected.
pub(crate) type End = [Posture<f64>; 2];

/// The posture in the middle of an interval, and its rate of change.
type Posed = (Posture<f64>, PostureRate<f64>);

/// Intervals that follow one another.
pub(crate) struct Intervals {
    /// Postures at the ends, one more than there are intervals.
    ends: Rc<[End]>,
    postures: Rc<[Posed]>,
    samples: Rc<[PostureSample<f64>]>,
    /// Parts of the samples, once another sample was made of them.
    parts: OnceCell<Rc<[SampleParts<f64>]>>,
}

impl Intervals {
    /// Intervals of this `duration` (s) between postures.
    pub(crate) fn new(ends: Rc<[End]>, dynamics: &Dynamics<f64>, duration: f64) -> Self {
        let posed = |pair: &[End]| {
            let [from, to] = [&pair[0][1], &pair[1][1]];
            let rate = PostureRate::between(from, to, duration);
            (from.interpolated(to, 0.5), rate)
        };
        let postures: Rc<[Posed]> = ends.windows(2).map(posed).collect();
        let blank = PostureSample::blank();
        // Copied, where a clone would go number by number, and filled in place: a sample takes 4 kB.
        let mut samples: Rc<[PostureSample<f64>]> = (0..postures.len()).map(|_| blank).collect();
        for (sample, (posture, rate)) in Rc::make_mut(&mut samples).iter_mut().zip(&*postures) {
            dynamics.sample_into(posture, rate, sample);
        }
        Self {
            ends,
            postures,
            samples,
            parts: OnceCell::new(),
        }
    }

    /// Number of intervals.
    pub(crate) fn count(&self) -> usize {
        self.samples.len()
    }

    /// The posture and the sample of an interval.
    pub(crate) fn at(&self, place: usize) -> (&Posture<f64>, &PostureSample<f64>) {
        (&self.postures[place].0, &self.samples[place])
    }

    /// The same postures for another model than that of these intervals.
    pub(crate) fn changed(&self, now: &Dynamics<f64>, then: &Dynamics<f64>) -> Self {
        let difference = Difference::between(now, then);
        let samples = match difference {
            Difference::None => self.samples.clone(),
            _ => self.resampled(now, &self.postures, |parts, posed, sample| {
                then.resample(parts, difference, posed, sample);
            }),
        };
        Self {
            ends: self.ends.clone(),
            postures: self.postures.clone(),
            samples,
            parts: OnceCell::new(),
        }
    }

    /// The same model with another rotation of one joint, given by `turn` for each end; `None` leaves it as it is.
    pub(crate) fn with_joint(
        &self,
        dynamics: &Dynamics<f64>,
        duration: f64,
        segment: Segment,
        turn: impl Fn(usize, &Posture<f64>) -> Option<UnitQuaternion<f64>>,
    ) -> Self {
        let mut ends: Rc<[End]> = self.ends.iter().copied().collect();
        for (k, [recorded, posture]) in Rc::make_mut(&mut ends).iter_mut().enumerate() {
            if let Some(turn) = turn(k, recorded) {
                posture.set(segment, turn);
            }
        }
        let mut postures: Rc<[Posed]> = self.postures.iter().copied().collect();
        for ((posture, rate), pair) in Rc::make_mut(&mut postures).iter_mut().zip(ends.windows(2)) {
            let [from, to] = [0, 1].map(|end| pair[end][1].parent_from_segment(segment));
            posture.set(segment, joint_between(from, to, 0.5));
            rate.set_between(segment, from, to, duration);
        }
        let samples = self.resampled(dynamics, &postures, |parts, posed, sample| {
            dynamics.resample_joint(parts, segment, posed, sample);
        });
        Self {
            ends,
            postures,
            samples,
            parts: OnceCell::new(),
        }
    }

    /// Samples of which `change` makes others; `now` is the model of these intervals.
    fn resampled(
        &self,
        now: &Dynamics<f64>,
        postures: &[Posed],
        change: impl Fn(&SampleParts<f64>, (&Posture<f64>, &PostureRate<f64>), &mut PostureSample<f64>),
    ) -> Rc<[PostureSample<f64>]> {
        let parts = self.parts.get_or_init(|| {
            let parts = |(posture, rate): &Posed| now.sample_parts(posture, rate);
            self.postures.iter().map(parts).collect()
        });
        let mut samples: Rc<[PostureSample<f64>]> = self.samples.iter().copied().collect();
        let each = Rc::make_mut(&mut samples).iter_mut().zip(&**parts);
        for ((sample, parts), (posture, rate)) in each.zip(postures) {
            change(parts, (posture, rate), sample);
        }
        samples
    }
}
