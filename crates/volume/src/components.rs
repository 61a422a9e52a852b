//! The components of a mask that stay, mostly the largest.
//!
//! **Input** a mask and its runs; how many components stay, and from which volume or share of the largest on.
//! **Output** the same without the others, and a ledger entry for each that went.
//! **Steps** 1. label the 26-connected components; 2. rank them by size, of equal ones the first in storage order;
//! 3. clear all beyond the limits.
//! **Cost** O(runs · α(runs)) time, O(runs) memory.

use espalier_model::{Bits, Grid, Ledger, LedgerEntry, LedgerKind, Report};
use glam::DVec3;

use crate::params::{Components as Policy, MAIN_SHARE, Params};
use crate::runs::{Components, Connectivity, Runs};

/// How many dropped components the ledger lists one by one; a noisy threshold drops thousands.
const MAX_LISTED: usize = 200;
/// Components of a mask or a label map that went are told of in a warning if together they are this share of it: of eight
/// masks of airways, vessels and a neuron, noise has 1.3 % at most; the vessels of two lungs lose 4.2 %, four pieces of
/// which are vessel.
const TELLING_SHARE: f64 = 0.02;

/// Size and place of a component.
#[derive(Clone, Copy, Default)]
pub(crate) struct Component {
    pub(crate) n_voxels: usize,
    /// The sum of its voxels' coordinates; exact, as whole numbers below 2⁵³ are.
    voxel_sum: DVec3,
}

impl Component {
    pub(crate) fn add(&mut self, other: Self) {
        self.n_voxels += other.n_voxels;
        self.voxel_sum += other.voxel_sum;
    }

    pub(crate) fn centroid_mm(&self, grid: &Grid) -> DVec3 {
        grid.world_from_voxel().transform_point3(self.voxel_sum / self.n_voxels.max(1) as f64)
    }
}

/// Clears all components but those that the policy keeps; tells how many went.
pub(crate) fn keep(
    bits: &mut Bits,
    runs: &Runs,
    grid: &Grid,
    params: &Params,
    report: &mut Report,
) -> (Ledger, usize) {
    let labelled = runs.components(Connectivity::All);
    let components = measure(runs, &labelled, grid);
    let mut ranked: Vec<usize> = (0..components.len()).collect();
    // A stable sort: of equal components the first in storage order comes first.
    ranked.sort_by_key(|&component| std::cmp::Reverse(components[component].n_voxels));
    let millilitres =
        |component: usize| components[component].n_voxels as f64 * grid.voxel_volume_mm3() / 1e3;
    let largest = ranked.first().map_or(0, |&component| components[component].n_voxels);
    let share = if params.components == Policy::Main { MAIN_SHARE } else { 0.0 };
    let is_large = |component: usize| {
        let n_voxels = components[component].n_voxels as f64;
        millilitres(component) >= params.min_component_ml && n_voxels >= share * largest as f64
    };
    let n_large = ranked.partition_point(|&component| is_large(component));
    let n_kept = n_large.min(params.components.limit());
    let (_, dropped) = ranked.split_at(n_kept);
    clear(bits, runs, &labelled, dropped);

    let size = |component: Option<&usize>| component.map_or(0, |&component| components[component].n_voxels);
    let n_dropped_voxels = dropped.iter().map(|&component| components[component].n_voxels).sum();
    report.count_usize("components", components.len());
    report.count_usize("components_dropped", dropped.len());
    report.count_usize("components_dropped_voxels", n_dropped_voxels);
    report.count_usize("component_largest_voxels", largest);
    report.count_usize("component_dropped_largest_voxels", size(dropped.first()));
    if params.components == Policy::Main {
        let n_voxels: usize = components.iter().map(|component| component.n_voxels).sum();
        warn_of_dropped(
            (n_dropped_voxels, n_voxels),
            (dropped.len(), dropped.first().map_or(0.0, |&c| millilitres(c))),
            grid,
            report,
        );
    }
    let entries: Vec<Component> = dropped.iter().map(|&component| components[component]).collect();
    (ledger_of(&entries, grid, params), dropped.len())
}

/// Of a mask or a label map all was meant to be the organ.
fn warn_of_dropped(
    (n_dropped_voxels, n_voxels): (usize, usize),
    (n_dropped, largest_ml): (usize, f64),
    grid: &Grid,
    report: &mut Report,
) {
    let share = n_dropped_voxels as f64 / n_voxels.max(1) as f64;
    if share >= TELLING_SHARE {
        let dropped_ml = n_dropped_voxels as f64 * grid.voxel_volume_mm3() / 1e3;
        report.warn(
            "W-VOLUME-DROPPED",
            format!(
                "{n_dropped} small components of the mask were dropped, together {dropped_ml:.3} ml, {:.1} % of it, the largest {largest_ml:.3} ml: \
                 volume.components = \"all\" keeps them, with volume.min_component_ml those from a volume on",
                100.0 * share
            ),
        );
    }
}

fn clear(bits: &mut Bits, runs: &Runs, labelled: &Components, dropped: &[usize]) {
    if dropped.is_empty() {
        return;
    }
    let mut is_dropped = vec![false; labelled.n_components];
    dropped.iter().for_each(|&component| is_dropped[component] = true);
    for row in 0..runs.n_rows() {
        for run in runs.of_row(row).filter(|&run| is_dropped[labelled.of_run[run]]) {
            bits.clear_run(row, runs.all()[run].range());
        }
    }
}

/// Size and place of each component.
pub(crate) fn measure(runs: &Runs, labelled: &Components, grid: &Grid) -> Vec<Component> {
    let ny = grid.shape()[1];
    let mut components = vec![Component::default(); labelled.n_components];
    for row in 0..runs.n_rows() {
        let (y, z) = ((row % ny) as f64, (row / ny) as f64);
        for run_idx in runs.of_row(row) {
            let run = runs.all()[run_idx];
            let n = run.len() as f64;
            let x_sum = (f64::from(run.start) + f64::from(run.end - 1)) * n / 2.0;
            let voxel_sum = DVec3::new(x_sum, y * n, z * n);
            components[labelled.of_run[run_idx]].add(Component { n_voxels: run.len(), voxel_sum });
        }
    }
    components
}

/// An entry for each dropped component, largest first; one for all beyond [`MAX_LISTED`].
fn ledger_of(dropped: &[Component], grid: &Grid, params: &Params) -> Ledger {
    let millilitres = |n_voxels: usize| n_voxels as f64 * grid.voxel_volume_mm3() / 1000.0;
    let mut rule = match params.components {
        Policy::Main => format!("those of at least {} % of the largest stay", 100.0 * MAIN_SHARE),
        Policy::Auto | Policy::All => String::new(),
        Policy::Largest | Policy::Count(_) => format!("the {} largest stay", params.components.limit()),
    };
    if params.min_component_ml > 0.0 {
        let joint = if rule.is_empty() { "" } else { ", " };
        rule = format!("{rule}{joint}those of at least {} ml stay", params.min_component_ml);
    }
    let entry = |component: &Component, what: String| LedgerEntry {
        kind: LedgerKind::ComponentDropped,
        position_mm: component.centroid_mm(grid),
        radius_mm: 0.0,
        length_mm: 0.0,
        reason: format!("{what}, {:.4} ml; {rule}", millilitres(component.n_voxels)),
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
