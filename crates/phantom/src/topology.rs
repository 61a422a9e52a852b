//! The Euler number of a mask, and the choice of a growth whose mask has no false loop.
//!
//! Where two branches part, a voxel mask can bridge the narrow crotch and leave a hole behind the bridge, about once
//! in a thousand forks. So a tree is grown anew until its mask at the nominal spacing has no such tunnel. The nominal
//! spacing is fixed, so that the tree does not depend on the spacing asked for.
//!
//! **Guarantees** the Euler number is 1 at 1 mm · size and no offset, unless all [`N_ATTEMPTS`] failed or the branches
//! may be thinner than [`MIN_RADIUS_MM`], when the first growth is kept.
//! **Cost** O(foreground) for the number.

use espalier_model::{Grid, Mask};
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
        if is_thin || euler_number(&raster::mask(&Body::about(&shape, |radius| radius), &grid)?) == 1 {
            return Ok(shape);
        }
        first.get_or_insert(shape);
    }
    Ok(first.unwrap_or_default())
}

/// The Euler number of the foreground under 26-connectivity, all of which must lie off the grid's border: vertices −
/// edges + faces − cubes of the union of its voxels as closed cubes. Components − tunnels + cavities.
fn euler_number(mask: &Mask) -> i64 {
    let [nx, ny, _] = mask.grid().shape();
    let voxels = mask.to_voxels();
    // The 13 neighbours that come before a voxel in storage order, as bits, with their distance there.
    let earlier: Vec<([i64; 3], usize)> = neighbours()
        .take(13)
        .map(|[dx, dy, dz]| ([dx, dy, dz], (-dx - nx as i64 * (dy + ny as i64 * dz)) as usize))
        .collect();
    // A voxel owns those of its 27 cells (itself, faces, edges, vertices) that no earlier voxel has too. For each
    // cell: the earlier neighbours that share it, and its sign.
    let cells: Vec<(u32, i64)> = neighbours()
        .map(|cell| {
            let shares = |step: &[i64; 3]| (0..3).all(|axis| step[axis] == 0 || step[axis] == cell[axis]);
            let bits = earlier.iter().enumerate().filter(|(_, (step, _))| shares(step));
            let n_thin = cell.iter().filter(|&&c| c != 0).count();
            (bits.fold(0, |bits, (bit, _)| bits | 1 << bit), if n_thin % 2 == 1 { 1 } else { -1 })
        })
        .collect();
    let owned = |index: usize| -> i64 {
        let present = earlier
            .iter()
            .enumerate()
            .filter(|(_, (_, back))| *back <= index && voxels[index - back])
            .fold(0_u32, |bits, (bit, _)| bits | 1 << bit);
        cells.iter().filter(|(sharers, _)| sharers & present == 0).map(|(_, sign)| sign).sum()
    };
    (0..voxels.len()).filter(|&index| voxels[index]).map(owned).sum()
}

/// The 27 steps to a voxel's neighbours in storage order, itself in the middle.
fn neighbours() -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(|i| [i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn euler_numbers_of_small_bodies() {
        let grid = Grid::axis_aligned([7, 7, 7], DVec3::ONE, DVec3::ZERO).expect("legal");
        let number = |is_inside: &dyn Fn([i64; 3]) -> bool| {
            euler_number(&Mask::from_fn(grid.clone(), |voxel| is_inside(voxel.map(|c| c as i64 - 3))))
        };
        let reach = |p: [i64; 3]| p.map(i64::abs).into_iter().max().unwrap_or(0);
        assert_eq!(number(&|_| false), 0);
        assert_eq!(number(&|p| reach(p) == 0), 1);
        assert_eq!(number(&|p| reach(p) <= 2), 1, "cube");
        assert_eq!(number(&|p| reach(p) == 2), 2, "shell");
        assert_eq!(number(&|p| reach(p) == 2 && p[2] == 0), 0, "ring");
        assert_eq!(number(&|p| reach(p) == 2 && p.contains(&2)), 1, "three faces that meet");
        assert_eq!(number(&|p| p.map(i64::abs) == [1, 1, 1]), 8, "eight corners, each apart");
        assert_eq!(number(&|p| p == [0, 0, 0] || p == [1, 1, 1]), 1, "two that touch at a vertex");
    }
}
