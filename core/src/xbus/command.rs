//! Commands to a sensor, and packets like those of a sensor for tests and simulations.

use super::item::DataId;
use super::packet::{EXTENDED, MAX_DATA_LENGTH, MessageId, PREAMBLE, checksum};

/// Bus address of a sensor that is alone on the line.
const MASTER: u8 = 0xFF;

/// Baud rate (bit/s) and its code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
#[repr(u8)]
pub enum Baudrate {
    B115200 = 0x02,
    B230400 = 0x01,
    B460800 = 0x00,
    B921600 = 0x80,
    B2000000 = 0x0C,
    B4000000 = 0x0D,
}

/// One entry of an output configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutputSetting {
    /// Data to send.
    pub id: DataId,
    /// Output rate (Hz); 0xFFFF means with every packet, as for counters and times.
    pub rate_hz: u16,
}

impl OutputSetting {
    /// Requests the item in every packet.
    pub const fn always(id: DataId) -> Self {
        Self {
            id,
            rate_hz: 0xFFFF,
        }
    }
}

/// Commands to a sensor. The configuration can only be changed in the configuration state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command<'a> {
    /// Stop measuring and enter the configuration state.
    GotoConfig,
    /// Start measuring with the present configuration.
    GotoMeasurement,
    /// Request the device ID.
    RequestDeviceId,
    /// Answer to the sensor's wake-up message after power-up: stay in the configuration state.
    WakeUpAck,
    /// Restart the sensor.
    Reset,
    /// Set the baud rate that applies after the next reset.
    SetBaudrate(Baudrate),
    /// Set which data to send at which rates.
    SetOutputConfiguration(&'a [OutputSetting]),
}

impl Command<'_> {
    /// Writes the packet to `packet` and returns its length (bytes), or `None` if it does not fit.
    pub fn encode(&self, packet: &mut [u8]) -> Option<usize> {
        let id = match self {
            Self::GotoConfig => MessageId::GOTO_CONFIG,
            Self::GotoMeasurement => MessageId::GOTO_MEASUREMENT,
            Self::RequestDeviceId => MessageId::REQUEST_DEVICE_ID,
            Self::WakeUpAck => MessageId::WAKE_UP_ACK,
            Self::Reset => MessageId::RESET,
            Self::SetBaudrate(_) => MessageId::BAUDRATE,
            Self::SetOutputConfiguration(_) => MessageId::OUTPUT_CONFIGURATION,
        };
        let mut writer = PacketWriter::new(packet, id);
        match self {
            Self::SetBaudrate(rate) => writer.data(&[*rate as u8])?,
            Self::SetOutputConfiguration(settings) => {
                for setting in *settings {
                    writer.data(&setting.id.0.to_be_bytes())?;
                    writer.data(&setting.rate_hz.to_be_bytes())?;
                }
            }
            _ => {}
        }
        writer.finish()
    }
}

/// Builds a packet in a buffer.
#[derive(Debug)]
pub struct PacketWriter<'a> {
    packet: &'a mut [u8],
    message_id: MessageId,
    /// Number of data bytes so far, stored after a header without extended length.
    length: usize,
}

impl<'a> PacketWriter<'a> {
    /// Starts an empty packet of the kind `message_id`.
    pub const fn new(packet: &'a mut [u8], message_id: MessageId) -> Self {
        Self {
            packet,
            message_id,
            length: 0,
        }
    }

    /// Appends data; returns `None` if it does not fit.
    pub fn data(&mut self, bytes: &[u8]) -> Option<()> {
        let start = 4 + self.length;
        self.packet
            .get_mut(start..start + bytes.len())?
            .copy_from_slice(bytes);
        self.length += bytes.len();
        Some(())
    }

    /// Appends an item; returns `None` if it does not fit or is longer than 255 bytes.
    pub fn item(&mut self, id: DataId, bytes: &[u8]) -> Option<()> {
        let size = u8::try_from(bytes.len()).ok()?;
        self.data(&id.0.to_be_bytes())?;
        self.data(&[size])?;
        self.data(bytes)
    }

    /// Appends an item of single-precision numbers; returns `None` if it does not fit.
    pub fn reals(&mut self, id: DataId, numbers: &[f32]) -> Option<()> {
        let size = u8::try_from(numbers.len() * 4).ok()?;
        self.data(&id.0.to_be_bytes())?;
        self.data(&[size])?;
        numbers
            .iter()
            .try_for_each(|number| self.data(&number.to_be_bytes()))
    }

    /// Writes header and checksum and returns the length of the packet (bytes), or `None` if it does not fit.
    pub fn finish(self) -> Option<usize> {
        let Self {
            packet,
            message_id,
            length,
        } = self;
        let header = match u8::try_from(length) {
            Ok(short) if short < EXTENDED => {
                packet
                    .get_mut(..4)?
                    .copy_from_slice(&[PREAMBLE, MASTER, message_id.0, short]);
                4
            }
            _ => {
                let long = u16::try_from(length)
                    .ok()
                    .filter(|_| length <= MAX_DATA_LENGTH)?;
                let [high, low] = long.to_be_bytes();
                // Move the data to make room for the two bytes of extended length.
                let moved = packet.get_mut(4..length + 6)?;
                moved.copy_within(..length, 2);
                packet.get_mut(..6)?.copy_from_slice(&[
                    PREAMBLE,
                    MASTER,
                    message_id.0,
                    EXTENDED,
                    high,
                    low,
                ]);
                6
            }
        };
        let (covered, rest) = packet.split_at_mut_checked(header + length)?;
        let sum = checksum(covered.get(1..)?);
        *rest.first_mut()? = sum.wrapping_neg();
        Some(header + length + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::xbus::{Decoder, Item, MAX_PACKET_LENGTH};

    #[test]
    fn commands_are_those_of_the_manual() {
        let settings = [
            OutputSetting::always(DataId::PACKET_COUNTER),
            OutputSetting::always(DataId::SAMPLE_TIME_FINE),
            OutputSetting {
                id: DataId::QUATERNION,
                rate_hz: 100,
            },
        ];
        let cases: [(Command<'_>, &[u8]); 5] = [
            (Command::GotoConfig, &[0xFA, 0xFF, 0x30, 0x00, 0xD1]),
            (Command::GotoMeasurement, &[0xFA, 0xFF, 0x10, 0x00, 0xF1]),
            (Command::RequestDeviceId, &[0xFA, 0xFF, 0x00, 0x00, 0x01]),
            (
                Command::SetBaudrate(Baudrate::B921600),
                &[0xFA, 0xFF, 0x18, 0x01, 0x80, 0x68],
            ),
            (
                Command::SetOutputConfiguration(&settings),
                &[
                    0xFA, 0xFF, 0xC0, 0x0C, 0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF, 0xFF, 0x20,
                    0x10, 0x00, 0x64, 0x05,
                ],
            ),
        ];
        for (command, expected) in cases {
            let mut packet = [0; 64];
            let length = command.encode(&mut packet).unwrap();
            assert_eq!(&packet[..length], expected);
            for short in 0..length {
                assert_eq!(command.encode(&mut packet[..short]), None);
            }
        }
    }

    #[test]
    fn written_packets_of_every_length_are_read() {
        let mut packet = [0; MAX_PACKET_LENGTH];
        for length in (0..600).chain(2030..=2048) {
            let mut writer = PacketWriter::new(&mut packet, MessageId::DEVICE_ID);
            for i in 0..length {
                let [byte, ..] = (i * 7_usize).to_le_bytes();
                writer.data(&[byte]).unwrap();
            }
            let total = writer.finish().unwrap();
            let mut decoder = Decoder::<MAX_PACKET_LENGTH>::new();
            let mut input = &packet[..total];
            let read = decoder.next(&mut input).unwrap();
            assert_eq!(read.data.len(), length);
            assert!(
                read.data
                    .iter()
                    .enumerate()
                    .all(|(i, &b)| b == (i * 7).to_le_bytes()[0])
            );
        }
        let mut room = [0; 2100];
        let mut writer = PacketWriter::new(&mut room, MessageId::DEVICE_ID);
        assert_eq!(writer.data(&[0; 2049]), Some(()));
        assert_eq!(writer.finish(), None);
    }

    #[test]
    fn items_are_read_back_as_written() {
        let mut packet = [0; 64];
        let mut writer = PacketWriter::new(&mut packet, MessageId::MT_DATA2);
        writer.item(DataId::PACKET_COUNTER, &[1, 2]).unwrap();
        writer
            .reals(DataId::RATE_OF_TURN, &[0.5, -1.0, 3.0])
            .unwrap();
        let total = writer.finish().unwrap();
        let mut decoder = Decoder::<64>::new();
        let mut input = &packet[..total];
        let mut items = decoder.next(&mut input).unwrap().items();
        assert_eq!(
            items.next().unwrap().decode(),
            Ok(Item::PacketCounter(0x0102))
        );
        match items.next().unwrap().decode() {
            Ok(Item::RateOfTurn(rate)) => {
                assert_eq!(
                    rate.to_f32().map(f32::to_bits),
                    [0.5f32, -1.0, 3.0].map(f32::to_bits)
                );
            }
            other => panic!("{other:?}"),
        }
        assert!(items.next().is_none());
    }
}
