//! A live stream, for the page.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bodyflight_core::dynamics::Motion;
use bodyflight_core::observation::Observation;
use bodyflight_viewer::frame::frame;
use serde::Serialize;
use tungstenite::Message;

use super::avatar::{Avatar, AvatarState};
use super::page::{FlyData, Mode, PageData, Provenance, html};
use super::server::Server;
use crate::diagnostic::{Problem, Result};
use crate::formats::flight::{DEFAULT_DENSITY, Flight};
use crate::formats::recording::FlightFrame;
use crate::interrupt;
use crate::replay::comparison::Channel;
use crate::unit::stream::report::Live;

/// What follows the parts of [`bodyflight_viewer::frame::LAYOUT`]: the measured body. `measured` are the channels in the order
/// of [`Channel::ALL`].
const MEASURED: [(&str, usize); 3] = [
    ("measured_position_m", 3),
    ("measured_attitude", 4),
    ("measured", 7),
];

/// What came over a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Received {
    /// Frames.
    pub frames: u64,
    /// Samples that never came, or not whole.
    pub lost: u64,
}

/// What goes with a picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Look {
    /// Time of the flight (s).
    pub time_s: f64,
    /// Progress of a stream to a unit.
    pub stream: Option<Live>,
    /// Progress of a stream that is only listened to.
    pub received: Option<Received>,
    /// The simulated body, once it flies.
    pub avatar: Option<AvatarState>,
}

/// An answer to the page.
#[derive(Serialize)]
struct Note {
    note: &'static str,
}

/// A page that shows a stream: the measured body, and a simulated one that follows its postures.
///
/// For each look it is sent a frame (binary, [`bodyflight_viewer::frame`] of the simulated body, then the measured one) and then
/// the [`Look`] that goes with it (JSON). A binary message of the page asks the simulated body to begin anew.
pub struct LiveView {
    server: Server,
    avatar: Option<Avatar>,
    flight: Flight,
    restart: Arc<AtomicBool>,
}

impl LiveView {
    /// Starts serving the page.
    ///
    /// # Errors
    /// Returns an error if the program was built without the page, or no port is free.
    pub fn start(flight: &Flight, title: String, provenance: Provenance) -> Result<Self> {
        let mut data = FlyData::new(&flight.subject, DEFAULT_DENSITY);
        data.layout.extend(MEASURED);
        let page = html(&PageData::of(Mode::Live, title, provenance, data))?;
        let restart = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&restart);
        let answer = move |_| {
            asked.store(true, Ordering::Relaxed);
            let note = "the simulated body begins anew";
            serde_json::to_string(&Note { note }).unwrap_or_default()
        };
        Ok(Self {
            server: Server::start(page, Box::new(answer))?,
            avatar: None,
            flight: flight.clone(),
            restart,
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

    /// Takes the simulated body on to a frame. To be called with every frame.
    ///
    /// # Errors
    /// Returns an error if an effect of the flight has a value that is not plausible.
    pub fn follow(&mut self, recorded: &FlightFrame) -> Result<()> {
        match &mut self.avatar {
            None => self.avatar = Some(Avatar::new(&self.flight, recorded)?),
            Some(avatar) => {
                if self.restart.swap(false, Ordering::Relaxed) {
                    avatar.restart();
                }
                avatar.follow(recorded);
            }
        }
        Ok(())
    }

    /// Sends what there is to see at the frame that was followed last.
    ///
    /// # Errors
    /// Returns an error if the numbers cannot be written.
    pub fn show(
        &self,
        recorded: &FlightFrame,
        stream: Option<Live>,
        received: Option<Received>,
    ) -> Result<()> {
        // A source without velocities is shown without forces of its own: nothing to see is no reason to stop.
        if let (Ok(measured), Some(avatar)) = (recorded.motion(), &self.avatar) {
            let inputs = self.flight.inputs_at(recorded.time);
            let (simulated, inputs) = avatar.motion().unwrap_or((&measured, &inputs));
            let dynamics = &avatar.model().dynamics;
            let (posture, time) = (&recorded.posture, recorded.time);
            let numbers = frame(dynamics, inputs, posture, simulated, time);
            let numbers = numbers.into_iter().chain(measured_part(&measured));
            let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
            self.server.send(&Message::binary(bytes));
        }
        let look = Look {
            time_s: recorded.time,
            stream,
            received,
            avatar: self.avatar.as_ref().and_then(Avatar::state),
        };
        let text = serde_json::to_string(&look)
            .map_err(|error| Problem::internal("cannot write JSON").caused_by(error))?;
        self.server.send(&Message::text(text));
        Ok(())
    }
}

/// The numbers of [`MEASURED`].
fn measured_part(motion: &Motion<f64>) -> impl Iterator<Item = f32> {
    let attitude = motion.inertial_from_body.quaternion();
    let seen = Observation::of(motion);
    let channels = Channel::ALL.map(|channel| channel.value(&seen));
    let numbers = motion.position.to_array().into_iter();
    let numbers = numbers.chain([attitude.w, attitude.i, attitude.j, attitude.k]);
    #[expect(clippy::cast_possible_truncation, reason = "for the eye")]
    numbers.chain(channels).map(|number| number as f32)
}
