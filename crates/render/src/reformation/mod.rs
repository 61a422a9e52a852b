//! The scan on the map: a curved planar reformation of the whole tree in one picture.
//!
//! **Input** an embedded tree and the scan that it was found in. **Output** for each pixel the grey of the scan at the
//! point of the patient that the map says; band by band, so that nobody needs to hold them all.
//! **Steps** For each pixel: 1. the edge that it belongs to, and its foot on that edge ([`PlanarMap`]: inside of tubes the
//! one seen there, outside the nearest). 2. Nothing if it is out of reach of that edge. 3. The scan at the pixel's point
//! in the patient, or over a slab across the surface of the map; where a pixel is larger than a voxel, the mean of some
//! points in it. 4. The window's grey, and over it the outline of the tubes as a thin line. 5. Fainter lines where the
//! picture ends, for bright tissue is as white as the paper, and where neighbours show distant places of the patient.
//! **Which surface?** The one that the map lies in: at forks the plane of their own branches, between forks carried with
//! as little twist as it can, so that sides do not flip from a branch to its children. Off a branch a place may show
//! twice, or not at all: the reach says how far around branches the picture goes.
//! **Guarantees** the same bytes for any number of threads: a band is one task. Where the scan has no value, or does not
//! reach, there is paper and no grey.
//! **Source** curved planar reformation: [Kanitsar2002]; of a whole tree at once, on an embedding without crossings: ours.
//! **Cost** O(pixels in reach · (edges near them + points of the slab)).

pub(crate) mod params;
mod sampler;
mod tiles;
pub(crate) mod window;

use espalier_model::{Grid, Report, Tree, Volume};
use glam::{DVec2, DVec3, Vec3};

use crate::Error;
use crate::map::{Beside, Place, PlanarMap};
use crate::page::Paper;
use crate::palette::{Palette, Rgb, to_byte};
use crate::raster::{NOTHING, Pixel, TILE};
use crate::shade::mix;
use params::VolumeParams;
use sampler::Sampler;
use tiles::Tiles;
use window::Greys;

/// The line round the tubes: an orange that no grey hides. Half its width and how much it covers, in pixels.
const OUTLINE: Rgb = [1.0, 0.62, 0.1];
const OUTLINE_PX: f32 = 0.9;
const OUTLINE_COVERS: f32 = 0.85;
/// Tubes of fewer pixels' radius have a fainter line: it would hide them.
const BROAD_PX: f32 = 5.0;
/// How strong the rule is where the picture ends, and where neighbours show distant places of the patient.
const BORDER: f32 = 0.6;
const SEAM: f32 = 0.45;
/// Neighbours are distant from so many pixels and a voxel on.
const JUMP_PX: f64 = 3.0;
/// Points along a pixel's side at most, where it is larger than a voxel.
const MOST_POINTS: f64 = 4.0;

/// A scan that holds less of the tree is of something else.
const LEAST_INSIDE: f64 = 0.5;

/// A scan on the map of a tree.
pub(crate) struct Reformation<'a> {
    map: &'a PlanarMap<'a>,
    sampler: Sampler<'a>,
    params: &'a VolumeParams,
    palette: Palette,
    greys: Greys,
    /// The colour of the thin lines where the picture ends or jumps.
    rule: Rgb,
    n_nodes: usize,
    /// Whether the root has one child.
    is_root_single: bool,
    /// The least distance between two voxels, mm.
    spacing_mm: f64,
    /// The share of the tree's nodes that lie in the scan.
    share_inside: f64,
}

/// A band of the picture.
pub(crate) struct Band {
    /// Its pixels.
    pub pixels: Vec<Pixel>,
    /// The scan at each of them; NaN where it has no value.
    pub values: Vec<f32>,
}

/// What is seen at a pixel.
#[derive(Clone, Copy, Debug)]
struct Seen {
    /// The lower node of its edge; [`NOTHING`] out of reach.
    node: u32,
    /// The place on the edge.
    share: f32,
    /// The distance to the tube's surface, the tube's radius, and how far to the left of the edge, in pixels.
    outside_px: f32,
    radius_px: f32,
    across_px: f32,
    /// The share of the pixel that is in reach.
    coverage: f32,
    /// Whether it lies before the first edge at the root.
    is_before_root: bool,
    /// Its point in the patient.
    position_mm: Vec3,
    /// The scan there; NaN where it has no value.
    value: f32,
}

impl Seen {
    const NOTHING: Self = Self {
        node: NOTHING,
        share: 0.0,
        outside_px: 0.0,
        radius_px: 0.0,
        across_px: 0.0,
        coverage: 0.0,
        is_before_root: false,
        position_mm: Vec3::ZERO,
        value: f32::NAN,
    };

    fn is_valued(&self) -> bool {
        self.node != NOTHING && self.value.is_finite()
    }

    fn is_shown(&self) -> bool {
        self.is_valued() && self.coverage >= 0.5
    }
}

/// What the bands of a picture have come to.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// Pixels in reach, and those of them with a value.
    n_in_reach: usize,
    n_valued: usize,
    /// Pixels inside of tubes with a value, and the sum of these.
    n_inside: usize,
    sum_inside: f64,
}

impl<'a> Reformation<'a> {
    /// # Errors
    /// [`Error::Elsewhere`] where less than half of the tree lies in the scan.
    pub(crate) fn new(
        (tree, map): (&'a Tree, &'a PlanarMap<'a>),
        scan: &'a Volume,
        (params, rule): (&'a VolumeParams, Rgb),
    ) -> Result<Self, Error> {
        let sampler = Sampler::new(scan, params);
        let greys = window::greys((tree, map), (scan, &sampler), params);
        let grid = scan.grid();
        let voxel_from_world = grid.voxel_from_world();
        let is_inside =
            |position_mm: DVec3| grid.voxel_at(voxel_from_world.transform_point3(position_mm)).is_some();
        let n_inside = tree.nodes().iter().filter(|node| is_inside(node.position_mm)).count();
        let share_inside = n_inside as f64 / tree.n_nodes() as f64;
        if share_inside < LEAST_INSIDE {
            let [scan, tree] =
                [corners_of(grid), tree.nodes().iter().map(|node| node.position_mm).collect()].map(box_of);
            return Err(Error::Elsewhere { percent: 100.0 * share_inside, scan, tree });
        }
        Ok(Self {
            map,
            sampler,
            params,
            palette: Palette::greys(),
            greys,
            rule,
            n_nodes: tree.n_nodes(),
            is_root_single: tree.children(0).len() == 1,
            spacing_mm: grid.spacing_mm().min_element(),
            share_inside,
        })
    }

    /// What is black and what is white.
    pub(crate) fn greys(&self) -> &Greys {
        &self.greys
    }

    /// Says what the picture shows.
    pub(crate) fn report(&self, tally: &Tally, report: &mut Report) {
        let [low, high] = self.greys.range;
        report.count("window_low", low);
        report.count("window_high", high);
        report.count("scan_shown_percent", 100.0 * tally.n_valued as f64 / tally.n_in_reach.max(1) as f64);
        if tally.n_inside > 0 {
            report.count("scan_mean_inside", tally.sum_inside / tally.n_inside as f64);
        }
        if self.share_inside < 1.0 {
            let percent = 100.0 * (1.0 - self.share_inside);
            report.warn(
                "W-RENDER-OUTSIDE",
                format!("{percent:.1} % of the tree's nodes lie outside of the scan; the map is empty there"),
            );
        }
    }

    /// Ready to be drawn on a page.
    pub(crate) fn on(&'a self, paper: &'a Paper<'a>) -> OnPage<'a> {
        let tiles = Tiles::sort(self.map, self.n_nodes, paper, self.params);
        let n = (1.0 / (paper.page.px_per_mm * self.spacing_mm)).ceil().clamp(1.0, MOST_POINTS);
        let place = |i: f64| ((i + 0.5) / n - 0.5) / paper.page.px_per_mm;
        let points =
            (0..(n * n) as usize).map(|i| DVec2::new(place(i as f64 % n), place((i as f64 / n).floor())));
        let first_edge = if self.is_root_single { 1 } else { usize::MAX };
        OnPage { of: self, paper, first_edge, tiles, points_mm: points.collect() }
    }
}

/// A scan on a page.
pub(crate) struct OnPage<'a> {
    of: &'a Reformation<'a>,
    paper: &'a Paper<'a>,
    /// The first edge of the tree, if its root has no other.
    first_edge: usize,
    tiles: Tiles,
    /// Where in a pixel the scan is looked at, from its middle.
    points_mm: Vec<DVec2>,
}

impl OnPage<'_> {
    /// The band of this index, [`TILE`] rows or what is left.
    pub(crate) fn band(&self, band: usize) -> (Band, Tally) {
        let [width, height] = self.paper.page.size();
        let n_rows = height.saturating_sub(band * TILE).min(TILE);
        // One row more on either side, to compare neighbours.
        let rows: Vec<Vec<Seen>> = (0..n_rows + 2).map(|row| self.row(band * TILE + row)).collect();
        let mut made =
            Band { pixels: Vec::with_capacity(width * n_rows), values: Vec::with_capacity(width * n_rows) };
        let mut tally = Tally::default();
        for row in 1..=n_rows {
            for x in 0..width {
                let seen = &rows[row][x];
                tally.see(seen);
                let beside = |x: usize| rows[row].get(x).unwrap_or(&Seen::NOTHING);
                let beyond = [beside(x.wrapping_sub(1)), beside(x + 1), &rows[row - 1][x], &rows[row + 1][x]];
                made.pixels.push(self.pixel(seen, beyond));
                made.values.push(seen.value);
            }
        }
        (made, tally)
    }

    /// What is seen along the row above the one of this index.
    fn row(&self, below: usize) -> Vec<Seen> {
        let [width, height] = self.paper.page.size();
        let mut seen = vec![Seen::NOTHING; width];
        let Some(row) = below.checked_sub(1).filter(|&row| row < height) else { return seen };
        for (column, seen) in seen.iter_mut().enumerate() {
            let edges = self.tiles.list(column / TILE, row / TILE);
            if !edges.is_empty() {
                let at = self.paper.plane_mm(DVec2::new(column as f64, row as f64) + 0.5);
                *seen = self.look(edges, at).unwrap_or(Seen::NOTHING);
            }
        }
        seen
    }

    /// What a point of the plane shows; nothing out of reach.
    fn look(&self, edges: &[u32], at: DVec2) -> Option<Seen> {
        let (map, params) = (self.of.map, self.of.params);
        let node = map.owner_among(edges.iter().map(|&edge| edge as usize), at)?;
        let Beside { place, patient_mm, .. } = map.from_plane(node, at);
        let radius_mm = map.radius_mm(place);
        let aside = at - map.plane_at(place);
        let outside_mm = aside.length() - radius_mm;
        let px_per_mm = self.paper.page.px_per_mm;
        // A pixel of which the border of the reach cuts off a part is covered in part.
        let coverage = (0.5 - (outside_mm - params.reach(radius_mm)) * px_per_mm).clamp(0.0, 1.0);
        let along = map.direction(node);
        (coverage > 0.0).then(|| Seen {
            node: node as u32,
            share: place.share as f32,
            outside_px: (outside_mm * px_per_mm) as f32,
            radius_px: (radius_mm * px_per_mm) as f32,
            across_px: (along.perp_dot(aside) * px_per_mm) as f32,
            coverage: coverage as f32,
            is_before_root: node == self.first_edge && place.share <= 0.0 && along.dot(aside) < 0.0,
            position_mm: patient_mm.as_vec3(),
            value: self.value(place, patient_mm).map_or(f32::NAN, |value| value as f32),
        })
    }

    /// A pixel, by what its neighbours are.
    fn pixel(&self, seen: &Seen, beyond: [&Seen; 4]) -> Pixel {
        if seen.node == NOTHING {
            return Pixel::EMPTY;
        }
        let outline = ((OUTLINE_PX + 0.5 - seen.outside_px.abs()).clamp(0.0, 1.0)) * OUTLINE_COVERS;
        let outline = outline * (seen.radius_px / BROAD_PX).min(1.0);
        let (color, coverage) = if seen.is_valued() {
            let grey = self.of.palette.at(self.of.greys.share(f64::from(seen.value)));
            let [_, right, _, below] = beyond;
            let is_border = seen.coverage >= 0.5 && beyond.iter().any(|other| !other.is_shown());
            let is_seam =
                seen.outside_px > 0.0 && [right, below].into_iter().any(|other| self.jumps(seen, other));
            let edge = if is_border { BORDER } else { SEAM * f32::from(is_seam) };
            (mix(mix(grey, self.of.rule, edge), OUTLINE, outline), seen.coverage)
        } else {
            // Without a value only the line is drawn, and that not round a root from which the scan was cut.
            (OUTLINE, if seen.is_before_root { 0.0 } else { outline })
        };
        if coverage <= 0.0 {
            return Pixel::EMPTY;
        }
        let Seen { node, share, across_px, .. } = *seen;
        Pixel { coverage, node, share, across_px, color: color.map(to_byte), ..Pixel::EMPTY }
    }

    /// Whether two pixels that touch show places of the patient that do not.
    fn jumps(&self, a: &Seen, b: &Seen) -> bool {
        let apart_mm = f64::from(a.position_mm.distance(b.position_mm));
        a.is_valued() && b.is_valued() && apart_mm > JUMP_PX / self.paper.page.px_per_mm + self.of.spacing_mm
    }

    /// The scan at a point: the mean over the pixel.
    fn value(&self, place: Place, patient_mm: DVec3) -> Option<f64> {
        let frame = self.of.map.frame_at(place);
        let normal = frame * DVec3::Z;
        let (mut sum, mut n) = (0.0, 0.0);
        for point in &self.points_mm {
            let turned = self.paper.turned(*point);
            if let Some(value) = self.of.sampler.slab(patient_mm + frame * turned.extend(0.0), normal) {
                (sum, n) = (sum + value, n + 1.0);
            }
        }
        (n > 0.0).then(|| sum / n)
    }
}

impl Tally {
    fn see(&mut self, seen: &Seen) {
        self.n_in_reach += usize::from(seen.node != NOTHING);
        self.n_valued += usize::from(seen.is_valued());
        if seen.is_valued() && seen.outside_px < 0.0 {
            self.n_inside += 1;
            self.sum_inside += f64::from(seen.value);
        }
    }

    /// The sum of two, the first from further up.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            n_in_reach: self.n_in_reach + other.n_in_reach,
            n_valued: self.n_valued + other.n_valued,
            n_inside: self.n_inside + other.n_inside,
            sum_inside: self.sum_inside + other.sum_inside,
        }
    }
}

/// The middles of the outermost voxels.
fn corners_of(grid: &Grid) -> Vec<DVec3> {
    let last = grid.shape().map(|extent| (extent - 1) as f64);
    let side = |corner: usize, axis: usize| if corner >> axis & 1 == 1 { last[axis] } else { 0.0 };
    let corner = |i| grid.world_from_voxel().transform_point3(DVec3::new(side(i, 0), side(i, 1), side(i, 2)));
    (0..8).map(corner).collect()
}

/// The box of some points in words: x -12 to 30, y …
fn box_of(points: Vec<DVec3>) -> String {
    let (low, high) = points
        .into_iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)));
    let part = |(name, axis): (&str, usize)| format!("{name} {:.0} to {:.0}", low[axis], high[axis]);
    [("x", 0), ("y", 1), ("z", 2)].map(part).join(", ")
}
