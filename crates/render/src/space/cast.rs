//! Rays onto the surface of an organ.
//!
//! **Input** the mask's field, which branch each voxel belongs to, a view, a lattice of rays. **Output** for each ray the
//! height, the normal and the branch of the surface that it meets first.
//! **Notation** heights are mm towards the viewer from the view's centre.
//! **Steps** 1. Bricks that hold something say between which heights each tile of rays has anything to meet. 2. A ray goes
//! down in equal steps, past empty bricks at once, until the field is ½ or more; the place is found by halving. 3. The
//! normal is the field's gradient over ±1 and ±2 voxels. 4. The branch is the one that has most of the 27 voxels around, weighted
//! by a quadratic B-spline, so that borders between branches run smoothly.
//! **Guarantees** the same for any number of threads.
//! **Cost** O(rays · steps), of which most rays of a tree need none.

use espalier_model::{Bits, Grid, View};
use glam::{DAffine3, DVec2, DVec3};
use rayon::prelude::*;

use super::field::{BRICK, Brick, Field, trilinear};

/// Step of a ray in voxels: two in a voxel find every wall that the filter leaves.
const STEP: f64 = 0.6;
/// How often the last step is halved: to a sixty-fourth.
const N_HALVINGS: usize = 6;
/// Rays of a tile along an axis.
const TILE: usize = 8;

/// An organ: its mask and whose each voxel is.
#[derive(Clone, Copy, Debug)]
pub struct Organ<'a> {
    /// Where voxels lie.
    pub grid: &'a Grid,
    /// The voxels of the branches.
    pub bits: &'a Bits,
    /// For each foreground voxel, in storage order, its branch plus 1; 0 where it has none.
    pub branches: &'a [u32],
}

/// What a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Height, mm; −∞ where there is nothing.
    pub height_mm: f32,
    /// Unit normal: x to the right, y down, z to the viewer.
    pub normal: [f32; 3],
    /// The branch plus 1.
    pub branch: u32,
}

impl Hit {
    pub(crate) const NOTHING: Self =
        Self { height_mm: f32::NEG_INFINITY, normal: [0.0, 0.0, 1.0], branch: 0 };

    pub(crate) fn is_something(&self) -> bool {
        self.height_mm > f32::NEG_INFINITY
    }
}

/// Parallel rays: where they stand in the view, mm, x to the right and y up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays {
    /// The first.
    pub first_mm: DVec2,
    /// From one to the next, to the right and downwards.
    pub step_mm: f64,
    /// How many along and down.
    pub size: [usize; 2],
}

/// The surface of an organ, seen along a view.
pub(crate) struct Surface<'a> {
    organ: Organ<'a>,
    field: Field,
    /// By row of the mask: how many foreground voxels come before it.
    before: Vec<usize>,
    voxel_from_view: DAffine3,
    view_from_voxel: DAffine3,
}

impl<'a> Surface<'a> {
    /// The surface; none of an empty mask.
    pub(crate) fn new(organ: Organ<'a>, view: &View) -> Option<Self> {
        let field = Field::new(organ.bits)?;
        let mut n_before = 0;
        let count = |row: usize| {
            let before = n_before;
            n_before += organ.bits.row(row).iter().map(|word| word.count_ones() as usize).sum::<usize>();
            before
        };
        let before = (0..organ.bits.n_rows()).map(count).collect();
        let axes = glam::DMat3::from_cols(view.right(), view.up, view.towards_camera);
        let world_from_view = DAffine3 { matrix3: axes, translation: view.center_mm };
        Some(Self {
            organ,
            field,
            before,
            voxel_from_view: organ.grid.voxel_from_world() * world_from_view,
            view_from_voxel: world_from_view.inverse() * organ.grid.world_from_voxel(),
        })
    }

    /// The box of the mask in the view, voxels whole: x to the right, y up, mm.
    pub(crate) fn bounds_mm(&self) -> [DVec2; 2] {
        let axes = self.view_from_voxel.matrix3;
        let half = 0.5 * (axes.x_axis.abs() + axes.y_axis.abs() + axes.z_axis.abs()).truncate();
        let ny = self.organ.bits.shape()[1];
        let nothing = [DVec2::INFINITY, DVec2::NEG_INFINITY];
        let ends = (0..self.organ.bits.n_rows()).flat_map(|row| {
            let end = move |x: usize| DVec3::new(x as f64, (row % ny) as f64, (row / ny) as f64);
            self.organ.bits.runs(row).flat_map(move |run| [end(run.start), end(run.end - 1)])
        });
        let [low, high] = ends.fold(nothing, |[low, high], voxel| {
            let point = self.view_from_voxel.transform_point3(voxel).truncate();
            [low.min(point), high.max(point)]
        });
        [low - half, high + half]
    }

    /// How long a voxel is at the most, mm.
    pub(crate) fn voxel_mm(&self) -> f64 {
        self.organ.grid.spacing_mm().max_element()
    }

    /// What each ray meets, row by row.
    pub(crate) fn cast(&self, rays: &Rays) -> Vec<Hit> {
        let [width, height] = rays.size;
        let tiles = self.tiles(rays);
        let n_x = width.div_ceil(TILE);
        let mut hits = vec![Hit::NOTHING; width * height];
        hits.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
            for (column, hit) in line.iter_mut().enumerate() {
                let [least, most] = tiles[row / TILE * n_x + column / TILE];
                if least < most {
                    let at = rays.first_mm + rays.step_mm * DVec2::new(column as f64, -(row as f64));
                    *hit = self.meet(at, [least, most]);
                }
            }
        });
        hits
    }

    /// By tile of rays: the heights between which there is something.
    fn tiles(&self, rays: &Rays) -> Vec<[f64; 2]> {
        let [n_x, n_y] = rays.size.map(|n| n.div_ceil(TILE));
        let mut tiles = vec![[f64::INFINITY, f64::NEG_INFINITY]; n_x * n_y];
        for [low, high] in self.field.boxes() {
            let corners = (0..8).map(|i| {
                let voxel = DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
                self.view_from_voxel.transform_point3(voxel)
            });
            let nothing = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            let (least, most) = corners.fold(nothing, |(a, b), corner| (a.min(corner), b.max(corner)));
            // Casts saturate: what lies off the lattice counts in the tiles at its border, which costs a look.
            let tile = |offset_mm: f64, n: usize| {
                ((offset_mm / (rays.step_mm * TILE as f64)) as usize).min(n.saturating_sub(1))
            };
            for y in tile(rays.first_mm.y - most.y, n_y)..=tile(rays.first_mm.y - least.y, n_y) {
                for x in tile(least.x - rays.first_mm.x, n_x)..=tile(most.x - rays.first_mm.x, n_x) {
                    let range = &mut tiles[y * n_x + x];
                    *range = [range[0].min(least.z), range[1].max(most.z)];
                }
            }
        }
        tiles
    }

    /// The first place of a ray, going down from the larger height, where the field is ½.
    fn meet(&self, at: DVec2, [least_mm, most_mm]: [f64; 2]) -> Hit {
        let down = -self.voxel_from_view.matrix3.z_axis;
        let start = self.voxel_from_view.transform_point3(at.extend(most_mm));
        let step_mm = STEP / down.length();
        let n_steps = ((most_mm - least_mm) / step_mm) as usize + 1;
        let mut step = 0;
        while step <= n_steps {
            let point = start + down * (step as f64 * step_mm);
            match self.field.brick_at(point) {
                None => step += 1,
                Some((Brick::Nothing, within)) => step += steps_through(within, down * step_mm),
                Some((Brick::Solid, _)) => return self.hit(at, most_mm, (step, step_mm)),
                Some((Brick::Values(values), within)) => {
                    if trilinear(values, within) >= 0.5 {
                        return self.hit(at, most_mm, (step, step_mm));
                    }
                    step += 1;
                }
            }
        }
        Hit::NOTHING
    }

    /// The surface within the step before one that is inside.
    fn hit(&self, at: DVec2, most_mm: f64, (step, step_mm): (usize, f64)) -> Hit {
        let voxel = |height_mm: f64| self.voxel_from_view.transform_point3(at.extend(height_mm));
        let mut inside_mm = most_mm - step as f64 * step_mm;
        let mut outside_mm = inside_mm + step_mm;
        for _ in 0..N_HALVINGS {
            let middle_mm = 0.5 * (inside_mm + outside_mm);
            let is_inside = self.field.value(voxel(middle_mm)) >= 0.5;
            *(if is_inside { &mut inside_mm } else { &mut outside_mm }) = middle_mm;
        }
        let point = voxel(inside_mm);
        Hit { height_mm: inside_mm as f32, normal: self.normal(point), branch: self.branch_at(point) }
    }

    fn normal(&self, point: DVec3) -> [f32; 3] {
        let across = |axis: DVec3| self.field.value(point - axis) - self.field.value(point + axis);
        let slope = |axis: DVec3| across(axis) + across(2.0 * axis);
        let outwards = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
        // Gradients go with the transposed transform.
        let seen = (self.voxel_from_view.matrix3.transpose() * outwards).try_normalize().unwrap_or(DVec3::Z);
        [seen.x as f32, -seen.y as f32, seen.z as f32]
    }

    fn branch_at(&self, point: DVec3) -> u32 {
        let nearest = point.round();
        let offset = point - nearest;
        let weights = |offset: f64| {
            let (low, high) = (0.5 - offset, 0.5 + offset);
            [0.5 * low * low, 0.75 - offset * offset, 0.5 * high * high]
        };
        let weights = [weights(offset.x), weights(offset.y), weights(offset.z)];
        let mut found: Vec<(u32, f64)> = Vec::with_capacity(4);
        for code in 0..27 {
            let step = [code % 3, code / 3 % 3, code / 9];
            let voxel = std::array::from_fn(|k| nearest[k] as i64 + step[k] as i64 - 1);
            let Some(branch) = self.owner(voxel).filter(|&branch| branch > 0) else { continue };
            let weight = (0..3).map(|k| weights[k][step[k]]).product::<f64>();
            match found.iter_mut().find(|(known, _)| *known == branch) {
                Some((_, sum)) => *sum += weight,
                None => found.push((branch, weight)),
            }
        }
        let most =
            found.into_iter().reduce(|a, b| if b.1 > a.1 || (b.1 == a.1 && b.0 < a.0) { b } else { a });
        most.map_or(0, |(branch, _)| branch)
    }

    /// Whose a voxel is; none outside of the mask.
    fn owner(&self, voxel: [i64; 3]) -> Option<u32> {
        let bits = self.organ.bits;
        if !bits.contains(voxel) {
            return None;
        }
        let [x, y, z] = voxel.map(|c| c as usize);
        let row = z * bits.shape()[1] + y;
        let words = bits.row(row);
        let in_row = words[..x / 64].iter().map(|word| word.count_ones() as usize).sum::<usize>()
            + (words[x / 64] & ((1 << (x % 64)) - 1)).count_ones() as usize;
        self.organ.branches.get(self.before[row] + in_row).copied()
    }
}

/// Steps to the first place behind a brick's walls.
fn steps_through(within: DVec3, step: DVec3) -> usize {
    let to_wall = |axis: usize| {
        let ahead = if step[axis] > 0.0 { BRICK as f64 - within[axis] } else { within[axis] };
        if step[axis] == 0.0 { f64::INFINITY } else { ahead / step[axis].abs() }
    };
    (to_wall(0).min(to_wall(1)).min(to_wall(2)) as usize).saturating_add(1)
}
