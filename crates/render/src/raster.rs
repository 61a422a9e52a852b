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
//! **Cost** O(S² · drawn area + E) time, 28 bytes a pixel.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::cone::{Cone, Hit};
use crate::kinship::Kinship;
use crate::palette::{PageColors, Palette, Rgb, to_byte};
use crate::params::Style;
use crate::shade::{self, Place};

/// Samples per pixel and axis; odd, so that one sample is the pixel's centre.
const SAMPLES: usize = 3;
/// Pixels per tile and axis.
const TILE: usize = 32;
const TILE_SAMPLES: usize = TILE * SAMPLES;
/// A sample this far outside an outline is still partly covered: half a sample.
const FRINGE_PX: f32 = 0.5 / SAMPLES as f32;
/// Cones that end lower than this share of the radius below the highest have no say in the normal.
const BLEND_SHARE: f32 = 0.7;
/// Two cones blend if the path between them is at most this many of their radii.
const BLEND_REACH: f32 = 2.0;
/// Where two distant parts of the map overlap at their widths, a dark line this wide says that they do not join.
const SEAM_PX: f32 = 1.3;
const SEAM: f32 = 0.55;
/// Width of the gap beside a branch that passes in front.
const GAP_PX: f32 = 1.6;
/// No edge.
const NOTHING: u32 = u32::MAX;

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
    const EMPTY: Self =
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

/// Draws the edges.
pub(crate) fn rasterise(job: &Job<'_>) -> Vec<Pixel> {
    let [width, height] = job.size;
    let tiles = Tiles::sort(job);
    let mut pixels = vec![Pixel::EMPTY; width * height];
    pixels.par_chunks_mut(width * TILE).enumerate().for_each(|(tile_y, band)| {
        let mut samples = Samples::new();
        for tile_x in 0..tiles.n_x {
            let list = tiles.list(tile_x, tile_y);
            if list.is_empty() {
                continue;
            }
            samples.draw(job, list, Vec2::new((tile_x * TILE) as f32, (tile_y * TILE) as f32));
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
            let (low, high) = edge.cone.bounds();
            // Casts saturate, so what lies off the page ends on its border.
            let range = |low: f32, high: f32, n: usize| {
                let tile = |at: f32| ((at / TILE as f32) as usize).min(n - 1);
                tile(low - GAP_PX - 1.0)..=tile(high + GAP_PX + 1.0)
            };
            for tile_y in range(low.y, high.y, n_y) {
                for tile_x in range(low.x, high.x, n_x) {
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

    fn list(&self, tile_x: usize, tile_y: usize) -> &[u32] {
        let tile = tile_y * self.n_x + tile_x;
        &self.entries[self.offsets[tile]..self.offsets[tile + 1]]
    }
}

/// The best cone at a sample.
#[derive(Clone, Copy)]
struct Best {
    hit: Hit,
    index: u32,
    /// Distance to the outline of all cones.
    outside: f32,
    /// How many cones reach the sample, or come so near that they may leave a gap beside it.
    n_near: u32,
}

impl Best {
    fn nothing() -> Self {
        Self { hit: Hit::default(), index: NOTHING, outside: f32::INFINITY, n_near: 0 }
    }

    fn offer(&mut self, index: u32, hit: Hit) {
        self.n_near += 1;
        if hit.outside > FRINGE_PX {
            return;
        }
        if self.index == NOTHING || hit.z > self.hit.z {
            (self.hit, self.index) = (hit, index);
        }
        self.outside = self.outside.min(hit.outside);
    }
}

/// Sums of the blending.
#[derive(Clone, Copy)]
struct Blend {
    normal: Vec3,
    color: Rgb,
    weight: f32,
    gap: f32,
    seam: f32,
}

impl Blend {
    const NOTHING: Self = Self { normal: Vec3::ZERO, color: [0.0; 3], weight: 0.0, gap: 0.0, seam: 0.0 };

    fn add(&mut self, job: &Job<'_>, edge: &Drawn, hit: &Hit, weight: f32) {
        let color = job.palette.at(edge.values[0] + hit.share * (edge.values[1] - edge.values[0]));
        self.normal += weight * edge.cone.normal(hit);
        self.color = std::array::from_fn(|k| self.color[k] + weight * color[k]);
        self.weight += weight;
    }
}

/// The samples of one tile.
struct Samples {
    best: Vec<Best>,
    blend: Vec<Blend>,
}

impl Samples {
    fn new() -> Self {
        let n = TILE_SAMPLES * TILE_SAMPLES;
        Self { best: vec![Best::nothing(); n], blend: vec![Blend::NOTHING; n] }
    }

    fn draw(&mut self, job: &Job<'_>, list: &[u32], origin: Vec2) {
        self.best.fill(Best::nothing());
        self.blend.fill(Blend::NOTHING);
        let margin = if job.has_depth { GAP_PX } else { FRINGE_PX };
        for &index in list {
            let edge = &job.drawn[index as usize];
            let all = |_: usize| true;
            for_each_sample(&edge.cone, (origin, margin), all, |sample, hit| {
                self.best[sample].offer(index, hit);
            });
        }
        // Most samples see one cone only and have nothing to blend.
        for (best, blend) in self.best.iter().zip(&mut self.blend) {
            if best.n_near == 1 && best.index != NOTHING {
                blend.add(job, &job.drawn[best.index as usize], &best.hit, 1.0);
            }
        }
        let best = &self.best;
        for &index in list {
            let edge = &job.drawn[index as usize];
            let shared = |sample: usize| best[sample].n_near > 1 && best[sample].index != NOTHING;
            for_each_sample(&edge.cone, (origin, margin), shared, |sample, hit| {
                weigh(job, &mut self.blend[sample], &best[sample], (index, edge, hit));
            });
        }
    }

    /// The pixel at (column, row) of the tile.
    fn resolve(&self, job: &Job<'_>, column: usize, row: usize) -> Pixel {
        let first = row * SAMPLES * TILE_SAMPLES + column * SAMPLES;
        let at = |i: usize| first + (i / SAMPLES) * TILE_SAMPLES + i % SAMPLES;
        let (mut color, mut covered) = ([0.0; 3], 0.0);
        for sample in (0..SAMPLES * SAMPLES).map(at) {
            let coverage = self.coverage(sample);
            if coverage > 0.0 {
                let shaded = self.shaded(job, sample);
                color = std::array::from_fn(|k| color[k] + coverage * shaded[k]);
                covered += coverage;
            }
        }
        if covered <= 0.0 {
            return Pixel::EMPTY;
        }
        // The centre speaks for the pixel; at the rim, where it is empty, the first sample that is not.
        let center = SAMPLES * SAMPLES / 2;
        let speaker = std::iter::once(center)
            .chain(0..SAMPLES * SAMPLES)
            .map(at)
            .find(|&sample| self.coverage(sample) > 0.0)
            .unwrap_or(first);
        let best = &self.best[speaker];
        Pixel {
            coverage: covered / (SAMPLES * SAMPLES) as f32,
            node: job.drawn[best.index as usize].node,
            share: best.hit.share,
            height_px: best.hit.height,
            normal: self.blend[speaker].normal.normalize_or(Vec3::Z).to_array(),
            color: color.map(|part| to_byte(part / covered)),
        }
    }

    fn coverage(&self, sample: usize) -> f32 {
        let best = &self.best[sample];
        if best.index == NOTHING { 0.0 } else { (0.5 - best.outside * SAMPLES as f32).clamp(0.0, 1.0) }
    }

    fn shaded(&self, job: &Job<'_>, sample: usize) -> Rgb {
        let (best, blend) = (&self.best[sample], &self.blend[sample]);
        let base = blend.color.map(|part| part / blend.weight.max(f32::MIN_POSITIVE));
        let normal = blend.normal.normalize_or(Vec3::Z);
        let place = Place { normal, outside_px: best.outside, radius_px: best.hit.radius };
        let lit = shade::shade(base, &place, job.colors.rim, job.style);
        let lit = shade::mix(lit, job.colors.rim, SEAM * blend.seam);
        shade::mix(lit, job.colors.background, blend.gap)
    }
}

/// Adds a cone's say to the blending of a sample that several cones reach.
fn weigh(job: &Job<'_>, blend: &mut Blend, best: &Best, (index, edge, hit): (u32, &Drawn, Hit)) {
    let winner = &job.drawn[best.index as usize];
    let arc = |edge: &Drawn, hit: &Hit| edge.arc_px[0] + hit.share * (edge.arc_px[1] - edge.arc_px[0]);
    let radii = hit.radius + best.hit.radius;
    let is_near = |reach: f32| {
        index == best.index
            || job.kinship.is_near(
                (edge.node, arc(edge, &hit)),
                (winner.node, arc(winner, &best.hit)),
                reach * radii,
            )
    };
    if hit.outside > FRINGE_PX {
        // Beside the outline: a gap if this cone passes in front of a distant part.
        let passes_in_front = hit.z > best.hit.z + 0.5 * radii && !is_near(2.0 * BLEND_REACH);
        if passes_in_front {
            blend.gap = blend.gap.max((GAP_PX - hit.outside).clamp(0.0, 1.0));
        }
        return;
    }
    let lower_by = (best.hit.z - hit.z) / (BLEND_SHARE * best.hit.radius).max(0.5);
    let fade = (1.0 - lower_by).max(0.0);
    if fade <= 0.0 {
        return;
    }
    if is_near(BLEND_REACH) {
        blend.add(job, edge, &hit, if index == best.index { 1.0 } else { fade * fade });
    } else if !is_near(2.0 * BLEND_REACH) {
        // The surfaces meet at an angle here, so the gap in height grows about as fast as the distance.
        let lower_px = best.hit.z - hit.z;
        blend.seam = blend.seam.max((1.0 - lower_px / SEAM_PX).max(0.0));
    }
}

/// Calls `visit` with each sample of the tile at `origin` that a cone reaches and that is `wanted`.
fn for_each_sample(
    cone: &Cone,
    (origin, margin): (Vec2, f32),
    wanted: impl Fn(usize) -> bool,
    mut visit: impl FnMut(usize, Hit),
) {
    const STEP: f32 = 1.0 / SAMPLES as f32;
    let clip = |low: f32, high: f32, from: f32| {
        let index = |at: f32| (at - from) * SAMPLES as f32 - 0.5;
        // Casts saturate at 0; one sample of slack on either side covers rounding.
        let first = (index(low) - 1.0) as usize;
        let last = (index(high) + 2.0).max(0.0) as usize;
        first..last.min(TILE_SAMPLES)
    };
    let (low, high) = cone.bounds();
    for row in clip(low.y - margin, high.y + margin, origin.y) {
        let y = origin.y + (row as f32 + 0.5) * STEP;
        let Some((from, to)) = cone.span(y, margin) else { continue };
        for column in clip(from, to, origin.x) {
            let sample = row * TILE_SAMPLES + column;
            if !wanted(sample) {
                continue;
            }
            let pixel = Vec2::new(origin.x + (column as f32 + 0.5) * STEP, y);
            if let Some(hit) = cone.at(pixel, margin) {
                visit(sample, hit);
            }
        }
    }
}
