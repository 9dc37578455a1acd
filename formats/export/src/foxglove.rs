//! Flights as MCAP files of messages in Foxglove's schemas: a moving body in 3D, and everything else as numbers to plot.

pub mod messages;
pub mod recording;
pub mod schemas;
