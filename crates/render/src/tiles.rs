//! Which cones each tile of a picture has to look at.
//!
//! **Input** the cones of a picture in preorder. **Output** by tile: the cones that reach it, in preorder; how crowded
//! it is.
//! **Notation** E cones.
//! **Steps** 1. A cone's box tells rows of tiles. 2. In each row of tiles its strip, cut by the row, tells columns: a long
//! slanting cone meets few of the tiles of its box.
//! **Guarantees** a cone is listed wherever it comes nearer to a pixel than its fillets and gaps reach.
//! **Cost** O(E + listed cones) time and memory.

use std::ops::RangeInclusive;

use glam::Vec2;
use rayon::prelude::*;

use crate::raster::{Drawn, Job, TILE};
use crate::samples::GAP_PX;

/// A cone as thin as this turns from light to shade within a pixel.
const THIN_PX: f32 = 2.0;
/// Beyond this mean over the tiles that are not empty nobody can see what blends with what.
const PLAIN_LAYERS: f64 = 16.0;

/// The tiles of the box around an edge and all that it may add to its neighbours: columns and rows.
pub(crate) fn around(size: [usize; 2], edge: &Drawn) -> [RangeInclusive<usize>; 2] {
    let (low, high) = edge.cone.bounds();
    let reach = reach_px(edge);
    [between(low.x - reach, high.x + reach, size[0]), between(low.y - reach, high.y + reach, size[1])]
}

/// How far beyond its outline an edge is looked at, with the pixel over the border that tiles look at.
fn reach_px(edge: &Drawn) -> f32 {
    edge.cone.fillet_px().max(GAP_PX) + 2.0
}

/// The tiles from one place to another along an axis. Casts saturate, so what lies off the page ends on its border.
fn between(low: f32, high: f32, n_pixels: usize) -> RangeInclusive<usize> {
    let tile = |at: f32| ((at / TILE as f32) as usize).min(n_pixels.div_ceil(TILE) - 1);
    tile(low)..=tile(high)
}

/// Which edges touch which tile.
pub(crate) struct Tiles {
    /// Tiles in a row.
    pub n_x: usize,
    offsets: Vec<usize>,
    entries: Vec<u32>,
}

impl Tiles {
    /// Sorts the edges into tiles.
    pub(crate) fn sort(job: &Job<'_>) -> Self {
        let [n_x, n_y] = job.size.map(|pixels| pixels.div_ceil(TILE));
        let mut offsets = vec![0; n_x * n_y + 1];
        for edge in job.drawn {
            visit(job.size, edge, |column, row| offsets[row * n_x + column + 1] += 1);
        }
        for tile in 0..n_x * n_y {
            offsets[tile + 1] += offsets[tile];
        }
        let mut next = offsets.clone();
        let mut entries = vec![0; offsets[n_x * n_y]];
        for (index, edge) in job.drawn.iter().enumerate() {
            visit(job.size, edge, |column, row| {
                let place = &mut next[row * n_x + column];
                entries[*place] = index as u32;
                *place += 1;
            });
        }
        Self { n_x, offsets, entries }
    }

    /// The edges of a tile.
    pub(crate) fn list(&self, column: usize, row: usize) -> &[u32] {
        let tile = row * self.n_x + column;
        &self.entries[self.offsets[tile]..self.offsets[tile + 1]]
    }
}

/// Calls `visitor` with column and row of each tile that an edge comes near to.
fn visit(size: [usize; 2], edge: &Drawn, mut visitor: impl FnMut(usize, usize)) {
    let reach = reach_px(edge);
    for row in around(size, edge)[1].clone() {
        let top = (row * TILE) as f32;
        // A pixel of the neighbours, as `reach` has for columns.
        let rows = [top - 2.0, top + TILE as f32 + 2.0];
        if let Some((from, to)) = edge.cone.span_between(rows, reach) {
            for column in between(from - 1.0, to + 1.0, size[0]) {
                visitor(column, row);
            }
        }
    }
}

/// What a tile has in store.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Crowd {
    /// About how often the cones whose boxes it meets cover it. Where ten thousand branches leave one root, all are in
    /// the tiles around it.
    pub n_layers: f64,
    /// Whether one of these cones is so thin that a sample a pixel does not do.
    pub has_thin: bool,
}

/// How crowded each tile is.
pub(crate) fn crowds(job: &Job<'_>) -> Vec<Crowd> {
    let [n_x, n_y] = job.size.map(|pixels| pixels.div_ceil(TILE));
    let boxes: Vec<_> = job.drawn.par_iter().map(|edge| around(job.size, edge)).collect();
    let of_row = |row: usize| {
        let mut crowds = vec![Crowd::default(); n_x];
        for (edge, [columns, rows]) in job.drawn.iter().zip(&boxes) {
            if rows.contains(&row) {
                let has_thin = edge.cone.least_radius() < THIN_PX;
                for column in columns.clone() {
                    let low = Vec2::new((column * TILE) as f32, (row * TILE) as f32);
                    crowds[column].n_layers += edge.cone.area_within((low, low + TILE as f32), GAP_PX);
                    crowds[column].has_thin |= has_thin;
                }
            }
        }
        for crowd in &mut crowds {
            crowd.n_layers /= (TILE * TILE) as f64;
        }
        crowds
    };
    (0..n_y).into_par_iter().flat_map_iter(of_row).collect()
}

/// Whether most of the picture is too crowded for blending: all of it then goes without, for a tile that does not blend
/// looks otherwise than its neighbour that does.
pub(crate) fn is_plain(crowds: &[Crowd]) -> bool {
    let n_layers = crowds.iter().map(|crowd| crowd.n_layers);
    let n_drawn = n_layers.clone().filter(|&n| n > 0.0).count().max(1);
    n_layers.sum::<f64>() / n_drawn as f64 > PLAIN_LAYERS
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};
    use glam::DVec3;

    use super::*;
    use crate::cone::{Ball, Cone, Joint};

    #[test]
    fn a_cone_is_listed_wherever_it_is_near() {
        let size = [300, 200];
        let mut stream = Stream::new(7, Purpose::Test, 0, 0);
        for case in 0..300 {
            let mut ball = |flat: bool| Ball {
                center: DVec3::new(
                    stream.uniform(-40.0, 340.0),
                    if flat { 90.0 } else { stream.uniform(-40.0, 240.0) },
                    stream.uniform(-40.0, 40.0),
                ),
                radius: stream.uniform(0.3, 12.0),
            };
            // Some lie along the rows.
            let flat = case % 5 == 0;
            let cone = Cone::new(ball(flat), ball(flat), [Joint::End; 2]);
            let edge = Drawn { node: 0, cone, values: [0.0; 2], arc_px: [0.0; 2] };
            let mut listed = [[false; 10]; 7];
            visit(size, &edge, |column, row| listed[row][column] = true);
            let reach = cone.fillet_px().max(GAP_PX);
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    if cone.at(pixel, reach).is_some() {
                        // The tile of the pixel, and those that look one pixel over their borders.
                        for (x, y) in [(x, y), (x + 1, y), (x.max(1) - 1, y), (x, y + 1), (x, y.max(1) - 1)] {
                            let [column, row] = [(x / TILE).min(9), (y / TILE).min(6)];
                            assert!(listed[row][column], "case {case}: {x} {y}");
                        }
                    }
                }
            }
        }
    }
}
