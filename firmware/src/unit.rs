//! The unit without its ports: bytes in, frames out.
//!
//! [`Unit`] implements the protocol (`docs/link.md`), the queue of samples and the filter. It is driven by the tasks of
//! [`run`](crate::run()), or by a test in virtual time. Every command is absolute, so after a lost answer the host can
//! ask again. No input stops the unit from answering.

mod logging;
mod outbox;
mod session;

use bodyflight_core::link::{
    Arrival, Configure, Configured, Credit, Decoder, Estimate, EstimateFlags, Event, Header, Hello,
    HelloAcknowledge, LogAsk, MAX_FRAME_LENGTH, Message, SCHEMA_HASH, Sample, SegmentTable, Status,
    Stop, StreamMode, TimeSync, Verdict,
};

use crate::board::{Board, Identity};
use crate::computer::{Computer, Configuration, Outcome};
use crate::light::Light;
use crate::queue::Queue;
use crate::sensor::Sensor;
use outbox::Outbox;
use session::Session;

/// Capacity of the sample queue; in paced mode the oldest sample is dropped when it is full.
pub const SAMPLES: u16 = 32;

/// A queued sample.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    header: Header,
    sample: Sample,
    /// Arrival time (us), by the board's clock.
    arrived: u64,
}

/// The unit; see the [module documentation](self).
#[derive(Debug)]
pub struct Unit<B: Board> {
    board: B,
    identity: Identity,
    /// Whether a host with the same schema hash has sent `HELLO`; until then all other messages are ignored.
    greeted: bool,
    decoder: Decoder,
    table: SegmentTable,
    asked: Option<Configure>,
    session: Option<Session>,
    sensor: Sensor,
    samples: Queue<Waiting, { SAMPLES as usize }>,
    outbox: Outbox,
    computer: Computer,
    light: Light,
    last: Option<(Header, Sample)>,
    wrong_session: u32,
    deadline_missed: u32,
    cycles_max: u32,
    not_taken_in: u32,
    /// Number of samples processed so far, and up to the last heartbeat.
    worked: [u32; 2],
}

impl<B: Board> Unit<B> {
    /// Creates a unit that waits for a host. Inlined so that the unit, which consists mostly of empty buffers, is built
    /// in place rather than copied.
    #[inline(always)]
    pub fn new(board: B, identity: Identity) -> Self {
        Self {
            board,
            identity,
            greeted: false,
            decoder: Decoder::new(),
            table: SegmentTable::new(),
            asked: None,
            session: None,
            sensor: Sensor::new(),
            samples: Queue::new(),
            outbox: Outbox::new(),
            computer: Computer::new(),
            light: Light::new(matches!(identity.reset_cause, 1 | 2)),
            last: None,
            wrong_session: 0,
            deadline_missed: 0,
            cycles_max: 0,
            not_taken_in: 0,
            worked: [0; 2],
        }
    }

    /// The board that the unit runs on.
    pub fn board(&self) -> &B {
        &self.board
    }

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
        self.sensor.receive_solutions(bytes);
        let mut input = bytes;
        while let Some((mut header, sample)) = self.sensor.next(&mut input, now) {
            if let Some(session) = self.session.as_mut().filter(|s| s.runs(StreamMode::Sensor)) {
                header.session = session.number;
                if let Arrival::New { .. } = session.ledger.receive(header.sequence) {
                    self.enqueue(header, sample);
                }
            }
        }
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
            // Only units send these.
            Message::HelloAcknowledge(_)
            | Message::Configured(_)
            | Message::Credit(_)
            | Message::Estimate(_)
            | Message::Status(_)
            | Message::LogPiece(_) => {}
        }
    }

    /// Queues a message with `time` (us) in its header.
    fn send(&mut self, time: u64, message: impl Into<Message>) {
        let session = self.session.as_ref().map_or(0, |session| session.number);
        self.outbox.push(session, time, message.into());
    }

    fn greet(&mut self, hello: &Hello) {
        self.greeted = hello.schema_hash == SCHEMA_HASH;
        self.introduce();
    }

    /// Queues `HELLO_ACK`, as after each start.
    pub fn introduce(&mut self) {
        let identity = self.identity;
        let answer = HelloAcknowledge {
            schema_hash: SCHEMA_HASH,
            build: identity.build,
            core_version: bodyflight_core::VERSION,
            boot_id: identity.boot_id,
            max_frame_length: u16::try_from(MAX_FRAME_LENGTH).unwrap_or(u16::MAX),
            queue_length: SAMPLES,
            reset_cause: identity.reset_cause,
            fault_resets: identity.fault_resets,
            fault_kind: identity.fault_kind,
            fault_address: identity.fault_address,
            fault_sequence: identity.fault_sequence,
        };
        self.send(self.board.now(), answer);
    }

    fn configure(&mut self, asked: Configure) {
        self.asked = Some(asked);
        let verdict = match Configuration::new(&asked, &self.table) {
            Ok(configuration) => {
                self.computer.configure(configuration);
                self.sensor.mount(asked.body_from_sensor.unpack());
                Verdict::Accepted
            }
            Err(verdict) => verdict,
        };
        let answer = Configured {
            preset: asked.preset,
            verdict,
            segments: self.table.received(),
            table_digest: self.table.digest(),
        };
        self.send(self.board.now(), answer);
    }

    fn start(&mut self, number: u16, mode: StreamMode) {
        let running = self.session.as_ref();
        if !running.is_some_and(|session| session.number == number && session.runs(mode)) {
            if self.computer.configuration().is_none() {
                // Repeats the answer to the last configuration, which tells the host what is missing.
                if let Some(asked) = self.asked {
                    self.configure(asked);
                }
                return;
            }
            self.computer.reset();
            self.samples.clear();
            self.sensor.restart();
            self.outbox.begin_session();
            self.session = Some(Session::new(number, mode));
            self.begin_log(number, mode);
        }
        self.report();
        self.grant(true);
    }

    fn stop(&mut self, number: u16, stop: Stop) {
        if let Some(session) = self.session.as_mut().filter(|s| s.number == number) {
            session.close(stop.sent);
            self.report_end();
        }
    }

    /// Accepts a sample from the host.
    fn take(&mut self, header: Header, sample: Sample) {
        let session = self.session.as_mut();
        let Some(session) = session.filter(|s| s.number == header.session && !s.is_closed()) else {
            self.wrong_session = self.wrong_session.wrapping_add(1);
            return;
        };
        if session.runs(StreamMode::Sensor) {
            self.sensor.set_posture(&sample);
            return;
        }
        match session.ledger.receive(header.sequence) {
            Arrival::New { .. } => self.enqueue(header, sample),
            Arrival::Late => {}
            // A repeated sample asks for the current credit.
            Arrival::Duplicate | Arrival::Stale => self.grant(true),
        }
    }

    fn enqueue(&mut self, header: Header, sample: Sample) {
        let waiting = Waiting {
            header,
            sample,
            arrived: self.board.now(),
        };
        let gave_way = self.samples.push(waiting).is_some();
        if let Some(session) = self.session.as_mut().filter(|_| gave_way) {
            session.ledger.drop_oldest();
        }
    }

    /// Processes the oldest queued sample; returns whether there was one.
    pub fn work(&mut self) -> bool {
        let Some(waiting) = self.samples.pop() else {
            return false;
        };
        self.worked[0] = self.worked[0].wrapping_add(1);
        let Header { sequence, time, .. } = waiting.header;
        self.board.note(sequence);
        self.last = Some((waiting.header, waiting.sample));
        let begin = self.board.cycles();
        let outcome = self.computer.sample(sequence, time, &waiting.sample);
        let cycles = self.board.cycles().wrapping_sub(begin);
        if let Some(session) = &mut self.session {
            match outcome {
                Outcome::Used(_) => session.ledger.use_one(),
                Outcome::Rejected => session.ledger.reject_one(),
            }
        }
        self.note(&waiting.header, waiting.sample);
        if let Outcome::Used(Some(estimate)) = outcome {
            let configuration = self.computer.configuration();
            let period = configuration.map_or(0, Configuration::update_period);
            let late = self.board.now().saturating_sub(waiting.arrived) > u64::from(period);
            let not_taken_in = estimate.flags.contains(EstimateFlags::NOT_TAKEN_IN);
            self.deadline_missed = self.deadline_missed.wrapping_add(u32::from(late));
            self.not_taken_in = self.not_taken_in.wrapping_add(u32::from(not_taken_in));
            self.cycles_max = self.cycles_max.max(cycles);
            let mut flags = estimate.flags;
            flags.set(EstimateFlags::LATE, late);
            self.light.see(flags);
            let estimate = Estimate {
                cycles,
                flags,
                ..estimate
            };
            self.note(&waiting.header, estimate);
            self.send(time, estimate);
        }
        self.grant(false);
        self.report_end();
        true
    }

    /// Grants credit for processed samples if there is enough to justify a frame, or if the host `asked`.
    fn grant(&mut self, asked: bool) {
        let waiting = self.samples.len();
        let session = self.session.as_mut();
        if let Some(granted) = session.and_then(|session| session.grant(waiting, asked)) {
            self.send(self.board.now(), Credit { granted });
        }
    }

    /// Reports once all samples of a closed session have been processed.
    fn report_end(&mut self) {
        let closed = self.session.as_ref().is_some_and(Session::is_closed);
        if closed && self.samples.is_empty() {
            if let Some(recorder) = self.board.recorder() {
                recorder.end();
            }
            self.report();
        }
    }

    /// Queues a status report if a host is connected, and writes it to the log. Returns the report.
    pub fn report(&mut self) -> Status {
        let status = self.status();
        self.light.see_battery(status.battery);
        self.note_status(status);
        if self.greeted {
            self.send(self.board.now(), status);
        }
        status
    }

    /// Handles a heartbeat: feeds the watchdog unless samples are waiting and none was processed since the last
    /// heartbeat. A single such heartbeat is harmless, since the sample may just have arrived; the watchdog resets the
    /// chip after several.
    pub fn feed_watchdog(&mut self) {
        let [worked, before] = self.worked;
        self.worked[1] = worked;
        if self.samples.is_empty() || worked != before {
            self.board.feed_watchdog();
        }
    }

    /// Advances the light by one step.
    pub fn shine(&mut self) {
        let is_on = self.light.advance();
        self.board.shine(is_on);
    }

    /// Current counters and state.
    pub fn status(&self) -> Status {
        let session = self.session.as_ref();
        let ledger = session.map(|session| session.ledger).unwrap_or_default();
        let [uart_overrun, uart_framing] = self.board.line_errors();
        let [sensor_overrun, sensor_framing] = self.board.sensor_errors();
        Status {
            wrong_session: self.wrong_session,
            uart_overrun,
            uart_framing,
            sensor_overrun,
            sensor_framing,
            fault_place: self.identity.fault_place,
            queue_high_water: self.samples.high_water(),
            deadline_missed: self.deadline_missed,
            cycles_max: self.cycles_max,
            innovation_rejected: self.not_taken_in,
            transmit_dropped: self.outbox.dropped(),
            stack_free: self.board.stack_free(),
            watchdog_resets: self.identity.watchdog_resets,
            battery: self.board.battery(),
            ..Status::new(self.board.now(), self.decoder.counters(), &ledger)
        }
    }

    /// The sample that was processed last, or `None` before the first.
    pub fn last_sample(&self) -> Option<&Sample> {
        self.last.as_ref().map(|(_, sample)| sample)
    }
}

#[cfg(test)]
mod tests;
