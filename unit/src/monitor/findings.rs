//! What is wrong with a stream as a whole, in sentences: another speed of the line, another protocol or byte order, a
//! sensor that restarted or reports errors.

use std::collections::BTreeMap;

use bodyflight_core::xbus::{DataId, MessageId, Packet, UtcTime};

/// The message of measurements that 10-series sensors send by default.
const LEGACY_DATA: MessageId = MessageId(0x32);

/// Bytes without a packet after which the line's speed, or the protocol, is in doubt.
const WITHOUT_PACKET: u64 = 200;

/// Share of bytes outside packets from which a stream is hardly Xbus.
const MOSTLY: f64 = 0.9;

/// Longest run of packets that may be missing: more at once are a jump of the counter.
pub(super) const LONGEST_MISSING: u16 = 10_000;

/// What has been seen that packets and counts do not show.
#[derive(Debug, Default)]
pub(super) struct Findings {
    /// Printable bytes, and synchronisation bytes of UBX.
    printable: u64,
    ubx: u64,
    last_byte: u8,
    legacy: u64,
    wake_ups: u64,
    jumps: u64,
    errors: BTreeMap<u8, u64>,
    invalid_utc: u64,
    utc: u64,
    not_numbers: u64,
    swapped: u64,
    plain: u64,
}

impl Findings {
    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            let is_text = byte.is_ascii_graphic() || byte.is_ascii_whitespace();
            self.printable += u64::from(is_text);
            self.ubx += u64::from(self.last_byte == 0xB5 && *byte == 0x62);
            self.last_byte = *byte;
        }
    }

    pub(super) fn packet(&mut self, packet: &Packet<'_>) {
        match packet.message_id {
            LEGACY_DATA => self.legacy += 1,
            MessageId::WAKE_UP => self.wake_ups += 1,
            MessageId::ERROR => {
                let code = packet.data.first().copied().unwrap_or_default();
                *self.errors.entry(code).or_default() += 1;
            }
            _ => {}
        }
        for item in packet.items() {
            // Single precision, the default; other formats are told by their identifier.
            let is_real = item.id.0 & 0x3 == 0;
            let length = match item.id.kind() {
                DataId::QUATERNION => 4,
                DataId::ACCELERATION => 3,
                _ => continue,
            };
            if is_real && item.data.len() == 4 * length {
                self.number_order(item.data, length);
            }
        }
    }

    /// Compares both byte orders of a unit quaternion or an acceleration.
    fn number_order(&mut self, data: &[u8], length: usize) {
        let norm = |read: fn([u8; 4]) -> f32| {
            let squares = data.chunks_exact(4).map(|bytes| {
                let number = f64::from(read([bytes[0], bytes[1], bytes[2], bytes[3]]));
                number * number
            });
            squares.sum::<f64>().sqrt()
        };
        let is_credible = |norm: f64| {
            if length == 4 {
                (0.9..1.1).contains(&norm)
            } else {
                (0.1..200.0).contains(&norm)
            }
        };
        let (big, little) = (norm(f32::from_be_bytes), norm(f32::from_le_bytes));
        self.swapped += u64::from(!is_credible(big) && is_credible(little));
        self.plain += u64::from(is_credible(big));
    }

    pub(super) fn numbers(&mut self, is_number: bool) {
        self.not_numbers += u64::from(!is_number);
    }

    pub(super) fn time_of_day(&mut self, time: &UtcTime) {
        self.utc += 1;
        self.invalid_utc += u64::from(!is_valid(time));
    }

    pub(super) fn jumped(&mut self) {
        self.jumps += 1;
    }

    /// The findings after `bytes` bytes of which `skipped` were outside packets.
    pub(super) fn sentences(
        &self,
        bytes: u64,
        skipped: u64,
        packets: u64,
        restarts: u32,
    ) -> Vec<String> {
        let mut said = Vec::new();
        #[expect(clippy::cast_precision_loss, reason = "a share")]
        let share = |part: u64| part as f64 / bytes.max(1) as f64;
        if bytes >= WITHOUT_PACKET && (packets == 0 || share(skipped) > MOSTLY) {
            said.push(self.not_xbus(bytes, share(self.printable)));
        }
        if self.legacy > 0 {
            said.push(format!(
                "{} packets of legacy MTData (message 32), which do not say what they contain: configure the sensor for MTData2 \
                 (SetOutputConfiguration, message C0)",
                self.legacy
            ));
        }
        let restarts = u64::from(restarts).max(self.wake_ups);
        if restarts > 0 {
            said.push(format!(
                "the sensor restarted {}: its packet counter and its clock began again",
                times(restarts)
            ));
        } else if self.jumps > 0 {
            said.push(format!(
                "the packet counter jumped {}: the sensor restarted, or recordings were joined",
                times(self.jumps)
            ));
        }
        for (code, count) in &self.errors {
            said.push(format!(
                "the sensor reports error {code:02x} {}: {}",
                times(*count),
                error_text(*code)
            ));
        }
        if self.invalid_utc > 0 {
            said.push(format!(
                "{} of {} UTC times are marked invalid or impossible: the receiver has no fix yet",
                self.invalid_utc, self.utc
            ));
        }
        if self.not_numbers > 0 {
            said.push(format!(
                "{} items hold values that are no numbers (NaN or infinite), shown as null",
                self.not_numbers
            ));
        }
        if self.swapped > self.plain {
            said.push(
                "the numbers make sense only with their bytes in reverse order (little-endian): a converter swapped them, \
                 since sensors send big-endian"
                    .to_owned(),
            );
        }
        said
    }

    /// What a stream without packets is.
    fn not_xbus(&self, bytes: u64, printable: f64) -> String {
        if printable > 0.95 {
            return "text instead of Xbus packets, perhaps NMEA: set the sensor's port to Xbus"
                .to_owned();
        }
        if self.ubx * 200 > bytes {
            return "UBX messages of a receiver instead of Xbus packets".to_owned();
        }
        format!(
            "hardly an Xbus packet in {bytes} bytes: the speed of the line is probably another; sensors use 115200, 230400, \
             460800, 921600 or 2000000 bit/s (--baud)"
        )
    }
}

/// Whether a time of day is marked valid and exists.
fn is_valid(time: &UtcTime) -> bool {
    time.flags & 0x3 == 0x3
        && (1..=12).contains(&time.month)
        && (1..=31).contains(&time.day)
        && time.hour < 24
        && time.minute < 60
        && time.second < 61
        && time.nanosecond < 1_000_000_000
}

fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        2 => "twice".to_owned(),
        _ => format!("{count} times"),
    }
}

/// Meaning of an error code, as in the protocol's documentation.
fn error_text(code: u8) -> &'static str {
    match code {
        0x03 => "the period is invalid",
        0x04 => "the message is invalid in this state",
        0x1E => "its timer overflowed: it is asked for more output than it can send",
        0x20 => "the speed of the line is invalid",
        0x21 => "a parameter is invalid",
        0x28 => "the device has a fault",
        _ => "see the protocol's documentation",
    }
}
