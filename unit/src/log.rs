//! The log kept on board by a unit, read back over its serial line.

mod flight;
mod folders;
mod tables;

use std::time::Instant;

use bodyflight_core::link::{
    Hello, LogAction, LogAsk, LogPiece, MAX_FRAME_LENGTH, Message, PIECE_LENGTH, SCHEMA_HASH,
};

pub use self::flight::{FILES, LoggedFlight, Written, flights, write};
pub use self::folders::{WithoutAttitude, WrittenLog, folders, write_all};
use super::stream::connection::{Connection, Target};
use super::stream::line::{ANSWER_TIMEOUT, Line};
use bodyflight_io::diagnostic::{Problem, Result};

/// How often a request is sent before the unit is considered silent.
const ATTEMPTS: u32 = 15;

/// Reads every block, oldest first; `progress` is called with the number of blocks so far.
///
/// # Errors
/// Returns an error if the port cannot be opened, or if the unit does not answer or was built with different messages.
pub fn read(target: &Target, progress: &mut dyn FnMut(usize)) -> Result<Vec<Vec<u8>>> {
    let mut line = greeted(target)?;
    let mut blocks = Vec::new();
    loop {
        bodyflight_io::interrupt::check()?;
        let number = u32::try_from(blocks.len()).unwrap_or(u32::MAX);
        let block = ask(&mut line, LogAction::Read, number)?;
        if block.is_empty() {
            return Ok(blocks);
        }
        blocks.push(block);
        progress(blocks.len());
    }
}

/// Erases the log.
///
/// # Errors
/// Same as [`read`].
pub fn erase(target: &Target) -> Result<()> {
    let mut line = greeted(target)?;
    ask(&mut line, LogAction::Erase, 0).map(|_| ())
}

pub(super) fn greeted(target: &Target) -> Result<Line> {
    let mut line = Line::new(Connection::open(target)?);
    let hello = Hello {
        schema_hash: SCHEMA_HASH,
        max_frame_length: u16::try_from(MAX_FRAME_LENGTH).unwrap_or(u16::MAX),
    };
    for _ in 0..ATTEMPTS {
        let frame = line.frame(0, hello);
        line.write(&frame)?;
        let deadline = Instant::now() + ANSWER_TIMEOUT;
        while let Some((_, _, message)) = line.next(deadline)? {
            if let Message::HelloAcknowledge(unit) = message {
                if unit.schema_hash == SCHEMA_HASH {
                    return Ok(line);
                }
                return Err(Problem::disagreement(format!(
                    "the unit was built with different messages: its hash is {:#018x}, ours {SCHEMA_HASH:#018x}",
                    unit.schema_hash
                ))
                .help("flash the unit and build the host from the same source"));
            }
        }
    }
    Err(silent())
}

/// The bytes of a block; empty if the log has no block with this number.
fn ask(line: &mut Line, action: LogAction, block: u32) -> Result<Vec<u8>> {
    let mut pieces = Pieces::new(block);
    for _ in 0..ATTEMPTS {
        let frame = line.frame(0, LogAsk { action, block });
        line.write(&frame)?;
        let deadline = Instant::now() + ANSWER_TIMEOUT;
        while let Some((_, _, message)) = line.next(deadline)? {
            if let Message::LogPiece(piece) = message
                && let Some(bytes) = pieces.take(&piece)
            {
                return Ok(bytes);
            }
        }
    }
    Err(silent())
}

pub(super) fn silent() -> Problem {
    Problem::refused("the unit does not answer")
        .help("check the port and the baud rate, and that the unit is running")
}

/// The pieces of a block received so far.
#[derive(Debug)]
pub struct Pieces {
    block: u32,
    bytes: Vec<Option<[u8; PIECE_LENGTH]>>,
}

impl Pieces {
    /// Starts with no pieces of block number `block`.
    pub fn new(block: u32) -> Self {
        Self {
            block,
            bytes: Vec::new(),
        }
    }

    /// Adds a piece; returns the block once it is complete.
    pub fn take(&mut self, piece: &LogPiece) -> Option<Vec<u8>> {
        if piece.block != self.block {
            return None;
        }
        let length = usize::from(piece.length);
        self.bytes.resize(length.div_ceil(PIECE_LENGTH), None);
        if let Some(place) = self.bytes.get_mut(usize::from(piece.offset) / PIECE_LENGTH) {
            *place = Some(piece.bytes);
        }
        let whole: Option<Vec<_>> = self.bytes.iter().copied().collect();
        let mut bytes = whole?.concat();
        bytes.truncate(length);
        Some(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_make_a_block_in_any_order_and_from_any_answer() {
        let block: Vec<u8> = (0..250_u8).collect();
        let piece = |offset: u16| {
            let mut bytes = [0; PIECE_LENGTH];
            let from = &block[usize::from(offset)..];
            let length = from.len().min(PIECE_LENGTH);
            bytes[..length].copy_from_slice(&from[..length]);
            LogPiece {
                block: 4,
                length: 250,
                offset,
                bytes,
            }
        };
        let mut pieces = Pieces::new(4);
        assert_eq!(pieces.take(&piece(192)), None);
        assert_eq!(pieces.take(&piece(0)), None);
        let of_another = LogPiece {
            block: 3,
            ..piece(96)
        };
        assert_eq!(pieces.take(&of_another), None);
        assert_eq!(pieces.take(&piece(96)), Some(block));
        let end = LogPiece {
            block: 4,
            length: 0,
            offset: 0,
            bytes: [0; PIECE_LENGTH],
        };
        assert_eq!(Pieces::new(4).take(&end), Some(Vec::new()));
    }
}
