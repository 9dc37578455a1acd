//! Readers of motion that other systems captured: trees of joints (BVH, ASF/AMC, SMPL), points (C3D, TRC, Nexus), and
//! tables of joint angles or quaternions (OpenSim, OpenSense, Movella's sensors and workbooks).
//!
//! A [`mapping::Mapping`] gives the directions of the source's axes and the names of its segments. Each reader returns
//! segment orientations in the source's axes; [`skeleton`] converts them to those of the model. [`repair`] finds points
//! that were lost or exchanged, and segments whose length changes; [`slip`] finds markers that slipped.
#![forbid(unsafe_code)]

mod acclaim;
pub mod alike;
mod archive;
pub mod axes;
pub mod bvh;
pub mod c3d;
mod conflicts;
mod header;
pub mod imu;
mod links;
pub mod mapping;
mod marker_set;
mod mounting;
mod movella;
pub mod names;
mod nexus;
mod numpy;
mod opensense;
mod points;
pub mod repair;
mod rest;
pub mod row;
pub mod rows;
mod sensors;
pub mod skeleton;
pub mod slimevr;
pub mod slip;
mod smpl;
pub mod source;
mod storage;
pub mod systems;
pub mod table;
pub mod timing;
pub mod tree;
mod workbook;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
