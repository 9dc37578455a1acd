//! The network stream of Xsens MVN over UDP: a live source of flight frames, and a sink that sends recordings.
//!
//! [`Source`] receives and [`Sink`] sends; [`Receiver`] turns datagrams into frames and needs no socket. Datagrams may
//! be truncated, repeated, late or lost; [`Counters`] counts each case. `docs/mvn.md` describes what is sent and
//! understood.

mod assembly;
mod clock;
mod counters;
mod datagram;
mod message;
mod rates;
mod receiver;
mod sink;
mod source;

pub use assembly::{REORDER_WINDOW, RESTART_DISTANCE};
pub use counters::Counters;
pub use datagram::{BadDatagram, Datagram, HEADER_LENGTH, Header, Kind};
pub use message::{
    AngularKinematics, JointAngles, LinearKinematics, Message, Scale, ScalePoint, SegmentPose,
};
pub use rates::{AngularUnit, DIFFERENCE_WINDOW};
pub use receiver::{Information, Options, Receiver};
pub use sink::{Sent, Sink, Speed, replay};
pub use source::{DEFAULT_PORT, Source};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
