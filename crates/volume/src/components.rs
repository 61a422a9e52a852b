//! The largest components of a mask.
//!
//! **Input** one `bool` a voxel, and how many components stay. **Output** the same without the others, and a
//! ledger entry for each that went.
//! **Steps** 1. label the 26-connected components; 2. rank them by size, of equal ones the first in storage order;
//! 3. clear all beyond the limit.
//! **Cost** O(voxels) time, O(runs) memory.

use espalier_model::{Grid, Ledger, LedgerEntry, LedgerKind, Report};
use glam::DVec3;

use crate::runs::{Connectivity, Labelled, label};

/// How many dropped components the ledger lists one by one; a noisy threshold drops thousands.
const MAX_LISTED: usize = 200;

/// Size and place of a component.
#[derive(Clone, Copy, Default)]
struct Component {
    n_voxels: usize,
    /// The sum of its voxels' coordinates; exact, as whole numbers below 2⁵³ are.
    voxel_sum: DVec3,
}

impl Component {
    fn add(&mut self, other: Self) {
        self.n_voxels += other.n_voxels;
        self.voxel_sum += other.voxel_sum;
    }

    fn centroid_mm(&self, grid: &Grid) -> DVec3 {
        grid.world_from_voxel().transform_point3(self.voxel_sum / self.n_voxels.max(1) as f64)
    }
}

/// Keeps the `limit` largest components and clears the others.
pub(crate) fn keep_largest(voxels: &mut [bool], grid: &Grid, limit: usize, report: &mut Report) -> Ledger {
    let labelled = label(voxels, grid.shape(), true, Connectivity::All);
    let components = measure(&labelled, grid);
    let mut ranked: Vec<usize> = (0..components.len()).collect();
    // A stable sort: of equal components the first in storage order comes first.
    ranked.sort_by_key(|&component| std::cmp::Reverse(components[component].n_voxels));
    let dropped = &ranked[limit.min(ranked.len())..];

    let mut is_dropped = vec![false; components.len()];
    dropped.iter().for_each(|&component| is_dropped[component] = true);
    let nx = grid.shape()[0];
    for (run, &component) in labelled.runs.iter().zip(&labelled.component) {
        if is_dropped[component] {
            voxels[run.row * nx + run.start..run.row * nx + run.end].fill(false);
        }
    }

    let n_dropped_voxels = dropped.iter().map(|&component| components[component].n_voxels).sum();
    report.count_usize("components", components.len());
    report.count_usize("components_dropped", dropped.len());
    report.count_usize("components_dropped_voxels", n_dropped_voxels);
    report.count_usize("component_largest_voxels", ranked.first().map_or(0, |&c| components[c].n_voxels));
    report.count_usize(
        "component_dropped_largest_voxels",
        dropped.first().map_or(0, |&c| components[c].n_voxels),
    );
    let dropped: Vec<Component> = dropped.iter().map(|&component| components[component]).collect();
    ledger_of(&dropped, grid, limit)
}

fn measure(labelled: &Labelled, grid: &Grid) -> Vec<Component> {
    let ny = grid.shape()[1];
    let mut components = vec![Component::default(); labelled.n_components];
    for (run, &component) in labelled.runs.iter().zip(&labelled.component) {
        let n_voxels = run.len();
        let x_sum = (run.start + run.end - 1) as f64 * n_voxels as f64 / 2.0;
        let (y, z) = (run.row % ny, run.row / ny);
        let voxel_sum = DVec3::new(x_sum, (y * n_voxels) as f64, (z * n_voxels) as f64);
        components[component].add(Component { n_voxels, voxel_sum });
    }
    components
}

/// An entry for each dropped component, largest first; one for all beyond [`MAX_LISTED`].
fn ledger_of(dropped: &[Component], grid: &Grid, limit: usize) -> Ledger {
    let millilitres = |n_voxels: usize| n_voxels as f64 * grid.voxel_volume_mm3() / 1000.0;
    let entry = |component: &Component, what: String| LedgerEntry {
        kind: LedgerKind::ComponentDropped,
        position_mm: component.centroid_mm(grid),
        radius_mm: 0.0,
        length_mm: 0.0,
        reason: format!("{what}, {:.4} ml; the {limit} largest stay", millilitres(component.n_voxels)),
    };
    let (listed, rest) = dropped.split_at(dropped.len().min(MAX_LISTED));
    let mut entries: Vec<LedgerEntry> = listed
        .iter()
        .map(|component| entry(component, format!("component of {} voxels", component.n_voxels)))
        .collect();
    if let Some(largest) = rest.first() {
        let mut all = Component::default();
        rest.iter().for_each(|&component| all.add(component));
        let (n, n_voxels, most) = (rest.len(), all.n_voxels, largest.n_voxels);
        entries
            .push(entry(&all, format!("{n} further components of {n_voxels} voxels, at most {most} each")));
    }
    Ledger(entries)
}
