//! Connects the protocol to the on-board log.

use bodyflight_core::link::{Header, Message, Start, Status, StreamMode};

use super::outbox::pieces;
use super::session::Session;
use super::state::Unit;
use crate::board::Board;

impl<B: Board> Unit<B> {
    /// Begins a log with the configuration.
    pub(super) fn begin_log(&self, session: u16, mode: StreamMode) {
        let (Some(recorder), Some(asked)) = (self.board.recorder(), self.asked) else {
            return;
        };
        let header = Header {
            session,
            sequence: 0,
            time: self.board.now(),
        };
        // Says why the unit started: after a reset in flight a log begins in the air.
        let start = Message::from(self.introduction());
        let rows = self.table.rows().map(|row| Message::from(*row));
        let messages = core::iter::once(Message::from(asked))
            .chain(rows)
            .chain([start, Message::from(Start { mode })]);
        recorder.begin(messages.map(|message| (header, message)));
    }

    /// Sends a block of the log; empty if there is no block of this number.
    pub(crate) fn answer_log(&mut self, block: u32, bytes: &[u8]) {
        for piece in pieces(block, bytes) {
            self.send(self.board.now(), piece);
        }
    }

    /// Shows a message to the board, and records it if there is a log.
    pub(super) fn note(&self, header: &Header, message: impl Into<Message>) {
        let message = message.into();
        self.board.observe(header, &message);
        if let Some(recorder) = self.board.recorder() {
            recorder.note(header, &message);
        }
    }

    /// Records a status report at the time of the preceding sample, since times in a log are the sensor's.
    pub(super) fn note_status(&self, status: Status) {
        let running = self.session.as_ref().is_some_and(Session::is_open);
        if let Some((header, _)) = self.last.as_ref().filter(|_| running) {
            self.note(header, status);
        }
    }
}
