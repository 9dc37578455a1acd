//! Which model of the loads is flown, and the drag of a segment's end over that of its side.

use crate::body::Segment;

/// How loads depend on the direction of the stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LoadModel {
    /// The paper's, tuned for belly flight.
    #[default]
    Paper,
    /// The paper's in belly flight, and falls in every other attitude at the speeds of free-flying.
    FreeFly,
}

impl LoadModel {
    /// Name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::FreeFly => "free-fly",
        }
    }

    /// The model of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Paper, Self::FreeFly]
            .into_iter()
            .find(|model| model.name() == name)
    }
}

/// Drag coefficient of a circular cylinder across the stream: the paper's Cd.
const BROADSIDE: f64 = 1.20;
/// Of a blunt cylinder of two to four diameters along the stream.
const ALONG: f64 = 0.87;
/// Of a rough sphere: the crown of a helmet.
const CROWN: f64 = 0.40;

/// Drag coefficient of a segment's end over that of its side, from tables of cylinders and spheres.
///
/// Soles are plates across the stream, whose coefficient (1.17) is that of a limb's side.
pub const fn end_drag(segment: Segment) -> f64 {
    match segment {
        Segment::Head => CROWN / BROADSIDE,
        Segment::LeftFoot | Segment::RightFoot => 1.0,
        _ => ALONG / BROADSIDE,
    }
}
