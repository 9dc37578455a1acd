//! Messages as Protocol Buffers, as far as the exported ones need them.

pub mod descriptor;

/// Wire types of the format.
const VARINT: u32 = 0;
const EIGHT_BYTES: u32 = 1;
const COUNTED: u32 = 2;
const FOUR_BYTES: u32 = 5;

/// A message that is being encoded. Fields are written even if they are zero, so that messages of a kind resemble each
/// other and compress well.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Message(Vec<u8>);

impl Message {
    /// The encoded message.
    pub fn into_bytes(self) -> Vec<u8> {
        self.0
    }

    /// A field of 64-bit floating point.
    pub fn double(&mut self, field: u32, number: f64) {
        self.tag(field, EIGHT_BYTES);
        self.0.extend(number.to_le_bytes());
    }

    /// A field of 32-bit floating point, to which the number is rounded.
    pub fn float(&mut self, field: u32, number: f64) {
        self.tag(field, FOUR_BYTES);
        #[expect(clippy::cast_possible_truncation, reason = "rounds as documented")]
        self.0.extend((number as f32).to_le_bytes());
    }

    /// A field of a whole number or a truth value.
    pub fn whole(&mut self, field: u32, number: u64) {
        self.tag(field, VARINT);
        self.varint(number);
    }

    /// A field of text.
    pub fn text(&mut self, field: u32, text: &str) {
        self.bytes(field, text.as_bytes());
    }

    /// A field of a message, which `fill` writes.
    pub fn message(&mut self, field: u32, fill: impl FnOnce(&mut Self)) {
        let mut inner = Self::default();
        fill(&mut inner);
        self.bytes(field, &inner.0);
    }

    /// A repeated field of whole numbers.
    pub fn wholes(&mut self, field: u32, numbers: &[u64]) {
        let mut inner = Self::default();
        numbers.iter().for_each(|number| inner.varint(*number));
        self.bytes(field, &inner.0);
    }

    fn bytes(&mut self, field: u32, bytes: &[u8]) {
        self.tag(field, COUNTED);
        self.varint(bytes.len() as u64);
        self.0.extend(bytes);
    }

    fn tag(&mut self, field: u32, wire_type: u32) {
        self.varint(u64::from(field << 3 | wire_type));
    }

    fn varint(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.0.push((number & 0x7f) as u8 | 0x80);
            number >>= 7;
        }
        self.0.push((number & 0x7f) as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_encoded_as_in_the_documentation_of_the_format() {
        // The examples of protobuf.dev/programming-guides/encoding: 150, "testing", a message in a message, and a packed list.
        let mut message = Message::default();
        message.whole(1, 150);
        message.text(2, "testing");
        message.message(3, |inner| inner.whole(1, 150));
        message.wholes(6, &[3, 270, 86942]);
        message.double(7, 1.0);
        message.float(8, 0.5);
        let wanted = [
            &[0x08, 0x96, 0x01][..],
            &[0x12, 0x07, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67],
            &[0x1a, 0x03, 0x08, 0x96, 0x01],
            &[0x32, 0x06, 0x03, 0x8e, 0x02, 0x9e, 0xa7, 0x05],
            &[0x39, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f],
            &[0x45, 0, 0, 0, 0x3f],
        ];
        assert_eq!(message.into_bytes(), wanted.concat());
    }
}
