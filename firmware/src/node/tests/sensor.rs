//! One node with a simulated sensor.

use core::cell::Cell;
use std::rc::Rc;
use std::vec::Vec;

use embassy_futures::block_on;
use embassy_futures::select::select;

use super::super::*;
use crate::sensor::icm42688::tests::{Simulated, chip};
use crate::test_spi::{Chip, Pins};

/// Time and line of one node with its sensor.
struct Bench {
    clock: Rc<Cell<u64>>,
    chip: Rc<RefCell<Simulated>>,
    sent: Rc<RefCell<Vec<Packet>>>,
}

impl Line for Bench {
    fn now(&mut self) -> u64 {
        self.clock.set(self.clock.get() + 3);
        self.chip.borrow_mut().pass(3);
        self.clock.get()
    }

    fn hear(&mut self) -> Option<u8> {
        None
    }

    fn send(&mut self, packet: &[u8; PACKET_LENGTH]) {
        self.sent
            .borrow_mut()
            .extend(Decoder::new().next(&mut &packet[..]));
    }

    fn feed_watchdog(&mut self) {}

    fn shine(&mut self, _: bool) {}
}

/// Waits for the clock of the bench.
struct Waiting(Rc<Cell<u64>>);

impl DelayNs for Waiting {
    async fn delay_ns(&mut self, time: u32) {
        let end = self.0.get() + u64::from(time / 1000);
        while self.0.get() < end {
            yield_now().await;
        }
    }
}

#[test]
fn a_sensor_that_fails_is_told_and_set_up_again_and_costs_no_other_node_a_cycle() {
    let pins: Pins<Simulated> = chip([0, 0, 2048, 164, 0, 0]);
    let clock: Rc<Cell<u64>> = Rc::default();
    let sent: Rc<RefCell<Vec<Packet>>> = Rc::default();
    let line = Bench {
        clock: Rc::clone(&clock),
        chip: Rc::clone(&pins.chip),
        sent: Rc::clone(&sent),
    };
    let sensor = Icm42688::new(pins.clone(), pins.clone(), Waiting(Rc::clone(&clock)));
    let until = async {
        for (time, loses_supply) in [(300_000, true), (700_000, false)] {
            while clock.get() < time {
                yield_now().await;
            }
            if loses_supply {
                pins.chip.borrow_mut().reset();
            }
        }
    };
    block_on(select(run(Segment::Pelvis, line, sensor), until));
    let sent = sent.borrow();
    let numbers: Vec<u16> = sent.iter().map(|packet| packet.cycle).collect();
    let all: Vec<u16> = (0..u16::try_from(sent.len()).unwrap()).collect();
    assert_eq!(numbers, all);
    assert_eq!(
        sent.len(),
        67,
        "a packet every 10 ms after three of listening"
    );
    let is_good = |packet: &Packet| packet.age <= 100;
    let (before, after) = (&sent[5..27], &sent[50..]);
    assert!(before.iter().all(is_good) && after.iter().all(is_good));
    let rate = 10.0_f32.to_radians();
    let found = before
        .iter()
        .map(|packet| packet.reading().angular_velocity.x);
    let mean = found.sum::<f32>() / 22.0;
    assert!((mean - rate).abs() < 1e-3, "{mean}");
    // The supply was lost for the cycles from 28 on; the age says so, until there is no measurement to speak of.
    assert!(sent[29].age > 100 && sent[29].age < TOO_OLD);
    assert!(sent[31..36].iter().all(|packet| packet.age == TOO_OLD));
}
