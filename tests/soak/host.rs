//! A host that streams through faults in virtual time and tracks the outcome of every sample.

use std::cell::Cell;
use std::fmt;

use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::estimator::unit_preset::UnitPreset;
use bodyflight_core::link::fault::{Faults, Injector};
use bodyflight_core::link::{
    Decoder, Event, Header, HelloAcknowledge, MAX_FRAME_LENGTH, Message, Sample, SegmentTable,
    Start, Status, Stop, StreamMode,
};
use bodyflight_firmware::{Board, Identity, Unit};
use bodyflight_tests::arm_swing::{self, RATE};
use bodyflight_tests::greeting;
use bodyflight_unit::stream::twin::Twin;

/// Number of samples in the flight, which is repeated.
const FLIGHT: u32 = 60 * RATE;

/// Number of samples in a session.
const SESSION: u32 = 10 * RATE;

/// Number of attempts to get an answer, since the line loses requests and answers.
const ATTEMPTS: usize = 200;

/// A board whose clock is the simulation's.
#[derive(Debug, Default)]
struct Bench(Cell<u64>);

impl Board for Bench {
    fn now(&self) -> u64 {
        self.0.get()
    }
    fn cycles(&self) -> u32 {
        0
    }
    fn stack_free(&self) -> u32 {
        0
    }
    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }
    fn feed_watchdog(&self) {}
    fn note(&self, _: u32) {}
}

/// Outcomes of all samples.
#[derive(Debug, Default, Clone, Copy)]
pub struct Totals {
    pub sent: u64,
    pub used: u64,
    pub rejected: u64,
    pub dropped: u64,
    pub late: u64,
    pub missing: u64,
    /// Samples of sessions that a restart ended without a report.
    pub cut_off: u64,
    pub sessions: u64,
    pub unit_restarts: u64,
    pub host_restarts: u64,
    /// Number of estimates received, and of those that differ from the desktop's.
    pub estimates: u64,
    pub different: u64,
    /// Estimates that the line delivered more than once.
    pub repeated: u64,
    pub not_finite: u64,
}

impl Totals {
    /// Number of samples whose outcome is known.
    pub fn accounted(&self) -> u64 {
        self.used + self.rejected + self.dropped + self.late + self.missing + self.cut_off
    }
}

impl fmt::Display for Totals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "| {} | {} | {} | {} | {} | {} | {}, {} | {} of {} |",
            self.sent,
            self.used,
            self.rejected,
            self.late,
            self.missing,
            self.cut_off,
            self.unit_restarts,
            self.host_restarts,
            self.estimates - self.different,
            self.estimates
        )
    }
}

/// The host, the lines in both directions, and the unit at the other end.
pub struct Host {
    unit: Unit<Bench>,
    boots: u32,
    to_unit: Injector,
    to_host: Injector,
    faults: Faults,
    seed: u64,
    decoder: Decoder,
    twin: Twin,
    table: SegmentTable,
    /// The paper's filter and the motion filter, alternating.
    presets: [u16; 2],
    flight: Vec<Sample>,
    session: u16,
    sequence: u32,
    time: u64,
    status: Option<Status>,
    greeted: Option<HelloAcknowledge>,
    running: bool,
    totals: Totals,
}

impl Host {
    pub fn new(seed: u64) -> Self {
        let body = arm_swing::body::<f32>();
        let mut host = Self {
            unit: Unit::new(Bench::default(), Identity::default()),
            boots: 0,
            to_unit: Injector::new(Faults::default(), seed),
            to_host: Injector::new(Faults::default(), seed),
            faults: Faults::default(),
            seed,
            decoder: Decoder::new(),
            twin: Twin::new(),
            table: SegmentTable::of(&body, &Aerodynamics::paper()),
            presets: ["tracking", "auto"].map(|name| {
                let number = UnitPreset::number(name, &BACK_TRACKING).expect("a preset");
                u16::try_from(number).expect("few presets")
            }),
            flight: arm_swing::samples(FLIGHT),
            session: 0,
            sequence: 0,
            time: 0,
            status: None,
            greeted: None,
            running: false,
            totals: Totals::default(),
        };
        host.begin();
        host
    }

    pub fn totals(&self) -> &Totals {
        &self.totals
    }

    pub fn set_faults(&mut self, faults: Faults) {
        self.faults = faults;
        self.renew_injectors();
    }

    fn renew_injectors(&mut self) {
        // A frame still in transit is lost, as on a real line.
        self.seed = self.seed.wrapping_add(1);
        self.to_unit = Injector::new(self.faults, self.seed);
        self.to_host = Injector::new(self.faults, !self.seed);
    }

    /// Cuts and restores the power.
    pub fn restart_unit(&mut self) {
        self.boots += 1;
        self.totals.unit_restarts += 1;
        let now = self.unit.board().0.get();
        let identity = Identity {
            boot_id: self.boots,
            ..Identity::default()
        };
        self.unit = Unit::new(Bench(Cell::new(now)), identity);
        self.unit.introduce();
    }

    /// Kills the host's process in the middle of a frame and starts another one.
    pub fn restart_host(&mut self) {
        self.totals.host_restarts += 1;
        let frame = self.frame(self.flight[0].into());
        self.unit.receive(&frame[..50]);
        self.cut_off();
        self.decoder = Decoder::new();
        self.renew_injectors();
        self.begin();
    }

    /// Advances by one sample period.
    pub fn tick(&mut self) {
        self.time += 1_000_000 / u64::from(RATE);
        self.unit.board().0.set(self.time);
        if !self.running {
            self.begin();
            return;
        }
        let part = u32::from(self.session) * SESSION;
        let sample = self.flight[((part + self.sequence) % FLIGHT) as usize];
        let frame = self.frame(sample.into());
        self.sequence += 1;
        self.totals.sent += 1;
        self.send(&frame);
        while self.unit.work() {}
        self.listen();
        if self.running && self.sequence == SESSION {
            self.end();
            self.begin();
        }
    }

    /// Ends the last session; returns the totals.
    pub fn finish(mut self) -> Totals {
        self.end();
        self.totals
    }

    fn frame(&self, message: Message) -> Vec<u8> {
        let header = Header {
            session: self.session,
            sequence: self.sequence,
            time: self.time,
        };
        let mut frame = vec![0; MAX_FRAME_LENGTH];
        let length = message.encode(&header, &mut frame).expect("it fits");
        frame.truncate(length);
        frame
    }

    /// Sends a frame over the line to the unit. Whatever arrives goes to the twin too.
    fn send(&mut self, frame: &[u8]) {
        let (unit, twin) = (&mut self.unit, &mut self.twin);
        self.to_unit.pass(frame, |piece| {
            unit.receive(piece);
            twin.receive(piece);
        });
    }

    /// Receives those of the unit's answers that the line lets through.
    fn listen(&mut self) {
        let mut bytes = [0; MAX_FRAME_LENGTH];
        let mut came = Vec::new();
        while let Some(length) = self.unit.transmit(&mut bytes) {
            self.to_host
                .pass(&bytes[..length], |piece| came.extend_from_slice(piece));
        }
        for byte in came {
            if let Some(Event::Frame(header, message)) = self.decoder.push(byte) {
                self.hear(&header, &message);
            }
        }
    }

    fn hear(&mut self, header: &Header, message: &Message) {
        match message {
            Message::HelloAcknowledge(unit) => {
                // The boot number changes only at power-on, so the session ended with the previous boot.
                if self
                    .greeted
                    .is_some_and(|before| before.boot_id != unit.boot_id)
                {
                    self.cut_off();
                }
                self.greeted = Some(*unit);
            }
            Message::Status(status) if header.session == self.session => {
                self.status = Some(*status);
            }
            Message::Estimate(estimate) if header.session == self.session => {
                let numbers = estimate.state.iter().chain(&estimate.variance);
                self.totals.not_finite += u64::from(!numbers.copied().all(f32::is_finite));
                self.twin.answer(estimate);
            }
            _ => {}
        }
    }

    /// Starts a new session, with sample numbers from zero.
    fn begin(&mut self) {
        self.session = self.session.wrapping_add(1);
        self.sequence = 0;
        self.status = None;
        self.twin = Twin::new();
        self.running = true;
        let hello = greeting::hello();
        let configure = greeting::configure(
            self.presets[usize::from(self.session.is_multiple_of(2))],
            &self.table,
        );
        // Commands are sent without faults: repeating them is tested elsewhere, and the twin must receive exactly the
        // same ones.
        let mut commands: Vec<Message> = vec![hello.into(), configure.into()];
        commands.extend(self.table.rows().map(|row| Message::from(*row)));
        let mode = StreamMode::Paced;
        commands.push(Start { mode }.into());
        for command in commands {
            let frame = self.frame(command);
            for bytes in [&[0][..], &frame] {
                self.unit.receive(bytes);
                self.twin.receive(bytes);
            }
        }
        self.listen();
        // A boot that is only reported now ended the previous session, not this one.
        self.running = true;
    }

    /// Repeats `STOP` until the unit accounts for every sample.
    fn end(&mut self) {
        let sent = self.sequence;
        for _ in 0..ATTEMPTS {
            if !self.running {
                return;
            }
            let (unit, twin) = (&mut self.unit, &mut self.twin);
            self.to_unit.flush(|piece| {
                unit.receive(piece);
                twin.receive(piece);
            });
            let frame = self.frame(Stop { sent }.into());
            self.send(&frame);
            while self.unit.work() {}
            self.listen();
            if let Some(status) = self.status.filter(|status| status.accounted() == sent) {
                self.book(&status);
                return;
            }
        }
        // The unit has restarted without the host noticing, so it does not know the session.
        self.cut_off();
    }

    fn book(&mut self, status: &Status) {
        let totals = &mut self.totals;
        totals.used += u64::from(status.used);
        totals.rejected += u64::from(status.rejected);
        totals.dropped += u64::from(status.dropped_oldest);
        totals.late += u64::from(status.late);
        totals.missing += u64::from(status.missing);
        totals.sessions += 1;
        self.compare();
    }

    /// Ends the session without a report.
    fn cut_off(&mut self) {
        if self.running {
            self.running = false;
            self.totals.cut_off += u64::from(self.sequence);
            self.compare();
        }
    }

    fn compare(&mut self) {
        let agreement = self.twin.agreement();
        self.totals.estimates += agreement.received;
        self.totals.different += agreement.received - agreement.equal;
        self.totals.repeated += agreement.repeated;
        self.running = false;
    }
}
