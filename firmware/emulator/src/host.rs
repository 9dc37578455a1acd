//! A host connected to the emulated chip, in the chip's time.

use bodyflight_core::link::{
    Configure, Decoder, Estimate, EstimateFlags, Event as LinkEvent, Header, Hello,
    HelloAcknowledge, LogAction, LogAsk, MAX_FRAME_LENGTH, Message, SCHEMA_HASH, SegmentTable,
    Setup, SetupAction, SetupAsk, SetupState, Start, Status, Stop, StreamMode, Verdict,
};
use bodyflight_unit::log::{self, LoggedFlight, Pieces};
use bodyflight_unit::stream::twin::{Agreement, Twin};

use crate::Result;
use crate::chip::{Chip, Cost, Event, Options};
use crate::flight::Flight;

/// Sample rate (Hz).
pub const RATE: u64 = 240;

/// Timeouts of the host (us).
#[derive(Debug, Clone, Copy)]
pub struct Limits;

impl Limits {
    /// Time without an answer after which the host repeats a request.
    pub const ANSWER: u64 = 50_000;
    /// Time without a sign of life from the unit after which the host gives up.
    pub const RETURN: u64 = 10_000_000;
    /// Polling interval.
    const LOOK: u64 = 1_000;
}

/// A host connected to an emulated chip.
pub struct Host {
    /// The chip.
    pub chip: Chip,
    flight: Flight,
    decoder: Decoder,
    twin: Twin,
    session: u16,
    sent: u32,
    /// Time of the next sample (us).
    due: u64,
    /// Estimates of this session, with their arrival time (us).
    pub estimates: Vec<(u64, Estimate)>,
    /// The last greeting.
    pub greeting: Option<HelloAcknowledge>,
    /// Arrival time of the last greeting (us), and the number of greetings.
    pub greeted: (u64, u32),
    /// The last report.
    pub status: Option<Status>,
    configured: Option<(Verdict, u16)>,
    started: bool,
    /// Whether the unit flies alone: nothing is sent to it, and estimates of any session count.
    alone: bool,
    stored: Option<SetupState>,
    /// The requested block of the log, in pieces and complete.
    pieces: Pieces,
    block: Option<Vec<u8>>,
    /// Resets and their times (us).
    pub resets: Vec<(u64, String)>,
}

impl Host {
    /// Powers a chip, without waiting for it.
    ///
    /// # Errors
    /// Returns an error if the emulator does not start.
    pub fn power(options: &Options, flight: &Flight) -> Result<Self> {
        Ok(Self {
            chip: Chip::start(options)?,
            flight: flight.clone(),
            decoder: Decoder::new(),
            twin: Twin::new(),
            session: 0,
            sent: 0,
            due: 0,
            estimates: Vec::new(),
            greeting: None,
            greeted: (0, 0),
            status: None,
            configured: None,
            started: false,
            alone: false,
            stored: None,
            pieces: Pieces::new(0),
            block: None,
            resets: Vec::new(),
        })
    }

    /// Runs the chip until a time (us) and processes what it sends.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn listen(&mut self, until: u64) -> Result<()> {
        for event in self.chip.run(until)? {
            match event {
                Event::Reset { at, cause } => self.resets.push((at, cause)),
                Event::Sent { at, port, bytes } if port == "host" => {
                    for byte in bytes {
                        if let Some(LinkEvent::Frame(header, message)) = self.decoder.push(byte) {
                            self.hear(at, &header, &message);
                        }
                    }
                }
                Event::Sent { .. } => {}
            }
        }
        Ok(())
    }

    fn hear(&mut self, at: u64, header: &Header, message: &Message) {
        let ours = header.session == self.session;
        match message {
            Message::HelloAcknowledge(greeting) => {
                self.greeting = Some(*greeting);
                self.greeted = (at, self.greeted.1 + 1);
            }
            Message::Configured(answer) => {
                self.configured = Some((answer.verdict, answer.segments));
            }
            Message::Estimate(estimate) if self.alone => self.estimates.push((at, *estimate)),
            Message::Stored(answer) => self.stored = Some(answer.state),
            Message::Estimate(estimate) if ours => {
                self.twin.answer(estimate);
                self.estimates.push((at, *estimate));
            }
            Message::Status(status) => {
                self.started |= ours;
                self.status = Some(*status);
            }
            Message::LogPiece(piece) => self.block = self.pieces.take(piece).or(self.block.take()),
            _ => {}
        }
    }

    fn frame(&self, sequence: u32, time: u64, message: Message) -> Vec<u8> {
        let header = Header {
            session: self.session,
            sequence,
            time,
        };
        let mut frame = vec![0; MAX_FRAME_LENGTH];
        // The buffer is large enough for every message.
        let length = message.encode(&header, &mut frame).unwrap_or(0);
        frame.truncate(length);
        frame
    }

    fn command(&mut self, message: impl Into<Message>) -> Result<()> {
        let frame = self.frame(0, self.chip.now(), message.into());
        self.twin.receive(&frame);
        self.chip.send(self.chip.now(), "host", &frame)
    }

    /// Repeats a request until `answered`.
    fn ask(
        &mut self,
        what: &str,
        message: impl Into<Message>,
        mut answered: impl FnMut(&Self) -> bool,
    ) -> Result<()> {
        let message = message.into();
        let give_up = self.chip.now() + Limits::RETURN;
        while self.chip.now() < give_up {
            self.command(message)?;
            let again = self.chip.now() + Limits::ANSWER;
            while self.chip.now() < again {
                self.listen(self.chip.now() + Limits::LOOK)?;
                if answered(self) {
                    return Ok(());
                }
            }
        }
        let look = self.chip.look()?;
        Err(format!("the unit does not answer {what}: {look:?}"))
    }

    /// Greets, configures and starts a new session.
    ///
    /// # Errors
    /// Returns an error if the unit does not answer.
    pub fn connect(&mut self, mode: StreamMode) -> Result<()> {
        self.greet()?;
        let (configure, table) = (self.flight.configure, self.flight.table);
        self.configure(configure, &table)?;
        self.ask("the start", Start { mode }, |host| host.started)?;
        self.due = self.chip.now();
        Ok(())
    }

    /// Begins a session with a greeting, also with a unit that flew alone until now.
    ///
    /// # Errors
    /// Returns an error if the unit does not answer.
    pub fn greet(&mut self) -> Result<()> {
        self.alone = false;
        self.session = self.session.wrapping_add(1);
        (self.sent, self.started, self.configured) = (0, false, None);
        self.twin = Twin::new();
        self.estimates.clear();
        let hello = Hello {
            schema_hash: SCHEMA_HASH,
            max_frame_length: u16::try_from(MAX_FRAME_LENGTH).unwrap_or(u16::MAX),
        };
        // The first greeting may be the unsolicited one that the unit sends after its start.
        for _ in 0..2 {
            let greetings = self.greeted.1;
            self.ask("a greeting", hello, |host| host.greeted.1 > greetings)?;
        }
        Ok(())
    }

    fn configure(&mut self, configure: Configure, table: &SegmentTable) -> Result<()> {
        self.ask("the configuration", configure, |host| {
            host.configured.is_some()
        })?;
        for row in table.rows() {
            let mask = 1 << (row.segment as u16);
            self.ask("a segment", *row, |host| {
                host.configured
                    .is_some_and(|(_, segments)| segments & mask != 0)
            })?;
        }
        if self.configured.map(|(verdict, _)| verdict) != Some(Verdict::Accepted) {
            return Err(format!("the unit refuses: {:?}", self.configured));
        }
        Ok(())
    }

    /// Stores a configuration on the unit, on the ground, and cuts the power: from then on the host only listens.
    ///
    /// # Errors
    /// Returns an error if the unit does not answer, or does not store it.
    pub fn store_and_leave(&mut self, setup: &Setup) -> Result<()> {
        self.greet()?;
        self.configure(setup.configure, &setup.table)?;
        for row in setup.limbs.rows() {
            self.command(*row)?;
        }
        let action = SetupAction::Store;
        self.ask("to store", SetupAsk { action }, |host| {
            host.stored.is_some()
        })?;
        if self.stored != Some(SetupState::Present) {
            return Err(format!("the unit does not store: {:?}", self.stored));
        }
        self.chip.power("power-on", false)?;
        self.resets.clear();
        self.estimates.clear();
        self.decoder = Decoder::new();
        self.alone = true;
        Ok(())
    }

    /// The next sample as a frame, with the time at which it is due (us).
    fn next_sample(&mut self) -> (u64, Vec<u8>) {
        let sequence = self.sent;
        let samples = &self.flight.samples;
        let sample = samples[sequence as usize % samples.len()];
        let frame = self.frame(
            sequence,
            u64::from(sequence) * 1_000_000 / RATE,
            sample.into(),
        );
        let due = self.next_due();
        self.sent += 1;
        (due, frame)
    }

    /// Sends samples in real time and processes what arrives meanwhile.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn fly(&mut self, samples: u32) -> Result<()> {
        self.fly_harmed(samples, |_, frame| Some(frame))
    }

    /// Like [`fly`](Self::fly), with each frame modified by `harm`; frames that it drops are withheld from the desktop
    /// too.
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn fly_harmed(
        &mut self,
        samples: u32,
        mut harm: impl FnMut(u32, Vec<u8>) -> Option<Vec<u8>>,
    ) -> Result<()> {
        for _ in 0..samples {
            let (due, frame) = self.next_sample();
            if let Some(frame) = harm(self.sent - 1, frame) {
                self.twin.receive(&frame);
                self.chip.send(due, "host", &frame)?;
            }
            self.listen(due)?;
        }
        Ok(())
    }

    /// Flies this number of samples, counting every cycle; returns the cost and the elapsed time (us).
    ///
    /// # Errors
    /// Returns an error if the emulator has ended.
    pub fn fly_traced(&mut self, samples: u32) -> Result<(Cost, u64)> {
        let begin = self.next_due();
        self.listen(begin)?;
        for _ in 0..samples {
            let (due, frame) = self.next_sample();
            self.twin.receive(&frame);
            self.chip.send(due, "host", &frame)?;
        }
        let end = self.next_due();
        Ok((self.chip.trace(end)?, end - begin))
    }

    /// Number of samples missing in this session, by the unit's own current count.
    ///
    /// # Errors
    /// Returns an error if the unit does not answer.
    pub fn missing(&mut self) -> Result<u32> {
        self.status = None;
        // The unit answers a repeated `START` with a report.
        let mode = StreamMode::Paced;
        self.ask("for a report", Start { mode }, |host| host.status.is_some())?;
        // No samples were due in the meantime.
        self.due += self.chip.now().saturating_sub(self.next_due());
        Ok(self.status.map_or(0, |status| status.missing))
    }

    /// When the next sample is due (us).
    fn next_due(&self) -> u64 {
        self.due + u64::from(self.sent) * 1_000_000 / RATE
    }

    /// Number of samples sent in this session.
    pub fn sent(&self) -> u32 {
        self.sent
    }

    /// Ends the session and returns the unit's final report.
    ///
    /// # Errors
    /// Returns an error if the unit does not answer, or cannot account for every sample.
    pub fn stop(&mut self) -> Result<Status> {
        let sent = self.sent;
        self.listen(self.chip.now() + 20_000)?;
        self.ask("the end", Stop { sent }, |host| {
            host.status.is_some_and(|status| accounted(&status) == sent)
        })?;
        self.status.ok_or_else(|| "no report".into())
    }

    /// The flights in the unit's log, and how many of its blocks are damaged.
    ///
    /// # Errors
    /// Returns an error if the unit does not answer.
    pub fn log(&mut self) -> Result<(Vec<LoggedFlight>, usize)> {
        let mut blocks = Vec::new();
        for block in 0.. {
            (self.pieces, self.block) = (Pieces::new(block), None);
            let action = LogAction::Read;
            self.ask("for its log", LogAsk { action, block }, |host| {
                host.block.is_some()
            })?;
            match self.block.take() {
                Some(bytes) if !bytes.is_empty() => blocks.push(bytes),
                _ => break,
            }
        }
        Ok(log::flights(&blocks))
    }

    /// Number of estimates of the session that were late, without the first two: the filter starts with the first sample,
    /// which takes the time of five, so the estimate after it may be late by a millisecond.
    pub fn late_in_flight(&self) -> usize {
        let later = self.estimates.iter().skip(2);
        later
            .filter(|(_, estimate)| estimate.flags.contains(EstimateFlags::LATE))
            .count()
    }

    /// Compares the estimates of the session with the desktop's.
    pub fn agreement(&self) -> Agreement {
        self.twin.agreement()
    }
}

/// Number of samples whose outcome is known.
fn accounted(status: &Status) -> u32 {
    [
        status.used,
        status.rejected,
        status.dropped_oldest,
        status.late,
        status.missing,
    ]
    .into_iter()
    .fold(0, u32::wrapping_add)
}
