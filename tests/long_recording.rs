//! Recordings of any length.

use std::io::Write;
use std::path::Path;

/// Writes `name/flight.toml` into a folder: the flight of the laboratory in the folder `from` again and again, with its frames
/// counted on, so many seconds at a frame rate (Hz).
///
/// # Panics
/// Panics if the flight cannot be read, or the new one not written.
pub fn repeated(folder: &Path, name: &str, from: &str, seconds: u32, rate: u32) {
    let text = std::fs::read_to_string(folder.join(from).join("flight.mvnx")).expect("a recording");
    let normal = text.find("type=\"normal\"").expect("frames");
    let begin = text[..normal].rfind("<frame ").expect("a frame");
    let end = text.rfind("</frame>").expect("a frame") + "</frame>".len();
    let frames: Vec<&str> = text[begin..end]
        .split_inclusive("</frame>")
        .map(str::trim)
        .collect();
    let into = folder.join(name);
    std::fs::create_dir_all(&into).expect("created");
    for file in ["flight.toml", "subject.toml"] {
        std::fs::copy(folder.join(from).join(file), into.join(file)).expect("copied");
    }
    let file = std::fs::File::create(into.join("flight.mvnx")).expect("created");
    let mut file = std::io::BufWriter::new(file);
    file.write_all(&text.as_bytes()[..begin]).expect("written");
    for (index, frame) in (0..seconds * rate).zip(frames.iter().cycle()) {
        let inside = &frame[frame.find('>').expect("a tag")..];
        let time = f64::from(index) * 1000.0 / f64::from(rate);
        writeln!(
            file,
            "<frame time=\"{time:.0}\" index=\"{index}\" type=\"normal\"{inside}"
        )
        .expect("written");
    }
    file.write_all(&text.as_bytes()[end..]).expect("written");
    file.flush().expect("written");
}
