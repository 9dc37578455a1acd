//! Measured and simulated motion side by side, channel by channel: RMS differences, and a thinned series for plots.
//! Memory use does not grow with the length of the flight.

use bodyflight_core::math::wrap_angle;
use bodyflight_core::observation::Observation;
use serde::Serialize;

/// A channel in which flights are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Roll, paper eq. (ypr).
    Roll,
    /// Pitch.
    Pitch,
    /// Heading.
    Heading,
    /// Rate of turn about the vertical axis.
    YawRate,
    /// Angular velocity, all axes.
    AngularVelocity,
    /// Horizontal speed.
    HorizontalVelocity,
    /// Vertical velocity.
    VerticalVelocity,
}

/// Number of channels.
pub const CHANNELS: usize = 7;

impl Channel {
    /// All channels, in the order used in tables.
    pub const ALL: [Self; CHANNELS] = [
        Self::Roll,
        Self::Pitch,
        Self::Heading,
        Self::YawRate,
        Self::AngularVelocity,
        Self::HorizontalVelocity,
        Self::VerticalVelocity,
    ];

    /// Name in files, including the unit.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Roll => "roll_rad",
            Self::Pitch => "pitch_rad",
            Self::Heading => "heading_rad",
            Self::YawRate => "yaw_rate_radps",
            Self::AngularVelocity => "angular_velocity_radps",
            Self::HorizontalVelocity => "horizontal_velocity_mps",
            Self::VerticalVelocity => "vertical_velocity_mps",
        }
    }

    /// Display name and unit.
    pub const fn label(self) -> (&'static str, &'static str) {
        match self {
            Self::Roll => ("roll", "rad"),
            Self::Pitch => ("pitch", "rad"),
            Self::Heading => ("heading", "rad"),
            Self::YawRate => ("yaw rate", "rad/s"),
            Self::AngularVelocity => ("angular velocity", "rad/s"),
            Self::HorizontalVelocity => ("horizontal velocity", "m/s"),
            Self::VerticalVelocity => ("vertical velocity", "m/s"),
        }
    }

    /// Name in figures, with the sense of what may be read either way.
    pub const fn titled(self) -> &'static str {
        match self {
            Self::Heading => "heading, positive to the left",
            Self::YawRate => "yaw rate, positive to the left",
            channel => channel.label().0,
        }
    }

    /// Unit used in figures and the conversion factor: degrees for angles and rates.
    pub const fn drawn(self) -> (&'static str, f64) {
        const DEGREES: f64 = 180.0 / core::f64::consts::PI;
        match self {
            Self::Roll | Self::Pitch | Self::Heading => ("degrees", DEGREES),
            Self::YawRate | Self::AngularVelocity => ("degrees/s", DEGREES),
            Self::HorizontalVelocity | Self::VerticalVelocity => ("m/s", 1.0),
        }
    }

    /// Whether values are angles.
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::Roll | Self::Pitch | Self::Heading)
    }

    /// Value of an observation; the magnitude if the channel is a vector.
    pub fn value(self, seen: &Observation<f64>) -> f64 {
        match self {
            Self::Roll => seen.angles.roll,
            Self::Pitch => seen.angles.pitch,
            Self::Heading => seen.angles.heading,
            Self::YawRate => seen.yaw_rate,
            Self::AngularVelocity => seen.angular_velocity.norm(),
            Self::HorizontalVelocity => seen.horizontal_speed,
            Self::VerticalVelocity => seen.vertical_velocity,
        }
    }

    /// Magnitude of the difference between two observations; angles are compared the short way round.
    pub fn gap(self, a: &Observation<f64>, b: &Observation<f64>) -> f64 {
        match self {
            Self::Roll | Self::Pitch | Self::Heading => {
                wrap_angle(self.value(a) - self.value(b)).abs()
            }
            Self::AngularVelocity => (a.angular_velocity - b.angular_velocity).norm(),
            _ => (self.value(a) - self.value(b)).abs(),
        }
    }
}

/// One number per channel; not a number for one that is not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PerChannel(pub [f64; CHANNELS]);

impl PerChannel {
    /// The number for a channel.
    pub fn get(&self, channel: Channel) -> f64 {
        self.0[channel as usize]
    }
}

impl Serialize for PerChannel {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(Channel::ALL.map(|channel| (channel.key(), self.get(channel))))
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for PerChannel {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "PerChannel".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let number = |channel: Channel| {
            let (label, unit) = channel.label();
            let description = format!("{label} ({unit})");
            let schema =
                serde_json::json!({ "type": ["number", "null"], "description": description });
            (channel.key().to_owned(), schema)
        };
        let properties: serde_json::Map<_, _> = Channel::ALL.into_iter().map(number).collect();
        schemars::json_schema!({
            "description": "One number per channel; null for one that is not measured.",
            "type": "object",
            "properties": properties,
            "required": Channel::ALL.map(Channel::key),
            "additionalProperties": false,
        })
    }
}

/// A pair of simultaneous observations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Time since frame 0 (s).
    pub time: f64,
    /// From the recording.
    pub measured: Observation<f64>,
    /// From the model.
    pub simulated: Observation<f64>,
}

/// Sums over pairs, and a thinned selection of them for plots.
#[derive(Debug, Clone, Default)]
pub struct Comparison {
    squares: PerChannel,
    amplitude: PerChannel,
    count: u64,
    thinned: Vec<Pair>,
    stride: u64,
}

/// Maximum number of pairs kept for plots: more than a page has pixel columns.
const THINNED_LIMIT: usize = 2048;

impl Comparison {
    /// Adds a pair.
    pub fn push(&mut self, pair: Pair) {
        for channel in Channel::ALL {
            let k = channel as usize;
            let gap = channel.gap(&pair.measured, &pair.simulated);
            self.squares.0[k] += gap * gap;
            let value = channel.value(&pair.measured).abs();
            // A channel that is not measured has no amplitude.
            if value > self.amplitude.0[k] || value.is_nan() {
                self.amplitude.0[k] = value;
            }
        }
        self.stride = self.stride.max(1);
        if self.count.is_multiple_of(self.stride) {
            if self.thinned.len() >= THINNED_LIMIT {
                let mut keep = false;
                self.thinned.retain(|_| {
                    keep = !keep;
                    keep
                });
                self.stride *= 2;
            }
            if self.count.is_multiple_of(self.stride) {
                self.thinned.push(pair);
            }
        }
        self.count += 1;
    }

    /// Number of pairs added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// RMS difference in each channel, SI units; angles in rad.
    #[expect(clippy::cast_precision_loss, reason = "counts of frames")]
    pub fn rms(&self) -> PerChannel {
        let count = self.count.max(1) as f64;
        PerChannel(self.squares.0.map(|sum| (sum / count).sqrt()))
    }

    /// Largest magnitude of the measured channel.
    pub fn amplitude(&self) -> PerChannel {
        self.amplitude
    }

    /// Pairs for plots, in order of time.
    pub fn series(&self) -> &[Pair] {
        &self.thinned
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::frame::AttitudeAngles;
    use bodyflight_core::frame::Vector;

    fn seen(roll: f64, speed: f64) -> Observation<f64> {
        Observation {
            angles: AttitudeAngles {
                heading: 0.0,
                pitch: 0.0,
                roll,
            },
            yaw_rate: 0.0,
            angular_velocity: Vector::new(3.0, 4.0, 0.0),
            horizontal_speed: speed,
            vertical_velocity: -50.0,
        }
    }

    #[test]
    fn gaps_add_up_and_angles_wrap() {
        let mut comparison = Comparison::default();
        for (time, speed) in [(0.0, 3.0), (1.0, 5.0)] {
            let (measured, simulated) = (seen(3.1, speed), seen(-3.1, speed - 2.0));
            comparison.push(Pair {
                time,
                measured,
                simulated,
            });
        }
        let rms = comparison.rms();
        assert!((rms.get(Channel::Roll) - (std::f64::consts::TAU - 6.2)).abs() < 1e-12);
        assert!((rms.get(Channel::HorizontalVelocity) - 2.0).abs() < 1e-12);
        assert!(rms.get(Channel::AngularVelocity).abs() < 1e-12);
        assert!((comparison.amplitude().get(Channel::AngularVelocity) - 5.0).abs() < 1e-12);
    }

    #[test]
    fn a_long_flight_keeps_a_bounded_even_series() {
        let mut comparison = Comparison::default();
        for k in 0..50_000 {
            let pair = Pair {
                time: f64::from(k),
                measured: seen(0.0, 1.0),
                simulated: seen(0.0, 1.0),
            };
            comparison.push(pair);
        }
        let series = comparison.series();
        assert!(series.len() <= THINNED_LIMIT && series.len() > THINNED_LIMIT / 4);
        let steps: Vec<f64> = series.windows(2).map(|w| w[1].time - w[0].time).collect();
        assert!(
            steps.iter().all(|step| (step - steps[0]).abs() < 1e-9),
            "{steps:?}"
        );
    }
}
