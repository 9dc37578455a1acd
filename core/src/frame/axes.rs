//! The frames of reference, as marker types.

/// X north, Y west, Z up (paper "Inertial Frame"), identical to the global frame of Xsens MVN. North is magnetic in
/// MVN recordings and true in satellite tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inertial;

/// Fixed to the pelvis, origin at the pelvic joint: X left, Y dorsal (back), Z cranial (head).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Body;

/// Fixed to a segment, origin at its proximal joint; parallel to the body frame in the H-pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentFrame;

/// Segment frame as reported by Xsens in the T-pose: X forward, Y left, Z up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct XsensSegment;
