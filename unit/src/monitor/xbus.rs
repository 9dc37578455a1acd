//! The packets of a sensor with their items, and how often each item occurs.

use std::collections::BTreeMap;

use bodyflight_core::xbus::{Decoder, Item, MAX_PACKET_LENGTH, MessageId, Packet, SampleClock};
use serde::Serialize;
use serde_json::{Map, Value};

use super::findings::{Findings, LONGEST_MISSING};
use super::reading::reading;

/// A decoded packet.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct PacketReading {
    /// Sensor time (s), unwrapped; none if the packet has no time.
    pub time_s: Option<f64>,
    /// Bus address.
    pub bus_id: u8,
    /// Message id, two hexadecimal digits; 36 is measurements.
    pub message_id: String,
    /// Measurements by name.
    pub items: Map<String, Value>,
    /// Items with invalid data.
    pub bad_items: u32,
}

/// How often an item occurred.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ItemTotals {
    /// Name with unit.
    pub name: &'static str,
    /// Number of occurrences.
    pub count: u64,
    /// Rate in the sensor's own time (Hz); none if its packets have no time.
    pub rate_hz: Option<f64>,
    /// The last value.
    pub last: Value,
}

/// Totals of what was decoded so far.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct XbusTotals {
    /// Bytes received.
    pub bytes: u64,
    /// Packets.
    pub packets: u64,
    /// Packets of measurements.
    pub measurements: u64,
    /// Bytes outside any packet.
    pub skipped_bytes: u32,
    /// Preambles followed by a wrong checksum.
    pub bad_checksums: u32,
    /// Preambles followed by an impossible length.
    pub bad_lengths: u32,
    /// Items with invalid data, and packets whose items do not fill them.
    pub bad_items: u64,
    /// Packets missing according to the packet counter.
    pub missing_packets: u64,
    /// Sensor time from the first packet to the last (s).
    pub duration_s: f64,
    /// Items by name.
    pub items: Vec<ItemTotals>,
    /// What is wrong with the stream as a whole, in sentences.
    pub findings: Vec<String>,
}

#[derive(Debug, Default)]
struct Tally {
    count: u64,
    last: Value,
}

/// Decodes the stream of one sensor.
#[derive(Debug, Default)]
pub struct Xbus {
    decoder: Decoder<MAX_PACKET_LENGTH>,
    survey: Survey,
}

/// Statistics over the packets.
#[derive(Debug, Default)]
struct Survey {
    clock: SampleClock,
    bytes: u64,
    packets: u64,
    measurements: u64,
    bad_items: u64,
    missing_packets: u64,
    last_counter: Option<u16>,
    span: Option<(f64, f64)>,
    tallies: BTreeMap<&'static str, Tally>,
    findings: Findings,
}

impl Xbus {
    /// A decoder that has received nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Accepts bytes in pieces of any size; returns the packets they complete.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<PacketReading> {
        self.survey.bytes += bytes.len() as u64;
        self.survey.findings.bytes(bytes);
        let mut packets = Vec::new();
        let mut input = bytes;
        while let Some(packet) = self.decoder.next(&mut input) {
            packets.push(self.survey.read(&packet));
        }
        packets
    }

    /// Abandons an incomplete packet, as at the end of a file; returns the packets found inside it.
    pub fn finish(&mut self) -> Vec<PacketReading> {
        let mut packets = Vec::new();
        while self.decoder.pending() > 0 {
            self.decoder.give_up();
            packets.extend(self.push(&[]));
        }
        packets
    }

    /// Totals of what was decoded so far.
    pub fn totals(&self) -> XbusTotals {
        let counters = self.decoder.counters();
        let survey = &self.survey;
        let duration = survey.span.map_or(0.0, |(first, last)| last - first);
        #[expect(clippy::cast_precision_loss, reason = "counts of packets")]
        let rate =
            |count: u64| (duration > 0.0).then(|| (count.saturating_sub(1)) as f64 / duration);
        XbusTotals {
            bytes: survey.bytes,
            packets: survey.packets,
            measurements: survey.measurements,
            skipped_bytes: counters.skipped_bytes,
            bad_checksums: counters.bad_checksum,
            bad_lengths: counters.bad_length,
            bad_items: survey.bad_items + u64::from(counters.bad_items),
            missing_packets: survey.missing_packets,
            duration_s: duration,
            items: survey
                .tallies
                .iter()
                .map(|(name, tally)| ItemTotals {
                    name,
                    count: tally.count,
                    rate_hz: rate(tally.count),
                    last: tally.last.clone(),
                })
                .collect(),
            findings: survey.findings.sentences(
                survey.bytes,
                u64::from(counters.skipped_bytes),
                survey.packets,
                survey.clock.restarts(),
            ),
        }
    }
}

impl Survey {
    fn read(&mut self, packet: &Packet<'_>) -> PacketReading {
        self.packets += 1;
        self.findings.packet(packet);
        if packet.message_id == MessageId::MT_DATA2 {
            self.measurements += 1;
        }
        let mut result = PacketReading {
            time_s: None,
            bus_id: packet.bus_id,
            message_id: format!("{:02x}", packet.message_id.0),
            items: Map::new(),
            bad_items: 0,
        };
        let (mut fine, mut solution) = (None, false);
        for raw in packet.items() {
            let Ok(item) = raw.decode() else {
                result.bad_items += 1;
                self.bad_items += 1;
                continue;
            };
            match item {
                Item::SampleTimeFine(ticks) => fine = Some(ticks),
                Item::PacketCounter(count) => self.count(count),
                Item::GnssPvt(_) => solution = true,
                Item::UtcTime(time) => self.findings.time_of_day(&time),
                _ => {}
            }
            let (name, value) = reading(&item);
            self.findings.numbers(is_number(&value));
            let tally = self.tallies.entry(name).or_default();
            tally.count += 1;
            tally.last = value.clone();
            result.items.insert(name.to_owned(), value);
        }
        #[expect(clippy::cast_precision_loss, reason = "2^53 us are 285 years")]
        let time = fine.map(|ticks| self.clock.time(ticks) as f64 / 1e6);
        result.time_s = time;
        // The time of a GNSS solution is earlier than that of the packets around it.
        if let Some(time) = time.filter(|_| !solution) {
            let (first, last) = self.span.unwrap_or((time, time));
            self.span = Some((first, last.max(time)));
        }
        result
    }

    fn count(&mut self, counter: u16) {
        if let Some(last) = self.last_counter {
            let missing = counter.wrapping_sub(last).saturating_sub(1);
            // A counter that begins again says nothing of what was lost meanwhile.
            if missing > LONGEST_MISSING {
                self.findings.jumped();
            } else {
                self.missing_packets += u64::from(missing);
            }
        }
        self.last_counter = Some(counter);
    }
}

/// Whether a value, or every part of it, is a number; JSON has none that are not.
fn is_number(value: &Value) -> bool {
    match value {
        Value::Null => false,
        Value::Array(parts) => parts.iter().all(is_number),
        _ => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::xbus::{DataId, PacketWriter};

    fn packet(counter: u16) -> Vec<u8> {
        let mut bytes = [0; 64];
        let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
        let ticks = u32::from(counter) * 100;
        writer
            .item(DataId::PACKET_COUNTER, &counter.to_be_bytes())
            .unwrap();
        writer
            .item(DataId::SAMPLE_TIME_FINE, &ticks.to_be_bytes())
            .unwrap();
        writer
            .reals(DataId::RATE_OF_TURN, &[0.5, -1.0, f32::from(counter)])
            .unwrap();
        let length = writer.finish().unwrap();
        bytes[..length].to_vec()
    }

    #[test]
    fn rates_follow_the_sensor_s_clock() {
        let mut xbus = Xbus::new();
        let mut readings = Vec::new();
        for counter in (0..101).filter(|counter| *counter != 50) {
            readings.extend(xbus.push(&packet(counter)));
        }
        assert_eq!(readings.len(), 100);
        assert_eq!(readings[10].time_s, Some(0.1));
        assert_eq!(
            readings[10].items["rate_of_turn_radps"],
            serde_json::json!([0.5, -1.0, 10.0])
        );
        let totals = xbus.totals();
        assert_eq!((totals.packets, totals.measurements), (100, 100));
        assert_eq!((totals.missing_packets, totals.bad_items), (1, 0));
        assert!((totals.duration_s - 1.0).abs() < 1e-9);
        let rate = &totals.items[1];
        assert_eq!((rate.name, rate.count), ("rate_of_turn_radps", 100));
        assert!((rate.rate_hz.unwrap() - 99.0).abs() < 1e-6);
    }

    #[test]
    fn the_end_of_a_file_releases_incomplete_packets() {
        let mut xbus = Xbus::new();
        // A chance preamble that announces more bytes than follow.
        let bytes = [vec![0xFA, 0xFF, 0x36, 0xF0], packet(7)].concat();
        assert!(xbus.push(&bytes).is_empty());
        assert_eq!(xbus.finish().len(), 1);
        assert_eq!(xbus.totals().skipped_bytes, 4);
    }
}
