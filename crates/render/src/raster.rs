//! The tree as pixels: round cones, the highest in front, smooth where branches join.
//!
//! **Input** a scene on its page, values in [0, 1] at the ends of each edge. **Output** for each pixel the colour,
//! the share covered, and what is seen there: edge, place on it, height, normal; in bands of [`TILE`] rows, so that
//! nobody needs to hold a whole picture of them.
//! **Notation** E edges.
//! **Steps** 1. Sort the cones into tiles. In each tile: 2. draw one sample a pixel (see [`crate::samples`]), three by
//! three where a cone is as thin as a few pixels. 3. Where neighbouring pixels show distant parts of the tree, draw
//! the pixel again with nine samples: outlines against the paper need none, since coverage follows from their
//! distance. 4. Shade, and average the samples by their coverage.
//! **Guarantees** the same bytes for any number of threads: a band is one task, and inside a tile cones come in
//! preorder. A pixel is drawn the same way in whichever tile it lies: tiles look one pixel over their borders.
//! **Source** section 4.1 of [Hu2022].
//! **Cost** O(sum of the cones' areas + E) time; 36 bytes a pixel of the bands in work. [`layers`] tells that sum
//! beforehand.

use crate::cone::Cone;
use crate::kinship::Kinship;
use crate::palette::{PageColors, Palette, to_byte};
use crate::params::Style;
use crate::samples::{Best, GAP_PX, Lattice, Samples};
use crate::shade::{self, Place};
use crate::tiles::{self, Crowd, Tiles};
use glam::Vec2;

/// Pixels per tile and axis.
pub(crate) const TILE: usize = 32;
/// Samples per pixel and axis where one is not enough; odd, so that one sample is the pixel's centre.
const FINE: usize = 3;
/// Tiles that cones cover more often than this get one sample a pixel. Organs at their true widths stay below: no
/// pixel of the airway, vessel and neuron phantoms' pictures changes by it.
const FINE_LAYERS: f64 = 12.0;
/// Neighbouring pixels whose heights differ by more than this share of the radius show an edge of one part before
/// another, even of the same neighbourhood.
const STEP: f32 = 0.5;
/// Places farther apart along the tree than this, in their radii, are distant parts.
const DISTANT: f32 = 4.0;
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
    /// How far to the left of the edge, seen from the parent, in pixels; under 0 to the right.
    pub across_px: f32,
    /// Colour, sRGB.
    pub color: [u8; 3],
}

impl Pixel {
    /// Background.
    pub(crate) const EMPTY: Self = Self {
        coverage: 0.0,
        node: NOTHING,
        share: 0.0,
        height_px: 0.0,
        normal: [0.0; 3],
        across_px: 0.0,
        color: [0; 3],
    };

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
            let [columns, rows] = tiles::around(size, edge);
            // In each tile a row is looked at even where the cone does not meet it.
            let n_rows = TILE * columns.count() * rows.count();
            (edge.cone.area(GAP_PX) + n_rows as f64 - SLENDER_PX).max(0.0)
        })
        .sum();
    looked_at / (size[0] * size[1]).max(1) as f64
}

/// A picture, ready to be drawn band by band.
pub(crate) struct Raster<'a> {
    job: Job<'a>,
    tiles: Tiles,
    crowds: Vec<Crowd>,
    is_plain: bool,
}

/// What a thread draws with.
pub(crate) struct Brush {
    tile: Samples,
    pixel: Samples,
}

impl Brush {
    pub(crate) fn new() -> Self {
        Self { tile: Samples::new(), pixel: Samples::new() }
    }
}

impl<'a> Raster<'a> {
    /// Sorts the cones.
    pub(crate) fn new(job: Job<'a>) -> Self {
        let crowds = tiles::crowds(&job);
        let is_plain = tiles::is_plain(&crowds);
        Self { job, tiles: Tiles::sort(&job), crowds, is_plain }
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> [usize; 2] {
        self.job.size
    }

    /// The pixels of the band of this index, [`TILE`] rows or what is left.
    pub(crate) fn band(&self, band: usize, brush: &mut Brush) -> Vec<Pixel> {
        let [width, height] = self.job.size;
        let n_rows = height.saturating_sub(band * TILE).min(TILE);
        let mut pixels = vec![Pixel::EMPTY; width * n_rows];
        for column in 0..self.tiles.n_x {
            let list = self.tiles.list(column, band);
            if !list.is_empty() {
                self.tile([column, band], list, (brush, &mut pixels));
            }
        }
        pixels
    }

    /// Draws one tile into its band.
    fn tile(&self, [column, band]: [usize; 2], list: &[u32], (brush, pixels): (&mut Brush, &mut [Pixel])) {
        let (job, width) = (&self.job, self.job.size[0]);
        let Crowd { n_layers, has_thin } = self.crowds[band * self.tiles.n_x + column];
        let is_crowded = n_layers > FINE_LAYERS;
        let n = if !self.is_plain && !is_crowded && has_thin { FINE } else { 1 };
        let corner = Vec2::new((column * TILE) as f32, (band * TILE) as f32);
        // One sample a pixel looks over the border, to compare neighbours.
        let rim = usize::from(n == 1);
        let origin = corner - rim as f32;
        let lattice = Lattice { origin, n_pixels: TILE + 2 * rim, n };
        brush.tile.draw(job, list, lattice, !self.is_plain);
        let is_refined = n == 1 && !self.is_plain && !is_crowded;
        for (row, line) in pixels.chunks_mut(width).enumerate() {
            let used = brush.tile.used_pixels(row + rim);
            let line = line.iter_mut().skip(column * TILE).take(TILE).enumerate();
            for (x, pixel) in line.take(used.end.saturating_sub(rim)).skip(used.start.saturating_sub(rim)) {
                let at = [x + rim, row + rim];
                if is_refined && self.has_edge(&brush.tile, at) {
                    let origin = corner + Vec2::new(x as f32, row as f32);
                    brush.pixel.draw(job, list, Lattice { origin, n_pixels: 1, n: FINE }, true);
                    *pixel = resolve(job, &brush.pixel, [0, 0]);
                } else {
                    *pixel = resolve(job, &brush.tile, at);
                }
            }
        }
    }

    /// Whether a pixel and one beside it show distant parts of the tree.
    fn has_edge(&self, tile: &Samples, [x, y]: [usize; 2]) -> bool {
        let row = tile.lattice.row();
        let own = &tile.best[y * row + x];
        if own.index == NOTHING {
            return false;
        }
        let beside = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
        beside.into_iter().any(|(x, y)| self.are_distant(own, &tile.best[y * row + x]))
    }

    fn are_distant(&self, a: &Best, b: &Best) -> bool {
        if a.index == b.index || b.index == NOTHING || a.hit.level.max(b.hit.level) < 0.0 {
            return false;
        }
        let place = |best: &Best| {
            let edge = &self.job.drawn[best.index as usize];
            (edge.node, edge.arc_px[0] + best.hit.share * (edge.arc_px[1] - edge.arc_px[0]))
        };
        let radius = a.hit.radius.min(b.hit.radius);
        let limit = DISTANT * (a.hit.radius + b.hit.radius);
        (a.hit.z - b.hit.z).abs() > STEP * radius + 1.0
            || self.job.kinship.path_px(place(a), place(b), limit) > limit
    }
}

/// The pixel at a column and row of some samples.
fn resolve(job: &Job<'_>, samples: &Samples, [x, y]: [usize; 2]) -> Pixel {
    let lattice = samples.lattice;
    let n = lattice.n;
    let first = (y * lattice.row() + x) * n;
    let at = |i: usize| first + (i / n) * lattice.row() + i % n;
    let (mut color, mut covered) = ([0.0; 3], 0.0);
    // The centre speaks for the pixel; at the rim, where it is empty, the first sample that is not.
    let (center, mut speaker) = (at(n * n / 2), None);
    for sample in (0..n * n).map(at) {
        let surface = &samples.surface[sample];
        let coverage = if samples.best[sample].index == NOTHING { 0.0 } else { lattice.coverage(surface) };
        if coverage <= 0.0 {
            continue;
        }
        if speaker.is_none() || sample == center {
            speaker = Some(sample);
        }
        let place =
            Place { normal: surface.normal(), outside_px: surface.outside, radius_px: surface.radius };
        let lit = shade::shade(surface.base(), &place, &job.colors, job.style);
        let lit = shade::mix(lit, job.colors.rim, shade::SEAM * surface.seam);
        let lit = shade::mix(lit, job.colors.background, surface.gap);
        color = std::array::from_fn(|k| color[k] + coverage * lit[k]);
        covered += coverage;
    }
    let Some(speaker) = speaker else { return Pixel::EMPTY };
    let (best, surface) = (&samples.best[speaker], &samples.surface[speaker]);
    let edge = &job.drawn[best.index as usize];
    Pixel {
        coverage: covered / (n * n) as f32,
        node: edge.node,
        share: best.hit.share,
        height_px: surface.level.max(0.0).sqrt(),
        normal: surface.normal().to_array(),
        across_px: edge.cone.across(&best.hit),
        color: color.map(|part| to_byte(part / covered)),
    }
}
