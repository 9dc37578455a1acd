//! Recorded traffic: files of tcpdump, and of Wireshark if they are saved as pcap.

use std::io::{BufReader, ErrorKind, Read};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

/// Greatest length of a packet in a file.
const LONGEST: u32 = 262_144;
/// First bytes of a file of pcapng.
const PCAPNG: [u8; 4] = [0x0A, 0x0D, 0x0D, 0x0A];
/// First number of a file, with times in microseconds and in nanoseconds.
const MICROSECONDS: u32 = 0xA1B2_C3D4;
const NANOSECONDS: u32 = 0xA1B2_3C4D;
/// Kinds of networks: loopback, Ethernet, IP alone, and two forms of Linux for all networks together.
const LOOPBACK: u32 = 0;
const ETHERNET: u32 = 1;
const IP_ALONE: u32 = 101;
const LINUX: u32 = 113;
const LINUX_2: u32 = 276;
/// Protocols by the numbers of Ethernet and of IP.
const VLAN: u16 = 0x8100;
const UDP: u8 = 17;

/// A datagram in recorded traffic.
#[derive(Debug, Clone, PartialEq)]
pub struct Captured {
    /// When it was recorded (s since 1970).
    pub time_s: f64,
    /// Who sent it.
    pub from: SocketAddr,
    /// The port that it was sent to.
    pub to_port: u16,
    /// Its content.
    pub bytes: Vec<u8>,
}

/// A file of recorded traffic, read packet by packet.
pub struct Capture {
    file: Box<dyn Read>,
    path: PathBuf,
    is_little: bool,
    fraction_s: f64,
    network: u32,
    packets: u64,
}

impl Capture {
    /// Opens a file, possibly compressed.
    ///
    /// # Errors
    /// Returns an error if it cannot be read, or is not recorded traffic of a kind of network that is known.
    pub fn open(path: &Path) -> Result<Self> {
        Self::of(Box::new(BufReader::new(input::open(path)?)), path)
    }

    /// Same as [`Capture::open`], for bytes.
    ///
    /// # Errors
    /// Same as [`Capture::open`].
    pub fn of(mut file: Box<dyn Read>, path: &Path) -> Result<Self> {
        let refused = |message: String| Err(Problem::bad_input(message).in_file(path));
        let mut head = [0; 24];
        let read =
            filled(&mut file, &mut head).map_err(|error| Problem::system("read", path, error))?;
        let save = "save it as pcap: tcpdump -w FILE udp port 6969, or Wireshark, Save As, pcap";
        if head.starts_with(&PCAPNG) {
            return refused("expected recorded traffic as pcap, found pcapng".to_owned())
                .map_err(|problem| problem.help(save));
        }
        let [a, b, c, d] = [head[0], head[1], head[2], head[3]];
        let is_little = matches!(u32::from_le_bytes([a, b, c, d]), MICROSECONDS | NANOSECONDS);
        let number = |at: usize| number(&head, at, is_little);
        let fraction_s = match number(0) {
            MICROSECONDS if read => 1e-6,
            NANOSECONDS if read => 1e-9,
            _ => {
                return refused(
                    "expected recorded traffic (pcap), found something else".to_owned(),
                )
                .map_err(|problem| problem.help(save));
            }
        };
        let network = number(20) & 0x0FFF_FFFF;
        if ![LOOPBACK, ETHERNET, IP_ALONE, LINUX, LINUX_2].contains(&network) {
            return refused(format!(
                "expected traffic of Ethernet, loopback or IP, found the kind {network}"
            ))
            .map_err(|problem| {
                problem.help("record it on the computer that runs the server, not on the radio")
            });
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            is_little,
            fraction_s,
            network,
            packets: 0,
        })
    }

    /// The next UDP datagram; `None` at the end of the file, even if that is in the middle of a packet.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or is damaged.
    pub fn next_datagram(&mut self) -> Result<Option<Captured>> {
        loop {
            let mut head = [0; 16];
            if !self.filled(&mut head)? {
                return Ok(None);
            }
            self.packets += 1;
            let number = |at: usize| number(&head, at, self.is_little);
            let length = number(8);
            if length > LONGEST {
                return Err(Problem::bad_input(format!(
                    "packet {}: expected at most {LONGEST} bytes, found {length}: the file is damaged from here on",
                    self.packets
                ))
                .in_file(&self.path));
            }
            let time_s = f64::from(number(0)) + f64::from(number(4)) * self.fraction_s;
            let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
            if !self.filled(&mut bytes)? {
                return Ok(None);
            }
            let found = internet(&bytes, self.network).and_then(datagram);
            if let Some((from, to_port, content)) = found {
                return Ok(Some(Captured {
                    time_s,
                    from,
                    to_port,
                    bytes: content.to_vec(),
                }));
            }
        }
    }

    fn filled(&mut self, bytes: &mut [u8]) -> Result<bool> {
        filled(&mut self.file, bytes).map_err(|error| Problem::system("read", &self.path, error))
    }
}

/// Whether there were enough bytes.
fn filled(file: &mut impl Read, bytes: &mut [u8]) -> std::io::Result<bool> {
    match file.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// The number at a place.
fn number(bytes: &[u8], at: usize, is_little: bool) -> u32 {
    let part = bytes.get(at..).and_then(<[u8]>::first_chunk::<4>);
    let part = part.copied().unwrap_or_default();
    if is_little {
        u32::from_le_bytes(part)
    } else {
        u32::from_be_bytes(part)
    }
}

fn short(bytes: &[u8], at: usize) -> Option<u16> {
    let part = bytes.get(at..)?.first_chunk::<2>()?;
    Some(u16::from_be_bytes(*part))
}

/// What follows the head of the network.
fn internet(bytes: &[u8], network: u32) -> Option<&[u8]> {
    match network {
        LOOPBACK => bytes.get(4..),
        ETHERNET => bytes.get(if short(bytes, 12)? == VLAN { 18 } else { 14 }..),
        LINUX => bytes.get(16..),
        LINUX_2 => bytes.get(20..),
        _ => Some(bytes),
    }
}

/// Sender, port of the receiver and content of a datagram of UDP that is whole.
fn datagram(bytes: &[u8]) -> Option<(SocketAddr, u16, &[u8])> {
    let (from, rest): (IpAddr, &[u8]) = match bytes.first()? >> 4 {
        4 => {
            let head = usize::from(bytes.first()? & 0x0F) * 4;
            // Parts of a larger one are left out: trackers send small ones.
            let is_part = short(bytes, 6)? & 0x3FFF != 0;
            if head < 20 || is_part || *bytes.get(9)? != UDP {
                return None;
            }
            let from: [u8; 4] = *bytes.get(12..)?.first_chunk()?;
            (Ipv4Addr::from(from).into(), bytes.get(head..)?)
        }
        6 => {
            if *bytes.get(6)? != UDP {
                return None;
            }
            let from: [u8; 16] = *bytes.get(8..)?.first_chunk()?;
            (Ipv6Addr::from(from).into(), bytes.get(40..)?)
        }
        _ => return None,
    };
    let length = usize::from(short(rest, 4)?);
    let content = rest.get(8..length)?;
    Some((
        SocketAddr::new(from, short(rest, 0)?),
        short(rest, 2)?,
        content,
    ))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A file with one datagram, with numbers in either order of bytes.
    fn file(network: u32, before: &[u8], is_little: bool) -> Vec<u8> {
        let number = |value: u32| {
            if is_little {
                value.to_le_bytes()
            } else {
                value.to_be_bytes()
            }
        };
        let content = b"0123456789";
        let mut packet = before.to_vec();
        packet.extend([
            0x45, 0, 0, 38, 0, 0, 0x40, 0, 64, 17, 0, 0, 192, 168, 1, 7, 192, 168, 1, 2,
        ]);
        packet.extend([0x1B, 0x39, 0x1B, 0x3A, 0, 18, 0, 0]);
        packet.extend(content);
        // Ethernet fills short packets up.
        packet.extend([0; 6]);
        let length = u32::try_from(packet.len()).unwrap();
        let head = [
            MICROSECONDS,
            0,
            0,
            0,
            LONGEST,
            network,
            100,
            250_000,
            length,
            length,
        ];
        let mut bytes: Vec<u8> = head.into_iter().flat_map(number).collect();
        bytes.extend(packet);
        bytes
    }

    fn read(bytes: Vec<u8>) -> Result<Vec<Captured>> {
        let mut capture = Capture::of(Box::new(std::io::Cursor::new(bytes)), Path::new("a.pcap"))?;
        let mut found = Vec::new();
        while let Some(captured) = capture.next_datagram()? {
            found.push(captured);
        }
        Ok(found)
    }

    #[test]
    fn datagrams_of_every_kind_of_network_are_found() {
        let expected = Captured {
            time_s: 100.25,
            from: SocketAddr::from(([192, 168, 1, 7], 6969)),
            to_port: 6970,
            bytes: b"0123456789".to_vec(),
        };
        let ethernet = [[0; 12].as_slice(), &[8, 0]].concat();
        let tagged = [[0; 12].as_slice(), &[0x81, 0, 0, 1, 8, 0]].concat();
        for (network, before) in [
            (LOOPBACK, vec![2, 0, 0, 0]),
            (ETHERNET, ethernet),
            (ETHERNET, tagged),
            (IP_ALONE, vec![]),
            (LINUX, vec![0; 16]),
            (LINUX_2, vec![0; 20]),
        ] {
            for is_little in [true, false] {
                let found = read(file(network, &before, is_little)).unwrap();
                assert_eq!(found, std::slice::from_ref(&expected), "{network}");
            }
        }
    }

    #[test]
    fn other_files_are_refused_and_cut_ones_end() {
        let said = |bytes: &[u8]| read(bytes.to_vec()).unwrap_err().with_causes();
        assert!(said(b"time,x\n0,1\n").contains("something else"));
        assert!(said(&[&[0x0A, 0x0D, 0x0D, 0x0A][..], &[0; 30]].concat()).contains("pcapng"));
        assert!(said(&file(105, &[], true)).contains("kind 105"));
        let whole = file(IP_ALONE, &[], true);
        for length in 24..whole.len() {
            assert!(read(whole[..length].to_vec()).unwrap().is_empty());
        }
        let mut damaged = whole;
        damaged[35] = 0xFF;
        assert!(said(&damaged).contains("packet 1"));
    }

    proptest! {
        #[test]
        fn no_bytes_stop_it(network in 0_u32..2, mut rest: Vec<u8>, at in 24_usize..90) {
            let mut bytes = file(network, &[0; 14], true);
            let at = at.min(bytes.len());
            bytes.truncate(at);
            bytes.append(&mut rest);
            let _ = read(bytes);
        }
    }
}
