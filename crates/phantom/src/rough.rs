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
    let smooth = mask.bits();
    let mut rough = smooth.clone();
    let words_per_row = rough.words_per_row();
    rough.words_mut().par_chunks_mut(words_per_row * ny).enumerate().for_each(|(z, slice)| {
        if z == 0 || z + 1 == nz {
            return;
        }
        let mut stream = Stream::new(seed, Purpose::PhantomNoise, z as u32, 1);
        for y in 1..ny - 1 {
            for x in 1..nx - 1 {
                let own = smooth.get([x, y, z]);
                let neighbours = [
                    [x - 1, y, z],
                    [x + 1, y, z],
                    [x, y - 1, z],
                    [x, y + 1, z],
                    [x, y, z - 1],
                    [x, y, z + 1],
                ];
                let is_surface = neighbours.into_iter().any(|neighbour| smooth.get(neighbour) != own);
                if is_surface && stream.unit() < share {
                    slice[y * words_per_row + x / 64] ^= 1 << (x % 64);
                }
            }
        }
    });
    Mask::new(mask.grid().clone(), rough)
}
