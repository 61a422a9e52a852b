//! NIfTI-1: header, place in the world, voxels.

mod affine;
mod header;
mod voxels;

pub(crate) use affine::world_from_voxel;
pub(crate) use header::{Header, N_HEADER_BYTES, parse};
pub(crate) use voxels::read_voxels;
