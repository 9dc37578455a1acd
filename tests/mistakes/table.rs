//! Mistakes in files: the change to a folder with a good flight, the command, and the expected message.

/// A change made to a folder with a good flight before the program is run.
#[derive(Clone, Copy)]
pub(crate) enum Made {
    Nothing,
    /// Writes a file with this content.
    File(&'static str, &'static [u8]),
    /// Replaces a text in a file.
    Edit(&'static str, &'static str, &'static str),
    /// Modifies the recording with a function.
    Recording(fn(String) -> Vec<u8>),
    Folder(&'static str),
    /// Standard output is a full disk.
    FullDisk,
    /// Ctrl-C once this path exists.
    CtrlC(&'static str),
}

use Made::{Edit, File, Folder, Nothing, Recording};

pub(crate) struct Mistake {
    /// The mistake, as worded in docs/mistakes.md.
    pub(crate) what: &'static str,
    pub(crate) made: Made,
    /// Arguments of the program; `@` is replaced by the folder.
    pub(crate) call: &'static str,
    pub(crate) code: i32,
    /// Part of the expected message.
    pub(crate) says: &'static str,
}

pub(crate) const fn mistake(
    what: &'static str,
    made: Made,
    call: &'static str,
    code: i32,
    says: &'static str,
) -> Mistake {
    Mistake {
        what,
        made,
        call,
        code,
        says,
    }
}

fn utf_16(text: String) -> Vec<u8> {
    let units = std::iter::once(0xFEFF).chain(text.encode_utf16());
    units.flat_map(u16::to_le_bytes).collect()
}

fn marked(text: String) -> Vec<u8> {
    format!("\u{feff}{text}").into_bytes()
}

fn windows(text: String) -> Vec<u8> {
    text.replace('\n', "\r\n").into_bytes()
}

fn cut(text: String) -> Vec<u8> {
    text.as_bytes()[..text.len() * 3 / 4].to_vec()
}

fn without_frames(text: String) -> Vec<u8> {
    let (head, _) = text.split_once("<frames").expect("frames");
    format!("{head}<frames></frames></subject></mvnx>").into_bytes()
}

/// Mistakes in files, each with the message that it must produce.
pub(crate) const FILES: [Mistake; 48] = [
    mistake(
        "misspelt verb",
        Nothing,
        "simulat @flight.mvnx",
        2,
        "some similar subcommands exist",
    ),
    mistake(
        "misspelt option",
        Nothing,
        "simulate @flight.mvnx --modle a",
        2,
        "a similar argument exists: '--model'",
    ),
    mistake(
        "no file given",
        Nothing,
        "simulate",
        2,
        "required arguments were not provided",
    ),
    mistake(
        "misspelt path",
        Nothing,
        "simulate @fligth.mvnx",
        3,
        "cannot read this file",
    ),
    mistake(
        "folder without a flight",
        Folder("empty"),
        "simulate @empty",
        2,
        "this folder has no flight.toml",
    ),
    mistake(
        "subject for a flight",
        Nothing,
        "simulate @subject.toml",
        2,
        "this is a subject, not a flight.toml",
    ),
    mistake(
        "empty file",
        File("flight.mvnx", b""),
        "inspect @flight.mvnx",
        2,
        "this file is empty",
    ),
    mistake(
        "proprietary .mvn",
        File("a.mvn", b"\x42\x00\x42\x00\x01"),
        "inspect @a.mvn",
        2,
        "export it as .mvnx",
    ),
    mistake(
        "UTF-16",
        Recording(utf_16),
        "inspect @flight.mvnx",
        2,
        "save it as UTF-8",
    ),
    mistake(
        "zip archive",
        File("a.mvnx", b"PK\x03\x04"),
        "inspect @a.mvnx",
        2,
        "unpack it and give the .mvnx file inside",
    ),
    mistake(
        "Git LFS pointer",
        File("a.mvnx", b"version https://git-lfs.github.com/spec/v1\n"),
        "inspect @a.mvnx",
        2,
        "fetch the content with `git lfs pull`",
    ),
    mistake(
        "C3D for MVNX",
        File("a.c3d", b"\x02\x50\x08\x00"),
        "simulate @a.c3d",
        2,
        "this is a C3D file, not MVNX",
    ),
    mistake(
        "BVH for MVNX",
        File("a.bvh", b"HIERARCHY\nROOT Hips\n"),
        "simulate @a.bvh",
        2,
        "convert it to a recording: bodyflight import FILE",
    ),
    mistake(
        "track of a FlySight for MVNX",
        File("a.csv", b"time,lat,lon,hMSL\n"),
        "simulate @a.csv",
        2,
        "see what it says about the jump: bodyflight fall FILE",
    ),
    mistake(
        "plain text for MVNX",
        File("a.txt", b"hello"),
        "inspect @a.txt",
        2,
        "give a recording exported from MVN as .mvnx",
    ),
    mistake(
        "recording cut off",
        Recording(cut),
        "simulate @flight.mvnx",
        2,
        "the file ends too early",
    ),
    mistake(
        "recording without frames",
        Recording(without_frames),
        "simulate @flight.mvnx",
        2,
        "frame",
    ),
    mistake(
        "MVNX for a track",
        Nothing,
        "fall @flight.mvnx",
        2,
        "this is an MVNX recording, not a track",
    ),
    mistake(
        "CSV without the columns of a track",
        File("a.csv", b"a,b\n1,2\n"),
        "fall @a.csv",
        2,
        "expected the columns time_s and",
    ),
    mistake(
        "stature in centimetres",
        Edit("subject.toml", "1.75", "175"),
        "simulate @flight.toml",
        2,
        "if that is in centimetres, write 1.75",
    ),
    mistake(
        "stature in feet",
        Edit("subject.toml", "1.75", "5.74"),
        "simulate @flight.toml",
        2,
        "if that is in feet, write 1.75",
    ),
    mistake(
        "mass in pounds",
        Edit("subject.toml", "75.0", "260"),
        "simulate @flight.toml",
        2,
        "if the mass is in pounds, divide it by 2.205",
    ),
    mistake(
        "mass below zero",
        Edit("subject.toml", "75.0", "-75"),
        "simulate @flight.toml",
        2,
        "expected",
    ),
    mistake(
        "misspelt key",
        Edit("subject.toml", "height_m", "heigth_m"),
        "simulate @flight.toml",
        2,
        "did you mean height_m?",
    ),
    mistake(
        "misspelt choice",
        Edit("subject.toml", "\"male\"", "\"mael\""),
        "simulate @flight.toml",
        2,
        "did you mean male?",
    ),
    mistake(
        "text without quotes",
        Edit("flight.toml", "\"flight.mvnx\"", "flight.mvnx"),
        "simulate @flight.toml",
        2,
        "put text in quotes: recording = \"flight.mvnx\"",
    ),
    mistake(
        "number in quotes",
        Edit("flight.toml", "1.0", "\"1.0\""),
        "simulate @flight.toml",
        2,
        "invalid type: string",
    ),
    mistake(
        "decimal comma",
        Edit("flight.toml", "1.0", "1,0"),
        "simulate @flight.toml",
        2,
        "flight.toml:6",
    ),
    mistake(
        "density of g/m3",
        Edit("flight.toml", "1.0", "1000"),
        "simulate @flight.toml",
        2,
        "density",
    ),
    mistake(
        "path of Windows between double quotes",
        Edit(
            "flight.toml",
            "\"flight.mvnx\"",
            "\"C:\\Users\\me\\flight.mvnx\"",
        ),
        "simulate @flight.toml",
        2,
        "use single quotes or forward slashes: recording = 'C:\\Users\\me\\flight.mvnx'",
    ),
    mistake(
        "list of two numbers instead of three",
        Edit(
            "flight.toml",
            "density = 1.0",
            "density = 1.0\nvelocity = [0, 60]",
        ),
        "simulate @flight.toml",
        2,
        "field air.velocity: invalid length 2, expected a list of 3 values",
    ),
    mistake(
        "number for a table",
        Edit("subject.toml", "[gear]\nhelmet = true", "gear = 1"),
        "trim @subject.toml",
        2,
        "field gear: invalid type: integer `1`, expected a table",
    ),
    mistake(
        "neither of two shapes",
        Edit(
            "subject.toml",
            "[gear]",
            "[coefficients]\nf_arch = true\n\n[gear]",
        ),
        "trim @subject.toml",
        2,
        "field coefficients.f_arch: expected \"posture\" or a number",
    ),
    mistake(
        "text for a number in a load",
        File("m.toml", b"[[effect]]\nforce_n = \"9\"\nalong = \"left\"\n"),
        "simulate @flight.mvnx --model @m.toml",
        2,
        "force_n: invalid type: string \"9\", expected a number",
    ),
    mistake(
        "inputs with semicolons",
        Edit("inputs.csv", ",", ";"),
        "simulate @flight.toml",
        0,
        "23 frames, 0.1 s of flight",
    ),
    mistake(
        "inputs with commas and decimal commas",
        Edit("inputs.csv", "0,0,0,0,6,0.5,12", "0,0,0,0,6,0,5,12"),
        "simulate @flight.toml",
        2,
        "expected 7 fields as in the line of names, found 8",
    ),
    mistake(
        "text among the inputs",
        Edit("inputs.csv", "0.5", "half"),
        "simulate @flight.toml",
        2,
        "column damp_yaw: expected a number, found \"half\"",
    ),
    mistake(
        "track for inputs",
        File("inputs.csv", b"time_s,north_m,east_m,height_m\n0,0,0,0\n"),
        "simulate @flight.toml",
        2,
        "this is the track of a logger, not a table of inputs",
    ),
    mistake(
        "damping below zero, so that the simulation diverges",
        Edit("inputs.csv", "6,0.5,12", "-900,-900,-900"),
        "simulate @flight.toml",
        5,
        "the simulation diverges: at 0.",
    ),
    mistake(
        "folder for a recording",
        Folder("folder"),
        "inspect @folder @flight.toml",
        2,
        "this is a flight.toml, not MVNX",
    ),
    mistake(
        "missing subject",
        Edit("flight.toml", "subject.toml", "subjct.toml"),
        "simulate @flight.toml",
        3,
        "cannot read this file",
    ),
    mistake(
        "byte order mark before settings",
        Edit("subject.toml", "height_m", "\u{feff}height_m"),
        "simulate @flight.toml",
        0,
        "23 frames, 0.1 s of flight",
    ),
    mistake(
        "byte order mark before a recording",
        Recording(marked),
        "simulate @flight.toml",
        0,
        "23 frames, 0.1 s of flight",
    ),
    mistake(
        "Windows line endings",
        Recording(windows),
        "simulate @flight.toml",
        0,
        "23 frames, 0.1 s of flight",
    ),
    mistake(
        "degrees for radians",
        File("m.toml", b"[[effect]]\nname = \"mounting\"\nz_rad = 5.0\n"),
        "simulate @flight.mvnx --model @m.toml",
        2,
        "if that is in degrees, write 0.0873",
    ),
    mistake(
        "duplicate key",
        Edit("subject.toml", "mass_kg", "mass_kg = 70.0\nmass_kg"),
        "simulate @flight.toml",
        2,
        "duplicate key",
    ),
    mistake(
        "density given in two ways",
        Edit("flight.toml", "density", "altitude_m = 3000\ndensity"),
        "simulate @flight.toml",
        2,
        "density and altitude_m are both given",
    ),
    mistake(
        "rate that a preset does not support",
        Edit("flight.mvnx", "frameRate=\"240\"", "frameRate=\"60\""),
        "estimate @flight.toml --preset tracking",
        2,
        "expected 240 frames a second, found 60",
    ),
];
