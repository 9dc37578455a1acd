//! Writes points as a C3D file: one header, parameters, floats in Intel format.

const BLOCK: usize = 512;
/// The second byte of every C3D file.
const KEY: u8 = 0x50;

/// Name, kind, sizes and values of a parameter.
type Row<'a> = (&'a str, i8, &'a [u8], Vec<u8>);

/// A file of points in millimetres at a rate (Hz), which header and parameters state.
pub(crate) fn written(names: &[String], frames: &[Vec<[f64; 3]>], rate: f32) -> Vec<u8> {
    let length = names.iter().map(String::len).max().unwrap_or(0);
    let word = |value: usize| u16::try_from(value).expect("small").to_le_bytes().to_vec();
    let byte = |value: usize| u8::try_from(value).expect("small");
    let labels: Vec<u8> = names
        .iter()
        .flat_map(|name| format!("{name:length$}").into_bytes())
        .collect();
    let sizes = [byte(length), byte(names.len())];
    let mut parameters = vec![1, KEY, 0, 84, 5, 255];
    parameters.extend(b"POINT\x03\0\0");
    let rows: [Row<'_>; 6] = [
        ("RATE", 4, &[], rate.to_le_bytes().to_vec()),
        ("USED", 2, &[], word(names.len())),
        ("FRAMES", 2, &[], word(frames.len())),
        ("SCALE", 4, &[], (-0.1_f32).to_le_bytes().to_vec()),
        ("UNITS", -1, &[2], b"mm".to_vec()),
        ("LABELS", -1, &sizes, labels),
    ];
    for (name, kind, sizes, values) in rows {
        parameters.extend([byte(name.len()), 1]);
        parameters.extend(name.as_bytes());
        parameters.extend(word(5 + sizes.len() + values.len()));
        parameters.extend([kind.cast_unsigned(), byte(sizes.len())]);
        parameters.extend(sizes);
        parameters.extend(values);
        parameters.push(0);
    }
    let blocks = parameters.len().div_ceil(BLOCK);
    parameters.resize(blocks * BLOCK, 0);
    parameters[2] = byte(blocks);

    let mut file = vec![0; BLOCK];
    let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &[2, KEY]);
    put(2, &word(names.len()));
    put(6, &word(1));
    put(8, &word(frames.len()));
    put(12, &(-0.1_f32).to_le_bytes());
    put(16, &word(2 + blocks));
    put(20, &rate.to_le_bytes());
    file.extend(parameters);
    for place in frames.iter().flatten() {
        for value in place.iter().chain(&[0.0]) {
            #[expect(clippy::cast_possible_truncation, reason = "the file's precision")]
            file.extend((*value as f32).to_le_bytes());
        }
    }
    file.resize(file.len().next_multiple_of(BLOCK), 0);
    file
}
