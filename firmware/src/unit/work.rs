//! The work of a session, from its configuration to its end: samples in, estimates out.

use bodyflight_core::link::{
    Arrival, Configure, Configured, Credit, Estimate, EstimateFlags, Header, Sample, SegmentErrors,
    SensorKind, Sensors, Status, Stop, StreamMode, Verdict,
};

use super::session::{Session, Silence};
use super::state::{Unit, Waiting};
use crate::board::Board;
use crate::computer::{Configuration, Outcome};
use crate::limbs;

impl<B: Board> Unit<B> {
    pub(super) fn configure(&mut self, asked: Configure) {
        self.asked = Some(asked);
        let is_unknown = asked.sensor == SensorKind::Chain && !limbs::IS_BUILT_IN;
        let verdict = match Configuration::new(&asked, &self.table) {
            Ok(_) if is_unknown => Verdict::NoChain,
            Ok(configuration) => {
                self.computer.configure(configuration);
                self.sensor.mount(asked.body_from_sensor.unpack());
                let rate = self.sensor.connect(asked.sensor, asked.receiver_latency);
                if let Some(rate) = rate {
                    self.board.set_sensor_rate(rate);
                }
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

    pub(super) fn start(&mut self, number: u16, mode: StreamMode) {
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
            self.silence = Silence::new();
            self.outbox.begin_session();
            self.session = Some(Session::new(number, mode));
            self.begin_log(number, mode);
        }
        self.report();
        self.grant(true);
    }

    pub(super) fn stop(&mut self, number: u16, stop: Stop) {
        if let Some(session) = self.session.as_mut().filter(|s| s.number == number) {
            session.close(stop.sent);
            self.report_end();
        }
    }

    /// Accepts a sample from the host.
    pub(super) fn take(&mut self, header: Header, sample: Sample) {
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
            Arrival::New { .. } => self.enqueue(header, sample, None, None),
            Arrival::Late => {}
            // A repeated sample asks for the current credit.
            Arrival::Duplicate | Arrival::Stale => self.grant(true),
        }
    }

    pub(super) fn enqueue(
        &mut self,
        header: Header,
        sample: Sample,
        sensors: Option<Sensors>,
        errors: Option<SegmentErrors>,
    ) {
        let waiting = Waiting {
            header,
            sample,
            sensors,
            errors,
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
        let sensors = waiting.sensors.as_ref();
        if let Some(errors) = &waiting.errors {
            self.computer.set_segment_errors(errors);
        }
        let outcome = self
            .computer
            .sample_with(sequence, time, &waiting.sample, sensors);
        let cycles = self.board.cycles().wrapping_sub(begin);
        if let Some(session) = &mut self.session {
            match outcome {
                Outcome::Used(_) => session.ledger.use_one(),
                Outcome::Rejected => session.ledger.reject_one(),
            }
        }
        if let Some(sensors) = waiting.sensors {
            self.note(&waiting.header, sensors);
        }
        if let Some(errors) = waiting.errors {
            self.note(&waiting.header, errors);
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
            if estimate.is_sendable() {
                self.note(&waiting.header, estimate);
                self.send(time, estimate);
            } else {
                self.estimates_bad = self.estimates_bad.wrapping_add(1);
            }
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
            if let Some(chain) = self.sensor.limbs().report() {
                self.send(self.board.now(), chain);
            }
        }
        status
    }
}
