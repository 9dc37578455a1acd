//! Whether an estimate can be trusted, as a sentence.

use bodyflight_core::estimator::motion::measurement::{CHANNELS, NAMES, Noise};
use bodyflight_core::estimator::motion::watch::{ChannelWatch, Consistency, Watch};
use serde::Serialize;

use bodyflight_replay::comparison::{Channel, PerChannel};

/// Longest uninterrupted time for which consistency may be lost (s).
pub const LONGEST_LOSS: f64 = 1.0;

/// Largest share of the time for which an estimate may be inconsistent. Beyond it, an unmodelled effect acts
/// throughout, and the error bars are not reliable at other times either.
pub const LARGEST_SHARE: f64 = 0.25;

/// Share of a channel's noise by which its gap may exceed that with constant coefficients and still count as chance.
const WORSE: f64 = 0.5;

/// What is known of a flight beforehand and adds to what the filter states.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Doubts {
    /// Least doubt of each estimate.
    pub(crate) least: Consistency,
    /// Factor on the deviations of muscle input.
    pub(crate) muscle: f64,
}

impl Doubts {
    /// Nothing to add to what the filter states.
    pub(crate) const NONE: Self = Self {
        least: Consistency::Consistent,
        muscle: 1.0,
    };
}

/// How consistent an estimation was.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Consistencies {
    /// Share of the time in which the error bars were right, as far as measurements can tell.
    pub consistent: f64,
    /// Share in which they were too small, or an effect acted that the filter does not model.
    pub doubtful: f64,
    /// Share in which predictions did not follow the measurements.
    pub lost: f64,
    /// Longest uninterrupted time for which it was lost (s).
    pub longest_loss_s: f64,
    /// When that began (s).
    pub loss_begins_s: f64,
    /// The channel that was worst then, or the residual load.
    pub worst: Option<String>,
    /// Time that passes per time by the recording's rate, if the rate is certainly wrong.
    pub time_ratio: Option<f64>,
    /// Statistics of each channel over the flight.
    pub nis: Vec<ChannelConsistency>,
}

/// A channel over the whole flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ChannelConsistency {
    /// Name.
    pub channel: &'static str,
    /// Mean normalised innovation squared; ideally 1.
    pub nis: f64,
    /// Correlation of successive innovations; ideally 0.
    pub correlation: f64,
    /// Share beyond the gate.
    pub rejected: f64,
}

/// Collects consistency estimate by estimate.
#[derive(Debug, Default)]
pub struct Collector {
    times: [f64; 3],
    /// Beginning of the present loss.
    since: Option<f64>,
    longest: [f64; 2],
    worst: Option<&'static str>,
    time_ratio: Option<f64>,
    sums: [[f64; 3]; CHANNELS],
    counts: [f64; CHANNELS],
}

impl Collector {
    /// Adds the filter's own report at `time` (s), `duration` (s) after the previous one.
    pub fn take(&mut self, watch: &Watch<f64>, consistency: Consistency, time: f64, duration: f64) {
        for ((channel, sums), count) in watch
            .channels
            .iter()
            .zip(&mut self.sums)
            .zip(&mut self.counts)
        {
            if channel.seen {
                let values = [channel.mean_square, channel.correlation, channel.rejected];
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum += value;
                }
                *count += 1.0;
            }
        }
        self.time_ratio = watch.pace;
        if self.take_state(consistency, time, duration) {
            self.worst = Some(worst(watch));
        }
    }

    /// The same for a filter that monitors all channels together. Returns whether this is the longest loss so far.
    pub fn take_state(&mut self, consistency: Consistency, time: f64, duration: f64) -> bool {
        if let Some(sum) = self.times.get_mut(consistency as usize) {
            *sum += duration;
        }
        if consistency != Consistency::Lost {
            self.since = None;
            return false;
        }
        let begin = *self.since.get_or_insert(time - duration);
        let longest = time - begin > self.longest[0];
        if longest {
            self.longest = [time - begin, begin];
        }
        longest
    }

    /// Sums up what was collected.
    pub fn finish(&self) -> Consistencies {
        let total: f64 = self.times.iter().sum::<f64>().max(1e-9);
        let [consistent, doubtful, lost] = self.times.map(|time| time / total);
        let channels = NAMES.iter().zip(self.sums.iter().zip(self.counts));
        Consistencies {
            consistent,
            doubtful,
            lost,
            longest_loss_s: self.longest[0],
            loss_begins_s: self.longest[1],
            worst: self.worst.map(str::to_owned),
            time_ratio: self.time_ratio,
            nis: channels
                .filter(|(_, (_, count))| *count > 0.0)
                .map(|(&channel, (sums, count))| ChannelConsistency {
                    channel,
                    nis: sums[0] / count,
                    correlation: sums[1] / count,
                    rejected: sums[2] / count,
                })
                .collect(),
        }
    }
}

/// The channel that fits worst.
fn worst(watch: &Watch<f64>) -> &'static str {
    let badness = |channel: &ChannelWatch<f64>| (channel.consistency(), channel.mean_square);
    let named = watch.channels.iter().zip(NAMES).filter(|(c, _)| c.seen);
    let found = named.max_by(|(a, _), (b, _)| {
        let (a, b) = (badness(a), badness(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    match found {
        Some((channel, name)) if channel.consistency() >= watch.residual_consistency() => name,
        _ => "the residual load",
    }
}

/// Channels in which the reconstruction is worse than with constant coefficients, by more than chance.
pub fn worse_channels(rms: &PerChannel, constant: &PerChannel, noise: &Noise<f32>) -> Vec<Channel> {
    Channel::ALL
        .into_iter()
        .filter(|&channel| {
            // What was not measured is not compared.
            if constant.get(channel).is_nan() {
                return false;
            }
            let noise = f64::from(match channel {
                Channel::Roll | Channel::Pitch | Channel::Heading => noise.attitude,
                Channel::YawRate | Channel::AngularVelocity => noise.angular_velocity,
                Channel::HorizontalVelocity => noise.horizontal_velocity,
                Channel::VerticalVelocity => noise.vertical_velocity,
            });
            // NaN counts as worse.
            let within = rms.get(channel) <= constant.get(channel) + WORSE * noise;
            !within
        })
        .collect()
}

/// Why an estimate should not be trusted, in a sentence; `None` if it can be. `velocity` is the standard deviation of a
/// velocity that is assumed (m/s).
pub fn sentence(
    worse: &[(Channel, f64, f64)],
    found: &Consistencies,
    velocity: Option<f64>,
) -> Option<String> {
    if let Some(ratio) = found.time_ratio {
        return Some(format!(
            "the frame rate is wrong: by the attitudes, {ratio:.2} times as much time passes as by the rate and the \
             angular velocities"
        ));
    }
    if let Some((channel, estimated, constant)) = worse.first() {
        let (label, unit) = channel.label();
        return Some(format!(
            "{label} is reconstructed to {estimated:.3} {unit}, worse than the {constant:.3} {unit} of constant coefficients"
        ));
    }
    if found.longest_loss_s <= LONGEST_LOSS {
        let share = found.doubtful + found.lost;
        return (share > LARGEST_SHARE).then(|| match velocity {
            Some(deviation) => format!(
                "the recording has no velocity: a steady fall was assumed, and what attitude, rates and posture make of it is known to {deviation:.1} m/s in each direction at best"
            ),
            None => format!(
                "the estimate is doubtful {:.0} % of the time: an effect that the model lacks acts throughout",
                100.0 * share
            ),
        });
    }
    Some(format!(
        "consistency is lost for {:.1} s from {:.1} s on, worst in {}",
        found.longest_loss_s,
        found.loss_begins_s,
        found.worst.as_deref().unwrap_or("all channels")
    ))
}
