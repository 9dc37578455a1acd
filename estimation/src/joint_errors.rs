//! How large the errors of the recorded joints are, from the flight itself.

use bodyflight_core::Real;
use bodyflight_core::estimator::motion::estimate::Recorder;
use bodyflight_core::estimator::motion::measurement::Row as ChannelRow;
use bodyflight_core::estimator::motion::settings::MotionPreset;
use bodyflight_core::estimator::motion::state::Difference;
use bodyflight_core::estimator::motion::update::Innovation;
use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_core::estimator::reduced::Reduced;

use crate::forward::STRIDE;
use crate::report::{JointErrorSource, Report};
use crate::run::Run;
use crate::size::{Size, Sizes};
use crate::verdict::Doubts;
use crate::whole::Expected;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::progress;

/// Length of flight (s) from which the size of constant joint errors is found.
const ENOUGH: f64 = 60.0;

/// Sizes of wandering joint errors to try: the preset's times two to the power of these, and their neighbours.
const OCTAVES: [i32; 2] = [-3, 2];

/// Factor on the most likely size of wandering joint errors. The filter's joint errors change like a random walk, more at once
/// and less over seconds than those of joints that sway, and the likelihood sees the former. Chosen on synthetic flights of
/// seed 501.
const SLOWER: f64 = 1.4;

/// Standard deviation of the size of joint errors that wander, as a share of it: the synthetic flights need a quarter, those
/// of the independent simulator half and more.
const WANDER_KNOWN: f64 = 0.55;

/// Joint errors (deg) from which on they are no explanation: no recording has as much, so a flight that needs it has some
/// other problem. The first is for constant errors, the second for the most likely size of wandering ones.
const IMPLAUSIBLE: [f64; 2] = [5.7, 3.0];

/// Growth of the filter's variance of muscle input for each square degree of joint errors that wander: loads of joints are
/// taken as linear, so what that leaves grows with the square of the errors. Chosen on flights of the bench of error bars,
/// seeds 601 and 602. Bars of flights with constant errors need no growth.
const NOT_LINEAR: f64 = 0.0125;

/// The joint errors of a flight, and what is found with them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointErrors {
    /// The size with which the filter counts is its root mean square.
    pub(crate) size: Size,
    pub(crate) source: JointErrorSource,
    /// Standard deviations of the damping that the filter has to expect.
    pub(crate) damping: [f32; 3],
    /// Whether they wander.
    pub(crate) wanders: bool,
    /// Whether joints may be off by so much.
    pub(crate) is_plausible: bool,
}

impl JointErrors {
    /// What they say of the filter's estimates.
    pub(crate) fn doubts(&self) -> Doubts {
        let degrees = if self.wanders {
            self.size.root_mean_square().to_degrees()
        } else {
            0.0
        };
        Doubts {
            least: if self.is_plausible {
                Consistency::Consistent
            } else {
                Consistency::Doubtful
            },
            muscle: (1.0 + NOT_LINEAR * degrees * degrees).sqrt(),
        }
    }

    /// Tells them in a report, and doubts the estimate if joints cannot be off by so much.
    pub(crate) fn tell(&self, report: &mut Report) {
        let Size { mean, deviation } = self.size;
        let mean = mean.to_degrees();
        if !self.is_plausible {
            report.doubt.get_or_insert_with(|| format!(
                "the measurements can only be explained by joint errors of {mean:.1} degrees, more than recordings have: an effect that the model lacks acts"
            ));
        }
        report.joint_error_deg = Some(mean);
        report.joint_error_sd_deg = Some(deviation.to_degrees());
        report.joint_error_source = Some(self.source);
    }
}

/// Finds how large the joint errors are.
pub(crate) fn joint_errors(run: &Run<'_>, preset: &MotionPreset) -> Result<JointErrors> {
    let expected = if run.velocities.are_sampled() {
        expected(run, preset)?
    } else {
        None
    };
    if let Some(Expected { size, damping }) = expected {
        return Ok(JointErrors {
            size,
            source: if size.is_seen() {
                JointErrorSource::Seen
            } else {
                JointErrorSource::Assumed
            },
            #[expect(clippy::cast_possible_truncation, reason = "coefficients")]
            damping: damping.map(|deviation| deviation as f32),
            wanders: false,
            is_plausible: size.mean < IMPLAUSIBLE[0].to_radians(),
        });
    }
    let likely = wandering(run, preset)?;
    let mean = SLOWER * likely;
    let deviation = WANDER_KNOWN * mean;
    Ok(JointErrors {
        size: Size { mean, deviation },
        source: JointErrorSource::Seen,
        // What wanders is taken for damping that varies.
        damping: preset.damping_deviation,
        wanders: true,
        is_plausible: likely < IMPLAUSIBLE[1].to_radians(),
    })
}

/// What the first minute as a whole says of the joint errors and of the damping, if joint errors are constant.
fn expected(run: &Run<'_>, preset: &MotionPreset) -> Result<Option<Expected>> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of samples"
    )]
    let enough = (ENOUGH * run.rate) as usize;
    let part = Run {
        samples: run.samples.get(..enough).unwrap_or(run.samples),
        ..*run
    };
    progress::stage("filtering, to find the joint errors");
    let (mut states, mut activity) = (Vec::new(), Vec::new());
    part.fly::<f64, Reduced>(
        preset,
        &mut (),
        |_, _| (),
        |index, filter, _| {
            activity.push(filter.activity());
            if (index + 1).is_multiple_of(STRIDE) {
                states.push(*filter.state());
            }
        },
    )?;
    part.whole(preset, Sizes::any(), &states, &activity)
        .expected()
}

/// The most likely size (rad) of joint errors that wander.
fn wandering(run: &Run<'_>, preset: &MotionPreset) -> Result<f64> {
    let size = |octave: i32| preset.joint_error * 2f32.powi(octave);
    let likelihood = |octave: i32| -> Result<f64> {
        let joint_error = size(octave);
        progress::stage(format!(
            "trying joint errors of {:.2} degrees",
            joint_error.to_degrees()
        ));
        let tried = MotionPreset {
            joint_error,
            ..*preset
        };
        let mut likelihood = Likelihood::default();
        run.fly::<f64, Reduced>(&tried, &mut likelihood, |_, _| (), |_, _, _| ())?;
        Ok(likelihood.0)
    };
    let [least, most] = OCTAVES;
    let mut octave = 0;
    let mut near = [likelihood(-1)?, likelihood(0)?, likelihood(1)?];
    loop {
        let [below, here, above] = near;
        if above > here && octave < most {
            octave += 1;
            near = [here, above, likelihood(octave + 1)?];
        } else if below > here && octave > least {
            octave -= 1;
            near = [likelihood(octave - 1)?, below, here];
        } else {
            break;
        }
    }
    // The top of the parabola through the three.
    let [below, here, above] = near;
    let bend = below - 2.0 * here + above;
    let top = if bend < 0.0 {
        (0.5 * (below - above) / bend).clamp(-1.0, 1.0)
    } else {
        0.0
    };
    Ok(f64::from(size(octave)) * top.exp2())
}

/// Sums the log likelihood of the measurements.
#[derive(Default)]
struct Likelihood(f64);

impl<T: Real> Recorder<T> for Likelihood {
    fn taken(&mut self, _: &ChannelRow<T>, innovation: &Innovation<T>, _: &Difference<T>) {
        let (value, variance) = (innovation.value.to_f64(), innovation.variance.to_f64());
        self.0 -= 0.5 * (variance.ln() + value * value / variance);
    }
}
