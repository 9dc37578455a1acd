//! Simulated lines that deliver packets, like those of boards.

use core::cell::Cell;
use std::collections::VecDeque;
use std::vec::Vec;

use embassy_futures::{block_on, poll_once};
use embedded_io_async::ErrorKind;

use super::*;

/// A simulated line: packets that it will receive, and bytes that were sent to it.
#[derive(Default)]
struct Line<'a> {
    hears: VecDeque<Result<Vec<u8>, ErrorKind>>,
    told: Vec<u8>,
    open: Option<&'a Cell<bool>>,
}

impl<'a> Line<'a> {
    fn hearing(packets: &[&[u8]]) -> Self {
        Self {
            hears: packets.iter().map(|packet| Ok(packet.to_vec())).collect(),
            ..Self::default()
        }
    }

    fn opened(self, open: &'a Cell<bool>) -> Self {
        Self {
            open: Some(open),
            ..self
        }
    }
}

impl Opened for Line<'_> {
    fn is_open(&self) -> bool {
        self.open.is_some_and(Cell::get)
    }
}

impl ErrorType for Line<'_> {
    type Error = ErrorKind;
}

impl Read for Line<'_> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, ErrorKind> {
        let Some(packet) = self.hears.pop_front() else {
            return core::future::pending().await;
        };
        let packet = packet?;
        bytes[..packet.len()].copy_from_slice(&packet);
        Ok(packet.len())
    }
}

impl Write for Line<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.told.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Reads everything that is available without waiting.
fn heard(line: &mut impl Read) -> Vec<u8> {
    let mut all = Vec::new();
    let mut bytes = [0; 128];
    while let core::task::Poll::Ready(Ok(count)) = poll_once(line.read(&mut bytes)) {
        all.extend_from_slice(&bytes[..count]);
    }
    all
}

#[test]
fn the_second_line_is_used_while_the_first_is_closed() {
    let open = Cell::new(false);
    let usb = Line::default().opened(&open);
    let mut both = Preferred(usb, Line::hearing(&[b"hello", b" unit"]));
    assert_eq!(heard(&mut both), b"hello unit");
    block_on(both.write(b"here")).unwrap();
    assert_eq!(
        (both.0.told.as_slice(), both.1.told.as_slice()),
        (&b""[..], &b"here"[..])
    );
}

#[test]
fn noise_on_the_second_line_does_not_reach_a_host_on_the_first() {
    let open = Cell::new(true);
    let usb = Line::hearing(&[b"hello"]).opened(&open);
    let mut both = Preferred(usb, Line::hearing(&[b"\xff\x00", b"\xfe"]));
    assert_eq!(heard(&mut both), b"hello");
    block_on(both.write(b"here")).unwrap();
    assert_eq!(
        (both.0.told.as_slice(), both.1.told.as_slice()),
        (&b"here"[..], &b""[..])
    );
    assert!(both.1.hears.is_empty(), "read, so that it does not overrun");
}

#[test]
fn errors_of_a_receiver_are_reported_and_counted() {
    static ERRORS: LineErrors = LineErrors::new();
    let mut line = Line::hearing(&[b"a"]);
    line.hears.push_front(Err(ErrorKind::OutOfMemory));
    line.hears.push_front(Err(ErrorKind::InvalidData));
    line.hears.push_front(Err(ErrorKind::InvalidData));
    let mut line = Counted::new(line, &ERRORS, |error| *error == ErrorKind::OutOfMemory);
    let mut bytes = [0; 4];
    for _ in 0..3 {
        block_on(line.read(&mut bytes)).unwrap_err();
    }
    assert_eq!(block_on(line.read(&mut bytes)), Ok(1));
    assert_eq!(ERRORS.counted(), [1, 2]);
}
