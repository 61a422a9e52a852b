//! Geometry under every stage: deterministic float functions, angles, planar segments, random streams.
//!
//! | module | what |
//! |---|---|
//! | [`math`] | transcendental functions that give the same bits on every machine |
//! | [`angle`] | wrapping, turns, interior angles |
//! | [`plane`] | planar segments: exact crossing test, distances |
//! | [`space`] | segments and directions in three dimensions |
//! | [`random`] | counter-based random streams (Philox4x32-10) |
//! | [`union_find`] | disjoint sets |
//!
//! **Spaces** Points in the world are RAS+ in mm, `f64`. Points in the picture are plane mm, x to the right,
//! y up. A transform is named `target_from_source`.

pub mod angle;
pub mod math;
pub mod plane;
pub mod random;
pub mod space;
pub mod union_find;
