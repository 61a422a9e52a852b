//! Who goes with whom: the pairs of two small sets with the largest sum of gains, some left alone.
//!
//! **Input** how many there are on either side, the gain of each pair. **Output** the sum and the pairs, in ascending
//! order of the first. A pair without gain is none.
//! **Steps** up to two on either side by looking at all; else the Hungarian method with potentials on the gains, cut off
//! at 0; beyond [`MOST_STEPS`] the largest gain first.
//! **Source** [Kuhn1955] in the form with shortest augmenting paths, see [Jonker1987].
//! **Cost** O(n² m) for n ≤ m; O(n m log n m) where the largest gain goes first.

/// Steps that the exact method may take. A fork of 250 branches is no fork of vessels, but a soma may have some.
const MOST_STEPS: usize = 1 << 24;

/// The best pairs of `n` and `m`.
pub(crate) fn assign(n: usize, m: usize, gain: impl Fn(usize, usize) -> f64) -> (f64, Vec<(usize, usize)>) {
    let mut pairs = if n == 0 || m == 0 {
        Vec::new()
    } else if n.min(m).saturating_mul(n).saturating_mul(m) > MOST_STEPS {
        greedy(n, m, &gain)
    } else if n <= m {
        hungarian(n, m, &gain)
    } else {
        let turned = hungarian(m, n, &|j, i| gain(i, j));
        turned.into_iter().map(|(j, i)| (i, j)).collect()
    };
    pairs.retain(|&(i, j)| gain(i, j) > 0.0);
    pairs.sort_unstable();
    (pairs.iter().map(|&(i, j)| gain(i, j)).sum(), pairs)
}

/// The sum of [`assign`] alone, without an allocation where there are at most two on either side.
pub(crate) fn best_gain(n: usize, m: usize, gain: impl Fn(usize, usize) -> f64) -> f64 {
    let positive = |i: usize, j: usize| gain(i, j).max(0.0);
    match (n, m) {
        (0, _) | (_, 0) => 0.0,
        (1, _) => (0..m).map(|j| positive(0, j)).fold(0.0, f64::max),
        (_, 1) => (0..n).map(|i| positive(i, 0)).fold(0.0, f64::max),
        (2, 2) => (positive(0, 0) + positive(1, 1)).max(positive(0, 1) + positive(1, 0)),
        _ => assign(n, m, gain).0,
    }
}

/// The least sum of costs that takes each of the `n` once; costs are the gains, negative, cut off at 0.
fn hungarian(n: usize, m: usize, gain: &dyn Fn(usize, usize) -> f64) -> Vec<(usize, usize)> {
    let cost = |i: usize, j: usize| -gain(i, j).max(0.0);
    // Index 0 is nobody; rows and columns are counted from 1.
    let (mut of_row, mut of_column) = (vec![0.0; n + 1], vec![0.0; m + 1]);
    let mut row_at = vec![0_usize; m + 1];
    let mut way = vec![0_usize; m + 1];
    for row in 1..=n {
        row_at[0] = row;
        let mut column = 0;
        let (mut least, mut is_used) = (vec![f64::INFINITY; m + 1], vec![false; m + 1]);
        // Grow the tree of alternating paths until a free column is reached.
        while row_at[column] != 0 {
            is_used[column] = true;
            let (here, mut delta, mut next) = (row_at[column], f64::INFINITY, 0);
            for j in (1..=m).filter(|&j| !is_used[j]) {
                let reduced = cost(here - 1, j - 1) - of_row[here] - of_column[j];
                if reduced < least[j] {
                    (least[j], way[j]) = (reduced, column);
                }
                if least[j] < delta {
                    (delta, next) = (least[j], j);
                }
            }
            for j in 0..=m {
                if is_used[j] {
                    of_row[row_at[j]] += delta;
                    of_column[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            column = next;
        }
        // Take the path back.
        while column != 0 {
            let before = way[column];
            row_at[column] = row_at[before];
            column = before;
        }
    }
    (1..=m).filter(|&j| row_at[j] > 0).map(|j| (row_at[j] - 1, j - 1)).collect()
}

fn greedy(n: usize, m: usize, gain: &dyn Fn(usize, usize) -> f64) -> Vec<(usize, usize)> {
    let all = (0..n).flat_map(|i| (0..m).map(move |j| (i, j)));
    let mut order: Vec<(f64, usize, usize)> =
        all.map(|(i, j)| (gain(i, j), i, j)).filter(|&(gain, ..)| gain > 0.0).collect();
    order.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let (mut is_taken, mut is_given) = (vec![false; n], vec![false; m]);
    let mut pairs = Vec::new();
    for (_, i, j) in order {
        if !is_taken[i] && !is_given[j] {
            (is_taken[i], is_given[j]) = (true, true);
            pairs.push((i, j));
        }
    }
    pairs
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    /// The best sum by looking at every way.
    fn by_force(
        n: usize,
        m: usize,
        gain: &dyn Fn(usize, usize) -> f64,
        used: &mut Vec<bool>,
        row: usize,
    ) -> f64 {
        if row == n {
            return 0.0;
        }
        let mut best = by_force(n, m, gain, used, row + 1);
        for j in 0..m {
            if !used[j] && gain(row, j) > 0.0 {
                used[j] = true;
                best = best.max(gain(row, j) + by_force(n, m, gain, used, row + 1));
                used[j] = false;
            }
        }
        best
    }

    #[test]
    fn as_good_as_every_other_way() {
        let mut stream = Stream::new(5, Purpose::PhantomShape, 0, 0);
        for case in 0..300 {
            let (n, m) = (case % 6, (case / 6) % 6);
            let table: Vec<f64> = (0..n * m).map(|_| stream.uniform(-1.0, 2.0)).collect();
            let gain = |i: usize, j: usize| table[i * m + j];
            let best = by_force(n, m, &gain, &mut vec![false; m], 0);
            let (sum, pairs) = assign(n, m, gain);
            assert!((sum - best).abs() < 1e-12, "{n} x {m}: {sum}, {best}");
            assert!((best_gain(n, m, gain) - best).abs() < 1e-12);
            assert!(pairs.iter().all(|&(i, j)| i < n && j < m));
        }
    }

    #[test]
    fn large_sets_are_paired_too() {
        let pairs = assign(700, 900, |i, j| if i + 100 == j { 2.0 } else { -1.0 }).1;
        assert_eq!(pairs.len(), 700);
        assert_eq!(pairs[3], (3, 103));
    }
}
