//! Sockets for datagrams: what addresses mean, and what to do if one cannot be used.

use std::io::{Error, ErrorKind};
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use crate::diagnostic::{Problem, Result};

/// Size of the largest datagram (bytes).
pub const LARGEST: usize = 65_536;

/// What to say of an address that cannot be used.
#[derive(Debug, Clone, Copy)]
pub struct Advice {
    /// What to do if another program listens there.
    pub in_use: &'static str,
    /// The port of the example of an address.
    pub port: u16,
}

impl Advice {
    /// A network problem, with the usual next step.
    pub fn problem(&self, message: &str, error: Error) -> Problem {
        let kind = error.kind();
        let problem = Problem::refused(message).caused_by(error);
        match kind {
            ErrorKind::AddrInUse => problem.help(self.in_use),
            ErrorKind::InvalidInput => problem.help(format!(
                "expected HOST:PORT, for example 192.168.1.20:{}, or :PORT to listen on all networks",
                self.port
            )),
            _ => problem,
        }
    }

    /// Listens at `address`: `host:port`, or `:port` for all networks of this machine. A read waits for `patience` at most.
    ///
    /// # Errors
    /// Returns an error if the address is invalid, or its port is in use.
    pub fn listen(&self, address: &str, patience: Duration) -> Result<UdpSocket> {
        let full = match address.strip_prefix(':') {
            Some(port) => format!("0.0.0.0:{port}"),
            None => address.to_owned(),
        };
        UdpSocket::bind(&full)
            .and_then(|socket| socket.set_read_timeout(Some(patience)).map(|()| socket))
            .map_err(|error| self.problem(&format!("cannot listen at {address}"), error))
    }

    /// The address of a socket.
    ///
    /// # Errors
    /// Returns an error if the system does not report it.
    pub fn local_address(&self, socket: &UdpSocket) -> Result<SocketAddr> {
        let address = socket.local_addr();
        address.map_err(|error| self.problem("cannot get the local address", error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADVICE: Advice = Advice {
        in_use: "stop the other program",
        port: 4711,
    };

    #[test]
    fn an_address_that_cannot_be_used_is_named_with_what_to_do() {
        let patience = Duration::from_millis(1);
        let socket = ADVICE.listen("127.0.0.1:0", patience).unwrap();
        let used = ADVICE.local_address(&socket).unwrap().to_string();
        let said = |address: &str| {
            let problem = ADVICE.listen(address, patience).unwrap_err();
            (problem.to_string(), problem.help.unwrap_or_default())
        };
        let (what, next) = said(&used);
        assert!(what.contains(&used), "{what}");
        assert_eq!(&*next, "stop the other program");
        let (_, next) = said("nothing");
        assert!(next.contains("192.168.1.20:4711"), "{next}");
        // A port alone is that of all networks.
        let all = ADVICE.listen(":0", patience).unwrap();
        let address = ADVICE.local_address(&all).unwrap();
        assert!(address.ip().is_unspecified());
    }
}
