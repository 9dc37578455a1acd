//! Connections that have not sent their request yet.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::net::{Shutdown, TcpStream};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest request head (bytes).
const LONGEST_HEAD: usize = 16 * 1024;

/// Time allowed for a complete head.
const HEAD_TIME: Duration = Duration::from_secs(5);

/// Number of connections that may wait; with one more, the oldest is closed.
const MOST_WAITING: usize = 64;

const END_OF_HEAD: &[u8] = b"\r\n\r\n";

/// Connections whose request is incomplete, oldest first.
#[derive(Default)]
pub(super) struct WaitingRoom {
    waiting: Mutex<Waiting>,
}

#[derive(Default)]
struct Waiting {
    next: u64,
    streams: VecDeque<(u64, TcpStream)>,
}

impl WaitingRoom {
    /// Reads the head of a request and not a byte more, since the rest belongs to the socket.
    ///
    /// # Errors
    /// Returns an error if the head is late or too long, or if the connection was closed as the oldest of too many.
    pub(super) fn read_head(&self, stream: &mut TcpStream) -> io::Result<Vec<u8>> {
        let number = self.enter(stream.try_clone()?);
        let head = read_head(stream, Instant::now() + HEAD_TIME);
        self.leave(number);
        head
    }

    fn enter(&self, stream: TcpStream) -> u64 {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        while waiting.streams.len() >= MOST_WAITING {
            if let Some((_, oldest)) = waiting.streams.pop_front() {
                // Its thread notices the end of its input.
                let _ = oldest.shutdown(Shutdown::Both);
            }
        }
        let number = waiting.next;
        waiting.next += 1;
        waiting.streams.push_back((number, stream));
        number
    }

    fn leave(&self, number: u64) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.streams.retain(|(waits, _)| *waits != number);
    }
}

fn read_head(stream: &mut TcpStream, end: Instant) -> io::Result<Vec<u8>> {
    let mut head = Vec::new();
    let mut piece = [0; 1024];
    loop {
        stream.set_read_timeout(Some(left_until(end)?))?;
        let ahead = stream.peek(&mut piece)?;
        let begin = head.len();
        head.extend_from_slice(piece.get(..ahead).unwrap_or_default());
        let searched = begin.saturating_sub(END_OF_HEAD.len() - 1);
        let rest = head.get(searched..).unwrap_or_default();
        let found = rest
            .windows(END_OF_HEAD.len())
            .position(|bytes| bytes == END_OF_HEAD);
        if let Some(place) = found {
            head.truncate(searched + place + END_OF_HEAD.len());
        }
        let taken = piece.get_mut(..head.len() - begin).unwrap_or_default();
        stream.read_exact(taken)?;
        if found.is_some() {
            return Ok(head);
        }
        if ahead == 0 || head.len() >= LONGEST_HEAD {
            return Err(io::ErrorKind::InvalidData.into());
        }
    }
}

/// The remaining time.
///
/// # Errors
/// Returns an error if no time remains.
pub(super) fn left_until(end: Instant) -> io::Result<Duration> {
    let left = end.saturating_duration_since(Instant::now());
    if left.is_zero() {
        Err(io::ErrorKind::TimedOut.into())
    } else {
        Ok(left)
    }
}
