//! The frames, as marker types.

/// X north, Y west, Z up (paper "Inertial Frame"): the global frame of Xsens MVN, with no turn between them. North is
/// magnetic in recordings of MVN and true in tracks of satellites.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Inertial;

/// Fixed to the pelvis, origin at the pelvic joint: X left, Y dorsal (back), Z cranial (head).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Body;

/// Of any one segment, origin at its proximal joint; equal to the body frame in the H-pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SegmentFrame;

/// Of a segment as Xsens reports it in the T-pose: X forward, Y left, Z up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct XsensSegment;
