//! The samples of one tile: which cone is highest, and how its neighbours blend with it.
//!
//! **Input** the cones of a tile in preorder. **Output** the tile's pixels.
//! **Steps** 2 to 5 of [`crate::raster`], in the [`Detail`] that the tile can afford.
//! **Guarantees** sums run in preorder of the cones, so the bytes do not depend on threads.

use std::ops::Range;

use glam::{Vec2, Vec3};

use crate::cone::{Cone, Hit};
use crate::palette::{Rgb, to_byte};
use crate::raster::{Drawn, Job, NOTHING, Pixel, SAMPLES, TILE, TILE_SAMPLES};
use crate::shade::{self, Place};

/// Tiles that cones cover more often than this get one sample a pixel. Organs at their true widths stay below: no
/// pixel of the airway, vessel and neuron phantoms' pictures changes by it.
const FINE_LAYERS: f64 = 12.0;
/// Cones that end lower than this share of the radius below the highest have no say in the normal.
const BLEND_SHARE: f32 = 0.7;
/// Two cones blend if the path between them is at most this many of their radii.
const BLEND_REACH: f32 = 2.0;
/// Where two distant parts of the map overlap at their widths, a dark line this wide says that they do not join.
const SEAM_PX: f32 = 1.3;
const SEAM: f32 = 0.55;
/// Width of the gap beside a branch that passes in front.
pub(crate) const GAP_PX: f32 = 1.6;

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

    fn offer(&mut self, index: u32, hit: Hit, fringe_px: f32) {
        self.n_near += 1;
        if hit.outside > fringe_px {
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

/// How carefully a tile is drawn: each layer of cones costs as much as the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Detail {
    /// [`SAMPLES`]² samples a pixel, neighbours blended.
    Fine,
    /// One sample a pixel, neighbours blended. Outlines stay smooth: coverage follows from their distance.
    Coarse,
    /// One sample a pixel, the highest cone alone.
    Plain,
}

impl Detail {
    /// For a tile that cones cover so many times over or that one broad cone has for itself, in a picture that blends
    /// or not.
    pub(crate) fn of_tile(n_layers: f64, is_one_body: bool, is_plain: bool) -> Self {
        if is_plain {
            Self::Plain
        } else if is_one_body || n_layers > FINE_LAYERS {
            Self::Coarse
        } else {
            Self::Fine
        }
    }

    fn samples(self) -> usize {
        if self == Self::Fine { SAMPLES } else { 1 }
    }
}

/// Where the samples of a tile lie.
#[derive(Clone, Copy)]
struct Lattice {
    /// The tile's upper left corner, pixels.
    origin: Vec2,
    /// Samples per pixel and axis.
    n: usize,
}

impl Lattice {
    /// Samples per tile and axis.
    fn row(self) -> usize {
        TILE * self.n
    }

    /// A sample this far outside an outline is still partly covered: half a sample.
    fn fringe_px(self) -> f32 {
        0.5 / self.n as f32
    }

    /// The indices of the samples from `low` to `high` along an axis on which the tile begins at `from`.
    fn clip(self, low: f32, high: f32, from: f32) -> Range<usize> {
        let index = |at: f32| (at - from) * self.n as f32 - 0.5;
        // Casts saturate at 0; one sample of slack on either side covers rounding.
        let first = (index(low) - 1.0) as usize;
        let last = (index(high) + 2.0).max(0.0) as usize;
        first..last.min(self.row())
    }

    /// A sample's place along an axis.
    fn place(self, from: f32, index: usize) -> f32 {
        from + (index as f32 + 0.5) * (1.0 / self.n as f32)
    }
}

/// The samples of one tile.
pub(crate) struct Samples {
    lattice: Lattice,
    best: Vec<Best>,
    blend: Vec<Blend>,
}

impl Samples {
    /// Samples that see nothing.
    pub(crate) fn new() -> Self {
        let n = TILE_SAMPLES * TILE_SAMPLES;
        let lattice = Lattice { origin: Vec2::ZERO, n: SAMPLES };
        Self { lattice, best: vec![Best::nothing(); n], blend: vec![Blend::NOTHING; n] }
    }

    /// Draws the listed cones of the tile whose upper left corner is `origin`.
    pub(crate) fn draw(&mut self, job: &Job<'_>, list: &[u32], origin: Vec2, detail: Detail) {
        self.lattice = Lattice { origin, n: detail.samples() };
        let (lattice, n_samples) = (self.lattice, self.lattice.row() * self.lattice.row());
        self.best[..n_samples].fill(Best::nothing());
        self.blend[..n_samples].fill(Blend::NOTHING);
        let is_plain = detail == Detail::Plain;
        let margin = if job.has_depth && !is_plain { GAP_PX } else { lattice.fringe_px() };
        for &index in list {
            let edge = &job.drawn[index as usize];
            let all = |_: usize| true;
            for_each_sample(&edge.cone, (lattice, margin), all, |sample, hit| {
                self.best[sample].offer(index, hit, lattice.fringe_px());
            });
        }
        // Most samples see one cone only and have nothing to blend.
        for (best, blend) in self.best[..n_samples].iter().zip(&mut self.blend) {
            if (is_plain || best.n_near == 1) && best.index != NOTHING {
                blend.add(job, &job.drawn[best.index as usize], &best.hit, 1.0);
            }
        }
        if !is_plain {
            self.blend_neighbours(job, list, margin);
        }
    }

    /// Blends where several cones reach a sample.
    fn blend_neighbours(&mut self, job: &Job<'_>, list: &[u32], margin: f32) {
        let (lattice, best) = (self.lattice, &self.best);
        for &index in list {
            let edge = &job.drawn[index as usize];
            let shared = |sample: usize| best[sample].n_near > 1 && best[sample].index != NOTHING;
            for_each_sample(&edge.cone, (lattice, margin), shared, |sample, hit| {
                let cone = Reaching { index, edge, hit, fringe_px: lattice.fringe_px() };
                weigh(job, &mut self.blend[sample], &best[sample], &cone);
            });
        }
    }

    /// The pixel at (column, row) of the tile.
    pub(crate) fn resolve(&self, job: &Job<'_>, column: usize, row: usize) -> Pixel {
        let Lattice { n, .. } = self.lattice;
        let first = (row * self.lattice.row() + column) * n;
        let at = |i: usize| first + (i / n) * self.lattice.row() + i % n;
        let (mut color, mut covered) = ([0.0; 3], 0.0);
        for sample in (0..n * n).map(at) {
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
        let center = n * n / 2;
        let speaker = std::iter::once(center)
            .chain(0..n * n)
            .map(at)
            .find(|&sample| self.coverage(sample) > 0.0)
            .unwrap_or(first);
        let best = &self.best[speaker];
        Pixel {
            coverage: covered / (n * n) as f32,
            node: job.drawn[best.index as usize].node,
            share: best.hit.share,
            height_px: best.hit.height,
            normal: self.blend[speaker].normal.normalize_or(Vec3::Z).to_array(),
            color: color.map(|part| to_byte(part / covered)),
        }
    }

    fn coverage(&self, sample: usize) -> f32 {
        let best = &self.best[sample];
        if best.index == NOTHING {
            return 0.0;
        }
        (0.5 - best.outside * self.lattice.n as f32).clamp(0.0, 1.0)
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

/// A cone at a sample that it reaches.
struct Reaching<'a> {
    index: u32,
    edge: &'a Drawn,
    hit: Hit,
    fringe_px: f32,
}

/// Adds a cone's say to the blending of a sample that several cones reach.
fn weigh(job: &Job<'_>, blend: &mut Blend, best: &Best, cone: &Reaching<'_>) {
    let Reaching { index, edge, hit, fringe_px } = *cone;
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
    if hit.outside > fringe_px {
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
    (lattice, margin): (Lattice, f32),
    wanted: impl Fn(usize) -> bool,
    mut visit: impl FnMut(usize, Hit),
) {
    let (low, high) = cone.bounds();
    let origin = lattice.origin;
    for row in lattice.clip(low.y - margin, high.y + margin, origin.y) {
        let y = lattice.place(origin.y, row);
        let Some((from, to)) = cone.span(y, margin) else { continue };
        for column in lattice.clip(from, to, origin.x) {
            let sample = row * lattice.row() + column;
            if !wanted(sample) {
                continue;
            }
            let pixel = Vec2::new(lattice.place(origin.x, column), y);
            if let Some(hit) = cone.at(pixel, margin) {
                visit(sample, hit);
            }
        }
    }
}
