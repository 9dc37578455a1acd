//! The server that trackers look for, without a socket: it takes datagrams with their times of arrival, and says what to
//! send back.

use std::collections::BTreeMap;
use std::net::SocketAddr;

use serde::Serialize;

use super::packet::{Datagram, Handshake, Message, kind};
pub use super::sample::{Received, Sample};
use super::tracker::{SILENCE, Tracker};

/// Most trackers at once.
pub const MOST_TRACKERS: usize = 64;
/// Time between two signs of life to each tracker (s); they give up after 3 s without one.
const SIGN_PERIOD: f64 = 0.5;
/// Time after which a silent tracker is sent nothing any more (s).
const GIVEN_UP: f64 = 10.0;
/// Time in which a tracker that introduced itself must have sent an orientation, if its place is needed (s).
const PROBATION: f64 = 3.0;
/// The answer to a tracker that looks for a server: its type as one byte, and this text, filled up with zeros.
const GREETING: &[u8; 12] = b"Hey OVR =D 5";
const GREETING_LENGTH: usize = 64;
/// Most answers to one datagram.
const MOST_REPLIES: usize = 16;
/// What this server can do: bundles, and those with short heads.
const FEATURES: u8 = 0b11;

/// A datagram to send.
pub type Reply = (SocketAddr, Vec<u8>);

/// Datagrams that arrived apart from samples.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Counters {
    /// All datagrams.
    pub all: u64,
    /// Those that are none of a tracker.
    pub foreign: u64,
    /// Those of senders that had not introduced themselves.
    pub from_strangers: u64,
    /// Trackers, sensors and samples for which there was no place.
    pub refused: u64,
    /// Packets that end too early.
    pub damaged: u64,
    /// Orientations and accelerations that are none.
    pub impossible: u64,
    /// Packets of types that are not known, by type.
    pub unknown_types: BTreeMap<u32, u64>,
}

/// Tells trackers apart and keeps them sending.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Server {
    trackers: Vec<Tracker>,
    counters: Counters,
    /// Whether trackers count that did not introduce themselves, as in traffic recorded while they were sending.
    takes_strangers: bool,
    signed_s: Option<f64>,
    questions: u32,
}

impl Server {
    /// A server for recorded traffic, to which nobody may have been introduced.
    pub fn of_recorded() -> Self {
        Self {
            takes_strangers: true,
            ..Self::default()
        }
    }

    /// The trackers so far, in the order in which they came.
    pub fn trackers(&self) -> &[Tracker] {
        &self.trackers
    }

    /// What else arrived.
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Takes a datagram that arrived at a time (s); samples that are complete by it go to `samples`, answers to `replies`.
    pub fn take(
        &mut self,
        time: f64,
        from: SocketAddr,
        bytes: &[u8],
        samples: &mut Vec<Received>,
        replies: &mut Vec<Reply>,
    ) {
        self.counters.all += 1;
        let Some(datagram) = Datagram::parse(bytes) else {
            self.counters.foreign += 1;
            return;
        };
        // Only alone, since each is answered with more bytes than it may have.
        if let [Message::Handshake(handshake)] = datagram.messages.as_slice() {
            self.greet(time, from, handshake, replies);
        }
        let Some(tracker) = self
            .place(from)
            .or_else(|| self.stranger(time, from, &datagram))
        else {
            self.counters.from_strangers += 1;
            return;
        };
        let Some(own) = self.trackers.get_mut(tracker) else {
            return;
        };
        let mut complete = Vec::new();
        let most = replies.len() + MOST_REPLIES;
        for message in &datagram.messages {
            match message {
                Message::Damaged => self.counters.damaged += 1,
                Message::Impossible => self.counters.impossible += 1,
                Message::Unknown(kind) => {
                    *self.counters.unknown_types.entry(*kind).or_default() += 1
                }
                Message::SensorInfo { sensor, status, .. } => {
                    let answer = [&kind::SENSOR_INFO.to_be_bytes()[..], &[*sensor, *status]];
                    replies.push((from, answer.concat()));
                }
                Message::Features => replies.push((from, packet(kind::FEATURES, &[FEATURES]))),
                _ => {}
            }
            replies.truncate(most);
        }
        let Datagram { number, messages } = datagram;
        self.counters.refused += own.take(time, number, messages, &mut complete);
        samples.extend(complete.into_iter().map(|(sensor, sample)| Received {
            tracker,
            sensor,
            sample,
        }));
    }

    /// What is to be sent at a time (s) to keep trackers sending. Call it a few times a second.
    pub fn tick(&mut self, time: f64, replies: &mut Vec<Reply>) {
        if self.signed_s.is_some_and(|last| time - last < SIGN_PERIOD) {
            return;
        }
        self.signed_s = Some(time);
        for tracker in &mut self.trackers {
            if tracker.silent_s(time) > GIVEN_UP {
                continue;
            }
            self.questions = self.questions.wrapping_add(1);
            let question = self.questions.to_be_bytes();
            tracker.ask(question, time);
            replies.push((tracker.address, packet(kind::ROTATION, &[])));
            replies.push((tracker.address, packet(kind::PING, &question)));
        }
    }

    /// The samples that still wait for packets before them or for an acceleration, at the end.
    pub fn ended(&mut self) -> Vec<Received> {
        let each = self.trackers.iter_mut().enumerate();
        let each = each.flat_map(|(tracker, own)| {
            let waiting = own.ended().into_iter();
            waiting.map(move |(sensor, sample)| Received {
                tracker,
                sensor,
                sample,
            })
        });
        each.collect()
    }

    /// The trackers that have been silent for some time (s).
    pub fn silent(&self, time: f64) -> impl Iterator<Item = (&Tracker, f64)> {
        let each = self.trackers.iter().filter(|tracker| tracker.samples() > 0);
        each.map(move |tracker| (tracker, tracker.silent_s(time)))
            .filter(|(_, silent)| *silent > SILENCE)
    }

    fn place(&self, from: SocketAddr) -> Option<usize> {
        self.trackers
            .iter()
            .position(|tracker| tracker.address == from)
    }

    /// A tracker introduced itself: one that is known by its name, or a new one if there is a place.
    fn greet(
        &mut self,
        time: f64,
        from: SocketAddr,
        handshake: &Handshake,
        replies: &mut Vec<Reply>,
    ) {
        let name = match handshake.mac {
            Some(mac) => mac.map(|part| format!("{part:02X}")).join(":"),
            None => from.ip().to_string(),
        };
        // One that sent before recorded traffic had its introduction is called by its address.
        let is_known = |tracker: &Tracker| {
            tracker.name == name
                || self.takes_strangers
                    && tracker.address == from
                    && tracker.name == from.ip().to_string()
        };
        let known = self.trackers.iter().position(is_known);
        let Some(place) = known.or_else(|| self.room(time, &name, from)) else {
            self.counters.refused += 1;
            return;
        };
        // Another tracker that had this address has it no more.
        for (other, tracker) in self.trackers.iter_mut().enumerate() {
            if other != place && tracker.address == from {
                tracker.disturbed(time);
                tracker.address = SocketAddr::from(([0, 0, 0, 0], 0));
            }
        }
        if let Some(tracker) = self.trackers.get_mut(place) {
            tracker.greet(time, from, handshake.clone());
        }
        let mut greeting = vec![0; GREETING_LENGTH];
        for (byte, own) in greeting.iter_mut().zip([3].iter().chain(GREETING)) {
            *byte = *own;
        }
        replies.push((from, greeting));
    }

    /// A place for a new tracker: a free one, or that of one that never sent anything.
    fn room(&mut self, time: f64, name: &str, from: SocketAddr) -> Option<usize> {
        let tracker = Tracker::new(name.to_owned(), from, time);
        if self.trackers.len() < MOST_TRACKERS {
            self.trackers.push(tracker);
            return Some(self.trackers.len() - 1);
        }
        let place = self
            .trackers
            .iter()
            .position(|tracker| tracker.samples() == 0 && time - tracker.greeted_s > PROBATION)?;
        if let Some(own) = self.trackers.get_mut(place) {
            *own = tracker;
        }
        Some(place)
    }

    /// A sender that did not introduce itself, if that is allowed and it sends orientations.
    fn stranger(&mut self, time: f64, from: SocketAddr, datagram: &Datagram) -> Option<usize> {
        let is_rotation = |message: &Message| matches!(message, Message::Rotation { .. });
        if !self.takes_strangers || !datagram.messages.iter().any(is_rotation) {
            return None;
        }
        let name = from.ip().to_string();
        if let Some(known) = self
            .trackers
            .iter()
            .position(|tracker| tracker.name == name)
        {
            return Some(known);
        }
        self.room(time, &name, from)
    }
}

/// A packet of a server, which has the number 0.
fn packet(kind: u32, payload: &[u8]) -> Vec<u8> {
    [&kind.to_be_bytes()[..], &[0; 8], payload].concat()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn address(last: u8) -> SocketAddr {
        SocketAddr::from(([192, 168, 0, last], 6969))
    }

    fn numbered(kind: u32, number: u64, payload: &[u8]) -> Vec<u8> {
        [&kind.to_be_bytes()[..], &number.to_be_bytes(), payload].concat()
    }

    fn handshake(mac: [u8; 6], sensor_type: u32) -> Vec<u8> {
        let parts = [4, sensor_type, 2, 0, 0, 0, 22];
        let mut payload: Vec<u8> = parts
            .iter()
            .flat_map(|part: &u32| part.to_be_bytes())
            .collect();
        payload.extend(b"\x03abc");
        payload.extend(mac);
        numbered(3, 0, &payload)
    }

    fn rotation(number: u64, sensor: u8) -> Vec<u8> {
        let mut payload = vec![sensor, 1];
        payload.extend(
            [0.0_f32, 0.0, 0.6, 0.8]
                .iter()
                .flat_map(|part| part.to_be_bytes()),
        );
        payload.push(0);
        numbered(17, number, &payload)
    }

    fn acceleration(number: u64, sensor: u8) -> Vec<u8> {
        let parts = [1.0_f32, 2.0, 3.0]
            .iter()
            .flat_map(|part| part.to_be_bytes());
        numbered(4, number, &parts.chain([sensor]).collect::<Vec<u8>>())
    }

    /// A server, the samples so far and the replies to the last datagram.
    #[derive(Default)]
    struct Talk {
        server: Server,
        samples: Vec<Received>,
    }

    impl Talk {
        fn say(&mut self, time: f64, from: SocketAddr, bytes: &[u8]) -> Vec<Reply> {
            let mut replies = Vec::new();
            let Self { server, samples } = self;
            server.take(time, from, bytes, samples, &mut replies);
            replies
        }
    }

    #[test]
    fn trackers_are_greeted_kept_alive_and_told_apart() {
        let mut talk = Talk::default();
        assert!(talk.say(0.0, address(1), &rotation(1, 0)).is_empty());
        assert_eq!(talk.server.counters().from_strangers, 1);
        let replies = talk.say(0.0, address(1), &handshake([1, 2, 3, 4, 5, 6], 13));
        assert_eq!(&replies[0].1[..14], b"\x03Hey OVR =D 5\0");
        talk.say(0.0, address(2), &handshake([1, 2, 3, 4, 5, 7], 4));
        let mut replies = Vec::new();
        talk.server.tick(0.6, &mut replies);
        assert_eq!(replies.len(), 4, "a sign and a question each");
        // A question comes back as it was sent.
        let (to, question) = replies[1].clone();
        talk.say(0.62, to, &question);
        talk.say(0.7, address(1), &rotation(1, 0));
        talk.say(0.701, address(1), &acceleration(2, 0));
        // Its second sensor, without an acceleration so far.
        talk.say(0.702, address(1), &rotation(3, 1));
        talk.say(0.8, address(1), &rotation(6, 0));
        talk.say(0.81, address(1), &acceleration(7, 0));
        talk.say(0.81, address(1), &acceleration(7, 0));
        talk.say(0.81, address(1), &rotation(5, 0));
        talk.samples.extend(talk.server.ended());
        let got = talk.samples.iter();
        let got: Vec<_> = got
            .map(|got| {
                (
                    got.tracker,
                    got.sensor,
                    got.sample.number,
                    got.sample.lost,
                    got.sample.acceleration.is_some(),
                )
            })
            .collect();
        assert_eq!(
            got,
            [
                (0, 0, 1, 0, true),
                (0, 0, 5, 1, false),
                (0, 0, 6, 0, true),
                (0, 1, 3, 0, false)
            ]
        );
        assert!((talk.samples[0].sample.time_s - 0.7).abs() < 1e-9);
        // The sixth came before the fifth, which was sent no later.
        assert!((talk.samples[1].sample.time_s - 0.8).abs() < 1e-9);
        let [first, second] = talk.server.trackers() else {
            panic!("two trackers");
        };
        assert_eq!(first.name, "01:02:03:04:05:06");
        assert_eq!((first.lost(), first.disordered()), (1, [1, 1]));
        assert!((first.round_trip_s.unwrap() - 0.02).abs() < 1e-9);
        assert_eq!(first.sensors[&0].sensor_type, 13);
        assert_eq!(second.samples(), 0);
        let silent: Vec<_> = talk
            .server
            .silent(5.0)
            .map(|(own, _)| own.name.clone())
            .collect();
        assert_eq!(silent, ["01:02:03:04:05:06"]);
        let mut replies = Vec::new();
        talk.server.tick(60.0, &mut replies);
        assert!(replies.is_empty(), "who is gone is left alone");
    }

    #[test]
    fn a_tracker_that_restarts_is_the_same_and_loses_nothing() {
        let mut talk = Talk::default();
        talk.say(0.0, address(1), &handshake([9; 6], 4));
        for number in 1000..1010 {
            talk.say(1.0, address(1), &rotation(number, 0));
        }
        // It comes back with another address, and counts from 1.
        talk.say(8.0, address(3), &handshake([9; 6], 4));
        for number in 1..10 {
            talk.say(8.5, address(3), &rotation(number, 0));
        }
        talk.samples.extend(talk.server.ended());
        assert_eq!((talk.server.trackers().len(), talk.samples.len()), (1, 19));
        let own = &talk.server.trackers()[0];
        assert_eq!((own.lost(), own.restarts()), (0, 1));
        assert_eq!(own.restarted_s, [8.5]);
        let restarts: Vec<u64> = talk.samples.iter().map(|own| own.sample.restarts).collect();
        assert_eq!(restarts, [[0; 10].as_slice(), &[1; 9]].concat());
        assert!((talk.server.trackers()[0].longest_silence_s - 7.0).abs() < 1e-9);
        // One that had only lost its server goes on.
        talk.say(20.0, address(3), &handshake([9; 6], 4));
        talk.say(20.1, address(3), &rotation(10, 0));
        assert_eq!(talk.server.trackers()[0].restarts(), 1);
    }

    /// Traffic that begins while trackers send: one that restarts is the same, though only then it says its name.
    #[test]
    fn a_tracker_that_introduces_itself_late_is_the_one_at_its_address() {
        let mut talk = Talk {
            server: Server::of_recorded(),
            samples: Vec::new(),
        };
        for number in 1000..1010 {
            talk.say(1.0, address(1), &rotation(number, 0));
        }
        talk.say(5.0, address(1), &handshake([9; 6], 4));
        talk.say(5.1, address(1), &rotation(1, 0));
        let [own] = talk.server.trackers() else {
            panic!("one tracker");
        };
        assert_eq!((own.name.as_str(), own.restarts()), ("192.168.0.1", 1));
        assert_eq!(own.handshake.protocol, 22);
    }

    #[test]
    fn two_trackers_of_one_name_or_at_one_address_are_told() {
        let doubled = |second: [u8; 6], from: u8, after: f64| {
            let mut talk = Talk::default();
            talk.say(0.0, address(1), &handshake([9; 6], 4));
            for number in 1..200_u32 {
                let time = 0.01 * f64::from(number);
                talk.say(time, address(1), &rotation(u64::from(number), 0));
            }
            talk.say(2.0 + after, address(from), &handshake(second, 4));
            talk.server.trackers()[0].is_doubled
        };
        assert!(doubled([9; 6], 2, 0.1) && doubled([8; 6], 1, 0.1));
        // Another one elsewhere, the same again, and one that has got another address meanwhile.
        assert!(!doubled([8; 6], 2, 0.1) && !doubled([9; 6], 1, 0.1));
        assert!(!doubled([9; 6], 2, 5.0) && !doubled([8; 6], 1, 5.0));
    }

    #[test]
    fn sensors_say_what_they_are_and_bundles_are_asked_for() {
        let mut talk = Talk::default();
        talk.say(0.0, address(1), &handshake([9; 6], 4));
        let replies = talk.say(0.1, address(1), &numbered(15, 1, &[1, 1, 4, 0, 3, 0, 0, 0]));
        assert_eq!(replies, [(address(1), vec![0, 0, 0, 15, 1, 1])]);
        assert!(talk.server.trackers()[0].sensors[&1].has_magnetometer);
        let replies = talk.say(0.1, address(1), &numbered(22, 2, &[6]));
        assert_eq!(replies[0].1, numbered(22, 0, &[3]));
        talk.say(0.1, address(1), &numbered(201, 3, &[]));
        talk.say(0.1, address(1), b"GET / HTTP/1.1\r\n\r\n");
        let counters = talk.server.counters();
        assert_eq!((counters.foreign, counters.unknown_types[&201]), (1, 1));
    }

    /// A flood of trackers that never send cannot take the places of those that do.
    #[test]
    fn a_flood_of_addresses_stays_bounded_and_pushes_nobody_out() {
        let mut talk = Talk::default();
        talk.say(0.0, address(1), &handshake([1; 6], 4));
        talk.say(0.0, address(1), &rotation(1, 0));
        talk.say(0.0, address(1), &rotation(2, 0));
        for k in 0..10_000_u32 {
            let time = f64::from(k) * 1e-3;
            let [_, one, two, three] = k.to_be_bytes();
            let from = SocketAddr::from(([10, one, two, three], 6969));
            talk.say(time, from, &handshake([7, 7, 7, one, two, three], 4));
            talk.say(time, from, &numbered(k % 256, u64::from(k), &[]));
        }
        assert_eq!(talk.server.trackers().len(), MOST_TRACKERS);
        assert!(talk.server.counters().refused > 5000);
        assert_eq!(talk.server.trackers()[0].name, "01:01:01:01:01:01");
        // A tracker that comes after the flood finds a place.
        talk.say(20.0, address(2), &handshake([2; 6], 4));
        assert!(
            talk.server
                .trackers()
                .iter()
                .any(|own| own.name == "02:02:02:02:02:02")
        );
    }

    proptest! {
        /// A network that delays packets by up to a tenth of a second and sends some twice costs no sample.
        #[test]
        fn packets_out_of_order_cost_no_sample(seed in 0_u32..1000, twice in 1_u32..9) {
            let mixed = |k: u32| (k ^ (seed << 8)).wrapping_mul(2_654_435_761) >> 16 & 0xFF;
            let mut sent = Vec::new();
            for k in 1..600_u32 {
                let number = 2 * u64::from(k);
                for (number, bytes) in [(number, rotation(number, 0)), (number + 1, acceleration(number + 1, 0))] {
                    let time = 0.005 * number as f64;
                    let delay = |by: u32| 1e-3 * f64::from(mixed(k ^ by) % 100);
                    let by = u32::from(number % 2 == 0);
                    sent.push((time + delay(by), bytes.clone()));
                    if k % twice == 0 {
                        sent.push((time + delay(by + 77), bytes));
                    }
                }
            }
            sent.sort_by(|one, other| one.0.total_cmp(&other.0));
            let mut talk = Talk::default();
            talk.say(0.0, address(1), &handshake([9; 6], 4));
            // The first packet that arrives is the first one: what was before is not known.
            talk.say(0.0, address(1), &rotation(1, 0));
            for (time, bytes) in &sent {
                talk.say(*time, address(1), bytes);
            }
            talk.samples.extend(talk.server.ended());
            let numbers: Vec<u64> = talk.samples.iter().map(|own| own.sample.number).collect();
            let expected: Vec<u64> = core::iter::once(1).chain((1..600).map(|k| 2 * k)).collect();
            prop_assert_eq!(numbers, expected);
            prop_assert!(talk.samples.iter().skip(1).all(|own| own.sample.acceleration.is_some() && own.sample.lost == 0));
            let times: Vec<f64> = talk.samples.iter().map(|own| own.sample.time_s).collect();
            prop_assert!(times.windows(2).all(|pair| pair[0] <= pair[1]));
            let own = &talk.server.trackers()[0];
            prop_assert_eq!((own.received(), own.lost(), own.restarts(), own.unused), (1199, 0, 0, 0));
        }

        #[test]
        fn no_datagrams_stop_it(
            steps in prop::collection::vec((0_u8..4, 0_u32..110, 0_u64..80, any::<Vec<u8>>()), 0..60),
        ) {
            let mut talk = Talk::default();
            let mut time = 0.0;
            for (from, kind, number, payload) in steps {
                time += 0.1;
                let replies = talk.say(time, address(from), &numbered(kind, number, &payload));
                // Nobody can make it send more than a little to an address that is not its own.
                let sent: usize = replies.iter().map(|(_, bytes)| bytes.len()).sum();
                prop_assert!(replies.len() <= 16 && sent <= 208, "{}", payload.len());
                talk.server.tick(time, &mut Vec::new());
            }
            talk.samples.extend(talk.server.ended());
            // Import refuses tables whose times fall.
            let mut latest = BTreeMap::new();
            for Received { tracker, sensor, sample } in &talk.samples {
                let before = latest.insert((tracker, sensor), sample.time_s);
                prop_assert!(before.is_none_or(|before| before <= sample.time_s));
            }
            let sampled: u64 = talk.server.trackers().iter().map(Tracker::samples).sum();
            prop_assert_eq!(sampled, talk.samples.len() as u64);
        }
    }
}
