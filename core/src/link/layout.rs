//! Types for the rows of the byte table: the position of every field in a message.

/// Protocol version in the first byte of each frame; frames of other versions are rejected and counted.
pub const PROTOCOL_VERSION: u8 = 1;

/// One field of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldLayout {
    /// Name of the field.
    pub name: &'static str,
    /// Number type of an element.
    pub kind: &'static str,
    /// Number of elements.
    pub count: usize,
    /// Total size of all elements (bytes).
    pub size: usize,
    /// Unit of one count.
    pub unit: &'static str,
    /// Accepted range; empty if any finite value is accepted.
    pub range: &'static str,
    /// Meaning of the field.
    pub meaning: &'static str,
}

/// A message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageLayout {
    /// Name of the message.
    pub name: &'static str,
    /// Type code, the second byte of the header.
    pub code: u8,
    /// Length of the body (bytes).
    pub size: usize,
    /// The fields in the order on the wire.
    pub fields: &'static [FieldLayout],
}
