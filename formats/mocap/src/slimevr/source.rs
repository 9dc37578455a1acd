//! The server on the network.

use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use bodyflight_io::diagnostic::Result;
use bodyflight_io::udp::{Advice, LARGEST};

use super::server::{Received, Reply, Server};

/// The port at which trackers look for a server.
pub const DEFAULT_PORT: u16 = 6969;
/// Longest wait for a datagram.
const PATIENCE: Duration = Duration::from_millis(50);
/// Longest time in which datagrams are taken without a pause.
const AT_ONCE: Duration = Duration::from_millis(100);
/// What to do about an address that cannot be used.
const ADVICE: Advice = Advice {
    in_use: "another program is listening there, as SlimeVR's own server does: stop it first",
    port: DEFAULT_PORT,
};

/// A server that listens.
#[derive(Debug)]
pub struct Source {
    socket: UdpSocket,
    server: Server,
    begin: Instant,
    buffer: Vec<u8>,
    replies: Vec<Reply>,
}

impl Source {
    /// Listens at `address`: `host:port`, or `:port` for all networks of this machine.
    ///
    /// # Errors
    /// Returns an error if the address is invalid, or its port is in use.
    pub fn bind(address: &str) -> Result<Self> {
        let socket = ADVICE.listen(address, PATIENCE)?;
        Ok(Self {
            socket,
            server: Server::default(),
            begin: Instant::now(),
            buffer: vec![0; LARGEST],
            replies: Vec::new(),
        })
    }

    /// The address it listens at.
    ///
    /// # Errors
    /// Returns an error if the system does not report it.
    pub fn local_address(&self) -> Result<SocketAddr> {
        ADVICE.local_address(&self.socket)
    }

    /// The server behind the socket.
    pub fn server(&self) -> &Server {
        &self.server
    }

    /// Time since it began to listen (s).
    pub fn time_s(&self) -> f64 {
        self.begin.elapsed().as_secs_f64()
    }

    /// Takes what arrives within a short time, and sends what is due; samples go to `samples`.
    ///
    /// # Errors
    /// Returns an error if the socket fails.
    pub fn take(&mut self, samples: &mut Vec<Received>) -> Result<()> {
        let begin = Instant::now();
        loop {
            let received = self.socket.recv_from(&mut self.buffer);
            let time = self.time_s();
            self.server.tick(time, &mut self.replies);
            match received {
                Ok((length, from)) => {
                    let bytes = self.buffer.get(..length).unwrap_or_default();
                    self.server
                        .take(time, from, bytes, samples, &mut self.replies);
                }
                Err(error) => match error.kind() {
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                        self.answer();
                        return Ok(());
                    }
                    // Windows reports here that answers were refused.
                    ErrorKind::Interrupted | ErrorKind::ConnectionReset => {}
                    _ => return Err(ADVICE.problem("cannot receive", error)),
                },
            }
            self.answer();
            if begin.elapsed() >= AT_ONCE {
                return Ok(());
            }
        }
    }

    /// The samples that still wait for an acceleration, at the end.
    pub fn ended(&mut self) -> Vec<Received> {
        self.server.ended()
    }

    /// Sends what is due. An answer that cannot be sent is one that a tracker asks for again.
    fn answer(&mut self) {
        for (to, bytes) in self.replies.drain(..) {
            let _ = self.socket.send_to(&bytes, to);
        }
    }
}
