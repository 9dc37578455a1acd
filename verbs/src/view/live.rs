//! A live stream for the page.

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
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::{DEFAULT_DENSITY, Flight};
use bodyflight_unit::stream::report::Live;

/// Parts after those of [`bodyflight_viewer::frame::LAYOUT`]: the measured body. `measured` has the channels in the
/// order of [`Channel::ALL`].
const MEASURED: [(&str, usize); 3] = [
    ("measured_position_m", 3),
    ("measured_attitude", 4),
    ("measured", 7),
];

/// Counts of data received from a network.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Received {
    /// Number of frames.
    pub frames: u64,
    /// Number of samples that never arrived, or not completely.
    pub lost: u64,
}

/// Data sent with each frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Look {
    /// Time of the flight (s).
    pub time_s: f64,
    /// Progress of a stream to a unit.
    pub stream: Option<Live>,
    /// Progress of a stream that is only listened to.
    pub received: Option<Received>,
    /// The simulated body, once its run has begun.
    pub avatar: Option<AvatarState>,
}

/// An answer to the page.
#[derive(Serialize)]
struct Note {
    note: &'static str,
}

/// A page that shows a stream: the measured body, and a simulated one that follows its postures.
///
/// Each update sends a frame (binary, [`bodyflight_viewer::frame`] of the simulated body, then the measured one) and
/// the [`Look`] that belongs to it (JSON). A binary message from the page restarts the simulated body.
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
    /// Returns an error if no port is free.
    pub fn start(flight: &Flight, title: String, provenance: Provenance) -> Result<Self> {
        let mut data = FlyData::new(&flight.subject, DEFAULT_DENSITY);
        data.layout.extend(MEASURED);
        let page = html(&PageData::of(Mode::Live, title, provenance, data))?;
        let restart = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&restart);
        let answer = move |_| {
            asked.store(true, Ordering::Relaxed);
            let note = "the simulated body restarts";
            serde_json::to_string(&Note { note }).unwrap_or_default()
        };
        Ok(Self {
            server: Server::start(page, Box::new(answer))?,
            avatar: None,
            flight: flight.clone(),
            restart,
        })
    }

    /// The page's address.
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// A file that leads a browser to the page, see [`Server::doorway`].
    ///
    /// # Errors
    /// Returns an error if the file cannot be created.
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

    /// Advances the simulated body to a frame. Call this with every frame.
    ///
    /// # Errors
    /// Returns an error if an effect of the flight has an implausible value.
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

    /// Sends the data to show for the frame that was followed last.
    ///
    /// # Errors
    /// Returns an error if the numbers cannot be written.
    pub fn show(
        &self,
        recorded: &FlightFrame,
        stream: Option<Live>,
        received: Option<Received>,
    ) -> Result<()> {
        // A source without velocities cannot be shown, but does not stop the stream.
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
    #[expect(clippy::cast_possible_truncation, reason = "precise enough to show")]
    numbers.chain(channels).map(|number| number as f32)
}
