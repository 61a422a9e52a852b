//! The choice of a growth whose mask has no false loop.
//!
//! Where two branches part, a voxel mask can bridge the narrow crotch and leave a hole behind the bridge, about once
//! in a thousand forks. So a tree is grown anew until its mask at the nominal spacing has no such tunnel. The nominal
//! spacing is fixed, so that the tree does not depend on the spacing asked for.
//!
//! **Guarantees** the Euler number is 1 at 1 mm · size and no offset, unless all [`N_ATTEMPTS`] failed or the branches
//! may be thinner than [`MIN_RADIUS_MM`], when the first growth is kept.
//! **Cost** O(foreground) for the number.

use espalier_model::Grid;
use glam::DVec3;

use crate::body::Body;
use crate::shape::{QUANTUM_MM, Shape};
use crate::{Error, raster};

/// How many growths are tried.
const N_ATTEMPTS: u32 = 12;

/// Half the diagonal of a nominal voxel: a thinner branch may break in the mask, and its loops cannot be counted.
const MIN_RADIUS_MM: f64 = 0.87;

/// The first of the growths whose mask at 1 mm is a ball to a topologist. `grow` makes the attempt of a number, at
/// size 1; `bounds` are the scan's corners.
pub(crate) fn first_ball(bounds: (DVec3, DVec3), grow: impl Fn(u32) -> Shape) -> Result<Shape, Error> {
    let extents = (bounds.1 - bounds.0).ceil() + 1.0;
    let shape = [extents.x as usize, extents.y as usize, extents.z as usize];
    let grid = Grid::axis_aligned(shape, DVec3::ONE, bounds.0)?;
    let mut first = None;
    for attempt in 0..N_ATTEMPTS {
        let mut shape = grow(attempt);
        shape.round(QUANTUM_MM);
        let is_thin = shape.nodes.iter().any(|node| node.radius_mm < MIN_RADIUS_MM);
        if is_thin || raster::mask(&Body::about(&shape, |radius| radius), &grid)?.bits().euler_number() == 1 {
            return Ok(shape);
        }
        first.get_or_insert(shape);
    }
    Ok(first.unwrap_or_default())
}
