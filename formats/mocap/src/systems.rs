//! The systems whose files are recognised by their content: how each is known, and how it is read.

use std::path::Path;

use crate::archive::{Archive, is_archive};
use crate::mapping::Mapping;
use crate::table::Table;
use crate::tree::Tree;
use crate::{acclaim, c3d, movella, nexus, opensense, sensors, smpl, workbook};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::{input, text};

/// What a file holds.
pub(crate) struct Content {
    /// Its kind, with an article.
    pub(crate) kind: &'static str,
    pub(crate) motion: Motion,
    /// Its mapping, if the system determines it.
    pub(crate) mapping: Option<Mapping>,
    pub(crate) warnings: Vec<String>,
    /// Whether its bones have the person's lengths.
    pub(crate) has_lengths: bool,
}

/// A motion before it is mapped.
pub(crate) enum Motion {
    Joints(Tree),
    Table(Table),
}

impl Content {
    fn table(
        kind: &'static str,
        table: Table,
        mapping: Option<Mapping>,
        warnings: Vec<String>,
    ) -> Self {
        Self {
            kind,
            motion: Motion::Table(table),
            mapping,
            warnings,
            has_lengths: true,
        }
    }
}

/// A system: whether these are its bytes, and its reader.
struct System {
    is: fn(&[u8]) -> bool,
    read: fn(&[u8], &Path) -> Result<Content>,
}

const FROM_FBX: &str = "export BVH: in MotionBuilder by File > Motion File Export, in Blender by File > Export > Motion Capture";
const FROM_SCENE: &str = "import it in Blender, and export BVH by File > Export > Motion Capture";

/// Formats without a reader: their name, their first bytes, and what to export instead.
const REFUSED: [(&str, &[u8], &str); 6] = [
    ("FBX", b"Kaydara FBX Binary", FROM_FBX),
    ("FBX", b"; FBX", FROM_FBX),
    ("binary glTF", b"glTF", FROM_SCENE),
    ("USD", b"PXR-USDC", FROM_SCENE),
    (
        "a workbook of old Excel",
        b"\xD0\xCF\x11\xE0",
        "save it as .xlsx",
    ),
    ("HDF5", b"\x89HDF", "export CSV, with a mapping"),
];

const SYSTEMS: [System; 5] = [
    System {
        is: c3d::is_c3d,
        read: |bytes, _| {
            let points = c3d::Points::read(bytes)?;
            Ok(Content::table(
                "a C3D file",
                Table::of_points(&points)?,
                None,
                Vec::new(),
            ))
        },
    },
    System {
        is: is_archive,
        read: |bytes, _| of_archive(bytes),
    },
    System {
        is: |bytes| begins(bytes, nexus::is_export),
        read: |bytes, _| {
            let (table, warnings) = nexus::read(&String::from_utf8_lossy(bytes))?;
            Ok(Content::table(
                "an export of Vicon Nexus",
                table,
                None,
                warnings,
            ))
        },
    },
    System {
        is: |bytes| begins(bytes, acclaim::is_amc),
        read: |bytes, path| {
            let (tree, warnings) = acclaim::read(&String::from_utf8_lossy(bytes), path)?;
            Ok(Content {
                kind: "a motion of Acclaim",
                motion: Motion::Joints(tree),
                mapping: None,
                warnings,
                has_lengths: true,
            })
        },
    },
    System {
        is: |bytes| begins(bytes, opensense::is_orientations),
        read: |bytes, _| {
            let table = Table::parse(&String::from_utf8_lossy(bytes))?;
            let (mapping, warnings) = opensense::mapping(&table)?;
            Ok(Content::table(
                "a table of OpenSim",
                table,
                mapping,
                warnings,
            ))
        },
    },
];

/// Bytes at the beginning of a text that show its format.
const HEAD: usize = 4096;

/// Text in UTF-16, as spreadsheets write it, in UTF-8; anything else as it is.
fn utf_8(bytes: Vec<u8>) -> Vec<u8> {
    text::marked_utf_16(&bytes).map_or(bytes, String::into_bytes)
}

fn begins(bytes: &[u8], is: fn(&str) -> bool) -> bool {
    let head = bytes.get(..HEAD).unwrap_or(bytes);
    is(&String::from_utf8_lossy(head))
}

fn refused(bytes: &[u8]) -> Option<Problem> {
    let start = bytes.get(..HEAD).unwrap_or(bytes);
    let is_json = String::from_utf8_lossy(start).trim_start().starts_with('{')
        && bytes
            .windows(8)
            .take(1 << 20)
            .any(|part| part == b"\"asset\":" || part == b"\"asset\" ");
    let json = ("glTF", &b""[..], FROM_SCENE);
    let of_bytes = REFUSED
        .iter()
        .find(|(_, first, _)| start.starts_with(first));
    let (name, _, instead) = of_bytes.or(is_json.then_some(&json))?;
    Some(Problem::bad_input(format!("this is {name}, which is not supported")).help(*instead))
}

/// The problem of a file that certainly is no motion. Tables may be, whatever their columns, as a mapping says.
fn another(bytes: &[u8]) -> Option<Problem> {
    use FileKind::{
        Empty, Flight, Mapping, Model, Pdf, Picture, Preset, Recording, Subject, WebPage,
    };
    let kinds = [
        Empty, Flight, Mapping, Model, Pdf, Picture, Preset, Recording, Subject, WebPage,
    ];
    let found = FileKind::of_head(bytes).filter(|found| kinds.contains(found));
    FileKind::Motion.mistaken(found)
}

fn of_archive(bytes: &[u8]) -> Result<Content> {
    let archive = Archive::read(bytes)?;
    if workbook::is_workbook(&archive) {
        let (table, mapping) = movella::read(&archive)?;
        return Ok(Content::table(
            "a workbook of MVN",
            table,
            Some(mapping),
            Vec::new(),
        ));
    }
    if smpl::is_motion(&archive) {
        let (tree, mapping, warnings) = smpl::read(&archive)?;
        return Ok(Content {
            kind: "a motion of SMPL",
            motion: Motion::Joints(tree),
            mapping: Some(mapping),
            warnings,
            has_lengths: false,
        });
    }
    let names: Vec<&str> = archive.names().take(10).collect();
    let message = format!(
        "expected an archive with poses of SMPL, or a workbook of MVN, found {}",
        names.join(", ")
    );
    Err(Problem::bad_input(message).help("unpack the archive, and import one of its files"))
}

/// Ends of the names of files that other systems write.
const ENDS: [&str; 13] = [
    ".bvh", ".amc", ".npz", ".xlsx", ".sto", ".mot", ".trc", ".c3d", ".csv", ".fbx", ".glb",
    ".gltf", ".usdc",
];

/// Whether a path is that of a file, or of a folder of sensors, of another system, by its name.
pub fn is_of_another_system(path: &Path) -> bool {
    if path.is_dir() {
        return !path.join("flight.toml").exists();
    }
    let name = path.to_string_lossy().to_ascii_lowercase();
    let name = name.trim_end_matches(".gz").trim_end_matches(".xz");
    ENDS.iter().any(|end| name.ends_with(end))
}

/// Reads a file or folder whose content shows its system; `None`, with its bytes, if it does not.
///
/// # Errors
/// Returns an error if it cannot be read, or does not follow the format of its system.
pub(crate) fn read(path: &Path) -> Result<core::result::Result<Content, Vec<u8>>> {
    if path.is_dir() {
        let (table, warnings) = sensors::read(path)?;
        return Ok(Ok(Content::table(
            "a folder of sensors",
            table,
            None,
            warnings,
        )));
    }
    parse(input::movement(path)?, path)
}

/// Same as [`read`], for the bytes of a file that were already read from `path`.
///
/// # Errors
/// Same as [`read`].
pub(crate) fn parse(bytes: Vec<u8>, path: &Path) -> Result<core::result::Result<Content, Vec<u8>>> {
    let bytes = utf_8(bytes);
    if let Some(problem) = refused(&bytes).or_else(|| another(&bytes)) {
        return Err(problem.in_file(path));
    }
    match SYSTEMS.iter().find(|system| (system.is)(&bytes)) {
        Some(system) => (system.read)(&bytes, path)
            .map(Ok)
            .map_err(|problem| problem.in_file(path)),
        None => Ok(Err(bytes)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_in_utf_16_is_read_in_either_order() {
        let text = "HIERARCHY\u{e9}";
        for (mark, bytes) in [
            ([0xFF, 0xFE], u16::to_le_bytes as fn(u16) -> [u8; 2]),
            ([0xFE, 0xFF], u16::to_be_bytes),
        ] {
            let wide = text.encode_utf16().flat_map(bytes);
            let wide: Vec<u8> = mark.into_iter().chain(wide).collect();
            assert_eq!(utf_8(wide), text.as_bytes());
        }
        assert_eq!(utf_8(b"PK\x03".to_vec()), b"PK\x03");
    }

    #[test]
    fn formats_without_a_reader_are_named_with_what_to_do() {
        for (bytes, name) in [
            (&b"Kaydara FBX Binary  \x00\x1a\x00"[..], "FBX"),
            (b"; FBX 7.4.0 project file\n", "FBX"),
            (b"glTF\x02\x00\x00\x00", "binary glTF"),
            (b"{\n \"asset\": {\"version\": \"2.0\"}}", "glTF"),
        ] {
            let problem = refused(bytes).unwrap();
            assert!(
                problem.to_string().contains(&format!("this is {name}")),
                "{problem}"
            );
            assert!(problem.help.unwrap().contains("BVH"));
        }
        assert!(refused(b"time,x\n0,1\n").is_none());
    }
}
