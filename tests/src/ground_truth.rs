//! How well a tree that was found agrees with the true one.
//!
//! **Input** both trees in RAS+ mm and the spacing of the grid. **Output** [`Score`].
//! **Voxel** the cube root of a voxel's volume; "2 voxels" of a tolerance are twice the largest spacing.
//! **Tips** every free end, the root's too, so that the choice of a root does not count. One to one, nearest first; a
//! found tip is a true one if it lies within max(2 voxels, the true radius there).
//! **Off axis** the found centreline in steps of half a smallest spacing, against the nearest point of the true one; mean
//! over all that is inside the true body (nearer to an axis than its radius or a voxel), forks included. What is not is `stray`.
//! **Radius** at the same steps, outside of the true forks' spheres: within, the largest sphere is not the tube's.
//! **Length** of the whole found tree against the whole true tree.
//! **Angles** at forks that are found within max(2 voxels, the true radius there), one to one, between every two arms. An
//! arm's direction is its chord from one true fork radius beyond the fork over at most four true radii of the arm.

mod angles;
mod curve;
pub mod phantoms;

use espalier_model::Tree;
use glam::DVec3;

use curve::Axis;

/// How well a tree agrees with the true one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Score {
    /// Free ends of the true tree.
    pub n_true_tips: usize,
    /// Free ends of the found tree.
    pub n_found_tips: usize,
    /// Pairs of them.
    pub n_matched_tips: usize,
    /// Mean distance of the found centreline from the true one, in voxels.
    pub off_axis_voxels: f64,
    /// Share of the found length outside the true body.
    pub stray_share: f64,
    /// Found length over true length, less 1.
    pub length_error: f64,
    /// Mean of found less true radius, in voxels.
    pub radius_bias_voxels: f64,
    /// Mean absolute difference of the radii, in voxels.
    pub radius_mae_voxels: f64,
    /// Forks of the true tree, and how many of them were found.
    pub n_forks: [usize; 2],
    /// Mean absolute error of the angles at those, in degrees.
    pub angle_error_mean_deg: f64,
    /// Their 95th percentile.
    pub angle_error_p95_deg: f64,
}

impl Score {
    /// Share of the true tips that were found.
    #[must_use]
    pub fn recall(&self) -> f64 {
        self.n_matched_tips as f64 / self.n_true_tips.max(1) as f64
    }

    /// Share of the found tips that are true.
    #[must_use]
    pub fn precision(&self) -> f64 {
        self.n_matched_tips as f64 / self.n_found_tips.max(1) as f64
    }
}

/// Compares a found tree with the true one on a grid of this spacing.
#[must_use]
pub fn score(truth: &Tree, found: &Tree, spacing_mm: DVec3) -> Score {
    let tolerance_mm = 2.0 * spacing_mm.max_element();
    let voxel_mm = espalier_geom::math::cbrt(spacing_mm.element_product());
    let (true_tips, found_tips) = (free_ends(truth), free_ends(found));
    let mut score = Score {
        n_true_tips: true_tips.len(),
        n_found_tips: found_tips.len(),
        n_matched_tips: matched((truth, &true_tips), (found, &found_tips), tolerance_mm).len(),
        length_error: found.length_mm() / truth.length_mm() - 1.0,
        ..Score::default()
    };
    compare_centrelines(truth, found, (0.5 * spacing_mm.min_element(), voxel_mm), &mut score);
    angles::compare(truth, found, tolerance_mm, &mut score);
    score
}

/// The nodes with one edge.
#[must_use]
pub fn free_ends(tree: &Tree) -> Vec<usize> {
    let n_edges = |node: usize| tree.children(node).len() + usize::from(tree.parent(node).is_some());
    (0..tree.n_nodes()).filter(|&node| n_edges(node) == 1).collect()
}

/// The free ends of the true tree that have none of the found tree for themselves.
#[must_use]
pub fn lost_tips(truth: &Tree, found: &Tree, spacing_mm: DVec3) -> Vec<usize> {
    let (mut tips, found_tips) = (free_ends(truth), free_ends(found));
    let pairs = matched((truth, &tips), (found, &found_tips), 2.0 * spacing_mm.max_element());
    tips.retain(|tip| pairs.iter().all(|(matched, _)| matched != tip));
    tips
}

/// The free ends of the found tree that are none of the true tree's.
#[must_use]
pub fn false_tips(truth: &Tree, found: &Tree, spacing_mm: DVec3) -> Vec<usize> {
    let (true_tips, mut tips) = (free_ends(truth), free_ends(found));
    let pairs = matched((truth, &true_tips), (found, &tips), 2.0 * spacing_mm.max_element());
    tips.retain(|tip| pairs.iter().all(|(_, matched)| matched != tip));
    tips
}

/// One-to-one pairs of true and found nodes, nearest first, within max(`tolerance_mm`, the true radius).
pub(crate) fn matched(
    (truth, true_nodes): (&Tree, &[usize]),
    (found, found_nodes): (&Tree, &[usize]),
    tolerance_mm: f64,
) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for &t in true_nodes {
        let reach_mm = tolerance_mm.max(truth.nodes()[t].radius_mm);
        let near = found_nodes.iter().map(|&f| (truth.position_mm(t).distance(found.position_mm(f)), t, f));
        pairs.extend(near.filter(|pair| pair.0 <= reach_mm));
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut is_true_taken, mut is_found_taken) =
        (vec![false; truth.n_nodes()], vec![false; found.n_nodes()]);
    pairs.retain(|&(_, t, f)| {
        let is_free = !is_true_taken[t] && !is_found_taken[f];
        if is_free {
            (is_true_taken[t], is_found_taken[f]) = (true, true);
        }
        is_free
    });
    pairs.into_iter().map(|(_, t, f)| (t, f)).collect()
}

fn compare_centrelines(truth: &Tree, found: &Tree, (step_mm, voxel_mm): (f64, f64), score: &mut Score) {
    let axis = Axis::of(truth);
    let (mut n_steps, mut n_inside, mut off_axis) = (0_usize, 0_usize, 0.0);
    let (mut n_radii, mut bias, mut absolute) = (0_usize, 0.0, 0.0);
    for (position_mm, radius_mm) in curve::steps(found, step_mm) {
        n_steps += 1;
        let (distance_mm, true_radius_mm) = axis.nearest(position_mm);
        if distance_mm > true_radius_mm.max(voxel_mm) {
            continue;
        }
        n_inside += 1;
        off_axis += distance_mm;
        if !axis.is_in_fork(position_mm) {
            n_radii += 1;
            bias += radius_mm - true_radius_mm;
            absolute += (radius_mm - true_radius_mm).abs();
        }
    }
    score.off_axis_voxels = off_axis / n_inside.max(1) as f64 / voxel_mm;
    score.stray_share = 1.0 - n_inside as f64 / n_steps.max(1) as f64;
    score.radius_bias_voxels = bias / n_radii.max(1) as f64 / voxel_mm;
    score.radius_mae_voxels = absolute / n_radii.max(1) as f64 / voxel_mm;
}
