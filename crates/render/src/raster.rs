//! The tree as pixels: round cones, the highest in front, smooth where branches join.
//!
//! **Input** a scene on its page, values in [0, 1] at the ends of each edge. **Output** for each pixel the colour,
//! the share covered, and what is seen there: edge, place on it, height, normal.
//! **Notation** S samples per pixel and axis, E edges.
//! **Steps** 1. Sort the cones into tiles. In each tile: 2. find the highest cone above each sample and the
//! distance to the outline of all. 3. Where several cones of one neighbourhood of the tree reach nearly as high,
//! average their normals and colours with weights that fade to 0 with the gap in height: creases between
//! neighbours become fillets, and a chain of collinear cones stays as it is. 4. Where a cone in front passes over
//! a distant part of the tree, leave a gap in the paper's colour, as anatomical drawings do; where distant parts of
//! the map touch, draw a seam. 5. Shade, and average the samples by their coverage.
//! **Guarantees** the same bytes for any number of threads: a band of tiles is one task, and inside a tile cones
//! come in preorder.
//! **Source** section 4.1 of [Hu2022]; the blending is ours.
//! **Cost** O(S² · sum of the cones' areas + E) time, S = 1 where a tile is crowded or
//! inside of one broad cone; 32 bytes a pixel. [`layers`] tells that sum beforehand.

use std::ops::RangeInclusive;

use glam::Vec2;
use rayon::prelude::*;

use crate::cone::Cone;
use crate::kinship::Kinship;
use crate::palette::{PageColors, Palette};
use crate::params::Style;
use crate::samples::{Detail, GAP_PX, Samples};

/// Samples per pixel and axis; odd, so that one sample is the pixel's centre.
pub(crate) const SAMPLES: usize = 3;
/// Pixels per tile and axis.
pub(crate) const TILE: usize = 32;
/// The most samples per tile and axis.
pub(crate) const TILE_SAMPLES: usize = TILE * SAMPLES;
/// Beyond this mean over the tiles that are not empty nobody can see what blends with what.
const PLAIN_LAYERS: f64 = 16.0;
/// What an edge of a few pixels may take, in pixels, without being counted: however many they are, they must be drawn.
const SLENDER_PX: f64 = 256.0;
/// No edge.
pub(crate) const NOTHING: u32 = u32::MAX;

/// What is seen at a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pixel {
    /// The share of the pixel that the tree covers, 0 to 1.
    pub coverage: f32,
    /// The lower node of the edge; `u32::MAX` where nothing is.
    pub node: u32,
    /// The place on the edge: 0 at the parent, 1 at the node.
    pub share: f32,
    /// Height over the centreline, in pixels.
    pub height_px: f32,
    /// Unit normal: x right, y down, z to the viewer.
    pub normal: [f32; 3],
    /// Colour, sRGB.
    pub color: [u8; 3],
}

impl Pixel {
    /// Background.
    pub(crate) const EMPTY: Self =
        Self { coverage: 0.0, node: NOTHING, share: 0.0, height_px: 0.0, normal: [0.0; 3], color: [0; 3] };

    /// Whether the tree touches the pixel.
    pub(crate) fn is_covered(&self) -> bool {
        self.node != NOTHING && self.coverage > 0.0
    }
}

/// A drawn edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drawn {
    /// Its lower node.
    pub node: u32,
    /// Its shape in pixels.
    pub cone: Cone,
    /// Palette values at its ends.
    pub values: [f32; 2],
    /// Arc lengths from the root at its ends, in pixels.
    pub arc_px: [f32; 2],
}

/// Everything that the rasteriser reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job<'a> {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// The edges in preorder.
    pub drawn: &'a [Drawn],
    /// Who is near whom.
    pub kinship: &'a Kinship,
    /// Colours of the values.
    pub palette: &'a Palette,
    /// Colours of the page.
    pub colors: PageColors,
    /// How to shade.
    pub style: Style,
    /// Whether edges can pass in front of each other.
    pub has_depth: bool,
}

/// How many times over the picture is looked at for the cones, beyond what slender cones take.
pub(crate) fn layers(size: [usize; 2], drawn: &[Drawn]) -> f64 {
    let looked_at: f64 = drawn
        .iter()
        .map(|edge| {
            let [columns, rows] = tiles_of(size, edge);
            // In each tile a row is looked at even where the cone does not meet it.
            let n_rows = TILE * columns.count() * rows.count();
            (edge.cone.area(GAP_PX) + n_rows as f64 - SLENDER_PX).max(0.0)
        })
        .sum();
    looked_at / (size[0] * size[1]).max(1) as f64
}

/// The tiles that an edge touches: columns and rows.
fn tiles_of(size: [usize; 2], edge: &Drawn) -> [RangeInclusive<usize>; 2] {
    let (low, high) = edge.cone.bounds();
    // Casts saturate, so what lies off the page ends on its border.
    let range = |low: f32, high: f32, n_pixels: usize| {
        let tile = |at: f32| ((at / TILE as f32) as usize).min(n_pixels.div_ceil(TILE) - 1);
        tile(low - GAP_PX - 1.0)..=tile(high + GAP_PX + 1.0)
    };
    [range(low.x, high.x, size[0]), range(low.y, high.y, size[1])]
}

/// Draws the edges.
pub(crate) fn rasterise(job: &Job<'_>) -> Vec<Pixel> {
    let [width, height] = job.size;
    let tiles = Tiles::sort(job);
    let n_layers = tiles.layers(job);
    let is_plain = is_plain(&n_layers);
    let mut pixels = vec![Pixel::EMPTY; width * height];
    pixels.par_chunks_mut(width * TILE).enumerate().for_each(|(tile_y, band)| {
        let mut samples = Samples::new();
        for tile_x in 0..tiles.n_x {
            let list = tiles.list(tile_x, tile_y);
            if list.is_empty() {
                continue;
            }
            let origin = Vec2::new((tile_x * TILE) as f32, (tile_y * TILE) as f32);
            let n_layers = n_layers[tile_y * tiles.n_x + tile_x];
            let is_one_body = matches!(list, [only] if job.drawn[*only as usize].cone.is_broad());
            let detail = Detail::of_tile(n_layers, is_one_body, is_plain);
            samples.draw(job, list, origin, detail);
            let columns = tile_x * TILE..((tile_x + 1) * TILE).min(width);
            for (row, line) in band.chunks_mut(width).enumerate() {
                for (column, pixel) in line[columns.clone()].iter_mut().enumerate() {
                    *pixel = samples.resolve(job, column, row);
                }
            }
        }
    });
    pixels
}

/// Whether most of the picture is too crowded for blending: all of it then goes without, for a tile that does not blend
/// looks otherwise than its neighbour that does.
fn is_plain(n_layers: &[f64]) -> bool {
    let n_drawn = n_layers.iter().filter(|&&n| n > 0.0).count().max(1);
    n_layers.iter().sum::<f64>() / n_drawn as f64 > PLAIN_LAYERS
}

/// Which edges touch which tile.
struct Tiles {
    n_x: usize,
    offsets: Vec<usize>,
    entries: Vec<u32>,
}

impl Tiles {
    fn sort(job: &Job<'_>) -> Self {
        let [n_x, n_y] = job.size.map(|pixels| pixels.div_ceil(TILE));
        let mut offsets = vec![0; n_x * n_y + 1];
        let visit = |edge: &Drawn, visitor: &mut dyn FnMut(usize)| {
            let [columns, rows] = tiles_of(job.size, edge);
            for tile_y in rows {
                for tile_x in columns.clone() {
                    visitor(tile_y * n_x + tile_x);
                }
            }
        };
        for edge in job.drawn {
            visit(edge, &mut |tile| offsets[tile + 1] += 1);
        }
        for tile in 0..n_x * n_y {
            offsets[tile + 1] += offsets[tile];
        }
        let mut next = offsets.clone();
        let mut entries = vec![0; offsets[n_x * n_y]];
        for (index, edge) in job.drawn.iter().enumerate() {
            visit(edge, &mut |tile| {
                entries[next[tile]] = index as u32;
                next[tile] += 1;
            });
        }
        Self { n_x, offsets, entries }
    }

    /// By tile: about how often its cones cover it. Where ten thousand branches leave one root, all are in the tiles
    /// around it.
    fn layers(&self, job: &Job<'_>) -> Vec<f64> {
        let of_tile = |tile: usize| {
            let (tile_x, tile_y) = (tile % self.n_x, tile / self.n_x);
            let low = Vec2::new((tile_x * TILE) as f32, (tile_y * TILE) as f32);
            let corners = (low, low + TILE as f32);
            let area = |&index: &u32| job.drawn[index as usize].cone.area_within(corners, GAP_PX);
            self.list(tile_x, tile_y).iter().map(area).sum::<f64>() / (TILE * TILE) as f64
        };
        (0..self.offsets.len() - 1).into_par_iter().map(of_tile).collect()
    }

    fn list(&self, tile_x: usize, tile_y: usize) -> &[u32] {
        let tile = tile_y * self.n_x + tile_x;
        &self.entries[self.offsets[tile]..self.offsets[tile + 1]]
    }
}
