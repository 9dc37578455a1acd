//! What a receiver has met, counted.

use schemars::JsonSchema;
use serde::Serialize;

/// What has come in so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, JsonSchema, Serialize)]
pub struct Counters {
    /// Datagrams of any kind.
    pub datagrams: u64,
    /// Datagrams that are not from MVN or are shorter than they claim.
    pub bad_datagrams: u64,
    /// Datagrams of other persons and of kinds that a flight does not need.
    pub ignored_datagrams: u64,
    /// Datagrams from other machines than the sender's.
    pub foreign_datagrams: u64,
    /// Datagrams that had come before.
    pub repeated_datagrams: u64,
    /// Datagrams whose sample was given already.
    pub late_datagrams: u64,
    /// Samples given on, good or not.
    pub samples: u64,
    /// Samples of which nothing came.
    pub missing_samples: u64,
    /// Samples without the pose of the whole body.
    pub incomplete_samples: u64,
    /// Samples with impossible numbers.
    pub bad_samples: u64,
    /// Frames handed out.
    pub frames: u64,
    /// Frames whose velocity is from differences.
    pub differenced_velocities: u64,
    /// Frames whose angular velocity is from differences.
    pub differenced_angular_velocities: u64,
    /// Times the sender started anew.
    pub restarts: u64,
}
