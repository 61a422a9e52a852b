//! Roughening a mask as segmenters leave it.
//!
//! **Input** a mask, a share, a seed. **Output** the mask with that share of the voxels next to its surface flipped.
//! **Notation** a voxel is next to the surface if one of its 6 neighbours differs from it.
//! **Guarantees** decided on the smooth mask and voxel by voxel, so the result depends on the seed alone; the
//! volume's outermost voxels stay background.

use espalier_geom::random::{Purpose, Stream};
use espalier_model::Mask;
use rayon::prelude::*;

/// Flips a share of the voxels on either side of the surface.
pub(crate) fn roughen(mask: &Mask, share: f64, seed: u64) -> Mask {
    let [nx, ny, nz] = mask.grid().shape();
    let smooth = mask.as_slice();
    let mut rough = mask.clone();
    rough.as_mut_slice().par_chunks_mut(nx * ny).enumerate().for_each(|(z, slice)| {
        if z == 0 || z + 1 == nz {
            return;
        }
        let mut stream = Stream::new(seed, Purpose::PhantomNoise, z as u32, 1);
        for y in 1..ny - 1 {
            for x in 1..nx - 1 {
                let at = (z * ny + y) * nx + x;
                let differs = |other: usize| smooth[other] != smooth[at];
                let is_surface =
                    [1, nx, nx * ny].into_iter().any(|step| differs(at - step) || differs(at + step));
                if is_surface && stream.unit() < share {
                    slice[y * nx + x] = !smooth[at];
                }
            }
        }
    });
    rough
}
