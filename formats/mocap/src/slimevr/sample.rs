//! Samples of a sensor.

/// A sample of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// When its orientation arrived (s), or the first packet that overtook it. Trackers do not say when they measured.
    pub time_s: f64,
    /// A quaternion w, x, y, z from the tracker's axes to axes of which Z is up.
    pub orientation: [f64; 4],
    /// Acceleration without gravity as the tracker sent it (m/s2); `None` if it did not arrive.
    pub acceleration: Option<[f64; 3]>,
    /// Number of the packet.
    pub number: u64,
    /// Packets of the tracker that were lost since this sensor's sample before.
    pub lost: u64,
    /// Times the tracker had begun again before: its heading is another one each time.
    pub restarts: u64,
}

/// A sample, and whose it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Received {
    /// Place of the tracker in the server's list.
    pub tracker: usize,
    /// Number of the sensor in the tracker.
    pub sensor: u8,
    /// The sample.
    pub sample: Sample,
}
