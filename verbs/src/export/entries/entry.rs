//! A quantity with its function, and the frame that it is taken from.

use bodyflight_core::Segment;
use bodyflight_core::aerodynamics::Loads;
use bodyflight_core::body::SegmentArray;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::posture::{PosedSegment, pose};
use bodyflight_core::dynamics::{Dynamics, State};
use bodyflight_core::frame::Vector;
use nalgebra::UnitQuaternion;

use bodyflight_estimation::report::Point;
use bodyflight_export::columns::quantity::{Of, Quantity, Unit};
use bodyflight_replay::steps::Step;

/// A frame with everything known about it.
pub(in crate::export) struct Seen<'a> {
    pub(super) step: &'a Step,
    pub(super) posed: SegmentArray<PosedSegment<f64>>,
    pub(super) turned: SegmentArray<UnitQuaternion<f64>>,
    pub(super) loads: SegmentArray<Loads<f64>>,
    pub(super) air_velocity: [f64; 3],
    pub(super) cg: [f64; 3],
    /// The measured motion of the whole body.
    pub(super) whole: State<f64>,
    estimate: Option<&'a Point>,
}

impl<'a> Seen<'a> {
    /// A frame of a flight simulated with `dynamics`, with the rates of its joints and the estimate that applies to it.
    pub(in crate::export) fn of(
        dynamics: &Dynamics<f64>,
        step: &'a Step,
        rate: &PostureRate<f64>,
        estimate: Option<&'a Point>,
    ) -> Self {
        let posed = pose(&dynamics.body, &step.posture);
        let mut cg = Vector::zero();
        for (segment, placed) in posed.iter() {
            cg += Vector::<_, bodyflight_core::frame::Body>::from_components(placed.cg)
                * dynamics.body.segments[segment].mass;
        }
        Self {
            step,
            turned: step.posture.body_from_segments(),
            loads: dynamics.segment_loads(&step.posture, &step.simulated),
            air_velocity: dynamics
                .air
                .velocity_at(&step.simulated.position)
                .to_array(),
            cg: (cg / dynamics.body.mass()).to_array(),
            whole: State::from_motion(&step.measured, &dynamics.sample(&step.posture, rate)),
            posed,
            estimate,
        }
    }

    /// Adds the numbers of each segment.
    pub(super) fn each<const N: usize>(
        &self,
        numbers: impl Fn(Segment) -> [f64; N],
        row: &mut Vec<f64>,
    ) {
        for segment in Segment::ALL {
            row.extend(numbers(segment));
        }
    }

    /// Adds the numbers of the estimate; NaN before the first one, and if nothing is estimated.
    pub(super) fn estimated<const N: usize>(
        &self,
        numbers: impl Fn(&Point) -> [f64; N],
        row: &mut Vec<f64>,
    ) {
        row.extend(self.estimate.map_or([f64::NAN; N], numbers));
    }
}

type Take = Box<dyn Fn(&Seen<'_>, &mut Vec<f64>)>;

/// A quantity, and how to extract it from a frame.
pub(in crate::export) struct Entry {
    /// The quantity.
    pub(in crate::export) quantity: Quantity,
    take: Take,
}

impl Entry {
    pub(super) fn new(
        of: Of,
        name: impl Into<String>,
        (parts, unit): (&'static [&'static str], Unit),
        meaning: &'static str,
        take: impl Fn(&Seen<'_>, &mut Vec<f64>) + 'static,
    ) -> Self {
        Self {
            quantity: Quantity {
                name: name.into(),
                unit,
                parts,
                of,
                meaning,
            },
            take: Box::new(take),
        }
    }

    /// Adds the numbers of a frame.
    pub(in crate::export) fn take(&self, seen: &Seen<'_>, row: &mut Vec<f64>) {
        (self.take)(seen, row);
    }
}
