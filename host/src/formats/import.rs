//! Converts motion from other systems to recordings: BVH files, C3D files, and tables of joint angles, quaternions or
//! points.
//!
//! A [`mapping::Mapping`] gives the directions of the source's axes and the names of its segments. Each reader returns
//! segment orientations in the source's axes; [`skeleton`] converts them to those of the model.

pub mod axes;
pub mod bvh;
pub mod c3d;
pub mod mapping;
pub mod names;
pub mod rows;
pub mod skeleton;
pub mod source;
pub mod table;
pub mod timing;
