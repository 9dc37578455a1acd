//! The choice of the load model, and the ratio of a segment's drag end-on to broadside-on.

use crate::body::Segment;

/// How loads depend on the direction of the airstream.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LoadModel {
    /// The paper's model, tuned for belly flight.
    #[default]
    Paper,
    /// The paper's model in belly flight, with realistic fall speeds in all other attitudes.
    FreeFly,
}

impl LoadModel {
    /// Name used in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::FreeFly => "free-fly",
        }
    }

    /// Returns the model with this name, or `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Paper, Self::FreeFly]
            .into_iter()
            .find(|model| model.name() == name)
    }
}

/// Drag coefficient of a circular cylinder across the airstream: the paper's Cd.
const BROADSIDE: f64 = 1.20;
/// Drag coefficient of a blunt cylinder of two to four diameters along the airstream.
const ALONG: f64 = 0.87;
/// Drag coefficient of a rough sphere, for the crown of a helmet.
const CROWN: f64 = 0.40;

/// Ratio of a segment's drag coefficient end-on to broadside-on, from tables of cylinders and spheres.
///
/// Soles are plates across the airstream, whose coefficient (1.17) is about that of a limb broadside-on.
pub const fn end_drag(segment: Segment) -> f64 {
    match segment {
        Segment::Head => CROWN / BROADSIDE,
        Segment::LeftFoot | Segment::RightFoot => 1.0,
        _ => ALONG / BROADSIDE,
    }
}
