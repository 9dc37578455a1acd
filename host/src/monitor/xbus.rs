//! A sensor's packets as text.

use bodyflight_core::xbus::{Counters, Decoder, Item, MAX_PACKET_LENGTH, MessageId, SampleClock};
use serde::Serialize;

/// One packet in words.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Line {
    /// Message type.
    pub message: u8,
    /// Sensor time (us), where it is sent.
    pub time_us: Option<u64>,
    /// Each measurement with its values.
    pub items: Vec<String>,
}

/// Turns bytes into packets in words.
#[derive(Debug, Default)]
pub struct Reader {
    decoder: Decoder<MAX_PACKET_LENGTH>,
    clock: SampleClock,
}

impl Reader {
    /// Nothing received yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// What the bytes held so far.
    pub fn counters(&self) -> &Counters {
        self.decoder.counters()
    }

    /// The packets that `bytes` complete.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Line> {
        let mut input = bytes;
        let mut lines = Vec::new();
        while let Some(packet) = self.decoder.next(&mut input) {
            let mut line = Line {
                message: packet.message_id.0,
                time_us: None,
                items: Vec::new(),
            };
            if packet.message_id == MessageId::MT_DATA2 {
                for item in packet.items() {
                    match item.decode() {
                        Ok(Item::SampleTimeFine(fine)) => {
                            line.time_us = Some(self.clock.time(fine))
                        }
                        Ok(item) => line.items.push(words(&item)),
                        Err(error) => line.items.push(error.to_string()),
                    }
                }
            }
            lines.push(line);
        }
        lines
    }
}

/// A measurement with its values and unit.
fn words(item: &Item<'_>) -> String {
    let list = |values: &[f64], unit: &str| {
        let values: Vec<String> = values.iter().map(|value| format!("{value:.5}")).collect();
        format!("{} {unit}", values.join(" "))
    };
    match item {
        Item::PacketCounter(count) => format!("packet {count}"),
        Item::Quaternion(system, q) => format!("quaternion {system:?} {}", list(&q.to_f64(), "")),
        Item::EulerAngles(system, a) => format!("angles {system:?} {}", list(&a.to_f64(), "deg")),
        Item::RateOfTurn(w) => format!("rate of turn {}", list(&w.to_f64(), "rad/s")),
        Item::Acceleration(a) => format!("acceleration {}", list(&a.to_f64(), "m/s2")),
        Item::FreeAcceleration(a) => format!("free acceleration {}", list(&a.to_f64(), "m/s2")),
        Item::MagneticField(m) => format!("magnetic field {}", list(&m.to_f64(), "")),
        Item::VelocityXyz(system, v) => format!("velocity {system:?} {}", list(&v.to_f64(), "m/s")),
        Item::LatLon(p) => format!("latitude, longitude {}", list(&p.to_f64(), "deg")),
        Item::AltitudeEllipsoid(h) => format!("altitude {}", list(&h.to_f64(), "m")),
        Item::Temperature(t) => format!("temperature {}", list(&t.to_f64(), "degC")),
        Item::BaroPressure(pressure) => format!("pressure {pressure} Pa"),
        Item::StatusWord(status) => format!("status {:#010x}", status.0),
        Item::StatusByte(status) => format!("status {:#04x}", status.0),
        other => format!("{other:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packet_is_read_off() {
        let bytes = [0xFA, 0xFF, 0x36, 0x05, 0x10, 0x20, 0x02, 0xDF, 0xC5, 0xF0];
        let mut reader = Reader::new();
        assert_eq!(reader.push(&bytes[..4]), []);
        let lines = reader.push(&bytes[4..]);
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].items, ["packet 57285"]);
        assert_eq!(reader.counters().packets, 1);
    }
}
