//! A mask as a smooth field, whose surface has no steps.
//!
//! **Input** a mask. **Output** a number at every voxel, 0 outside to 1 inside, read between voxels as well; the surface is
//! where it is ½.
//! **Notation** m the mask, B the binomial filter (1, 4, 6, 4, 1) / 16 along each axis.
//! **Steps** 1. b = B m. 2. Voxels with b under [`LEAST`] belong to parts so thin that the filter would rub them out: they
//! count LEAST / b. 3. The field is B applied to the mask so weighted, cut at 1. 4. Bricks of 8³ cells hold it where it
//! is neither all 0 nor all 1.
//! **Guarantees** a plate, a bar and a point of one voxel all show, at about one voxel's width; a flat wall lies where it
//! lies in the mask.
//! **Cost** O(runs of the mask + bricks at its surface) time; a byte for each voxel of those bricks.

use std::ops::RangeInclusive;

use espalier_model::Bits;
use glam::DVec3;
use rayon::prelude::*;

/// Cells of a brick along an axis.
pub(crate) const BRICK: usize = 8;
/// Values of a brick along an axis: it has those of its far faces too.
const SIDE: usize = BRICK + 1;
/// Taps of the filter on either side.
const REACH: usize = 2;
/// Voxels around a brick that its values depend on: through both filters.
const HALO: usize = 2 * REACH;
/// A voxel inside at a flat wall has 11/16; what has less than this is thin.
const LEAST: f32 = 0.6;
const TAPS: [f32; 5] = [0.0625, 0.25, 0.375, 0.25, 0.0625];
/// What a full voxel holds.
const FULL: f32 = 255.0;
/// Bricks without values of their own: all 0, all 1.
const NOTHING: u32 = u32::MAX;
const SOLID: u32 = u32::MAX - 1;

/// What a brick holds.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Brick<'a> {
    Nothing,
    Solid,
    Values(&'a [u8]),
}

/// The field.
pub(crate) struct Field {
    /// The voxel of the first brick's first value.
    low: [i64; 3],
    n_bricks: [usize; 3],
    places: Vec<u32>,
    values: Vec<[u8; SIDE * SIDE * SIDE]>,
}

impl Field {
    /// The field of a mask; none of an empty one.
    pub(crate) fn new(mask: &Bits) -> Option<Self> {
        let (first, last) = mask.bounding_box()?;
        let low = first.map(|c| c as i64 - HALO as i64);
        let n_bricks = std::array::from_fn(|k| (last[k] as i64 + HALO as i64 - low[k]) as usize / BRICK + 1);
        let mut field =
            Self { low, n_bricks, places: vec![NOTHING; n_bricks.iter().product()], values: Vec::new() };
        field.mark(mask);
        let touched: Vec<usize> = (0..field.places.len()).filter(|&i| field.places[i] != NOTHING).collect();
        let filled: Vec<Option<_>> =
            touched.par_iter().map(|&index| values(mask, field.corner(index))).collect();
        for (index, brick) in touched.into_iter().zip(filled) {
            field.places[index] = brick.map_or(SOLID, |values| {
                field.values.push(values);
                field.values.len() as u32 - 1
            });
        }
        Some(field)
    }

    /// Marks the bricks that the filter spreads the mask into.
    fn mark(&mut self, mask: &Bits) {
        let ny = mask.shape()[1];
        let [n_x, n_y, _] = self.n_bricks;
        let mut places = std::mem::take(&mut self.places);
        for row in 0..mask.n_rows() {
            for run in mask.runs(row) {
                for z in self.touched(2, row / ny, row / ny) {
                    for y in self.touched(1, row % ny, row % ny) {
                        let first = (z * n_y + y) * n_x;
                        self.touched(0, run.start, run.end - 1).for_each(|x| places[first + x] = SOLID);
                    }
                }
            }
        }
        self.places = places;
    }

    /// The bricks along an axis that voxels are spread into.
    fn touched(&self, axis: usize, first: usize, last: usize) -> RangeInclusive<usize> {
        let brick = |voxel: i64| (voxel - self.low[axis]) as usize / BRICK;
        // A value on a face stands in both of its bricks.
        brick(first as i64 - REACH as i64 - 1)..=brick(last as i64 + REACH as i64)
    }

    /// The voxel of a brick's first value.
    fn corner(&self, index: usize) -> [i64; 3] {
        let [nx, ny, _] = self.n_bricks;
        let brick = [index % nx, index / nx % ny, index / (nx * ny)];
        std::array::from_fn(|k| self.low[k] + (brick[k] * BRICK) as i64)
    }

    /// The boxes of all bricks that hold something: first and last voxel.
    pub(crate) fn boxes(&self) -> impl Iterator<Item = [DVec3; 2]> {
        let held = (0..self.places.len()).filter(|&index| self.places[index] != NOTHING);
        held.map(|index| {
            let low = DVec3::from_array(self.corner(index).map(|c| c as f64));
            [low, low + BRICK as f64]
        })
    }

    /// The brick around a point, and where the point lies in it, in voxels; none outside of all.
    pub(crate) fn brick_at(&self, point_voxel: DVec3) -> Option<(Brick<'_>, DVec3)> {
        let from_low = point_voxel - DVec3::from_array(self.low.map(|c| c as f64));
        let size = DVec3::from_array(self.n_bricks.map(|n| (n * BRICK) as f64));
        // What is not a number is in no brick.
        if !(from_low.cmpge(DVec3::ZERO).all() && from_low.cmplt(size).all()) {
            return None;
        }
        let brick: [usize; 3] = from_low.to_array().map(|c| c as usize / BRICK);
        let index = (brick[2] * self.n_bricks[1] + brick[1]) * self.n_bricks[0] + brick[0];
        let within = from_low - DVec3::from_array(brick.map(|c| (c * BRICK) as f64));
        let held = match self.places[index] {
            NOTHING => Brick::Nothing,
            SOLID => Brick::Solid,
            place => Brick::Values(&self.values[place as usize]),
        };
        Some((held, within))
    }

    /// The field at a point.
    pub(crate) fn value(&self, point_voxel: DVec3) -> f64 {
        match self.brick_at(point_voxel) {
            None | Some((Brick::Nothing, _)) => 0.0,
            Some((Brick::Solid, _)) => 1.0,
            Some((Brick::Values(values), within)) => trilinear(values, within),
        }
    }
}

/// The value at a place in a brick.
pub(crate) fn trilinear(values: &[u8], within: DVec3) -> f64 {
    let cell: [usize; 3] = within.to_array().map(|c| (c as usize).min(BRICK - 1));
    let share = within - DVec3::from_array(cell.map(|c| c as f64));
    let first = (cell[2] * SIDE + cell[1]) * SIDE + cell[0];
    let line = |at: usize| {
        let (a, b) = (f64::from(values[at]), f64::from(values[at + 1]));
        a + share.x * (b - a)
    };
    let face = |at: usize| {
        let (a, b) = (line(at), line(at + SIDE));
        a + share.y * (b - a)
    };
    let (a, b) = (face(first), face(first + SIDE * SIDE));
    (a + share.z * (b - a)) / f64::from(FULL)
}

/// Side of the part of the mask that a brick's values depend on, and of what the first filter leaves of it.
const WIDE: usize = SIDE + 2 * HALO;
const MIDDLE: usize = SIDE + 2 * REACH;

/// The values of a brick whose first lies at a voxel; none where all around is inside.
fn values(mask: &Bits, corner: [i64; 3]) -> Option<[u8; SIDE * SIDE * SIDE]> {
    let mut inside = vec![0.0_f32; WIDE * WIDE * WIDE];
    let mut n_inside = 0;
    for (row, line) in inside.chunks_exact_mut(WIDE).enumerate() {
        let y = corner[1] - HALO as i64 + (row % WIDE) as i64;
        let z = corner[2] - HALO as i64 + (row / WIDE) as i64;
        for (x, value) in line.iter_mut().enumerate() {
            if mask.contains([corner[0] - HALO as i64 + x as i64, y, z]) {
                *value = 1.0;
                n_inside += 1;
            }
        }
    }
    if n_inside == inside.len() {
        return None;
    }
    let blurred = filtered(&inside, WIDE);
    let weigh = |(i, &b): (usize, &f32)| {
        let at = |c: usize| c + REACH;
        let (x, y, z) = (at(i % MIDDLE), at(i / MIDDLE % MIDDLE), at(i / (MIDDLE * MIDDLE)));
        inside[(z * WIDE + y) * WIDE + x] * if b < LEAST { LEAST / b.max(1e-3) } else { 1.0 }
    };
    let weighted: Vec<f32> = blurred.iter().enumerate().map(weigh).collect();
    let smooth = filtered(&weighted, MIDDLE);
    Some(std::array::from_fn(|i| (FULL * smooth[i].min(1.0) + 0.5) as u8))
}

/// A cube filtered along each axis; it loses [`REACH`] at every face.
fn filtered(cube: &[f32], side: usize) -> Vec<f32> {
    let mut from = cube.to_vec();
    let mut size = [side; 3];
    for axis in 0..3 {
        let stride = size[..axis].iter().product::<usize>();
        let mut to = size;
        to[axis] -= 2 * REACH;
        let mut out = Vec::with_capacity(to.iter().product());
        for z in 0..to[2] {
            for y in 0..to[1] {
                let first = (z * size[1] + y) * size[0];
                let tap = |at: usize| -> f32 { (0..5).map(|k| TAPS[k] * from[at + k * stride]).sum() };
                out.extend((first..first + to[0]).map(tap));
            }
        }
        (from, size) = (out, to);
    }
    from
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask_of(shape: [usize; 3], is_inside: impl Fn([usize; 3]) -> bool) -> Bits {
        let mut bits = Bits::new(shape);
        for z in 0..shape[2] {
            for y in 0..shape[1] {
                (0..shape[0]).filter(|&x| is_inside([x, y, z])).for_each(|x| bits.set([x, y, z]));
            }
        }
        bits
    }

    /// Where along x the field falls below ½ from a point inside.
    fn wall(field: &Field, from: DVec3) -> f64 {
        let at = |step: i32| from + DVec3::X * 0.01 * f64::from(step);
        (0..2000).map(at).find(|&point| field.value(point) < 0.5).map_or(f64::NAN, |point| point.x)
    }

    #[test]
    fn walls_lie_between_voxels() {
        let field = Field::new(&mask_of([40, 40, 40], |[x, _, _]| x < 20)).expect("a field");
        let at = wall(&field, DVec3::new(15.0, 20.0, 20.0));
        assert!((at - 19.5).abs() < 0.05, "{at}");
        assert_eq!(field.value(DVec3::splat(12.0)), 1.0);
        assert_eq!(field.value(DVec3::new(30.0, 12.0, 12.0)), 0.0);
        assert_eq!(field.value(DVec3::splat(1e9)), 0.0);
        assert_eq!(field.value(DVec3::splat(f64::NAN)), 0.0);
    }

    #[test]
    fn a_ball_is_round() {
        let center = DVec3::new(20.3, 19.8, 20.0);
        let place = |v: [usize; 3]| DVec3::from_array(v.map(|c| c as f64));
        let field =
            Field::new(&mask_of([40, 40, 40], |v| place(v).distance(center) <= 9.0)).expect("a field");
        for i in 0..100 {
            // Directions all around.
            let z = (f64::from(i) + 0.5) / 50.0 - 1.0;
            let turn = f64::from(i) * 2.4;
            let flat = (1.0 - z * z).sqrt();
            let along =
                DVec3::new(flat * espalier_geom::math::cos(turn), flat * espalier_geom::math::sin(turn), z);
            let radius = (0..1500).map(|step| 0.01 * f64::from(step));
            let radius = radius.into_iter().find(|r| field.value(center + *r * along) < 0.5).expect("a wall");
            assert!((radius - 9.0).abs() < 0.45, "{along} {radius}");
        }
    }

    #[test]
    fn what_is_thin_shows() {
        for (name, is_inside) in [
            ("point", Box::new(|v: [usize; 3]| v == [10, 10, 10]) as Box<dyn Fn([usize; 3]) -> bool>),
            ("bar", Box::new(|v: [usize; 3]| v[0] == 10 && v[1] == 10)),
            ("plate", Box::new(|v: [usize; 3]| v[0] == 10)),
        ] {
            let field = Field::new(&mask_of([21, 21, 21], is_inside)).expect("a field");
            let at = wall(&field, DVec3::splat(10.0));
            assert!((10.2..10.9).contains(&at), "{name} {at}");
        }
        assert!(Field::new(&Bits::new([4, 4, 4])).is_none());
    }
}
