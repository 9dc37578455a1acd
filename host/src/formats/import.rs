//! Motion of other systems, and how it becomes a recording: BVH, and tables of joint angles, quaternions or points, C3D among them.
//!
//! A [`mapping::Mapping`] says where the axes of the source point and what its segments are called. Each reader hands out
//! the orientation of its segments in its own axes; [`skeleton`] turns them into those of the model.

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
