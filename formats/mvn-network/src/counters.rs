//! Counters of what a receiver has received.

use serde::Serialize;

/// What has been received so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Counters {
    /// Datagrams of any kind.
    pub datagrams: u64,
    /// Datagrams that are not from MVN or are shorter than they claim.
    pub bad_datagrams: u64,
    /// Datagrams for other persons, or of kinds that a flight does not need.
    pub ignored_datagrams: u64,
    /// Datagrams from machines other than the sender's.
    pub foreign_datagrams: u64,
    /// Datagrams received before.
    pub repeated_datagrams: u64,
    /// Datagrams whose sample had already been handed out.
    pub late_datagrams: u64,
    /// Samples handed on, good or not.
    pub samples: u64,
    /// Samples of which nothing arrived.
    pub missing_samples: u64,
    /// Samples without the pose of the whole body.
    pub incomplete_samples: u64,
    /// Samples with impossible numbers.
    pub bad_samples: u64,
    /// Frames handed out.
    pub frames: u64,
    /// Frames whose velocity comes from differences.
    pub differenced_velocities: u64,
    /// Frames whose angular velocity comes from differences.
    pub differenced_angular_velocities: u64,
    /// Restarts of the sender.
    pub restarts: u64,
}
