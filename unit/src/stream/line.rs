//! The host's end of the line: sends frames, receives messages with their time of arrival.

use std::io::{ErrorKind, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use bodyflight_core::link::{Decoder, Event, Header, MAX_FRAME_LENGTH, Message};

use super::connection::{Connection, Machine};
use bodyflight_io::diagnostic::{Problem, Result};

/// What the reading thread received.
enum Seen {
    Message(Instant, Header, Message),
    /// A rejected frame.
    Refused,
    /// The line was closed.
    Closed(String),
}

/// An open line with its reading thread.
pub struct Line {
    writer: Box<dyn Write + Send>,
    seen: Receiver<Seen>,
    stop: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
    /// The machine behind it.
    pub machine: Machine,
    begin: Instant,
    /// Frames from the unit that were rejected.
    pub refused: u64,
    /// Bytes sent.
    pub sent_bytes: u64,
}

impl Line {
    /// Starts reading.
    pub fn new(connection: Connection) -> Self {
        let (sender, seen) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let reader = std::thread::spawn({
            let (reader, stop) = (connection.reader, Arc::clone(&stop));
            move || read(reader, &sender, &stop)
        });
        Self {
            writer: connection.writer,
            seen,
            stop,
            reader: Some(reader),
            machine: connection.machine,
            begin: Instant::now(),
            refused: 0,
            sent_bytes: 0,
        }
    }

    /// Encodes a message as a frame.
    pub fn frame(&self, session: u16, message: impl Into<Message>) -> Vec<u8> {
        let time = u64::try_from(self.begin.elapsed().as_micros()).unwrap_or(u64::MAX);
        let header = Header {
            session,
            sequence: 0,
            time,
        };
        encode(&header, &message.into())
    }

    /// Writes bytes.
    ///
    /// # Errors
    /// Returns an error if the line does not accept them.
    pub fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.sent_bytes += bytes.len() as u64;
        self.writer
            .write_all(bytes)
            .and_then(|()| self.writer.flush())
            .map_err(|error| closed(&error.to_string()))
    }

    /// The next message, waiting until `deadline` at the latest.
    ///
    /// # Errors
    /// Returns an error if the line was closed.
    pub fn next(&mut self, deadline: Instant) -> Result<Option<(Instant, Header, Message)>> {
        loop {
            let wait = deadline.saturating_duration_since(Instant::now());
            match self.seen.recv_timeout(wait) {
                Ok(Seen::Message(at, header, message)) => return Ok(Some((at, header, message))),
                Ok(Seen::Refused) => self.refused += 1,
                Ok(Seen::Closed(why)) => return Err(closed(&why)),
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Err(RecvTimeoutError::Disconnected) => return Err(closed("reading has ended")),
            }
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
    }
}

/// Encodes a message as a frame.
pub fn encode(header: &Header, message: &Message) -> Vec<u8> {
    let mut frame = vec![0; MAX_FRAME_LENGTH];
    // The buffer is large enough for every message.
    let length = message.encode(header, &mut frame).unwrap_or(0);
    frame.truncate(length);
    frame
}

fn closed(why: &str) -> Problem {
    Problem::refused(format!("the line to the unit was closed: {why}"))
        .help("was the unit unplugged, or did its machine stop?")
}

fn read(mut reader: Box<dyn Read + Send>, sender: &Sender<Seen>, stop: &AtomicBool) {
    let mut decoder = Decoder::new();
    let mut bytes = [0; 1024];
    while !stop.load(Ordering::Relaxed) {
        let count = match reader.read(&mut bytes) {
            Ok(0) => {
                let _ = sender.send(Seen::Closed("end of file".to_owned()));
                return;
            }
            Ok(count) => count,
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => continue,
                _ => {
                    let _ = sender.send(Seen::Closed(error.to_string()));
                    return;
                }
            },
        };
        let at = Instant::now();
        for &byte in &bytes[..count] {
            let seen = match decoder.push(byte) {
                Some(Event::Frame(header, message)) => Seen::Message(at, header, message),
                Some(Event::Refused(_)) => Seen::Refused,
                None => continue,
            };
            if sender.send(seen).is_err() {
                return;
            }
        }
    }
}

/// Longest wait for the answer to a request before it is repeated.
pub const ANSWER_TIMEOUT: Duration = Duration::from_millis(300);
