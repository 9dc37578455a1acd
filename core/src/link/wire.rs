//! The encoding of each kind of number, and the macro that defines messages.

use super::decode_error::DecodeError;
use super::layout::FieldLayout;

/// Why a value of an undamaged frame is invalid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BadValue {
    NotFinite,
    OutOfRange,
}

/// Writes bytes to a buffer; every write is checked, so a short buffer causes no panic.
pub(super) struct Writer<'a> {
    rest: &'a mut [u8],
    written: usize,
}

impl<'a> Writer<'a> {
    pub(super) fn new(buffer: &'a mut [u8]) -> Self {
        Self {
            rest: buffer,
            written: 0,
        }
    }

    pub(super) fn put<const N: usize>(&mut self, bytes: [u8; N]) -> Option<()> {
        let (place, rest) = core::mem::take(&mut self.rest).split_first_chunk_mut::<N>()?;
        *place = bytes;
        self.rest = rest;
        self.written += N;
        Some(())
    }

    pub(super) fn written(&self) -> usize {
        self.written
    }
}

/// Reads bytes from a buffer. Lengths are checked beforehand; missing bytes read as zero.
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn take<const N: usize>(&mut self) -> [u8; N] {
        match self.0.split_first_chunk::<N>() {
            Some((bytes, rest)) => {
                self.0 = rest;
                *bytes
            }
            None => {
                self.0 = &[];
                [0; N]
            }
        }
    }
}

/// A value of fixed size on the wire.
pub(super) trait Wire: Copy {
    /// Size on the wire (bytes).
    const SIZE: usize;
    /// Number type in the byte table.
    const KIND: &'static str;
    /// Number of elements.
    const COUNT: usize = 1;

    /// Appends the value; returns `None` if the buffer is full.
    fn put(self, writer: &mut Writer<'_>) -> Option<()>;
    /// Reads the next value.
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue>;
    /// Checks that the value lies in `low..=high`; only floating-point fields have a range.
    fn check(&self, _low: f32, _high: f32) -> Result<(), BadValue> {
        Ok(())
    }
}

macro_rules! wire_integers {
    ($($integer:ident),*) => { $(
        impl Wire for $integer {
            const SIZE: usize = size_of::<Self>();
            const KIND: &'static str = stringify!($integer);
            fn put(self, writer: &mut Writer<'_>) -> Option<()> {
                writer.put(self.to_le_bytes())
            }
            fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
                Ok(Self::from_le_bytes(reader.take()))
            }
        }
    )* };
}
wire_integers!(u8, u16, u32, u64, i16);

impl Wire for f32 {
    const SIZE: usize = 4;
    const KIND: &'static str = "f32";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(self.to_le_bytes())
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        Ok(Self::from_le_bytes(reader.take()))
    }
    fn check(&self, low: f32, high: f32) -> Result<(), BadValue> {
        if !self.is_finite() {
            Err(BadValue::NotFinite)
        } else if (low..=high).contains(self) {
            Ok(())
        } else {
            Err(BadValue::OutOfRange)
        }
    }
}

impl<V: Wire + Default, const N: usize> Wire for [V; N] {
    const SIZE: usize = V::SIZE * N;
    const KIND: &'static str = V::KIND;
    const COUNT: usize = N;
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        self.into_iter().try_for_each(|value| value.put(writer))
    }
    // Out of line: many messages have arrays of the same kind, and a unit little flash.
    #[inline(never)]
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        let mut values = [V::default(); N];
        for value in &mut values {
            *value = V::take(reader)?;
        }
        Ok(values)
    }
    fn check(&self, low: f32, high: f32) -> Result<(), BadValue> {
        self.iter().try_for_each(|value| value.check(low, high))
    }
}

/// The body of a message type.
pub(super) trait Body: Sized {
    /// Size on the wire (bytes).
    const SIZE: usize;
    /// The fields in the order on the wire.
    const FIELDS: &'static [FieldLayout];
    fn put(&self, writer: &mut Writer<'_>) -> Option<()>;
    /// Reads the body, or returns the name of the invalid field and the reason.
    fn take(reader: &mut Reader<'_>) -> Result<Self, (&'static str, BadValue)>;
}

/// Defines a message body: the struct, its codec and its rows in the byte table, from one list of fields.
///
/// Each field is `/// meaning` `name: type = "unit"`, followed by `in low..=high` for floats. A float without a range
/// only has to be finite.
macro_rules! body {
    (
        $(#[$attribute:meta])*
        $name:ident {
            $(
                #[doc = $meaning:literal]
                $field:ident : $kind:ty = $unit:tt $(in $low:literal ..= $high:literal)?
            ),* $(,)?
        }
    ) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub struct $name {
            $(
                #[doc = $meaning]
                #[doc = $crate::link::wire::unit_text!($unit)]
                $(#[doc = concat!("\n\nRange: ", stringify!($low), " to ", stringify!($high))])?
                pub $field: $kind,
            )*
        }

        impl $crate::link::wire::Body for $name {
            const SIZE: usize = 0 $(+ <$kind as $crate::link::wire::Wire>::SIZE)*;
            const FIELDS: &'static [$crate::link::layout::FieldLayout] = &[$(
                $crate::link::layout::FieldLayout {
                    name: stringify!($field),
                    kind: <$kind as $crate::link::wire::Wire>::KIND,
                    count: <$kind as $crate::link::wire::Wire>::COUNT,
                    size: <$kind as $crate::link::wire::Wire>::SIZE,
                    unit: $unit,
                    range: concat!($(stringify!($low), " to ", stringify!($high))?),
                    meaning: $meaning,
                }
            ),*];

            fn put(&self, _writer: &mut $crate::link::wire::Writer<'_>) -> Option<()> {
                $($crate::link::wire::Wire::put(self.$field, _writer)?;)*
                Some(())
            }

            fn take(
                _reader: &mut $crate::link::wire::Reader<'_>,
            ) -> Result<Self, (&'static str, $crate::link::wire::BadValue)> {
                $(
                    let $field = <$kind as $crate::link::wire::Wire>::take(_reader)
                        .map_err(|why| (stringify!($field), why))?;
                    #[allow(unused_mut, unused_assignments, reason = "the range is optional")]
                    let (mut low, mut high) = (f32::MIN, f32::MAX);
                    $((low, high) = ($low, $high);)?
                    $crate::link::wire::Wire::check(&$field, low, high)
                        .map_err(|why| (stringify!($field), why))?;
                )*
                Ok(Self { $($field),* })
            }
        }
    };
}

/// The line about the unit in the documentation of a field; empty for a plain number.
macro_rules! unit_text {
    ("") => {
        ""
    };
    ($unit:literal) => {
        concat!("\n\nUnit: ", $unit)
    };
}

/// Defines a number with named values; any other number is rejected.
macro_rules! code {
    (
        $(#[$attribute:meta])*
        $name:ident { $( #[doc = $meaning:literal] $variant:ident = $number:literal ),* $(,)? }
    ) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        pub enum $name {
            $( #[doc = $meaning] $variant = $number, )*
        }

        impl $crate::link::wire::Wire for $name {
            const SIZE: usize = 1;
            const KIND: &'static str =
                concat!("u8: ", $(stringify!($number), " ", stringify!($variant), " "),*);
            fn put(self, writer: &mut $crate::link::wire::Writer<'_>) -> Option<()> {
                writer.put([self as u8])
            }
            fn take(
                reader: &mut $crate::link::wire::Reader<'_>,
            ) -> Result<Self, $crate::link::wire::BadValue> {
                let [number] = reader.take();
                match number {
                    $( $number => Ok(Self::$variant), )*
                    _ => Err($crate::link::wire::BadValue::OutOfRange),
                }
            }
        }
    };
}

pub(super) use {body, code, unit_text};

/// Decodes a body from bytes whose checksum is correct.
pub(super) fn take_body<B: Body>(body: &[u8]) -> Result<B, DecodeError> {
    if body.len() != B::SIZE {
        return Err(DecodeError::Length {
            found: body.len(),
            expected: B::SIZE,
        });
    }
    B::take(&mut Reader::new(body)).map_err(|(field, why)| match why {
        BadValue::NotFinite => DecodeError::NotFinite { field },
        BadValue::OutOfRange => DecodeError::OutOfRange { field },
    })
}
