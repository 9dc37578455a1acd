//! Frames from a UDP socket.

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use super::datagram::Datagram;
use super::receiver::{Options, Receiver};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_io::udp::{Advice, LARGEST};
use bodyflight_mvnx::recording::FlightFrame;

/// The port that MVN sends to by default.
pub const DEFAULT_PORT: u16 = 9763;
/// Silence after which a sample is no longer waited for.
const SILENCE: Duration = Duration::from_millis(50);
/// What to do about an address that cannot be used.
pub(super) const ADVICE: Advice = Advice {
    in_use: "another program is listening there: stop it or use another port",
    port: DEFAULT_PORT,
};

/// Frames received live from MVN.
///
/// It follows a single machine: the one given in [`Options::sender`], otherwise the first that sends an MVN datagram.
/// Datagrams from others are counted and ignored.
///
/// As an iterator it waits for the next frame, and ends only with an error, such as Ctrl-C.
#[derive(Debug)]
pub struct Source {
    socket: UdpSocket,
    receiver: Receiver,
    /// The sender's machine, once known.
    sender: Option<IpAddr>,
    buffer: Vec<u8>,
}

impl Source {
    /// Listens at `address`: `host:port`, or `:port` for all networks of this machine.
    ///
    /// # Errors
    /// Returns an error if the address is invalid, or its port is in use.
    pub fn bind(address: &str) -> Result<Self> {
        Self::with_options(address, Options::default())
    }

    /// Same as [`Source::bind`], with options.
    ///
    /// # Errors
    /// Same as [`Source::bind`].
    pub fn with_options(address: &str, options: Options) -> Result<Self> {
        let socket = ADVICE.listen(address, SILENCE)?;
        Ok(Self {
            socket,
            receiver: Receiver::new(options),
            sender: options.sender,
            buffer: vec![0; LARGEST],
        })
    }

    /// The address it listens at.
    ///
    /// # Errors
    /// Returns an error if the system does not report it.
    pub fn local_address(&self) -> Result<SocketAddr> {
        ADVICE.local_address(&self.socket)
    }

    /// The receiver behind the socket, with its counters.
    pub fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// The next frame, `None` if none arrives within `patience`.
    ///
    /// # Errors
    /// Returns an error if the socket fails, the time codes do not advance and no rate is given, or Ctrl-C was pressed.
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<FlightFrame>> {
        let begin = Instant::now();
        loop {
            if self.receiver.time_stands_still() {
                return Err(Problem::bad_input(
                    "the sender's time codes do not advance, so its frames have no time",
                )
                .help("start the playback or recording in MVN, or give the rate with --rate"));
            }
            if let Some(frame) = self.receiver.next_frame() {
                return Ok(Some(frame));
            }
            interrupt::check()?;
            match self.socket.recv_from(&mut self.buffer) {
                Ok((length, from)) => self.take(length, from.ip()),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => self.receiver.flush(),
                    // Windows reports here that replies from this socket were refused.
                    ErrorKind::Interrupted | ErrorKind::ConnectionReset => {}
                    _ => return Err(ADVICE.problem("cannot receive", error)),
                },
            }
            if begin.elapsed() >= patience {
                return Ok(self.receiver.next_frame());
            }
        }
    }
}

impl Source {
    /// Takes a datagram from the followed machine, which is the first to send an MVN datagram.
    fn take(&mut self, length: usize, from: IpAddr) {
        let bytes = self.buffer.get(..length).unwrap_or_default();
        if self.sender.is_none() && Datagram::parse(bytes).is_ok() {
            self.sender = Some(from);
        }
        if self.sender.is_some_and(|sender| sender != from) {
            self.receiver.count_foreign();
        } else {
            self.receiver.push(bytes);
        }
    }
}

impl Iterator for Source {
    type Item = Result<FlightFrame>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(result) = self.next_within(Duration::MAX).transpose() {
                return Some(result);
            }
        }
    }
}
