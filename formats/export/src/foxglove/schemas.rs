//! The schemas of the messages. Foxglove and Rerun recognise Foxglove's schemas by name; they are the published ones, field
//! by field (`python/tests/test_exports.py` compares them).

use crate::columns::quantity::{Of, Quantity, Unit};
use crate::protobuf::descriptor::{Field, File, Kind, Type, described};
use bodyflight_core::Segment;

/// A schema, as a file carries it.
pub struct Schema {
    /// Full name of the message.
    pub name: &'static str,
    /// Its description and those of all messages in it.
    pub descriptors: Vec<u8>,
}

/// One field, or several.
enum Count {
    One(&'static str, Kind),
    Many(&'static str, Kind),
}

use Count::{Many, One};
use Kind::{Bytes, Double, Fixed32, Flag, Int32, Int64, Text, TypeIn};

const COLOR: Kind = Kind::Of("foxglove.Color");
const DURATION: Kind = Kind::Of("google.protobuf.Duration");
const POINT: Kind = Kind::Of("foxglove.Point3");
const POSE: Kind = Kind::Of("foxglove.Pose");
const TIMESTAMP: Kind = Kind::Of("google.protobuf.Timestamp");
const VECTOR: Kind = Kind::Of("foxglove.Vector3");
const ROTATION: Kind = Kind::Of("foxglove.Quaternion");

/// Messages by full name, with their fields in the order of their numbers; each follows those that it needs.
const MESSAGES: [(&str, &[Count]); 22] = [
    (
        "google.protobuf.Timestamp",
        &[One("seconds", Int64), One("nanos", Int32)],
    ),
    (
        "google.protobuf.Duration",
        &[One("seconds", Int64), One("nanos", Int32)],
    ),
    (
        "foxglove.Color",
        &[
            One("r", Double),
            One("g", Double),
            One("b", Double),
            One("a", Double),
        ],
    ),
    (
        "foxglove.Vector3",
        &[One("x", Double), One("y", Double), One("z", Double)],
    ),
    (
        "foxglove.Point3",
        &[One("x", Double), One("y", Double), One("z", Double)],
    ),
    (
        "foxglove.Quaternion",
        &[
            One("x", Double),
            One("y", Double),
            One("z", Double),
            One("w", Double),
        ],
    ),
    (
        "foxglove.Pose",
        &[One("position", VECTOR), One("orientation", ROTATION)],
    ),
    (
        "foxglove.KeyValuePair",
        &[One("key", Text), One("value", Text)],
    ),
    (
        "foxglove.ArrowPrimitive",
        &[
            One("pose", POSE),
            One("shaft_length", Double),
            One("shaft_diameter", Double),
            One("head_length", Double),
            One("head_diameter", Double),
            One("color", COLOR),
        ],
    ),
    (
        "foxglove.CubePrimitive",
        &[One("pose", POSE), One("size", VECTOR), One("color", COLOR)],
    ),
    (
        "foxglove.SpherePrimitive",
        &[One("pose", POSE), One("size", VECTOR), One("color", COLOR)],
    ),
    (
        "foxglove.CylinderPrimitive",
        &[
            One("pose", POSE),
            One("size", VECTOR),
            One("bottom_scale", Double),
            One("top_scale", Double),
            One("color", COLOR),
        ],
    ),
    (
        "foxglove.LinePrimitive",
        &[
            One("type", TypeIn("foxglove.LinePrimitive")),
            One("pose", POSE),
            One("thickness", Double),
            One("scale_invariant", Flag),
            Many("points", POINT),
            One("color", COLOR),
            Many("colors", COLOR),
            Many("indices", Fixed32),
        ],
    ),
    (
        "foxglove.TriangleListPrimitive",
        &[
            One("pose", POSE),
            Many("points", POINT),
            One("color", COLOR),
            Many("colors", COLOR),
            Many("indices", Fixed32),
        ],
    ),
    (
        "foxglove.TextPrimitive",
        &[
            One("pose", POSE),
            One("billboard", Flag),
            One("font_size", Double),
            One("scale_invariant", Flag),
            One("color", COLOR),
            One("text", Text),
        ],
    ),
    (
        "foxglove.ModelPrimitive",
        &[
            One("pose", POSE),
            One("scale", VECTOR),
            One("color", COLOR),
            One("override_color", Flag),
            One("url", Text),
            One("media_type", Text),
            One("data", Bytes),
        ],
    ),
    (
        "foxglove.SceneEntityDeletion",
        &[
            One("timestamp", TIMESTAMP),
            One("type", TypeIn("foxglove.SceneEntityDeletion")),
            One("id", Text),
        ],
    ),
    (
        "foxglove.SceneEntity",
        &[
            One("timestamp", TIMESTAMP),
            One("frame_id", Text),
            One("id", Text),
            One("lifetime", DURATION),
            One("frame_locked", Flag),
            Many("metadata", Kind::Of("foxglove.KeyValuePair")),
            Many("arrows", Kind::Of("foxglove.ArrowPrimitive")),
            Many("cubes", Kind::Of("foxglove.CubePrimitive")),
            Many("spheres", Kind::Of("foxglove.SpherePrimitive")),
            Many("cylinders", Kind::Of("foxglove.CylinderPrimitive")),
            Many("lines", Kind::Of("foxglove.LinePrimitive")),
            Many("triangles", Kind::Of("foxglove.TriangleListPrimitive")),
            Many("texts", Kind::Of("foxglove.TextPrimitive")),
            Many("models", Kind::Of("foxglove.ModelPrimitive")),
        ],
    ),
    (
        "foxglove.SceneUpdate",
        &[
            Many("deletions", Kind::Of("foxglove.SceneEntityDeletion")),
            Many("entities", Kind::Of("foxglove.SceneEntity")),
        ],
    ),
    (
        "foxglove.FrameTransform",
        &[
            One("timestamp", TIMESTAMP),
            One("parent_frame_id", Text),
            One("child_frame_id", Text),
            One("translation", VECTOR),
            One("rotation", ROTATION),
        ],
    ),
    (
        "foxglove.FrameTransforms",
        &[Many("transforms", Kind::Of("foxglove.FrameTransform"))],
    ),
    (
        "foxglove.PoseInFrame",
        &[
            One("timestamp", TIMESTAMP),
            One("frame_id", Text),
            One("pose", POSE),
        ],
    ),
];

/// Values of the enumeration `Type` in a message.
fn values(message: &str) -> &'static [&'static str] {
    match message {
        "foxglove.LinePrimitive" => &["LINE_STRIP", "LINE_LOOP", "LINE_LIST"],
        "foxglove.SceneEntityDeletion" => &["MATCHING_ID", "ALL"],
        _ => &[],
    }
}

/// Package and own name of a message.
fn parted(name: &'static str) -> (&'static str, &'static str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

/// The file in which a message is published.
fn file_of(name: &'static str) -> String {
    match parted(name) {
        ("google.protobuf", own) => format!("google/protobuf/{}.proto", own.to_lowercase()),
        (package, own) => format!("{package}/{own}.proto"),
    }
}

/// Adds the file of a message after those that it needs.
fn collect(name: &'static str, files: &mut Vec<File>) {
    let Some((_, counts)) = MESSAGES.iter().find(|(known, _)| *known == name) else {
        return;
    };
    let file = file_of(name);
    if files.iter().any(|known| known.name == file) {
        return;
    }
    let mut imports = Vec::new();
    let mut fields = Vec::new();
    for count in *counts {
        let (field, kind, is_repeated) = match *count {
            One(field, kind) => (field, kind, false),
            Many(field, kind) => (field, kind, true),
        };
        if let Kind::Of(other) = kind {
            collect(other, files);
            imports.push(file_of(other));
        }
        fields.push(Field {
            name: field.to_owned(),
            kind,
            is_repeated,
            meaning: String::new(),
        });
    }
    imports.sort();
    imports.dedup();
    let (package, own) = parted(name);
    files.push(File {
        name: file,
        package,
        imports,
        types: vec![Type {
            name: own.to_owned(),
            fields,
            values: values(name),
        }],
    });
}

/// A schema of Foxglove's.
fn published(name: &'static str) -> Schema {
    let mut files = Vec::new();
    collect(name, &mut files);
    Schema {
        name,
        descriptors: described(&files),
    }
}

/// `foxglove.FrameTransforms`.
pub fn frame_transforms() -> Schema {
    published("foxglove.FrameTransforms")
}

/// `foxglove.PoseInFrame`.
pub fn pose_in_frame() -> Schema {
    published("foxglove.PoseInFrame")
}

/// `foxglove.SceneUpdate`.
pub fn scene_update() -> Schema {
    published("foxglove.SceneUpdate")
}

/// How the numbers of a quantity are stored. Times and places of the body need 64 bits: 32 would show in steps of a quarter of
/// a millimetre at 4000 m. Nothing else is known as precisely.
pub fn kind_of(quantity: &Quantity) -> Kind {
    let is_wide = quantity.of == Of::Body && [Unit::SECOND, Unit::METRE].contains(&quantity.unit);
    if is_wide { Double } else { Kind::Float }
}

/// Fields for the columns of the quantities, without the segment, with units and meanings.
fn fields<'a>(quantities: impl Iterator<Item = &'a Quantity>) -> Vec<Field> {
    let fields = quantities.flat_map(|quantity| {
        let kind = kind_of(quantity);
        let meaning = format!("{} ({})", quantity.meaning, quantity.unit.symbol);
        let tails = quantity.tails().into_iter();
        tails.map(move |name| Field {
            name,
            kind,
            is_repeated: false,
            meaning: meaning.clone(),
        })
    });
    fields.collect()
}

fn own(name: &'static str, types: Vec<Type>) -> Schema {
    let (package, _) = parted(name);
    let file = File {
        name: file_of(name),
        package,
        imports: Vec::new(),
        types,
    };
    Schema {
        name,
        descriptors: described(&[file]),
    }
}

fn plain(name: &str, fields: Vec<Field>) -> Type {
    Type {
        name: name.to_owned(),
        fields,
        values: &[],
    }
}

/// The schema for all quantities of the body.
pub fn of_body(quantities: &[Quantity]) -> Schema {
    let of_body = quantities.iter().filter(|quantity| quantity.of == Of::Body);
    let body = plain("Body", fields(of_body));
    own("bodyflight.Body", vec![body])
}

/// The schema for all quantities of each segment, by segment name.
pub fn of_segments(quantities: &[&Quantity]) -> Schema {
    let segment = plain("Segment", fields(quantities.iter().copied()));
    let segments = Segment::ALL.map(|each| Field {
        name: each.name().to_owned(),
        kind: Kind::Of("bodyflight.Segment"),
        is_repeated: false,
        meaning: String::new(),
    });
    let all = plain("Segments", segments.to_vec());
    own("bodyflight.Segments", vec![segment, all])
}
