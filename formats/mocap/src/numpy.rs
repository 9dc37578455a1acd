//! Arrays of NumPy (`.npy`), as far as recordings need: numbers of one or two dimensions.

use bodyflight_io::diagnostic::{Problem, Result};

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of numbers, rows one after another.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array {
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

/// How numbers are stored: the name of the type, its size (bytes), and its conversion.
type Number = (&'static str, usize, fn(&[u8]) -> Option<f64>);

const NUMBERS: [Number; 4] = [
    ("f4", 4, |bytes| {
        Some(f32::from_le_bytes(bytes.try_into().ok()?).into())
    }),
    ("f8", 8, |bytes| {
        Some(f64::from_le_bytes(bytes.try_into().ok()?))
    }),
    ("i4", 4, |bytes| {
        Some(i32::from_le_bytes(bytes.try_into().ok()?).into())
    }),
    ("i8", 8, |bytes| {
        Some(i64::from_le_bytes(bytes.try_into().ok()?) as f64)
    }),
];

/// The text of a field of the header, which is a dictionary of Python.
fn field<'a>(header: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = header.split_once(&format!("'{name}'"))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

impl Array {
    /// Reads an array.
    ///
    /// # Errors
    /// Returns an error if it is not one of numbers, or its length is not that of its shape.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self> {
        let bad =
            |what: &str| Problem::bad_input(format!("expected an array of NumPy, found {what}"));
        let major = bytes
            .strip_prefix(MAGIC)
            .and_then(|rest| rest.first())
            .ok_or_else(|| bad("other bytes"))?;
        let wide = if *major == 1 { 2 } else { 4 };
        let size = bytes.get(8..8 + wide).ok_or_else(|| bad("its end"))?;
        let size = size
            .iter()
            .rev()
            .fold(0_usize, |size, byte| size << 8 | usize::from(*byte));
        let from = 8 + wide;
        let header = bytes.get(from..from.saturating_add(size));
        let header = header.ok_or_else(|| bad("its end in the header"))?;
        let header = String::from_utf8_lossy(header);
        let kind = field(&header, "descr").unwrap_or_default();
        let kind: String = kind
            .trim_start_matches('\'')
            .chars()
            .take_while(|c| *c != '\'')
            .collect();
        let little = kind.strip_prefix(['<', '|', '=']).unwrap_or_default();
        let Some((_, width, number)) = NUMBERS.iter().find(|(name, ..)| *name == little) else {
            return Err(bad(&format!("numbers of type \"{kind}\"")));
        };
        let shape = field(&header, "shape").and_then(|rest| rest.strip_prefix('('));
        let shape = shape
            .and_then(|rest| rest.split_once(')'))
            .map_or("", |(shape, _)| shape);
        let shape: Vec<usize> = shape
            .split(',')
            .map(str::trim)
            .filter(|word| !word.is_empty())
            .map(|word| {
                word.trim_end_matches('L')
                    .parse()
                    .map_err(|_| bad("no shape"))
            })
            .collect::<Result<_>>()?;
        let count = shape
            .iter()
            .try_fold(1_usize, |count, side| count.checked_mul(*side));
        let data = &bytes[from + size..];
        if count.and_then(|count| count.checked_mul(*width)) != Some(data.len()) {
            return Err(bad(&format!(
                "{} bytes for a shape of {shape:?}",
                data.len()
            )));
        }
        let mut values: Vec<f64> = data.chunks_exact(*width).filter_map(number).collect();
        let by_columns =
            field(&header, "fortran_order").is_some_and(|rest| rest.starts_with("True"));
        if let ([rows, columns], true) = (&shape[..], by_columns) {
            let at = |k: usize| values.get(k % columns * rows + k / columns).copied();
            values = (0..rows * columns).filter_map(at).collect();
        }
        Ok(Self { shape, values })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// An array of doubles as NumPy writes it.
    pub(crate) fn written(shape: &str, values: &[f64]) -> Vec<u8> {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({shape}), }}");
        let header = format!("{header:<117}\n");
        let mut bytes = [MAGIC, &[1, 0, 118, 0]].concat();
        bytes.extend(header.bytes());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        bytes
    }

    fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
        assert_eq!(from.len(), to.len());
        let at = bytes
            .windows(from.len())
            .position(|part| part == from.as_bytes());
        let mut bytes = bytes.to_vec();
        bytes[at.unwrap()..][..to.len()].copy_from_slice(to.as_bytes());
        bytes
    }

    #[test]
    fn arrays_of_any_order_and_width_are_read() {
        let bytes = written("2, 3", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let array = Array::parse(&bytes).unwrap();
        assert_eq!(array.shape, [2, 3]);
        assert_eq!(array.values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let columns = Array::parse(&replaced(&bytes, "False", "True ")).unwrap();
        assert_eq!(columns.values, [1.0, 3.0, 5.0, 2.0, 4.0, 6.0]);
        let scalar = Array::parse(&written("", &[120.0])).unwrap();
        assert_eq!((scalar.shape.len(), scalar.values), (0, vec![120.0]));
        let mut small = replaced(&written("2,", &[0.0]), "<f8", "<f4");
        small.truncate(small.len() - 8);
        small.extend([1.5_f32, -2.0].iter().flat_map(|value| value.to_le_bytes()));
        assert_eq!(Array::parse(&small).unwrap().values, [1.5, -2.0]);
    }

    #[test]
    fn other_bytes_are_refused() {
        let bytes = written("2, 3", &[0.0; 6]);
        for (bytes, part) in [
            (b"hello".to_vec(), "other bytes"),
            (replaced(&bytes, "<f8", "|O8"), "\"|O8\""),
            (
                replaced(&bytes, "(2, 3)", "(2, 4)"),
                "48 bytes for a shape of [2, 4]",
            ),
            (bytes[..20].to_vec(), "in the header"),
            (bytes[..140].to_vec(), "bytes for a shape"),
        ] {
            let said = Array::parse(&bytes).unwrap_err().to_string();
            assert!(said.contains(part), "{said}");
        }
    }
}
