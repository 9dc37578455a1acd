//! Frames from a UDP socket.

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use super::datagram::Datagram;
use super::receiver::{Options, Receiver};
use crate::diagnostic::{Problem, Result};
use crate::formats::recording::FlightFrame;
use crate::interrupt;

/// The port that MVN sends to unless told otherwise.
pub const DEFAULT_PORT: u16 = 9763;
/// Silence after which a sample is not waited for any longer.
const SILENCE: Duration = Duration::from_millis(50);
/// Most bytes of a datagram.
const LARGEST: usize = 65_536;

/// Frames as MVN sends them, live.
///
/// It follows one machine, the first to send anything of MVN, or the one of [`Options::sender`]; what others send is
/// counted and left.
///
/// As an iterator it waits for the next frame and never ends but with a problem, Ctrl-C being one.
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
    /// Returns an error if the address is none, or its port is taken.
    pub fn bind(address: &str) -> Result<Self> {
        Self::with_options(address, Options::default())
    }

    /// As [`Source::bind`], with options.
    ///
    /// # Errors
    /// Same as [`Source::bind`].
    pub fn with_options(address: &str, options: Options) -> Result<Self> {
        let full = match address.strip_prefix(':') {
            Some(port) => format!("0.0.0.0:{port}"),
            None => address.to_owned(),
        };
        let socket = UdpSocket::bind(&full)
            .and_then(|socket| socket.set_read_timeout(Some(SILENCE)).map(|()| socket))
            .map_err(|error| network(&format!("cannot listen at {address}"), error))?;
        Ok(Self {
            socket,
            receiver: Receiver::new(options),
            sender: options.sender,
            buffer: vec![0; LARGEST],
        })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// Returns an error if the system does not tell.
    pub fn local_address(&self) -> Result<SocketAddr> {
        self.socket
            .local_addr()
            .map_err(|error| network("cannot tell the address", error))
    }

    /// What was received.
    pub fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// The next frame, `None` where none comes within `patience`.
    ///
    /// # Errors
    /// Returns an error if the socket fails, the time codes stand still and no rate is given, or Ctrl-C was pressed.
    pub fn next_within(&mut self, patience: Duration) -> Result<Option<FlightFrame>> {
        let begin = Instant::now();
        loop {
            if self.receiver.time_stands_still() {
                return Err(Problem::bad_input(
                    "the time codes of the sender stand still, so its frames have no time",
                )
                .help("start the playback or recording in MVN, or say the rate with --rate"));
            }
            if let Some(frame) = self.receiver.next_frame() {
                return Ok(Some(frame));
            }
            interrupt::check()?;
            match self.socket.recv_from(&mut self.buffer) {
                Ok((length, from)) => self.take(length, from.ip()),
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => self.receiver.flush(),
                    // Windows tells a receiver that its own answers were refused.
                    ErrorKind::Interrupted | ErrorKind::ConnectionReset => {}
                    _ => return Err(network("cannot receive", error)),
                },
            }
            if begin.elapsed() >= patience {
                return Ok(self.receiver.next_frame());
            }
        }
    }
}

impl Source {
    /// Takes a datagram of the one sender: whoever sent the first that is of MVN.
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

/// A problem of the network, with the usual next step.
pub(super) fn network(message: &str, error: std::io::Error) -> Problem {
    let kind = error.kind();
    let problem = Problem::refused(message).caused_by(error);
    match kind {
        ErrorKind::AddrInUse => problem.help("another program listens there: end it or take another port"),
        ErrorKind::InvalidInput => problem.help(format!(
            "expected HOST:PORT, for example 192.168.1.20:{DEFAULT_PORT}, or :PORT to listen on all networks"
        )),
        _ => problem,
    }
}
