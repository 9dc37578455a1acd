//! One stream of samples to a unit: greeting, configuration, samples, stop.

use std::time::{Duration, Instant};

use bodyflight_core::link::fault::Injector;
use bodyflight_core::link::{
    Configure, Configured, Estimate, Header, Hello, HelloAcknowledge, MAX_FRAME_LENGTH, Message,
    SCHEMA_HASH, Sample, SegmentTable, Start, Status, Stop, StreamMode, TimeSync, Verdict,
};

use super::super::request::refused;
use super::latencies::Latencies;
use super::line::{ANSWER_TIMEOUT, Line, encode};
use super::twin::Twin;
use bodyflight_io::diagnostic::{Problem, Result};

/// How often a request is sent before the unit is considered silent.
const ATTEMPTS: u32 = 15;

/// Time to wait for credit before asking for it.
const CREDIT_TIMEOUT: Duration = Duration::from_millis(300);

/// A stream to one unit, with its twin on the desktop.
pub(super) struct Session {
    pub(super) line: Line,
    pub(super) twin: Twin,
    pub(super) injector: Injector,
    number: u16,
    mode: StreamMode,
    granted: u32,
    /// Frame of the last sample, sent again if credit was lost.
    last_frame: Vec<u8>,
    /// Latencies from samples to estimates.
    pub(super) latencies: Latencies,
    pub(super) status: Option<Status>,
    /// The last estimate.
    pub(super) estimate: Option<Estimate>,
    pub(super) unit: Option<HelloAcknowledge>,
    /// Shortest round trip of a clock comparison (us).
    pub(super) round_trip: Option<u64>,
}

impl Session {
    pub(super) fn new(line: Line, injector: Injector, number: u16, mode: StreamMode) -> Self {
        Self {
            line,
            twin: Twin::new(),
            injector,
            number,
            mode,
            granted: 0,
            last_frame: Vec::new(),
            latencies: Latencies::default(),
            status: None,
            estimate: None,
            unit: None,
            round_trip: None,
        }
    }

    pub(super) fn sent(&self) -> u32 {
        self.latencies.sent()
    }

    /// Sends a command to the unit and its twin.
    fn command(&mut self, message: impl Into<Message>) -> Result<()> {
        let frame = self.line.frame(self.number, message);
        self.twin.receive(&frame);
        self.line.write(&frame)
    }

    /// Sends a command repeatedly until an answer is accepted.
    fn ask(
        &mut self,
        what: &str,
        question: impl Into<Message>,
        mut passes: impl FnMut(&Header, &Message) -> bool,
    ) -> Result<Message> {
        let question = question.into();
        for _ in 0..ATTEMPTS {
            bodyflight_io::interrupt::check()?;
            self.command(question)?;
            let deadline = Instant::now() + ANSWER_TIMEOUT;
            while let Some((at, header, message)) = self.line.next(deadline)? {
                self.hear(at, &header, &message)?;
                if passes(&header, &message) {
                    return Ok(message);
                }
            }
        }
        Err(Problem::refused(format!("the unit does not answer {what}"))
            .help("check the port and the baud rate, and that the unit is running"))
    }

    /// Handles a message that the unit sends unprompted.
    fn hear(&mut self, at: Instant, header: &Header, message: &Message) -> Result<()> {
        match message {
            Message::Estimate(estimate) if header.session == self.number => {
                self.latencies.estimate_came(estimate.sample_sequence, at);
                self.estimate = Some(*estimate);
                self.twin.answer(estimate);
            }
            Message::Credit(credit) if header.session == self.number => {
                self.granted = credit.granted;
            }
            Message::Status(status) if header.session == self.number => {
                self.status = Some(*status);
            }
            Message::HelloAcknowledge(unit) => {
                let before = self.unit.replace(*unit);
                if before.is_some_and(|before| before.boot_id != unit.boot_id) {
                    return Err(Problem::disagreement(format!(
                        "the unit restarted in mid-stream: cause {}, fault kind {} at {:#010x}, sample {}",
                        unit.reset_cause, unit.fault_kind, unit.fault_address, unit.fault_sequence
                    )));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Greets the unit.
    pub(super) fn greet(&mut self) -> Result<()> {
        let hello = Hello {
            schema_hash: SCHEMA_HASH,
            max_frame_length: u16::try_from(MAX_FRAME_LENGTH).unwrap_or(u16::MAX),
        };
        let answer = self.ask("the greeting", hello, |_, message| {
            matches!(message, Message::HelloAcknowledge(_))
        })?;
        if let Message::HelloAcknowledge(unit) = answer
            && unit.schema_hash != SCHEMA_HASH
        {
            return Err(Problem::disagreement(format!(
                "the unit was built with different messages: its hash is {:#018x}, ours {SCHEMA_HASH:#018x}",
                unit.schema_hash
            ))
            .help("flash the unit and build the host from the same source"));
        }
        Ok(())
    }

    /// Compares the clocks a few times.
    pub(super) fn compare_clocks(&mut self) -> Result<()> {
        for _ in 0..5 {
            let begin = Instant::now();
            let question = TimeSync {
                asked: self.sent().into(),
                received: 0,
                answered: 0,
            };
            let answer = self.ask("a clock comparison", question, |_, message| {
                matches!(message, Message::TimeSync(_))
            })?;
            if let Message::TimeSync(answer) = answer {
                let whole = u64::try_from(begin.elapsed().as_micros()).unwrap_or(u64::MAX);
                let inside = answer.answered.saturating_sub(answer.received);
                let trip = whole.saturating_sub(inside);
                self.round_trip = Some(self.round_trip.map_or(trip, |best| best.min(trip)));
            }
        }
        Ok(())
    }

    /// Sends the configuration and the segment table until the unit has both.
    pub(super) fn configure(&mut self, configure: Configure, table: &SegmentTable) -> Result<()> {
        // The unit may still have the table of an earlier session; the twin never does.
        for row in table.rows() {
            let frame = self.line.frame(self.number, *row);
            self.twin.receive(&frame);
        }
        let mut verdict = Verdict::Incomplete;
        for _ in 0..ATTEMPTS {
            let answer = self.ask_configured(configure)?;
            verdict = answer.verdict;
            let wanted = match verdict {
                Verdict::Accepted => return Ok(()),
                Verdict::Incomplete => !answer.segments,
                Verdict::DigestMismatch => u16::MAX,
                Verdict::UnknownPreset
                | Verdict::NotABody
                | Verdict::UnusableRates
                | Verdict::NoChain => break,
            };
            // One by one: the unit's receive buffer need not hold them all.
            for row in table
                .rows()
                .filter(|row| wanted & 1 << (row.segment as u16) != 0)
            {
                self.ask_configured(*row)?;
            }
        }
        Err(refused(verdict))
    }

    fn ask_configured(&mut self, question: impl Into<Message>) -> Result<Configured> {
        let question = question.into();
        let mut found = None;
        self.ask("the configuration", question, |_, message| {
            if let Message::Configured(answer) = message {
                found = Some(*answer);
            }
            found.is_some()
        })?;
        found.ok_or_else(|| Problem::bad_input("the unit does not answer the configuration"))
    }

    /// Starts the session.
    pub(super) fn start(&mut self) -> Result<()> {
        let number = self.number;
        let start = Start { mode: self.mode };
        self.ask("the start", start, |header, message| {
            matches!(message, Message::Status(_)) && header.session == number
        })?;
        Ok(())
    }

    /// Handles incoming messages until `deadline`.
    pub(super) fn listen(&mut self, deadline: Instant) -> Result<()> {
        while let Some((at, header, message)) = self.line.next(deadline)? {
            self.hear(at, &header, &message)?;
        }
        Ok(())
    }

    /// Waits until one more sample may be sent.
    pub(super) fn await_credit(&mut self) -> Result<()> {
        let mut waits = 0;
        while self.mode == StreamMode::Credit
            && self.granted.wrapping_sub(self.sent()).cast_signed() <= 0
        {
            bodyflight_io::interrupt::check()?;
            match self.line.next(Instant::now() + CREDIT_TIMEOUT)? {
                Some((at, header, message)) => self.hear(at, &header, &message)?,
                None if waits == ATTEMPTS => {
                    return Err(Problem::disagreement(
                        "the unit has stopped granting credit, so no more samples can be sent",
                    ));
                }
                None => {
                    waits += 1;
                    // The unit answers a repeated sample with its credit; frames held back by the fault injector go out
                    // as well.
                    let mut pieces = Vec::new();
                    self.injector.flush(|piece| pieces.extend_from_slice(piece));
                    pieces.extend_from_slice(&self.last_frame);
                    self.twin.receive(&pieces);
                    self.line.write(&pieces)?;
                }
            }
        }
        Ok(())
    }

    /// Sends a sample through the fault injector.
    pub(super) fn sample(&mut self, time: u64, sample: Sample) -> Result<()> {
        let header = Header {
            session: self.number,
            sequence: self.sent(),
            time,
        };
        let frame = encode(&header, &sample.into());
        let mut pieces = Vec::new();
        self.injector
            .pass(&frame, |piece| pieces.extend_from_slice(piece));
        self.twin.receive(&pieces);
        self.latencies.sample_sent(Instant::now());
        self.last_frame = frame;
        self.line.write(&pieces)
    }

    /// Stops the session and waits until the unit has processed everything.
    pub(super) fn stop(&mut self) -> Result<()> {
        let mut pieces = Vec::new();
        self.injector.flush(|piece| pieces.extend_from_slice(piece));
        self.twin.receive(&pieces);
        self.line.write(&pieces)?;
        let (number, sent) = (self.number, self.sent());
        self.ask("the end", Stop { sent }, |header, message| match message {
            Message::Status(status) => header.session == number && status.accounted() == sent,
            _ => false,
        })?;
        self.listen(Instant::now() + ANSWER_TIMEOUT)
    }
}
