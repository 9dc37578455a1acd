//! A live stream, for the page.

use std::time::Duration;

use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::estimator::inputs_of;
use bodyflight_viewer::frame::frame;
use tungstenite::Message;

use super::page::{FlyData, Mode, PageData, Provenance, html};
use super::server::Server;
use crate::diagnostic::{Problem, Result};
use crate::formats::flight::{DEFAULT_DENSITY, Flight};
use crate::formats::recording::FlightFrame;
use crate::interrupt;
use crate::unit::stream::report::Live;

/// A page that shows a stream.
///
/// For each look it is sent the frame (binary, [`bodyflight_viewer::frame`]) and then the [`Live`] that goes with it
/// (JSON).
pub struct LiveView {
    server: Server,
    dynamics: Option<Dynamics<f64>>,
    flight: Flight,
}

impl LiveView {
    /// Starts serving the page.
    ///
    /// # Errors
    /// Returns an error if the program was built without the page, or no port is free.
    pub fn start(flight: &Flight, title: String, provenance: Provenance) -> Result<Self> {
        let subject = &flight.subject;
        let data = FlyData::new(subject, DEFAULT_DENSITY);
        let page = html(&PageData::of(Mode::Live, title, provenance, data))?;
        let deaf = |_| String::from("this page only listens");
        Ok(Self {
            server: Server::start(page, Box::new(deaf))?,
            dynamics: None,
            flight: flight.clone(),
        })
    }

    /// Where the page is.
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// The way to the page for a browser, see [`Server::doorway`].
    ///
    /// # Errors
    /// Returns an error if the system refuses a file.
    pub fn doorway(&self) -> Result<tempfile::NamedTempFile> {
        self.server.doorway()
    }

    /// Waits until a page is open.
    ///
    /// # Errors
    /// Returns an error if Ctrl-C was pressed.
    pub fn await_page(&self) -> Result<()> {
        while self.server.listening() == 0 {
            interrupt::check()?;
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(())
    }

    /// Sends what there is to see at a frame of the flight.
    ///
    /// # Errors
    /// Returns an error if the numbers cannot be written.
    pub fn show(&mut self, live: &Live, recorded: &FlightFrame) -> Result<()> {
        let height = recorded.pelvis.position.up();
        let dynamics = self
            .dynamics
            .get_or_insert_with(|| self.flight.dynamics(height));
        let inputs = live.estimate.map_or_else(Inputs::belly_turn, |estimate| {
            inputs_of(&estimate.state.map(f64::from).into())
        });
        // A source without velocities is shown without forces of its own: nothing to see is no reason to stop.
        if let Ok(motion) = recorded.motion() {
            let numbers = frame(dynamics, &inputs, &recorded.posture, &motion, recorded.time);
            let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
            self.server.send(&Message::binary(bytes));
        }
        let text = serde_json::to_string(live)
            .map_err(|error| Problem::internal("cannot write JSON").caused_by(error))?;
        self.server.send(&Message::text(text));
        Ok(())
    }
}
