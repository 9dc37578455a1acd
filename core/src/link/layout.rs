//! Rows of the byte table: what lies where in a message.

/// Version in the first byte of each frame; another one is refused and counted.
pub const PROTOCOL_VERSION: u8 = 1;

/// One field of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldLayout {
    /// Name.
    pub name: &'static str,
    /// Number type of one element.
    pub kind: &'static str,
    /// Number of elements.
    pub count: usize,
    /// Bytes of all elements.
    pub size: usize,
    /// Unit of one count.
    pub unit: &'static str,
    /// Accepted range, empty where any (finite) value is.
    pub range: &'static str,
    /// What it says.
    pub meaning: &'static str,
}

/// One message type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageLayout {
    /// Name.
    pub name: &'static str,
    /// Second byte of the header.
    pub code: u8,
    /// Bytes of the body.
    pub size: usize,
    /// The fields in wire order.
    pub fields: &'static [FieldLayout],
}
