//! Stress and rank correlation of node distances.
//!
//! **Input** the tree, positions. **Output** Kruskal's stress √(Σ (d − δ)² / Σ d²), Spearman's ρ.
//! **Notation** δ distance of a pair in space, d in the plane; all pairs of the first 1500 nodes in even steps of
//! the preorder, node ⌊i N / 1500⌋, of all nodes where there are no more.
//! **Steps** ranks by sorting; those who tie share their mean rank; ρ by 1 − 6 Σ (difference of ranks)² / (n³ − n) with
//! the correction for ties, which is the correlation of the ranks.
//! **Guarantees** ρ is 1 where the distances of either side are all the same. **Cost** O(P log P) for P pairs.

use espalier_model::Tree;
use glam::DVec2;

/// The most nodes whose pairs are all compared.
const MOST_NODES: usize = 1500;

/// Stress and ρ of a layout.
pub(crate) fn compare(tree: &Tree, positions: &[DVec2]) -> (f64, f64) {
    let n_nodes = tree.n_nodes();
    let n_kept = n_nodes.min(MOST_NODES);
    let (mut space, mut plane) = (Vec::new(), Vec::new());
    for i in 0..n_kept {
        let a = i * n_nodes / n_kept;
        for j in i + 1..n_kept {
            let b = j * n_nodes / n_kept;
            space.push((tree.position_mm(a) - tree.position_mm(b)).length());
            plane.push((positions[a] - positions[b]).length());
        }
    }
    let misfit: f64 = space.iter().zip(&plane).map(|(s, p)| (s - p) * (s - p)).sum();
    let total: f64 = plane.iter().map(|p| p * p).sum();
    let stress = if total > 0.0 { (misfit / total).sqrt() } else { 0.0 };
    (stress, spearman(&space, &plane))
}

/// Spearman's ρ with ties.
fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let ((rank_a, ties_a), (rank_b, ties_b)) = (double_ranks(a), double_ranks(b));
    let all = (n * n * n - n) / 12.0;
    let (vary_a, vary_b) = (all - ties_a, all - ties_b);
    if vary_a <= 0.0 || vary_b <= 0.0 {
        return 1.0;
    }
    let difference = |(x, y): (&u32, &u32)| 0.5 * (f64::from(*x) - f64::from(*y));
    let squares: f64 = rank_a.iter().zip(&rank_b).map(|pair| difference(pair) * difference(pair)).sum();
    ((vary_a + vary_b - squares) / (2.0 * (vary_a * vary_b).sqrt())).clamp(-1.0, 1.0)
}

/// Twice the rank of each value, and Σ (t³ − t) / 12 over groups of t equal ones.
fn double_ranks(values: &[f64]) -> (Vec<u32>, f64) {
    let mut order: Vec<u32> = (0..values.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| values[a as usize].total_cmp(&values[b as usize]));
    let (mut ranks, mut ties, mut start) = (vec![0; values.len()], 0.0, 0);
    for group in order.chunk_by(|&a, &b| values[a as usize] == values[b as usize]) {
        let t = group.len();
        group.iter().for_each(|&idx| ranks[idx as usize] = (2 * start + t - 1) as u32);
        ties += ((t * t) as f64 * t as f64 - t as f64) / 12.0;
        start += t;
    }
    (ranks, ties)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_correlations() {
        assert!((spearman(&[1.0, 2.0, 3.0, 4.0], &[2.0, 1.0, 4.0, 3.0]) - 0.6).abs() < 1e-15);
        assert_eq!(spearman(&[1.0, 2.0, 9.0], &[5.0, 6.0, 7.0]), 1.0);
        assert_eq!(spearman(&[1.0, 2.0, 9.0], &[7.0, 6.0, 5.0]), -1.0);
        assert_eq!(spearman(&[1.0, 1.0], &[7.0, 6.0]), 1.0);
        // Pearson's correlation of the ranks (1, 2.5, 2.5, 4) and (1, 2, 3, 4).
        let expected = 4.5 / (4.5_f64 * 5.0).sqrt();
        assert!((spearman(&[1.0, 2.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]) - expected).abs() < 1e-15);
    }
}
