//! Where the trachea is: a seed for growing airways.
//!
//! **Input** a CT in HU. **Output** every candidate with its measures, best first.
//! **Notation** a blob is a 4-connected piece of air of one axial slice; a column is a stack of blobs of
//! neighbouring slices, each above the next.
//! **Steps** 1. In each axial slice (by the voxel axis nearest to the body's) take the pieces of air that do not
//! touch the slice's border, have the area of a trachea and the shape of an ellipse, with tissue all around them and
//! some before and behind them: that leaves out the air around the patient, the lungs, and tubes in the table.
//! 2. Stack them from the top down. 3. Columns that are long enough are candidates; the score prefers long, wide,
//! round and high ones: the trachea is above the main bronchi and above any gas in the abdomen. 4. The seed is the
//! darkest voxel near the centre of the column's middle slice.
//! **Guarantees** the result does not depend on the number of threads. Nothing is guessed: without a candidate there
//! is no seed, and the caller says so.
//! **Differs from the source** [Mori1996] seed by hand; searching the top slices alone, as is usual, finds nothing in
//! a crop whose top is below the larynx or above which the trachea does not go.
//! **Cost** O(voxels) time, a slice a thread in memory.

use espalier_geom::math;
use espalier_model::table::{Column as TableColumn, Table, fixed};
use espalier_model::{Grid, Volume};
use glam::DVec3;
use rayon::prelude::*;

/// Air is below this, lung included; both sides of a wall that a voxel shows at all are not. HU.
const AIR_HU: f64 = -700.0;
/// Tissue, fat included, is above this. HU.
const TISSUE_HU: f64 = -250.0;
/// Cross-sections of tracheas, in mm²: a diameter of 5 mm at birth, of 27 mm in large men, some more when oblique.
const AREA_MM2: [f64; 2] = [20.0, 900.0];
/// The most that a trachea's cross-section is longer than wide.
const MAX_ELONGATION: f64 = 2.2;
/// The least share of the ellipse with the same moments that the cross-section fills.
const MIN_FILL: f64 = 0.85;
/// Tissue before and behind, in mm.
const MIN_TISSUE_MM: f64 = 8.0;
/// In how many directions its wall is looked for, how far from it, and the least share that must find one.
const N_RAYS: usize = 16;
const WALL_MM: f64 = 4.0;
const WALL_HU: f64 = -500.0;
const MIN_WALLED: f64 = 0.6;
/// The least length of a column in mm.
const MIN_LENGTH_MM: f64 = 8.0;
/// What a column at the bottom of the volume scores, where one at the top scores 1.
const BOTTOM_WEIGHT: f64 = 0.25;

/// A column of air that may be the trachea.
#[derive(Clone, Debug, PartialEq)]
pub struct SeedCandidate {
    /// The seed voxel (x, y, z).
    pub voxel: [usize; 3],
    /// Its place, RAS+ mm.
    pub position_mm: DVec3,
    /// The column's length, top to bottom, in mm.
    pub length_mm: f64,
    /// The mean area of its cross-sections in mm².
    pub area_mm2: f64,
    /// The mean ratio of their axes, from 1.
    pub elongation: f64,
    /// The mean share of directions with a wall, 0 to 1.
    pub walled: f64,
    /// Where its middle is between the bottom (0) and the top (1) of the volume.
    pub height: f64,
    /// length · diameter · walled / elongation · height's weight; the highest wins.
    pub score: f64,
}

/// The columns of `seeds.tsv`.
pub const SEED_COLUMNS: [TableColumn; 14] = [
    TableColumn::new("rank", "n/a", "1: the seed that was taken; the others were found beside it"),
    TableColumn::new("voxel_x", "voxel", "the seed voxel, on the file's own axes"),
    TableColumn::new("voxel_y", "voxel", "the seed voxel"),
    TableColumn::new("voxel_z", "voxel", "the seed voxel"),
    TableColumn::new("x_mm", "mm", "the seed in space, RAS+: towards the right"),
    TableColumn::new("y_mm", "mm", "towards the front"),
    TableColumn::new("z_mm", "mm", "upwards"),
    TableColumn::new("length_mm", "mm", "length of the column of air, top to bottom"),
    TableColumn::new("area_mm2", "mm²", "mean area of its axial cross-sections"),
    TableColumn::new("elongation", "n/a", "mean ratio of the axes of its cross-sections; 1 is round"),
    TableColumn::new("walled", "n/a", "mean share of directions in which a wall is within 4 mm"),
    TableColumn::new("height", "n/a", "where its middle is, 0 the bottom of the volume, 1 its top"),
    TableColumn::new("score", "n/a", "length · diameter · walled / elongation, times 0.25 + 0.75 · height"),
    TableColumn::new("why", "n/a", "what decided"),
];

/// The table `seeds.tsv`.
#[must_use]
pub fn seeds_to_tsv(candidates: &[SeedCandidate]) -> String {
    let mut table = Table::with(&SEED_COLUMNS);
    for (candidate_idx, candidate) in candidates.iter().enumerate() {
        let [x, y, z] = candidate.voxel;
        let why = match candidate_idx {
            0 => "the highest score".to_owned(),
            _ => format!("{:.0} % of the winner's score", 100.0 * candidate.score / candidates[0].score),
        };
        table.row(&[
            &(candidate_idx + 1),
            &x,
            &y,
            &z,
            &fixed(candidate.position_mm.x, 3),
            &fixed(candidate.position_mm.y, 3),
            &fixed(candidate.position_mm.z, 3),
            &fixed(candidate.length_mm, 2),
            &fixed(candidate.area_mm2, 1),
            &fixed(candidate.elongation, 3),
            &fixed(candidate.walled, 3),
            &fixed(candidate.height, 3),
            &fixed(candidate.score, 1),
            &why,
        ]);
    }
    table.into_string()
}

/// The candidates, best first.
pub(crate) fn find(volume: &Volume) -> Vec<SeedCandidate> {
    let axes = Axes::new(volume.grid());
    let slices: Vec<Vec<Blob>> =
        (0..axes.n_slices).into_par_iter().map(|depth| blobs_of(&Slice::read(volume, axes, depth))).collect();
    let mut candidates: Vec<SeedCandidate> = stack(slices, &axes)
        .iter()
        .map(|column| candidate(column, volume, &axes))
        .filter(|candidate| candidate.length_mm >= MIN_LENGTH_MM)
        .collect();
    // A stable sort: of equal ones the higher.
    candidates.sort_by(|a, b| b.score.total_cmp(&a.score));
    candidates
}

/// The voxel axes by what they are in the body.
#[derive(Clone, Copy)]
struct Axes {
    /// The voxel axes towards the side, towards the front or back, and up or down.
    side: usize,
    front: usize,
    up: usize,
    is_up: bool,
    shape: [usize; 3],
    spacing_mm: [f64; 3],
    n_slices: usize,
}

impl Axes {
    fn new(grid: &Grid) -> Self {
        let nearest = grid.nearest_world_axes();
        let axis_of = |world| nearest.iter().position(|&(axis, _)| axis == world).unwrap_or(world);
        let (side, front, up) = (axis_of(0), axis_of(1), axis_of(2));
        let (shape, spacing_mm) = (grid.shape(), grid.spacing_mm().to_array());
        Self { side, front, up, is_up: nearest[up].1, shape, spacing_mm, n_slices: shape[up] }
    }

    /// The voxel at a place of a slice, slices counted from the top.
    fn voxel(&self, [u, v]: [usize; 2], depth: usize) -> [usize; 3] {
        let mut voxel = [0; 3];
        voxel[self.side] = u;
        voxel[self.front] = v;
        voxel[self.up] = if self.is_up { self.n_slices - 1 - depth } else { depth };
        voxel
    }

    /// Spacing along u and v.
    fn pixel_mm(&self) -> [f64; 2] {
        [self.spacing_mm[self.side], self.spacing_mm[self.front]]
    }
}

/// An axial slice: u to the side, v to the front or back, u fastest.
struct Slice {
    depth: usize,
    shape: [usize; 2],
    pixel_mm: [f64; 2],
    values: Vec<f32>,
}

impl Slice {
    fn read(volume: &Volume, axes: Axes, depth: usize) -> Self {
        let [nu, nv] = [axes.shape[axes.side], axes.shape[axes.front]];
        let value = |place| volume.value(volume.grid().index(axes.voxel(place, depth))) as f32;
        let values = (0..nu * nv).map(|pixel| value([pixel % nu, pixel / nu])).collect();
        Self { depth, shape: [nu, nv], pixel_mm: axes.pixel_mm(), values }
    }

    fn value(&self, [u, v]: [usize; 2]) -> f64 {
        f64::from(self.values[v * self.shape[0] + u])
    }

    fn is_air(&self, pixel: usize) -> bool {
        f64::from(self.values[pixel]) <= AIR_HU
    }
}

/// A piece of air of one slice that looks like a trachea.
struct Blob {
    depth: usize,
    centre: [f64; 2],
    area_mm2: f64,
    elongation: f64,
    walled: f64,
    /// The darkest pixel near the centre.
    seed: [usize; 2],
}

impl Blob {
    fn diameter_mm(&self) -> f64 {
        (4.0 * self.area_mm2 / std::f64::consts::PI).sqrt()
    }
}

/// The pieces of air of a slice that look like a trachea, in storage order.
fn blobs_of(slice: &Slice) -> Vec<Blob> {
    let mut is_seen = vec![false; slice.values.len()];
    let mut blobs = Vec::new();
    for start in 0..is_seen.len() {
        if slice.is_air(start) && !is_seen[start] {
            let pixels = piece(slice, start, &mut is_seen);
            blobs.extend(measure(slice, &pixels));
        }
    }
    blobs
}

/// The 4-connected piece of air about a pixel.
fn piece(slice: &Slice, start: usize, is_seen: &mut [bool]) -> Vec<usize> {
    let [nu, nv] = slice.shape;
    let mut pixels = vec![start];
    is_seen[start] = true;
    let mut next = 0;
    while let Some(&pixel) = pixels.get(next) {
        next += 1;
        let (u, v) = (pixel % nu, pixel / nu);
        let neighbours = [
            (u > 0).then(|| pixel - 1),
            (u + 1 < nu).then(|| pixel + 1),
            (v > 0).then(|| pixel - nu),
            (v + 1 < nv).then(|| pixel + nu),
        ];
        for other in neighbours.into_iter().flatten() {
            if !is_seen[other] && slice.is_air(other) {
                is_seen[other] = true;
                pixels.push(other);
            }
        }
    }
    pixels
}

/// The blob of a piece of air, if it looks like a trachea.
fn measure(slice: &Slice, pixels: &[usize]) -> Option<Blob> {
    let [nu, nv] = slice.shape;
    let [du, dv] = slice.pixel_mm;
    let area_mm2 = pixels.len() as f64 * du * dv;
    let place = |pixel: usize| [pixel % nu, pixel / nu];
    let at_border = |[u, v]: [usize; 2]| u == 0 || v == 0 || u + 1 == nu || v + 1 == nv;
    if !(AREA_MM2[0]..=AREA_MM2[1]).contains(&area_mm2) || pixels.iter().any(|&p| at_border(place(p))) {
        return None;
    }
    let n = pixels.len() as f64;
    let mean = |of: &dyn Fn([f64; 2]) -> f64| {
        pixels.iter().map(|&pixel| of(place(pixel).map(|v| v as f64))).sum::<f64>() / n
    };
    let centre = [mean(&|[u, _]| u), mean(&|[_, v]| v)];
    // Second moments in mm², with a pixel's own.
    let uu = (mean(&|[u, _]| (u - centre[0]) * (u - centre[0])) + 1.0 / 12.0) * du * du;
    let vv = (mean(&|[_, v]| (v - centre[1]) * (v - centre[1])) + 1.0 / 12.0) * dv * dv;
    let uv = mean(&|[u, v]| (u - centre[0]) * (v - centre[1])) * du * dv;
    let (half, gap) = ((uu + vv) / 2.0, ((uu - vv) * (uu - vv) / 4.0 + uv * uv).sqrt());
    let (long, short) = ((half + gap).sqrt(), (half - gap).max(0.0).sqrt());
    let fill = area_mm2 / (4.0 * std::f64::consts::PI * long * short);
    let elongation = long / short;
    let walled = walled_share(slice, centre);
    let is_trachea = elongation <= MAX_ELONGATION
        && fill >= MIN_FILL
        && walled >= MIN_WALLED
        && tissue_mm(slice, centre).into_iter().all(|thickness| thickness >= MIN_TISSUE_MM);
    is_trachea.then(|| Blob {
        depth: slice.depth,
        centre,
        area_mm2,
        elongation,
        walled,
        seed: darkest(slice, pixels, centre),
    })
}

/// The share of directions in which air ends and a wall begins.
fn walled_share(slice: &Slice, centre: [f64; 2]) -> f64 {
    let [du, dv] = slice.pixel_mm;
    let step_mm = du.min(dv) / 2.0;
    let is_walled = |ray: usize| {
        let (sin, cos) = math::sin_cos(std::f64::consts::TAU * ray as f64 / N_RAYS as f64);
        let at = |step: usize| {
            let way = step as f64 * step_mm;
            slice.sample([centre[0] + way * cos / du, centre[1] + way * sin / dv])
        };
        // As far as the border of the slice, which every ray meets.
        let Some(edge) = (0..).find(|&step| at(step).is_none_or(|value| value > AIR_HU)) else {
            return false;
        };
        let n_steps = (WALL_MM / step_mm) as usize + 1;
        (edge..edge + n_steps).any(|step| at(step).is_some_and(|value| value > WALL_HU))
    };
    (0..N_RAYS).filter(|&ray| is_walled(ray)).count() as f64 / N_RAYS as f64
}

impl Slice {
    /// The value of the nearest pixel; none outside the slice.
    fn sample(&self, [u, v]: [f64; 2]) -> Option<f64> {
        let (u, v) = ((u + 0.5).floor(), (v + 0.5).floor());
        let is_inside = u >= 0.0 && v >= 0.0 && u < self.shape[0] as f64 && v < self.shape[1] as f64;
        is_inside.then(|| self.value([u as usize, v as usize]))
    }
}

/// How many mm of tissue lie towards smaller and towards larger v.
fn tissue_mm(slice: &Slice, centre: [f64; 2]) -> [f64; 2] {
    let (u, v) = ((centre[0] + 0.5) as usize, (centre[1] + 0.5) as usize);
    let thickness = |range: std::ops::Range<usize>| {
        range.filter(|&v| slice.value([u, v]) > TISSUE_HU).count() as f64 * slice.pixel_mm[1]
    };
    [thickness(0..v), thickness(v..slice.shape[1])]
}

/// The darkest pixel within half the radius of the centre, of equal ones the first; else the nearest.
fn darkest(slice: &Slice, pixels: &[usize], centre: [f64; 2]) -> [usize; 2] {
    let [du, dv] = slice.pixel_mm;
    let nu = slice.shape[0];
    let reach_mm = (pixels.len() as f64 * du * dv / std::f64::consts::PI).sqrt() / 2.0;
    let offset_mm = |pixel: usize| {
        let (u, v) = (((pixel % nu) as f64 - centre[0]) * du, ((pixel / nu) as f64 - centre[1]) * dv);
        (u * u + v * v).sqrt()
    };
    let value = |pixel: usize| slice.values[pixel];
    let near = pixels.iter().copied().filter(|&pixel| offset_mm(pixel) <= reach_mm);
    let darkest = near.min_by(|&a, &b| value(a).total_cmp(&value(b)).then(a.cmp(&b)));
    let nearest =
        || pixels.iter().copied().min_by(|&a, &b| offset_mm(a).total_cmp(&offset_mm(b)).then(a.cmp(&b)));
    let pixel = darkest.or_else(nearest).unwrap_or_default();
    [pixel % nu, pixel / nu]
}

/// Stacks blobs from the top down: each goes to the column whose last blob, at most one slice missing between, is
/// nearest and not further than its own radius.
fn stack(slices: Vec<Vec<Blob>>, axes: &Axes) -> Vec<Vec<Blob>> {
    let [du, dv] = axes.pixel_mm();
    let mut columns: Vec<Vec<Blob>> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    for (depth, blobs) in slices.into_iter().enumerate() {
        open.retain(|&column| columns[column].last().is_some_and(|last| last.depth + 2 >= depth));
        for blob in blobs {
            let distance = |column: usize| {
                let last = columns[column].last().filter(|last| last.depth < depth)?;
                let (u, v) = ((blob.centre[0] - last.centre[0]) * du, (blob.centre[1] - last.centre[1]) * dv);
                Some((u * u + v * v).sqrt()).filter(|&distance| distance <= last.diameter_mm() / 2.0)
            };
            let nearest = open
                .iter()
                .filter_map(|&column| Some((distance(column)?, column)))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            match nearest {
                Some((_, column)) => columns[column].push(blob),
                None => {
                    open.push(columns.len());
                    columns.push(vec![blob]);
                }
            }
        }
    }
    columns
}

/// The measures of a column.
fn candidate(column: &[Blob], volume: &Volume, axes: &Axes) -> SeedCandidate {
    let n = column.len() as f64;
    let mean = |of: &dyn Fn(&Blob) -> f64| column.iter().map(of).sum::<f64>() / n;
    let (top, bottom) = (column[0].depth, column[column.len() - 1].depth);
    let middle = &column[column.len() / 2];
    let voxel = axes.voxel(middle.seed, middle.depth);
    let [x, y, z] = voxel.map(|coordinate| coordinate as f64);
    let length_mm = (bottom - top + 1) as f64 * axes.spacing_mm[axes.up];
    let height = 1.0 - (top + bottom) as f64 / 2.0 / (axes.n_slices.max(2) - 1) as f64;
    let (elongation, walled) = (mean(&|blob| blob.elongation), mean(&|blob| blob.walled));
    let weight = BOTTOM_WEIGHT + (1.0 - BOTTOM_WEIGHT) * height;
    SeedCandidate {
        voxel,
        position_mm: volume.grid().world_from_voxel().transform_point3(DVec3::new(x, y, z)),
        length_mm,
        area_mm2: mean(&|blob| blob.area_mm2),
        elongation,
        walled,
        height,
        score: length_mm * mean(&Blob::diameter_mm) * walled / elongation * weight,
    }
}
