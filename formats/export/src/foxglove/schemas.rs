//! The schemas of the messages, as JSON Schema. Foxglove recognises its own schemas by name.

use serde_json::{Value, json};

use crate::columns::quantity::{Of, Quantity};
use bodyflight_core::Segment;

/// A named schema.
pub struct Schema {
    /// Name by which Foxglove recognises it.
    pub name: &'static str,
    /// The JSON Schema.
    pub schema: Value,
}

fn object(properties: Value) -> Value {
    json!({ "type": "object", "properties": properties })
}

fn list(items: Value) -> Value {
    json!({ "type": "array", "items": items })
}

fn number() -> Value {
    json!({ "type": "number" })
}

fn text() -> Value {
    json!({ "type": "string" })
}

fn numbers<const N: usize>(names: [&str; N]) -> Value {
    object(Value::Object(
        names
            .map(|name| (name.to_owned(), number()))
            .into_iter()
            .collect(),
    ))
}

fn time() -> Value {
    object(json!({ "sec": { "type": "integer" }, "nsec": { "type": "integer" } }))
}

fn vector() -> Value {
    numbers(["x", "y", "z"])
}

fn rotation() -> Value {
    numbers(["x", "y", "z", "w"])
}

fn pose() -> Value {
    object(json!({ "position": vector(), "orientation": rotation() }))
}

fn color() -> Value {
    numbers(["r", "g", "b", "a"])
}

/// `foxglove.FrameTransforms`.
pub fn frame_transforms() -> Schema {
    let transform = object(json!({
        "timestamp": time(),
        "parent_frame_id": text(),
        "child_frame_id": text(),
        "translation": vector(),
        "rotation": rotation(),
    }));
    Schema {
        name: "foxglove.FrameTransforms",
        schema: object(json!({ "transforms": list(transform) })),
    }
}

/// `foxglove.PoseInFrame`.
pub fn pose_in_frame() -> Schema {
    Schema {
        name: "foxglove.PoseInFrame",
        schema: object(json!({ "timestamp": time(), "frame_id": text(), "pose": pose() })),
    }
}

/// `foxglove.SceneUpdate`.
pub fn scene_update() -> Schema {
    let sphere = object(json!({ "pose": pose(), "size": vector(), "color": color() }));
    let arrow = object(json!({
        "pose": pose(),
        "shaft_length": number(),
        "shaft_diameter": number(),
        "head_length": number(),
        "head_diameter": number(),
        "color": color(),
    }));
    let anything = || list(json!({ "type": "object" }));
    let entity = object(json!({
        "timestamp": time(),
        "frame_id": text(),
        "id": text(),
        "lifetime": time(),
        "frame_locked": { "type": "boolean" },
        "metadata": anything(),
        "arrows": list(arrow),
        "cubes": anything(),
        "spheres": list(sphere),
        "cylinders": anything(),
        "lines": anything(),
        "triangles": anything(),
        "texts": anything(),
        "models": anything(),
    }));
    Schema {
        name: "foxglove.SceneUpdate",
        schema: object(json!({ "deletions": anything(), "entities": list(entity) })),
    }
}

/// Properties for the columns of the quantities, without the segment, with units and meanings.
fn described<'a>(quantities: impl Iterator<Item = &'a Quantity>) -> Value {
    let properties = quantities.flat_map(|quantity| {
        let about = json!({
            "type": ["number", "null"],
            "description": format!("{} ({})", quantity.meaning, quantity.unit.symbol),
        });
        let tails = quantity.tails().into_iter();
        tails.map(move |tail| (tail, about.clone()))
    });
    object(Value::Object(properties.collect()))
}

/// The schema for all quantities of the body.
pub fn of_body(quantities: &[Quantity]) -> Schema {
    let of_body = quantities.iter().filter(|quantity| quantity.of == Of::Body);
    Schema {
        name: "bodyflight.Body",
        schema: described(of_body),
    }
}

/// The schema for all quantities of each segment, by segment name.
pub fn of_segments(quantities: &[&Quantity]) -> Schema {
    let segment = described(quantities.iter().copied());
    let segments = Segment::ALL.map(|each| (each.name().to_owned(), segment.clone()));
    Schema {
        name: "bodyflight.Segments",
        schema: object(Value::Object(segments.into_iter().collect())),
    }
}
