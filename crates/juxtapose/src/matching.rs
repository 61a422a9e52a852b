//! Which branch of one tree is which of the other.
//!
//! **Input** the limbs of both trees, a measure of how unlike two of them are. **Output** chains: runs of limbs of one
//! tree that are one branch of the other.
//! **Notation** c a limb of the baseline, d one of the follow-up; T(c) the length of c and of all behind it; D(c, d) the
//! least cost at which what lies from c on becomes what lies from d on.
//! **Steps** 1. From the tips to the root, D(c, d) is the least of: *their ends are one fork* (how far apart the ends are,
//! and the best assignment of the limbs that go on there; who is left over costs its T); *the fork at the end of c is the
//! baseline's alone* (D(c', d) for a limb c' behind c, T of the other limbs there); the same of the follow-up. 2. From the
//! root on, read what was chosen.
//! **Guarantees** each limb is in one chain at most; parents match parents; the least cost there is for the measure, but
//! for forks too large for an exact assignment. Of equal costs ends that meet win, then the first limb.
//! **Source** ours, after the edit distance between unordered trees under the constraint that disjoint subtrees stay
//! disjoint [Zhang1996]; a deletion there that leaves one child is a fork here that only one tree has.
//! **Differs from the source** costs are lengths, of what has no partner, and distances, of what has one.
//! **Cost** O(pairs · children) time, 12 bytes a pair.

use crate::assign::{assign, best_gain};
use crate::limbs::Limbs;

/// A fork that only one tree has costs this share of the limb before it, so that of equal ways the simple one is taken.
const FORK_ALONE: f64 = 1e-6;

/// How unlike two limbs are, in mm.
pub(crate) trait Unlike {
    /// As they set out from one fork.
    fn at_start(&self, c: usize, d: usize) -> f64;
    /// As they end.
    fn at_end(&self, c: usize, d: usize) -> f64;
}

/// A branch of both trees: limbs that follow on one another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Chain {
    /// The limbs of the baseline; at least one.
    pub(crate) baseline: Vec<usize>,
    /// The limbs of the follow-up; at least one.
    pub(crate) followup: Vec<usize>,
    /// The chain that it hangs from; `None` at the root.
    pub(crate) parent: Option<usize>,
}

/// Which limb is which.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Matching {
    /// Parents before what hangs from them.
    pub(crate) chains: Vec<Chain>,
    /// What all that differs costs, in mm.
    pub(crate) cost_mm: f64,
}

/// Pairs from both trees.
struct Pairs<'a, U> {
    limbs: [&'a Limbs; 2],
    unlike: &'a U,
    /// D by c and d.
    cost: Vec<f64>,
    /// 0 if the ends meet; else 2 k + 1 where the k-th limb behind c goes on, 2 k + 2 behind d.
    choice: Vec<u32>,
}

/// Matches the limbs of two trees.
pub(crate) fn match_limbs<U: Unlike>(limbs: [&Limbs; 2], unlike: &U) -> Matching {
    let n_pairs = limbs[0].len() * limbs[1].len();
    let mut pairs = Pairs { limbs, unlike, cost: vec![0.0; n_pairs], choice: vec![0; n_pairs] };
    for c in (0..limbs[0].len()).rev() {
        for d in (0..limbs[1].len()).rev() {
            let place = pairs.place(c, d);
            (pairs.cost[place], pairs.choice[place]) = pairs.cheapest(c, d);
        }
    }
    pairs.read()
}

impl<U: Unlike> Pairs<'_, U> {
    fn place(&self, c: usize, d: usize) -> usize {
        c * self.limbs[1].len() + d
    }

    fn cheapest(&self, c: usize, d: usize) -> (f64, u32) {
        let [base, follow] = self.limbs;
        let (behind_c, behind_d) = (&base.children[c], &follow.children[d]);
        let gain = |i: usize, j: usize| self.gain(behind_c[i], behind_d[j]);
        let met = self.unlike.at_end(c, d) + base.below_mm[c] + follow.below_mm[d];
        let mut best = (met - best_gain(behind_c.len(), behind_d.len(), gain), 0);
        let mut offer = |cost: f64, choice: usize| {
            if cost < best.0 {
                best = (cost, choice as u32);
            }
        };
        let alone = base.below_mm[c] + FORK_ALONE * base.lines[c].length_mm();
        for (k, &next) in behind_c.iter().enumerate() {
            offer(alone - base.total_mm[next] + self.cost[self.place(next, d)], 2 * k + 1);
        }
        let alone = follow.below_mm[d] + FORK_ALONE * follow.lines[d].length_mm();
        for (k, &next) in behind_d.iter().enumerate() {
            offer(alone - follow.total_mm[next] + self.cost[self.place(c, next)], 2 * k + 2);
        }
        best
    }

    /// What is saved if two limbs that set out from one fork match, against both being alone.
    fn gain(&self, c: usize, d: usize) -> f64 {
        let [base, follow] = self.limbs;
        base.total_mm[c] + follow.total_mm[d] - self.unlike.at_start(c, d) - self.cost[self.place(c, d)]
    }

    /// The limbs that match among those that set out from one fork.
    fn assigned(&self, from_c: &[usize], from_d: &[usize]) -> (f64, Vec<(usize, usize)>) {
        let (gain, pairs) = assign(from_c.len(), from_d.len(), |i, j| self.gain(from_c[i], from_d[j]));
        (gain, pairs.into_iter().map(|(i, j)| (from_c[i], from_d[j])).collect())
    }

    /// Reads the chains from the root on.
    fn read(&self) -> Matching {
        let [base, follow] = self.limbs;
        let (gain, at_root) = self.assigned(&base.roots, &follow.roots);
        let cost_mm = base.length_mm() + follow.length_mm() - gain;
        let mut chains: Vec<Chain> = Vec::new();
        let mut waiting: Vec<((usize, usize), Option<usize>)> =
            at_root.into_iter().rev().map(|pair| (pair, None)).collect();
        while let Some(((mut c, mut d), parent)) = waiting.pop() {
            let mut chain = Chain { baseline: vec![c], followup: vec![d], parent };
            loop {
                let choice = self.choice[self.place(c, d)] as usize;
                if choice == 0 {
                    break;
                }
                let k = (choice - 1) / 2;
                if choice % 2 == 1 {
                    c = base.children[c][k];
                    chain.baseline.push(c);
                } else {
                    d = follow.children[d][k];
                    chain.followup.push(d);
                }
            }
            let (_, next) = self.assigned(&base.children[c], &follow.children[d]);
            waiting.extend(next.into_iter().rev().map(|pair| (pair, Some(chains.len()))));
            chains.push(chain);
        }
        Matching { chains, cost_mm }
    }
}
