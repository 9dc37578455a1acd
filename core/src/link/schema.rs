//! The byte table of the link as data, and its hash.

use super::layout::{FieldLayout, MessageLayout, PROTOCOL_VERSION};
use super::message::LAYOUTS;

/// The header at the start of every frame.
pub const HEADER: &[FieldLayout] = &[
    header_field("version", "u8", 1, "", "Protocol version"),
    header_field("type", "u8", 1, "", "Message type"),
    header_field(
        "session",
        "u16",
        2,
        "",
        "Session number, chosen by the host; a new one resets the filter",
    ),
    header_field(
        "sequence",
        "u32",
        4,
        "",
        "Sequence number of frames of this type in the session, from 0, wraps",
    ),
    header_field(
        "time",
        "u64",
        8,
        "us",
        "Sensor time for samples and their estimates, otherwise the sender's clock",
    ),
];

/// All message types.
pub const MESSAGES: &[MessageLayout] = LAYOUTS;

/// Hash of version, names, types, units and ranges. Both sides refuse to stream if their hashes differ.
pub const SCHEMA_HASH: u64 = schema_hash();

const fn header_field(
    name: &'static str,
    kind: &'static str,
    size: usize,
    unit: &'static str,
    meaning: &'static str,
) -> FieldLayout {
    FieldLayout {
        name,
        kind,
        count: 1,
        size,
        unit,
        range: "",
        meaning,
    }
}

// FNV-1a is short enough to run in a constant. The hash guards against mistakes, not attacks.
const fn fold(mut hash: u64, bytes: &[u8]) -> u64 {
    let mut rest = bytes;
    while let [byte, tail @ ..] = rest {
        hash = (hash ^ *byte as u64).wrapping_mul(0x0000_0100_0000_01B3);
        rest = tail;
    }
    // A separator that no text contains makes "ab" + "c" differ from "a" + "bc".
    (hash ^ 0xFF).wrapping_mul(0x0000_0100_0000_01B3)
}

const fn fold_fields(mut hash: u64, fields: &[FieldLayout]) -> u64 {
    let mut rest = fields;
    while let [field, tail @ ..] = rest {
        hash = fold(hash, field.name.as_bytes());
        hash = fold(hash, field.kind.as_bytes());
        hash = fold(hash, &(field.count as u64).to_le_bytes());
        hash = fold(hash, field.unit.as_bytes());
        hash = fold(hash, field.range.as_bytes());
        rest = tail;
    }
    hash
}

const fn schema_hash() -> u64 {
    let mut hash = fold(0xCBF2_9CE4_8422_2325, &[PROTOCOL_VERSION]);
    hash = fold_fields(hash, HEADER);
    let mut rest = MESSAGES;
    while let [message, tail @ ..] = rest {
        hash = fold(hash, message.name.as_bytes());
        hash = fold(hash, &[message.code]);
        hash = fold_fields(hash, message.fields);
        rest = tail;
    }
    hash
}
