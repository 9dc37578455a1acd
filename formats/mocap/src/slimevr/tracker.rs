//! What is known of a tracker and its sensors.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use super::numbers::{Numbers, Order};
use super::packet::{Handshake, Message};
use super::sample::Sample;
use super::sorted::{Due, Sorter};

/// Silence from which a tracker is named (s).
pub(super) const SILENCE: f64 = 1.0;
/// Most sensors of a tracker: gloves have ten.
const MOST_SENSORS: usize = 16;
/// Most times of restarts that are kept.
const MOST_RESTARTS: usize = 16;

/// A tracker on the network.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    /// Address of its network card as `A1:B2:C3:D4:E5:F6`, or else its network address.
    pub name: String,
    /// Where it sends from.
    pub address: SocketAddr,
    /// What it said of itself.
    pub handshake: Handshake,
    /// Its sensors by number.
    pub sensors: BTreeMap<u8, SensorState>,
    /// Lowest time to a question's return (s).
    pub round_trip_s: Option<f64>,
    /// Voltage of its battery (V).
    pub battery_v: Option<f64>,
    /// Failures that it reported, and the last code.
    pub errors: (u64, u8),
    /// Longest time in which nothing came from it (s).
    pub longest_silence_s: f64,
    /// When the first packet came after each of its first restarts (s).
    pub restarted_s: Vec<f64>,
    /// Packets that came after later ones had had their turn, so that their content is not used.
    pub unused: u64,
    /// Whether another tracker introduced itself from its address, or by its name from another one, while it was heard.
    pub is_doubled: bool,
    /// When it last introduced itself (s).
    pub(super) greeted_s: f64,
    /// When the last packet came (s).
    heard_s: f64,
    numbers: Numbers,
    sorter: Sorter,
    /// The question that is on its way, and since when (s).
    asked: Option<([u8; 4], f64)>,
}

/// One of its sensors.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SensorState {
    /// Its type; 0 if it is not known.
    pub sensor_type: u8,
    /// Whether its magnetometer is used.
    pub has_magnetometer: bool,
    /// Samples so far.
    pub samples: u64,
    /// Samples without an acceleration.
    pub without_acceleration: u64,
    /// When the first and the last sample came (s).
    pub span_s: Option<[f64; 2]>,
    /// A sample whose acceleration may still come.
    waiting: Option<Sample>,
    /// Missed packets of the tracker when the last sample came.
    missed: u64,
}

impl Tracker {
    pub(super) fn new(name: String, address: SocketAddr, time: f64) -> Self {
        Self {
            name,
            address,
            handshake: Handshake::default(),
            sensors: BTreeMap::new(),
            round_trip_s: None,
            battery_v: None,
            errors: (0, 0),
            longest_silence_s: 0.0,
            restarted_s: Vec::new(),
            unused: 0,
            is_doubled: false,
            greeted_s: time,
            heard_s: time,
            numbers: Numbers::default(),
            sorter: Sorter::default(),
            asked: None,
        }
    }

    /// Packets that arrived, each once.
    pub fn received(&self) -> u64 {
        self.numbers.received
    }

    /// Packets that never arrived.
    pub fn lost(&self) -> u64 {
        self.numbers.lost
    }

    /// Packets that others overtook, and those that came twice.
    pub fn disordered(&self) -> [u64; 2] {
        [self.numbers.late, self.numbers.repeated]
    }

    /// Times it restarted: its numbers began again.
    pub fn restarts(&self) -> u64 {
        self.numbers.restarts
    }

    /// When it restarted, as the end of a sentence; empty if it did not.
    pub fn restarted(&self) -> String {
        let times = self.restarted_s.iter().map(|time| format!("{time:.1} s"));
        let times: Vec<String> = times.collect();
        match (self.restarts(), self.restarted_s.len() as u64) {
            (0, _) => String::new(),
            (all, told) if all > told => {
                format!(", restarted {all} times, first at {}", times.join(", "))
            }
            _ => format!(", restarted at {}", times.join(", ")),
        }
    }

    /// Samples of all sensors.
    pub fn samples(&self) -> u64 {
        self.sensors.values().map(|sensor| sensor.samples).sum()
    }

    /// How long nothing has come from it (s).
    pub fn silent_s(&self, time: f64) -> f64 {
        (time - self.heard_s).max(0.0)
    }

    /// It introduced itself at a time (s).
    pub(super) fn greet(&mut self, time: f64, address: SocketAddr, handshake: Handshake) {
        if address.ip() != self.address.ip() {
            self.disturbed(time);
        }
        if self.numbers.received > 0 && time - self.greeted_s > SILENCE {
            self.numbers.greeted();
        }
        if let Ok(sensor_type) = u8::try_from(handshake.sensor_type)
            && let Some(first) = self.sensor(0)
            && first.sensor_type == 0
        {
            first.sensor_type = sensor_type;
        }
        (self.address, self.handshake, self.greeted_s) = (address, handshake, time);
        self.heard(time);
    }

    /// Another tracker, or the same after it was silent, takes its name or its address at a time (s).
    pub(super) fn disturbed(&mut self, time: f64) {
        self.is_doubled |= self.silent_s(time) < SILENCE;
    }

    /// Notes that something came; silence is measured between such times.
    fn heard(&mut self, time: f64) {
        self.longest_silence_s = self.longest_silence_s.max(time - self.heard_s);
        self.heard_s = time;
    }

    /// Takes a packet; samples that are complete go to `into`. Returns for how many messages there was no room for a sensor.
    pub(super) fn take(
        &mut self,
        time: f64,
        number: u64,
        messages: Vec<Message>,
        into: &mut Vec<(u8, Sample)>,
    ) -> u64 {
        self.heard(time);
        let restarts = self.numbers.restarts;
        if self.numbers.take(number) == Order::Repeated {
            return 0;
        }
        let mut refused = 0;
        if self.numbers.restarts != restarts {
            // What waits is of before.
            refused += self.release(f64::INFINITY, restarts, into);
            into.extend(self.without_acceleration());
            self.sorter.begin_again();
            if self.restarted_s.len() < MOST_RESTARTS {
                self.restarted_s.push(time);
            }
        }
        let restarts = self.numbers.restarts;
        let (samples, others): (Vec<Message>, Vec<Message>) =
            messages.into_iter().partition(is_of_a_sample);
        refused += others
            .iter()
            .map(|other| self.told(time, other))
            .sum::<u64>();
        if number != 0 {
            if !self.sorter.push(number, time, samples) {
                self.unused += 1;
            }
        } else if !samples.is_empty() {
            refused += self.release(f64::INFINITY, restarts, into);
            let own = Due {
                number,
                time_s: time,
                messages: samples,
            };
            refused += self.sampled(&own, restarts, into);
        }
        refused + self.release(time, restarts, into)
    }

    /// Takes the packets whose turn it is at a time (s).
    fn release(&mut self, time: f64, restarts: u64, into: &mut Vec<(u8, Sample)>) -> u64 {
        let mut refused = 0;
        while let Some(due) = self.sorter.next(time) {
            refused += self.sampled(&due, restarts, into);
        }
        refused
    }

    /// Takes what does not wait for packets before it; returns 1 if there was no room for its sensor.
    fn told(&mut self, time: f64, message: &Message) -> u64 {
        match *message {
            Message::SensorInfo {
                sensor,
                sensor_type,
                has_magnetometer,
                is_inertial,
                ..
            } if is_inertial => {
                let Some(own) = self.sensor(sensor) else {
                    return 1;
                };
                own.sensor_type = sensor_type;
                own.has_magnetometer = has_magnetometer;
            }
            Message::Error { code, .. } => self.errors = (self.errors.0 + 1, code),
            Message::Battery { volts, .. } => {
                self.battery_v = volts.filter(|volts| volts.is_finite()).or(self.battery_v);
            }
            Message::Pong(question) => self.answered(question, time),
            _ => {}
        }
        0
    }

    /// Takes the orientations and accelerations of a packet; returns for how many there was no room for their sensor.
    fn sampled(&mut self, due: &Due, restarts: u64, into: &mut Vec<(u8, Sample)>) -> u64 {
        let missed = self.sorter.missed;
        let mut refused = 0;
        for message in &due.messages {
            match *message {
                Message::Rotation {
                    sensor,
                    orientation,
                    acceleration,
                } => {
                    let Some(own) = self.sensor(sensor) else {
                        refused += 1;
                        continue;
                    };
                    let sample = Sample {
                        time_s: due.time_s,
                        orientation,
                        acceleration,
                        number: due.number,
                        lost: missed.saturating_sub(own.missed),
                        restarts,
                    };
                    own.missed = missed;
                    let before = own.waiting.replace(sample);
                    into.extend(before.map(|sample| (sensor, own.counted(sample))));
                    if acceleration.is_some() {
                        let whole = own.waiting.take();
                        into.extend(whole.map(|sample| (sensor, own.counted(sample))));
                    }
                }
                Message::Acceleration {
                    sensor,
                    acceleration,
                } => {
                    let Some(own) = self.sensor(sensor) else {
                        refused += 1;
                        continue;
                    };
                    if let Some(sample) = own.waiting.take() {
                        let acceleration = Some(acceleration);
                        let whole = Sample {
                            acceleration,
                            ..sample
                        };
                        into.push((sensor, own.counted(whole)));
                    }
                }
                _ => {}
            }
        }
        refused
    }

    /// The samples that still wait, at the end.
    pub(super) fn ended(&mut self) -> Vec<(u8, Sample)> {
        let mut samples = Vec::new();
        self.release(f64::INFINITY, self.numbers.restarts, &mut samples);
        samples.extend(self.without_acceleration());
        samples
    }

    /// The samples whose acceleration will not come.
    fn without_acceleration(&mut self) -> Vec<(u8, Sample)> {
        let each = self.sensors.iter_mut().filter_map(|(number, sensor)| {
            let sample = sensor.waiting.take()?;
            Some((*number, sensor.counted(sample)))
        });
        each.collect()
    }

    /// Notes a question that is being sent.
    pub(super) fn ask(&mut self, question: [u8; 4], time: f64) {
        self.asked = Some((question, time));
    }

    fn answered(&mut self, question: [u8; 4], time: f64) {
        if let Some((_, since)) = self.asked.take_if(|(asked, _)| *asked == question) {
            let took = time - since;
            self.round_trip_s = Some(self.round_trip_s.map_or(took, |least| least.min(took)));
        }
    }

    fn sensor(&mut self, number: u8) -> Option<&mut SensorState> {
        if !self.sensors.contains_key(&number) && self.sensors.len() >= MOST_SENSORS {
            return None;
        }
        Some(self.sensors.entry(number).or_default())
    }
}

/// Whether a message is an orientation or an acceleration.
fn is_of_a_sample(message: &Message) -> bool {
    matches!(
        message,
        Message::Rotation { .. } | Message::Acceleration { .. }
    )
}

impl SensorState {
    /// Samples a second from the first to the last (Hz).
    pub fn rate_hz(&self) -> Option<f64> {
        let [first, last] = self.span_s?;
        (last > first).then(|| (self.samples.saturating_sub(1)) as f64 / (last - first))
    }

    fn counted(&mut self, sample: Sample) -> Sample {
        self.samples += 1;
        self.without_acceleration += u64::from(sample.acceleration.is_none());
        let first = self.span_s.map_or(sample.time_s, |[first, _]| first);
        self.span_s = Some([first, sample.time_s]);
        sample
    }
}
