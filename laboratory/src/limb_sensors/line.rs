//! The readings as the bytes of the sensors' line, with a receiver's solutions after the slots.

use bodyflight_core::chain::{Packet, Rounding};
use bodyflight_core::frame::Vector;
use bodyflight_core::suit::strapdown::Reading;

use super::{Row, Streams};
use crate::sensor_bytes::solution;

/// Cycles in a second.
const CYCLES: f64 = 100.0;
/// Time without a new measurement after which a node is silent (s): it is dead.
const DEAD: f64 = 0.1;
/// Time from the instant of a solution to its arrival (s), and the accuracy that the receiver states (m/s).
const LATENCY: f64 = 0.1;
const STATED: f64 = 0.25;

/// After the calibration the person stands still for longer than in the files (s), as before boarding. Until then a second
/// of readings of the upright pose comes again, forwards and backwards.
pub const STANDING: f64 = 10.0;
/// Begin and length of that second (s).
const AGAIN: [f64; 2] = [60.4, 1.0];

/// A node: the measurements that its chip has made and not yet, and what rounding leaves over.
struct Node<'a> {
    address: bodyflight_core::Segment,
    rows: &'a [Row],
    rounding: Rounding,
}

impl Streams {
    /// What is sent in each cycle, and when it begins (s). The flight begins at [`Streams::flight_s`] and [`STANDING`], and with
    /// it the receiver is switched on.
    pub fn line(&self) -> Vec<(f64, Vec<u8>)> {
        let mut nodes: Vec<_> = (self.sensors.iter())
            .map(|(address, rows)| Node {
                address: *address,
                rows,
                rounding: Rounding::default(),
            })
            .collect();
        nodes.sort_by_key(|node| node.address as u8);
        let ends = self.sensors.iter().filter_map(|(_, rows)| rows.last());
        let end = ends.map(|row| row.0).fold(0.0, f64::max) + STANDING;
        let mut solutions = self.solutions();
        let mut sent = Vec::new();
        loop {
            let number = sent.len();
            let time = number as f64 / CYCLES;
            if time > end {
                return sent;
            }
            let mut bytes = Vec::new();
            for node in &mut nodes {
                bytes.extend(node.packet(number, time).iter().flat_map(Packet::encode));
            }
            while let Some((_, message)) = solutions.next_if(|(arrival, _)| *arrival <= time) {
                bytes.extend(message);
            }
            sent.push((time, bytes));
        }
    }

    /// Arrival (s) and bytes of the receiver's solutions from the begin of the flight on.
    fn solutions(&self) -> std::iter::Peekable<impl Iterator<Item = (f64, Vec<u8>)>> {
        let flown = self.track.iter().filter_map(|fix| {
            let (time, velocity) = fix.in_flight()?;
            let message = solution(time, &Vector::from_components(velocity), STATED);
            let arrival = self.flight_s + STANDING + time + LATENCY;
            Some((arrival, message.encode().to_vec()))
        });
        flown.peekable()
    }
}

/// Time of the recorded readings that are sent at a time on the line (s).
fn recorded(time: f64) -> f64 {
    let [begin, length] = AGAIN;
    let standing = time - begin;
    if standing < 0.0 {
        return time;
    }
    if standing > STANDING {
        return time - STANDING;
    }
    let phase = (standing / length).rem_euclid(2.0);
    begin + length * if phase < 1.0 { phase } else { 2.0 - phase }
}

impl Node<'_> {
    /// The packet of a cycle; `None` from a node that is dead.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "counters wrap, and ages saturate"
    )]
    fn packet(&mut self, number: usize, time: f64) -> Option<Packet> {
        let recorded = recorded(time);
        let made = self.rows.partition_point(|row| row.0 <= recorded);
        let (measured, rate, force) = self.rows.get(made.checked_sub(1)?)?;
        let age = recorded - measured;
        let reading = Reading {
            angular_velocity: rate.cast::<f32>(),
            specific_force: force.cast::<f32>(),
        };
        let [rates, forces] = self.rounding.counts(&reading);
        (age < DEAD).then(|| Packet {
            segment: self.address,
            cycle: number as u16,
            time: (time * 1e6).round() as u32,
            age: (age * 1e4).round() as u8,
            rates,
            forces,
        })
    }
}
