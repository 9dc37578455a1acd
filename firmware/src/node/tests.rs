//! Ten nodes on one line, each with its own clock, heard by the unit's decoder.

mod sensor;

use std::rc::Rc;
use std::vec;
use std::vec::Vec;

use bodyflight_core::chain::cycle::{Cycle, Cycles};
use bodyflight_core::suit::placement::of_size;

use super::*;

/// Time that a packet and one of its bytes take (ns).
const LENGTH: u64 = 250_000;
const BYTE: u64 = 10_000;

/// What was sent, with its begin (ns of true time) and its sender.
type Sent = Vec<(u64, usize, [u8; PACKET_LENGTH])>;

/// A node at its place on the line.
struct Place {
    who: usize,
    /// True time (ns), and how fast this node's clock is (parts per million).
    true_time: u64,
    ppm: i64,
    /// Start of its clock (ns).
    started: u64,
    /// The next packet and byte of the line that it hears.
    next: (usize, usize),
    sent: Rc<RefCell<Sent>>,
    is_deaf: bool,
    lit: bool,
}

impl Line for Place {
    fn now(&mut self) -> u64 {
        let since = i128::from(self.true_time - self.started);
        let own = since * (1_000_000 + i128::from(self.ppm)) / 1_000_000;
        u64::try_from(own / 1000).unwrap()
    }

    fn hear(&mut self) -> Option<u8> {
        let sent = self.sent.borrow();
        while let Some((begin, from, bytes)) = sent.get(self.next.0) {
            let at = begin + (self.next.1 as u64 + 1) * BYTE;
            if at > self.true_time {
                return None;
            }
            let byte = bytes[self.next.1];
            self.next.1 += 1;
            if self.next.1 == PACKET_LENGTH {
                self.next = (self.next.0 + 1, 0);
            }
            // Who drives the line, or is off, hears nothing.
            if *from != self.who && at > self.started {
                return Some(if self.is_deaf { !byte } else { byte });
            }
        }
        None
    }

    fn send(&mut self, packet: &[u8; PACKET_LENGTH]) {
        self.sent
            .borrow_mut()
            .push((self.true_time, self.who, *packet));
    }

    fn feed_watchdog(&mut self) {}

    fn shine(&mut self, on: bool) {
        self.lit = on;
    }
}

/// A set of nodes, called at irregular intervals.
struct Set {
    now: u64,
    nodes: Vec<(Node, Place)>,
    /// When each node is called, and measures, next (ns).
    calls: Vec<u64>,
    measures: Vec<u64>,
    random: u64,
    sent: Rc<RefCell<Sent>>,
}

/// A reading that tells the nodes apart.
fn reading(address: Segment) -> Reading<f32> {
    let turn = f32::from(address as u8) + 0.25;
    Reading {
        angular_velocity: Vector3::new(turn, -turn, 0.5),
        specific_force: Vector3::new(0.0, turn, 9.75),
    }
}

impl Set {
    /// Nodes whose clocks differ by up to 100 ppm, off until they [start](Set::start).
    fn new(addresses: &[Segment]) -> Self {
        let sent: Rc<RefCell<Sent>> = Rc::default();
        let place = |who: usize| Place {
            who,
            true_time: 0,
            ppm: if who.is_multiple_of(2) { 100 } else { -100 },
            started: 0,
            next: (0, 0),
            sent: Rc::clone(&sent),
            is_deaf: false,
            lit: false,
        };
        let nodes = addresses.iter().enumerate();
        let nodes = nodes.map(|(who, address)| (Node::new(*address, 0), place(who)));
        Self {
            now: 0,
            nodes: nodes.collect(),
            calls: vec![u64::MAX; addresses.len()],
            measures: vec![0; addresses.len()],
            random: 1,
            sent,
        }
    }

    /// Starts a node, or starts it again.
    fn start(&mut self, who: usize) {
        let (node, place) = &mut self.nodes[who];
        place.started = self.now;
        place.true_time = self.now;
        *node = Node::new(node.address, place.now());
        self.calls[who] = self.now;
        self.measures[who] = self.now;
    }

    /// Starts all nodes.
    fn start_all(&mut self) {
        (0..self.nodes.len()).for_each(|who| self.start(who));
    }

    /// A number below `limit`.
    fn random(&mut self, limit: u64) -> u64 {
        self.random = self
            .random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (self.random >> 33) % limit
    }

    /// Runs for some time (ms).
    fn run(&mut self, millis: u64) {
        let end = self.now + millis * 1_000_000;
        while self.now < end {
            for who in 0..self.nodes.len() {
                if self.calls[who] > self.now {
                    continue;
                }
                let (node, place) = &mut self.nodes[who];
                place.true_time = self.now;
                if self.measures[who] <= self.now {
                    // At 200 Hz of the sensor's own clock, a percent off.
                    self.measures[who] += 5_050_000;
                    let time = place.now();
                    node.take(&reading(node.address), time);
                }
                let count = self.sent.borrow().len();
                node.serve(place);
                let is_sending = self.sent.borrow().len() > count;
                let busy = if is_sending { LENGTH } else { 0 };
                // As a rule a loop takes some microseconds, and now and then a look at the sensor as well.
                let rest = 1_000 + self.random(5_000);
                let has_looked = self.random(20) == 0;
                let look = if has_looked { 15_000 } else { 0 };
                self.calls[who] = self.now + busy + rest + look;
            }
            self.now += 1_000;
        }
    }

    /// What the unit hears: cycles, and its accounts.
    fn cycles(&self) -> (Vec<Cycle>, Cycles, Decoder) {
        let (mut decoder, mut cycles) = (Decoder::new(), Cycles::new());
        let mut found = Vec::new();
        for (_, _, bytes) in &*self.sent.borrow() {
            let mut input = &bytes[..];
            while let Some(packet) = decoder.next(&mut input) {
                found.extend(cycles.push(&packet));
            }
        }
        (found, cycles, decoder)
    }

    /// The number of packets that each node sent since a time (ns).
    fn sent_since(&self, time: u64) -> Vec<usize> {
        let sent = self.sent.borrow();
        let of = |who| {
            sent.iter()
                .filter(|(at, by, _)| *at >= time && *by == who)
                .count()
        };
        (0..self.nodes.len()).map(of).collect()
    }

    /// The shortest time between the end of a packet and the begin of the next (ns).
    fn gap(&self) -> i64 {
        let sent = self.sent.borrow();
        let begins = sent.windows(2).map(|pair| pair[1].0 - pair[0].0);
        i64::try_from(begins.min().unwrap()).unwrap() - LENGTH as i64
    }
}

#[test]
fn ten_nodes_never_talk_at_once_and_the_unit_has_every_reading() {
    let addresses = of_size(10).unwrap();
    let mut set = Set::new(addresses);
    set.start_all();
    set.run(530);
    assert!(set.gap() > 0, "{} ns", set.gap());
    let (cycles, accounts, decoder) = set.cycles();
    assert!(cycles.len() >= 48, "{}", cycles.len());
    assert_eq!(decoder.counters().skipped, 0);
    for cycle in &cycles[1..] {
        for address in addresses {
            let found = cycle.readings[*address].unwrap();
            let error = found.angular_velocity - reading(*address).angular_velocity;
            assert!(error.norm() < 1.0 / 800.0, "{address:?}: {error}");
            assert!((found.specific_force - reading(*address).specific_force).norm() < 0.01);
        }
    }
    for address in addresses {
        let account = accounts.nodes()[*address as usize];
        // The cycle in which the unit learns who belongs to the line.
        assert!(
            account.late <= 1 && account.missing == 0,
            "{address:?} {account:?}"
        );
        assert!(account.age <= 75, "{address:?} {account:?}");
    }
    for (node, place) in &set.nodes {
        assert_eq!(
            (node.counters.missed, node.counters.late),
            (0, 0),
            "{}",
            place.who
        );
        assert_eq!(node.skipped(), 0);
    }
}

#[test]
fn a_node_that_starts_late_or_again_takes_its_slot() {
    let addresses = of_size(5).unwrap();
    let pelvis = addresses
        .iter()
        .position(|a| *a == Segment::Pelvis)
        .unwrap();
    let other = (pelvis + 1) % addresses.len();
    let mut set = Set::new(addresses);
    set.start_all();
    set.run(100);
    set.start(other);
    let restarted = set.now;
    set.run(100);
    assert!(
        set.sent_since(restarted)[other] >= 9,
        "from the next cycle on"
    );
    // The pelvis listens for three cycles first, and all are silent with it.
    set.start(pelvis);
    let restarted = set.now;
    set.run(29);
    // The cycle that had begun ends before.
    let after = restarted + 5_000_000;
    let silent = set.sent_since(after);
    assert!(silent.iter().all(|count| *count == 0), "{silent:?}");
    set.run(100);
    let sent = set.sent_since(after);
    assert!(
        sent.iter().all(|count| (9..=10).contains(count)),
        "{sent:?}"
    );
    assert!(set.gap() > 0);
    // A packet of the pelvis that was damaged on the way to one node costs it that cycle alone.
    let missed = set.nodes[other].0.counters.missed;
    set.nodes[other].1.is_deaf = true;
    let deaf = set.now;
    set.run(20);
    set.nodes[other].1.is_deaf = false;
    assert_eq!(set.sent_since(deaf)[other], 0);
    set.run(20);
    assert_eq!(set.nodes[other].0.counters.missed, missed + 2);
    assert!(set.sent_since(deaf)[other] >= 1);
    assert!(set.nodes[other].0.skipped() >= 50);
}

#[test]
fn a_second_pelvis_is_silent_and_shows_it() {
    let mut set = Set::new(&[Segment::Pelvis, Segment::Thorax, Segment::Pelvis]);
    set.start(0);
    set.start(1);
    set.run(100);
    set.start(2);
    set.run(200);
    let sent = set.sent_since(0);
    assert!(sent[0] > 20 && sent[1] > 20 && sent[2] == 0, "{sent:?}");
    let mut lit = 0;
    for _ in 0..20 {
        set.run(100);
        lit += u32::from(set.nodes[2].1.lit);
    }
    assert_eq!(lit, TWICE.count_ones());
    assert_eq!(set.sent_since(0)[2], 0);
}

#[test]
fn a_slot_that_was_missed_is_not_used() {
    let mut set = Set::new(&[Segment::Pelvis, Segment::Thorax]);
    set.start_all();
    set.run(65);
    // Something keeps the node from the line from the pelvis's packet to after its slot.
    let stall = |set: &mut Set| {
        while set.nodes[1].0.next.is_none() {
            set.now += 1_000;
            let now = set.now;
            for (node, place) in &mut set.nodes {
                place.true_time = now;
                node.serve(place);
            }
        }
    };
    stall(&mut set);
    let sent = set.sent_since(0)[1];
    set.now += 1_000_000;
    set.run(2);
    assert_eq!(set.sent_since(0)[1], sent);
    assert_eq!(set.nodes[1].0.counters.late, 1);
    set.run(20);
    assert!(set.sent_since(0)[1] > sent);
}

#[test]
fn the_sum_of_the_packets_is_the_turn() {
    let mut node = Node::new(Segment::Head, 0);
    let (mut sent, mut turned) = (0.0, 0.0);
    for k in 0..200_u16 {
        for half in 0..2_u16 {
            let rate = f32::from((k * 7 + half * 13) % 17) * 0.321;
            turned += f64::from(rate) / 200.0;
            let reading = Reading {
                angular_velocity: Vector3::new(rate, 0.0, 0.0),
                specific_force: Vector3::zeros(),
            };
            node.take(&reading, u64::from(k) * PERIOD + u64::from(half) * 5_000);
        }
        let packet = node.packet(k, 0, u64::from(k) * PERIOD + 7_000);
        assert_eq!(packet.age, 45, "mean of 2 and 7 ms");
        sent += f64::from(packet.reading().angular_velocity.x) / 100.0;
    }
    assert!((sent - turned).abs() < 1e-4, "{sent} {turned}");
    assert_eq!(node.counters.old, 0);
}
