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
//! **Guarantees** the result depends neither on the number of threads nor on the scan's axis order. Nothing is guessed:
//! without a candidate there is no seed, and the caller says so.
//! **Differs from the source** [Mori1996] seed by hand; searching the top slices alone, as is usual, finds nothing in
//! a crop whose top is below the larynx or above which the trachea does not go.
//! **Cost** O(voxels) time, a slice a thread in memory.

mod slice;

use espalier_model::table::{Column as TableColumn, Table, fixed};
use espalier_model::{Grid, Volume};
use glam::DVec3;
use rayon::prelude::*;
use slice::{Blob, Slice, blobs_of};

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
    /// Whether they point to the right, to the front and up.
    is_along: [bool; 3],
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
        let is_along = [side, front, up].map(|axis| nearest[axis].1);
        Self { side, front, up, is_along, shape, spacing_mm, n_slices: shape[up] }
    }

    /// The voxel at a place of a slice, slices counted from the top.
    fn voxel(&self, [u, v]: [usize; 2], depth: usize) -> [usize; 3] {
        let mut voxel = [0; 3];
        let place = [u, v, self.n_slices - 1 - depth];
        for (i, axis) in [self.side, self.front, self.up].into_iter().enumerate() {
            voxel[axis] = if self.is_along[i] { place[i] } else { self.shape[axis] - 1 - place[i] };
        }
        voxel
    }

    /// Spacing along u and v.
    fn pixel_mm(&self) -> [f64; 2] {
        [self.spacing_mm[self.side], self.spacing_mm[self.front]]
    }
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
