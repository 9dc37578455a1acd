//! The viewer's page: a flight, its simulation and where they differ, in one HTML file that needs nothing else.
//!
//! [`run`] flies a recording and keeps what there is to see of it, [`estimated`] what a filter finds, [`shape`] the body, [`series`] makes it small, [`page`] puts it into the
//! page that `cargo xtask viewer` builds from `host/viewer`. [`server`] shows a page to this machine's browser and talks
//! to it; [`flown`] keeps what was flown there, [`live`] shows a stream, with an [`avatar`] beside the
//! measured body.

pub mod avatar;
pub mod estimated;
pub mod flown;
pub mod live;
pub mod page;
pub mod run;
pub mod series;
pub mod server;
pub mod shape;
#[cfg(test)]
mod typescript;
