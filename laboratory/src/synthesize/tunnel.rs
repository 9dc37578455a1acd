//! Contacts of a flight in a wind tunnel with wall, net and top.

use bodyflight_core::frame::{Inertial, Vector};
use serde::Serialize;

/// A flight in a wind tunnel 4.2 m wide, which begins in the middle, 3 m above the net and 8 m below the top.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Tunnel {
    /// Speed of the airflow (m/s).
    pub stream_mps: f64,
    /// When the pelvis first reaches the wall (s).
    pub wall_s: Option<f64>,
    /// When it first reaches the net (s).
    pub net_s: Option<f64>,
    /// When it first rises above the top (s).
    pub top_s: Option<f64>,
}

impl Tunnel {
    const RADIUS: f64 = 2.1;
    const NET: f64 = -3.0;
    const TOP: f64 = 8.0;

    /// A tunnel with this airflow, without contacts.
    pub(super) const fn new(stream_mps: f64) -> Self {
        Self {
            stream_mps,
            wall_s: None,
            net_s: None,
            top_s: None,
        }
    }

    /// Records contacts at the pelvis position, relative to its start.
    pub(super) fn see(&mut self, time: f64, position: &Vector<f64, Inertial>) {
        let aside = position.north().hypot(position.west());
        let above = position.up();
        for (first, met) in [
            (&mut self.wall_s, aside > Self::RADIUS),
            (&mut self.net_s, above < Self::NET),
            (&mut self.top_s, above > Self::TOP),
        ] {
            if met {
                first.get_or_insert(time);
            }
        }
    }
}

impl std::fmt::Display for Tunnel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "stream {:.1} m/s", self.stream_mps)?;
        for (what, time) in [
            ("wall", self.wall_s),
            ("net", self.net_s),
            ("top", self.top_s),
        ] {
            match time {
                Some(time) => write!(f, ", {what} reached after {time:.1} s")?,
                None => write!(f, ", {what} not reached")?,
            }
        }
        Ok(())
    }
}
