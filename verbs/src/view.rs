//! The viewer's page: a flight, its simulation and their differences, in one self-contained HTML file.
//!
//! [`run`] simulates a recording and collects the data to show, [`full_rate`] those for changes, [`estimated`] adds the results of a filter and
//! [`shape`] the body. [`series`] compresses the data, and [`page`] puts them into the page that `cargo xtask viewer`
//! builds from `host/viewer`. [`server`] serves a page to this machine's browser and talks to it; [`flown`] saves
//! flights flown there, and [`live`] shows a stream, with an [`avatar`] beside the measured body.

pub mod avatar;
pub mod estimated;
pub mod flown;
pub mod full_rate;
pub mod live;
pub mod page;
pub mod run;
pub mod series;
pub mod server;
pub mod shape;
#[cfg(test)]
mod typescript;
