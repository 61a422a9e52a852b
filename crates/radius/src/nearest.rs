//! The nearest background of a place, looked up in the mask's bits.
//!
//! **Input** a mask, a place in grid mm. **Output** the exact distance to the nearest background centre, in mm.
//! **Steps** Rows along x are visited from the nearest outwards, in y and then in z, as long as they are nearer than the
//! best background so far; in a row the words tell the first background voxels to the left and to the right.
//! **Guarantees** exact up to rounding in `f64`, equal to [`distance_field`](crate::distance_field); the border of the
//! scan is not background.
//! **Cost** O((r/s)²) words for radius r at spacing s, and nothing for the rest of the volume.

use espalier_model::{Bits, Mask};
use glam::DVec3;

/// Bits in a word.
const WORD: usize = u64::BITS as usize;

/// The background of a mask.
#[derive(Clone, Copy)]
pub(crate) struct Background<'m> {
    bits: &'m Bits,
    spacing: DVec3,
}

impl<'m> Background<'m> {
    pub(crate) fn of(mask: &'m Mask) -> Self {
        Self { bits: mask.bits(), spacing: mask.grid().spacing_mm() }
    }

    /// The distance between neighbouring voxels, in mm.
    pub(crate) fn spacing_mm(&self) -> DVec3 {
        self.spacing
    }

    /// A voxel's centre in grid mm.
    pub(crate) fn position_mm(&self, voxel: [i64; 3]) -> DVec3 {
        DVec3::from_array(voxel.map(|c| c as f64)) * self.spacing
    }

    /// The voxel whose cell holds a point.
    pub(crate) fn voxel_at(&self, point: DVec3) -> [i64; 3] {
        (point / self.spacing + 0.5).floor().to_array().map(|c| c as i64)
    }

    /// Whether a voxel is foreground.
    pub(crate) fn is_foreground(&self, voxel: [i64; 3]) -> bool {
        self.bits.contains(voxel)
    }

    /// The words of the row at (y, z); `None` outside the scan.
    pub(crate) fn row(&self, y: i64, z: i64) -> Option<&'m [u64]> {
        let [_, ny, nz] = self.bits.shape();
        let is_inside = (0..ny as i64).contains(&y) && (0..nz as i64).contains(&z);
        is_inside.then(|| self.bits.row(z as usize * ny + y as usize))
    }

    /// Voxels in a row.
    pub(crate) fn n_columns(&self) -> usize {
        self.bits.shape()[0]
    }

    /// The last voxel's centre, in grid mm.
    pub(crate) fn last_mm(&self) -> DVec3 {
        DVec3::from_array(self.bits.shape().map(|n| (n - 1) as f64)) * self.spacing
    }

    /// The distance from a point to the outer faces of the scan, in mm.
    pub(crate) fn border_mm(&self, point: DVec3) -> f64 {
        let from_low = point + 0.5 * self.spacing;
        from_low.min(self.last_mm() + 0.5 * self.spacing - point).min_element()
    }

    /// How far one can go from a point both ways along a direction before leaving the scan, in mm; 0 if it is outside.
    pub(crate) fn free_mm(&self, point: DVec3, direction: DVec3) -> f64 {
        let from_low = point + 0.5 * self.spacing;
        let nearest = from_low.min(self.last_mm() + 0.5 * self.spacing - point);
        let free = |axis: usize| nearest[axis] / direction[axis].abs().max(f64::MIN_POSITIVE);
        free(0).min(free(1)).min(free(2)).max(0.0)
    }

    /// The distance from a voxel's centre to the nearest background centre, in mm; 0 for background and outside the
    /// scan, infinite in a mask without background.
    pub(crate) fn distance_mm(&self, voxel: [i64; 3]) -> f64 {
        if self.is_foreground(voxel) { self.distance_at_mm(self.position_mm(voxel)) } else { 0.0 }
    }

    /// The largest distance among the 27 voxels about `voxel`, in mm.
    pub(crate) fn neighborhood_max_mm(&self, [x, y, z]: [i64; 3]) -> f64 {
        neighborhood().map(|[dx, dy, dz]| self.distance_mm([x + dx, y + dy, z + dz])).fold(0.0, f64::max)
    }

    /// The distance from a point inside the scan to the nearest background centre, in mm.
    pub(crate) fn distance_at_mm(&self, point: DVec3) -> f64 {
        let last = self.bits.shape().map(|n| n as i64 - 1);
        let [x, y, z] = self.voxel_at(point);
        let (x, y, z) = (x.clamp(0, last[0]), y.clamp(0, last[1]), z.clamp(0, last[2]));
        let mut best = f64::INFINITY;
        for slice in outwards(z, last[2]) {
            let across_z = slice as f64 * self.spacing.z - point.z;
            let z_squared = across_z * across_z;
            if z_squared >= best {
                // A nearer one may follow on the other side, unless this is a whole step farther.
                if beyond(across_z, self.spacing.z) >= best {
                    break;
                }
                continue;
            }
            for row in outwards(y, last[1]) {
                let across_y = row as f64 * self.spacing.y - point.y;
                let row_squared = z_squared + across_y * across_y;
                if row_squared >= best {
                    if z_squared + beyond(across_y, self.spacing.y) >= best {
                        break;
                    }
                    continue;
                }
                let Some(words) = self.row(row, slice) else { continue };
                best = best.min(row_squared + self.along_row_squared(words, x as usize, point.x));
            }
        }
        best.sqrt()
    }

    /// The squared distance along a row from `point_x` to the nearest background; `x` is the voxel that holds it.
    fn along_row_squared(&self, words: &[u64], x: usize, point_x: f64) -> f64 {
        let squared = |x: Option<usize>| {
            x.map_or(f64::INFINITY, |x| {
                let along = x as f64 * self.spacing.x - point_x;
                along * along
            })
        };
        squared(zero_at_or_after(words, x, self.n_columns())).min(squared(zero_at_or_before(words, x)))
    }
}

/// The squared distance, less than half a step short, that every further place on either side has at least.
fn beyond(across: f64, spacing: f64) -> f64 {
    let least = (across.abs() - spacing).max(0.0);
    least * least
}

/// The places from 0 to `last`, nearest to `start` first: start, start − 1, start + 1, ….
fn outwards(start: i64, last: i64) -> impl Iterator<Item = i64> {
    let furthest = start.max(last - start);
    let both = (1..=furthest).flat_map(move |step| [start - step, start + step]);
    std::iter::once(start).chain(both).filter(move |place| (0..=last).contains(place))
}

/// The first 0 at or after `x` among `n` bits.
pub(crate) fn zero_at_or_after(words: &[u64], x: usize, n: usize) -> Option<usize> {
    let first = x / WORD;
    let mut zeros = !words.get(first)? & (u64::MAX << (x % WORD));
    let mut word = first;
    while zeros == 0 {
        word += 1;
        zeros = !*words.get(word)?;
    }
    let place = word * WORD + zeros.trailing_zeros() as usize;
    (place < n).then_some(place)
}

/// The last 0 at or before `x`.
pub(crate) fn zero_at_or_before(words: &[u64], x: usize) -> Option<usize> {
    let mut word = x / WORD;
    let mut zeros = !words.get(word)? & (u64::MAX >> (WORD - 1 - x % WORD));
    while zeros == 0 {
        word = word.checked_sub(1)?;
        zeros = !words[word];
    }
    Some(word * WORD + WORD - 1 - zeros.leading_zeros() as usize)
}

/// The 27 offsets of a neighbourhood, z slowest.
pub(crate) fn neighborhood() -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(|bit| [bit % 3 - 1, bit / 3 % 3 - 1, bit / 9 - 1])
}
