//! How well distances between nodes survive: Kruskal's stress and Spearman's rank correlation.
//!
//! **Input** the tree, rounded positions. **Output** (stress, ρ).
//! **Notation** δ distance of a pair of nodes in space, d in the plane.
//! **Steps** stress = √(Σ (d − δ)² / Σ d²) over all pairs; ρ is the correlation of the ranks of δ and d, ties
//! sharing their mean rank. Above 1500 nodes the pairs are those of 1500 nodes, evenly spaced in preorder.
//! **Guarantees** sums in a fixed order. A tree with one pair at most has stress and ρ of that pair: ρ = 1.
//! **Cost** O(P log P) for P pairs, at most 1.1 million; the ranks in space are found once.

use espalier_model::Tree;
use glam::DVec2;
use rayon::prelude::*;

/// The most nodes whose pairs are all compared.
const MOST_NODES: usize = 1500;

/// Distances in space, with their ranks: the same for every layout.
pub(crate) struct SpaceDistances {
    nodes: Vec<usize>,
    distances: Vec<f64>,
    ranks: Vec<f64>,
}

impl SpaceDistances {
    pub(crate) fn new(tree: &Tree) -> Self {
        let n_nodes = tree.n_nodes();
        let n_kept = n_nodes.min(MOST_NODES);
        let nodes: Vec<usize> = (0..n_kept).map(|idx| idx * n_nodes / n_kept).collect();
        let distances = pairs(&nodes, |a, b| tree.position_mm(a).distance(tree.position_mm(b)));
        let ranks = ranks(&distances);
        Self { nodes, distances, ranks }
    }

    /// Stress and rank correlation of a layout.
    pub(crate) fn compare(&self, positions: &[DVec2]) -> (f64, f64) {
        let flat = pairs(&self.nodes, |a, b| positions[a].distance(positions[b]));
        let (mut misfit, mut total) = (0.0, 0.0);
        for (d, delta) in flat.iter().zip(&self.distances) {
            misfit += (d - delta) * (d - delta);
            total += d * d;
        }
        let stress = if total > 0.0 { (misfit / total).sqrt() } else { 0.0 };
        (stress, correlation(&self.ranks, &ranks(&flat)))
    }
}

fn pairs(nodes: &[usize], distance: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    let mut list = Vec::with_capacity(nodes.len() * nodes.len().saturating_sub(1) / 2);
    for (idx, &a) in nodes.iter().enumerate() {
        list.extend(nodes[idx + 1..].iter().map(|&b| distance(a, b)));
    }
    list
}

/// Ranks of distances, from 0; ties share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    // Numbers that are not negative are in the order of their bits, and whole numbers beside their places sort three
    // times as fast as places by numbers elsewhere.
    let mut order: Vec<(u64, u32)> = (0..).zip(values).map(|(idx, value)| (value.to_bits(), idx)).collect();
    order.par_sort_unstable();
    let mut ranks = vec![0.0; values.len()];
    let mut start = 0;
    for equal in order.chunk_by(|a, b| a.0 == b.0) {
        for &(_, idx) in equal {
            ranks[idx as usize] = start as f64 + 0.5 * (equal.len() - 1) as f64;
        }
        start += equal.len();
    }
    ranks
}

/// Pearson's correlation; 1 if either side does not vary.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        ab += (x - mean) * (y - mean);
        aa += (x - mean) * (x - mean);
        bb += (y - mean) * (y - mean);
    }
    if aa > 0.0 && bb > 0.0 { (ab / (aa * bb).sqrt()).clamp(-1.0, 1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_share_ties_and_correlate() {
        assert_eq!(ranks(&[3.0, 1.0, 3.0, 2.0]), [2.5, 0.0, 2.5, 1.0]);
        assert_eq!(correlation(&ranks(&[1.0, 2.0, 9.0]), &ranks(&[5.0, 6.0, 7.0])), 1.0);
        assert_eq!(correlation(&ranks(&[1.0, 2.0, 9.0]), &ranks(&[7.0, 6.0, 5.0])), -1.0);
        // Classic formula without ties: 1 − 6 Σ d² / (n (n² − 1)).
        let rho = correlation(&ranks(&[1.0, 2.0, 3.0, 4.0]), &ranks(&[2.0, 1.0, 4.0, 3.0]));
        assert!((rho - 0.6).abs() < 1e-15);
    }
}
