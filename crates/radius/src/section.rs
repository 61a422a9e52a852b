//! The mask's cross-section: its area and its centroid.
//!
//! **Input** a mask, a foreground voxel and a point near it, the direction of the branch, the distance r to the background
//! there, at least [`MIN_SPACINGS`] of the largest spacing. **Output** the radius of the circle with the section's area, in
//! mm, and the section's centroid, in grid mm.
//! **Steps** 1. The slab of three voxels about the point across the direction; where the scan ends nearer, a thinner one.
//! 2. Flood it from the voxel over faces. A voxel counts by its share in the slab, as if it reached along the direction as
//! far as its box does: so sums do not depend on how the grid lies. 3. Area = volume / thickness.
//! **Guarantees** none where the flood reaches [`LIMIT_RADII`] · r from the point: there the slab runs along another
//! branch, or the mask is no tube; nor where the search would need more than [`MOST_CELLS`].
//! **Why not one plane?** In tubes of one to two voxels its centroid jumps from voxel to voxel: the centreline came out
//! 0.18 voxel off the axis, with three voxels 0.15.
//! **Cost** O(voxels of the slab).

use std::f64::consts::PI;

use glam::DVec3;

use crate::nearest::Background;

/// Half the thickness of the slab, in voxels along the direction.
const HALF_SLAB: f64 = 1.5;
/// How far a section may reach, in inscribed radii.
const LIMIT_RADII: f64 = 3.0;
/// The least radius taken for that: a section of one or two voxels is as wide as its voxels.
const MIN_SPACINGS: f64 = 0.75;
/// The sides of a pit on which there is foreground; a voxel beside a smooth convex wall has three at most.
const LEAST_SIDES: usize = 4;
/// The largest box that is searched, in voxels: four megabytes. No tube needs as many.
const MOST_CELLS: f64 = 3.2e7;
/// Bits in a word.
const WORD: usize = u64::BITS as usize;

/// A cross-section.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Section {
    /// The radius of the circle of its area, in mm.
    pub(crate) area_radius_mm: f64,
    /// The semi-axes of the ellipse with its second moments, in mm, the larger first.
    pub(crate) semi_axes_mm: [f64; 2],
    /// Its centroid, in grid mm.
    pub(crate) centroid: DVec3,
    /// The share of pits in its wall: background voxels with foreground on four or more of their six sides. A smooth wall
    /// has next to none; of a wall with 15 % of its voxels flipped they are one in ten.
    pub(crate) pit_share: f64,
}

/// The section through `point` (grid mm) across `tangent`, which the foreground voxel `start` is part of.
pub(crate) fn through(
    background: Background<'_>,
    (start, point): ([i64; 3], DVec3),
    tangent: DVec3,
    radius_mm: f64,
) -> Option<Section> {
    // Without any background there is no tube to cut.
    if !radius_mm.is_finite() {
        return None;
    }
    let spacing = background.spacing_mm();
    let limit_mm = LIMIT_RADII * radius_mm.max(MIN_SPACINGS * spacing.max_element());
    // How far a voxel reaches along the direction.
    let depth_mm = (tangent.abs() * spacing).element_sum();
    let thickness_mm = HALF_SLAB * (tangent.abs() * spacing).max_element();
    let half_mm = thickness_mm.min(background.free_mm(point, tangent)).max(0.5 * depth_mm);

    let mut seen = Seen::about((DVec3::splat(limit_mm) + half_mm) / spacing)?;
    let mut stack = vec![(start, seen.center)];
    seen.insert(seen.center);
    let (first, second) = tangent.any_orthonormal_pair();
    let (mut total, mut sum, mut squares) = (0.0, DVec3::ZERO, [0.0; 3]);
    let (mut n_walls, mut n_pits) = (0_u32, 0_u32);
    while let Some((voxel, place)) = stack.pop() {
        let from_point = background.position_mm(voxel) - point;
        let along_mm = tangent.dot(from_point);
        let share = ((half_mm - along_mm.abs()) / depth_mm + 0.5).clamp(0.0, 1.0);
        let across = from_point - tangent * along_mm;
        total += share;
        sum += across * share;
        let [u, v] = [first, second].map(|axis| across.dot(axis));
        for (square, product) in squares.iter_mut().zip([u * u, u * v, v * v]) {
            *square += product * share;
        }
        // What lies in the slab for its smaller part is counted, but leads no further.
        if share < 0.5 {
            continue;
        }
        if across.length_squared() > limit_mm * limit_mm {
            return None;
        }
        for (axis, stride) in seen.strides.into_iter().enumerate() {
            for (step, place) in [(-1, place - stride), (1, place + stride)] {
                let mut next = voxel;
                next[axis] += step;
                // Most were met before, and that is the cheaper question.
                if !seen.insert(place) {
                    continue;
                }
                if background.is_foreground(next) {
                    stack.push((next, place));
                } else {
                    n_walls += 1;
                    n_pits += u32::from(is_pit(background, next));
                }
            }
        }
    }
    let area_mm2 = total * spacing.element_product() / (2.0 * half_mm);
    (total > 0.0).then(|| {
        let mean = sum / total;
        let [u, v] = [first, second].map(|axis| mean.dot(axis));
        // A voxel is as wide as the grid, not a point.
        let own = |a: DVec3, b: DVec3| (a * b * spacing * spacing).element_sum() / 12.0;
        let moments = [
            squares[0] / total - u * u + own(first, first),
            squares[1] / total - u * v + own(first, second),
            squares[2] / total - v * v + own(second, second),
        ];
        Section {
            area_radius_mm: (area_mm2 / PI).sqrt(),
            semi_axes_mm: semi_axes(moments),
            centroid: point + mean,
            pit_share: f64::from(n_pits) / f64::from(n_walls.max(1)),
        }
    })
}

/// Whether a background voxel has foreground on most of its sides.
fn is_pit(background: Background<'_>, [x, y, z]: [i64; 3]) -> bool {
    let sides = [[x - 1, y, z], [x + 1, y, z], [x, y - 1, z], [x, y + 1, z], [x, y, z - 1], [x, y, z + 1]];
    sides.into_iter().filter(|&side| background.is_foreground(side)).count() >= LEAST_SIDES
}

/// The semi-axes of the ellipse with these second moments about its centre (uu, uv, vv), the larger first.
fn semi_axes([uu, uv, vv]: [f64; 3]) -> [f64; 2] {
    let (middle, half) = (0.5 * (uu + vv), (0.25 * (uu - vv) * (uu - vv) + uv * uv).sqrt());
    [middle + half, middle - half].map(|moment| 2.0 * moment.max(0.0).sqrt())
}

/// The voxels of a box that were met, by their place in it.
struct Seen {
    center: usize,
    strides: [usize; 3],
    words: Vec<u64>,
}

impl Seen {
    /// A box that reaches from its centre by `reach` voxels, and farther than a step beyond; none that is too large.
    fn about(reach: DVec3) -> Option<Self> {
        let sides = 2.0 * (reach + 3.0).floor() + 1.0;
        if sides.element_product() > MOST_CELLS {
            return None;
        }
        let [nx, ny, nz] = sides.to_array().map(|side| side as usize);
        let strides = [1, nx, nx * ny];
        Some(Self { center: (nx * ny * nz) / 2, strides, words: vec![0; (nx * ny * nz).div_ceil(WORD)] })
    }

    /// Whether a place is met for the first time.
    fn insert(&mut self, place: usize) -> bool {
        let (word, bit) = (&mut self.words[place / WORD], 1 << (place % WORD));
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }
}
