//! The unit without its ports: bytes in, frames out.
//!
//! [`Unit`] implements the protocol (`docs/link.md`), the queue of samples and the filter. It is driven by the tasks of
//! [`run`](crate::run()), or by a test in virtual time. Every command is absolute, so after a lost answer the host can
//! ask again. No input stops the unit from answering.

mod health;
mod logging;
mod outbox;
mod session;
mod setup;
mod state;
mod work;

use bodyflight_core::link::{
    Arrival, Event, Header, Hello, LogAsk, MAX_FRAME_LENGTH, Message, SCHEMA_HASH, StreamMode,
    TimeSync,
};

use crate::board::Board;
use crate::computer::Configuration;
use crate::sensor::Sensed;
pub use state::{SAMPLES, Unit};

impl<B: Board> Unit<B> {
    /// Processes bytes received from the host.
    pub fn receive(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            if let Some(Event::Frame(header, message)) = self.decoder.push(byte) {
                self.serve(&header, &message);
            }
        }
    }

    /// Discards a partial frame after the receiver lost bytes.
    pub fn line_error(&mut self) {
        self.decoder.discard_partial();
    }

    /// Processes bytes received from the inertial sensor; ignored except in sessions in sensor mode.
    pub fn receive_sensor(&mut self, bytes: &[u8]) {
        let now = self.board.now();
        self.sensor.receive_solutions(bytes, now);
        let mut input = bytes;
        loop {
            let body = self.computer.configuration().map(Configuration::body);
            let Some(sensed) = self.sensor.next(&mut input, now, body) else {
                break;
            };
            self.silence.hear(now);
            self.sensor_samples = self.sensor_samples.wrapping_add(1);
            let Sensed {
                mut header,
                sample,
                sensors,
                errors,
            } = sensed;
            if let Some(session) = self.session.as_mut().filter(|s| s.runs(StreamMode::Sensor)) {
                header.session = session.number;
                if let Arrival::New { .. } = session.ledger.receive(header.sequence) {
                    self.enqueue(header, sample, Some(sensors), errors);
                }
            }
        }
        self.follow_calibration();
    }

    /// Writes the next outgoing frame to `frame` and returns its length, or `None` if there is none.
    pub fn transmit(&mut self, frame: &mut [u8; MAX_FRAME_LENGTH]) -> Option<usize> {
        self.outbox.next(self.board.now(), frame)
    }

    /// Counts a frame that could not be sent.
    pub fn transmit_failed(&mut self) {
        self.outbox.count_dropped();
    }

    fn serve(&mut self, header: &Header, message: &Message) {
        self.host_heard = Some(self.board.now());
        match message {
            Message::Hello(hello) => self.greet(hello),
            _ if !self.greeted => {}
            Message::Configure(asked) => self.configure(*asked),
            Message::SegmentValues(row) => {
                self.table.insert(*row);
                if let Some(asked) = self.asked {
                    self.configure(asked);
                }
            }
            Message::Start(start) => self.start(header.session, start.mode),
            Message::Stop(stop) => self.stop(header.session, *stop),
            Message::ResetFilter(_) => self.computer.reset(),
            Message::TimeSync(question) => {
                let received = self.board.now();
                let answer = TimeSync {
                    received,
                    ..*question
                };
                self.send(received, answer);
            }
            Message::Sample(sample) => self.take(*header, *sample),
            Message::LogAsk(LogAsk { action, block }) => match self.board.recorder() {
                Some(recorder) => recorder.ask(*action, *block),
                None => self.answer_log(*block, &[]),
            },
            Message::SetupAsk(ask) => self.ask_setup(ask.action),
            Message::LimbSensor(row) => self.sensor.limbs_mut().insert(row),
            Message::Calibrate(_) => self.calibrate(),
            // Only units send these.
            Message::HelloAcknowledge(_)
            | Message::Configured(_)
            | Message::Credit(_)
            | Message::Estimate(_)
            | Message::Status(_)
            | Message::Sensors(_)
            | Message::Stored(_)
            | Message::Calibration(_)
            | Message::SegmentErrors(_)
            | Message::ChainReport(_)
            | Message::LogPiece(_) => {}
        }
    }

    fn greet(&mut self, hello: &Hello) {
        self.greeted = hello.schema_hash == SCHEMA_HASH;
        self.introduce();
    }

    /// Queues `HELLO_ACK`, as after each start.
    pub fn introduce(&mut self) {
        self.send(self.board.now(), self.introduction());
    }
}

#[cfg(test)]
mod tests;
