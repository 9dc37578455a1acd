//! Recorded traffic: files of tcpdump and of Wireshark.

mod bytes;
mod pcapng;

use std::io::{BufReader, Read};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;

use bytes::{filled, number};
use pcapng::{Blocks, Next, SECTION};

/// Greatest length of a packet in a file.
const LONGEST: u32 = 262_144;
/// First number of a file of pcap, with times in microseconds and in nanoseconds.
const MICROSECONDS: u32 = 0xA1B2_C3D4;
const NANOSECONDS: u32 = 0xA1B2_3C4D;
/// Kinds of networks: loopback, Ethernet, IP alone, and two forms of Linux for all networks together.
const LOOPBACK: u32 = 0;
const ETHERNET: u32 = 1;
const IP_ALONE: u32 = 101;
const LINUX: u32 = 113;
const LINUX_2: u32 = 276;
const NETWORKS: [u32; 5] = [LOOPBACK, ETHERNET, IP_ALONE, LINUX, LINUX_2];
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
    packets: u64,
    form: Form,
    is_cut: bool,
}

/// How the packets are in a file.
enum Form {
    /// Pcap: all have heads of one kind, and were on networks of one kind.
    Same {
        is_little: bool,
        fraction_s: f64,
        network: u32,
    },
    /// Pcapng, and whether the type of its first block was read.
    Blocks(Blocks, bool),
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
        let mut first = [0; 4];
        let read = |error| Problem::system("read", path, error);
        let is_filled = filled(&mut file, &mut first).map_err(read)? == 4;
        let form = if is_filled && first == SECTION {
            Form::Blocks(Blocks::default(), true)
        } else {
            let mut head = [0; 20];
            let is_filled = is_filled && filled(&mut file, &mut head).map_err(read)? == 20;
            let form = if is_filled { same(first, &head) } else { None };
            let problem = || {
                Problem::bad_input(
                    "expected recorded traffic (pcap or pcapng), found something else",
                )
                .in_file(path)
                .help("record it with tcpdump -w FILE udp port 6969, or with Wireshark")
            };
            form.ok_or_else(problem)?
        };
        if let Form::Same { network, .. } = form
            && !NETWORKS.contains(&network)
        {
            return Err(Problem::bad_input(format!(
                "expected traffic of Ethernet, loopback or IP, found the kind {network}"
            ))
            .in_file(path)
            .help("record it on the computer that runs the server, not on the radio"));
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            packets: 0,
            form,
            is_cut: false,
        })
    }

    /// Whether the file ended in the middle of a packet.
    pub fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// The next UDP datagram; `None` at the end of the file, even if that is in the middle of a packet ([`Capture::is_cut`]).
    ///
    /// # Errors
    /// Returns an error if the file cannot be read, or is damaged.
    pub fn next_datagram(&mut self) -> Result<Option<Captured>> {
        loop {
            self.packets += 1;
            let next = self.form.next(&mut self.file);
            let next = next.map_err(|error| Problem::system("read", &self.path, error))?;
            let (network, time_s, bytes) = match next {
                Next::Packet(network, time_s, bytes) => (network, time_s, bytes),
                Next::End => return Ok(None),
                Next::Cut => {
                    self.is_cut = true;
                    return Ok(None);
                }
                Next::Damaged(length) => {
                    return Err(Problem::bad_input(format!(
                        "packet {}: found a length of {length} bytes, which is none: the file is damaged from here on",
                        self.packets
                    ))
                    .in_file(&self.path));
                }
            };
            let found = internet(&bytes, network).and_then(datagram);
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
}

/// The form by the first number of a file and what follows it; `None` if it is not pcap.
fn same(first: [u8; 4], head: &[u8]) -> Option<Form> {
    let little = u32::from_le_bytes(first);
    let is_little = matches!(little, MICROSECONDS | NANOSECONDS);
    let fraction_s = match number(&first, 0, is_little) {
        MICROSECONDS => 1e-6,
        NANOSECONDS => 1e-9,
        _ => return None,
    };
    Some(Form::Same {
        is_little,
        fraction_s,
        network: number(head, 16, is_little) & 0x0FFF_FFFF,
    })
}

impl Form {
    fn next(&mut self, file: &mut impl Read) -> std::io::Result<Next> {
        let (is_little, fraction_s, network) = match self {
            Self::Blocks(blocks, is_first) => {
                let before: &[u8] = if core::mem::take(is_first) {
                    &SECTION
                } else {
                    &[]
                };
                return blocks.next(file, before);
            }
            Self::Same {
                is_little,
                fraction_s,
                network,
            } => (*is_little, *fraction_s, *network),
        };
        let mut head = [0; 16];
        match filled(file, &mut head)? {
            0 => return Ok(Next::End),
            16 => {}
            _ => return Ok(Next::Cut),
        }
        let number = |at: usize| number(&head, at, is_little);
        let length = number(8);
        if length > LONGEST {
            return Ok(Next::Damaged(length));
        }
        let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
        if filled(file, &mut bytes)? < bytes.len() {
            return Ok(Next::Cut);
        }
        let time_s = f64::from(number(0)) + f64::from(number(4)) * fraction_s;
        Ok(Next::Packet(network, time_s, bytes))
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
        IP_ALONE => Some(bytes),
        _ => None,
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

    /// A number in either order of bytes.
    fn ordered(value: u32, is_little: bool) -> [u8; 4] {
        if is_little {
            value.to_le_bytes()
        } else {
            value.to_be_bytes()
        }
    }

    /// A packet with one datagram.
    fn packet(before: &[u8]) -> Vec<u8> {
        let content = b"0123456789";
        let mut packet = before.to_vec();
        packet.extend([
            0x45, 0, 0, 38, 0, 0, 0x40, 0, 64, 17, 0, 0, 192, 168, 1, 7, 192, 168, 1, 2,
        ]);
        packet.extend([0x1B, 0x39, 0x1B, 0x3A, 0, 18, 0, 0]);
        packet.extend(content);
        // Ethernet fills short packets up.
        packet.extend([0; 6]);
        packet
    }

    /// A file of pcap with one datagram.
    fn file(network: u32, before: &[u8], is_little: bool) -> Vec<u8> {
        let packet = packet(before);
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
        let mut bytes: Vec<u8> = head
            .into_iter()
            .flat_map(|value| ordered(value, is_little))
            .collect();
        bytes.extend(packet);
        bytes
    }

    /// A block of pcapng.
    fn block(kind: u32, mut content: Vec<u8>, is_little: bool) -> Vec<u8> {
        content.resize(content.len().next_multiple_of(4), 0);
        let length = ordered(u32::try_from(content.len() + 12).unwrap(), is_little);
        [&ordered(kind, is_little)[..], &length, &content, &length].concat()
    }

    /// A file of pcapng with the same datagram on the second of two networks, whose times are in units of 2^-10 s from 50 s on,
    /// between blocks that are not read.
    fn blocks(network: u32, before: &[u8], is_little: bool) -> Vec<u8> {
        let numbers = |values: &[u32]| -> Vec<u8> {
            let each = values.iter().flat_map(|value| ordered(*value, is_little));
            each.collect()
        };
        // Two halves in one number.
        let halves = |one: u32, other: u32| match is_little {
            true => one | other << 16,
            false => one << 16 | other,
        };
        let section = numbers(&[0x1A2B_3C4D, halves(1, 0), u32::MAX, u32::MAX]);
        let plain = numbers(&[halves(105, 0), 0]);
        let mut own = numbers(&[halves(network, 0), 0, halves(2, 2)]);
        own.extend(b"eth\0");
        own.extend(numbers(&[halves(9, 1)]));
        own.extend([0x80 | 10, 0, 0, 0]);
        let offset = if is_little { [50, 0] } else { [0, 50] };
        own.extend(numbers(&[halves(14, 8), offset[0], offset[1], 0]));
        let packet = packet(before);
        let length = u32::try_from(packet.len()).unwrap();
        let mut enhanced = numbers(&[1, 0, 50 * 1024 + 256, length, length]);
        enhanced.extend(packet);
        let name = vec![1; 40];
        let parts = [(1, plain), (1, own), (4, name), (6, enhanced)];
        let rest = parts.map(|(kind, content)| block(kind, content, is_little));
        let first = block(0x0A0D_0D0A, section, is_little);
        [first, rest.concat()].concat()
    }

    fn read(bytes: Vec<u8>) -> Result<(Vec<Captured>, bool)> {
        let mut capture = Capture::of(Box::new(std::io::Cursor::new(bytes)), Path::new("a.pcap"))?;
        let mut found = Vec::new();
        while let Some(captured) = capture.next_datagram()? {
            found.push(captured);
        }
        Ok((found, capture.is_cut()))
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
                for made in [file, blocks] {
                    let found = read(made(network, &before, is_little)).unwrap();
                    assert_eq!(found, (vec![expected.clone()], false), "{network}");
                }
            }
        }
    }

    #[test]
    fn other_files_are_refused_and_cut_ones_end() {
        let said = |bytes: &[u8]| read(bytes.to_vec()).unwrap_err().with_causes();
        assert!(said(b"time,x\n0,1\n").contains("something else"));
        assert!(said(&[&SECTION[..], &[0; 30]].concat()).contains("packet 1: found a length of 0"));
        assert!(said(&SECTION[..3]).contains("something else"));
        assert!(said(&file(105, &[], true)).contains("kind 105"));
        let whole = file(IP_ALONE, &[], true);
        for length in 24..whole.len() {
            let found = read(whole[..length].to_vec()).unwrap();
            assert_eq!(found, (Vec::new(), length > 24), "{length}");
        }
        let mut damaged = whole;
        damaged[35] = 0xFF;
        assert!(said(&damaged).contains("packet 1"));
        let whole = blocks(IP_ALONE, &[], false);
        let mut cut = 0;
        for length in 4..whole.len() {
            let (found, is_cut) = read(whole[..length].to_vec()).unwrap();
            assert!(found.is_empty(), "{length}");
            cut += u32::from(is_cut);
        }
        assert!(cut > 100, "{cut}");
        // Of another network, nothing is read.
        assert_eq!(read(blocks(105, &[], true)).unwrap(), (Vec::new(), false));
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

        #[test]
        fn no_blocks_stop_it(mut rest: Vec<u8>, at in 4_usize..200, is_little: bool) {
            let mut bytes = blocks(IP_ALONE, &[], is_little);
            bytes.truncate(at);
            bytes.append(&mut rest);
            let _ = read(bytes);
        }
    }
}
