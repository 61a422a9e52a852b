//! A tree by its branches, as the matching reads it.
//!
//! **Guarantees** limbs stand in preorder: those that hang from a limb come after it.

use espalier_model::{Branches, Tree};

use crate::line::Line;

/// The branches of a tree, or the longest part of them.
#[derive(Clone, Debug)]
pub(crate) struct Limbs {
    /// By limb: its branch.
    pub(crate) branch: Vec<usize>,
    /// By limb: what it hangs from.
    pub(crate) parent: Vec<Option<usize>>,
    /// By limb: what hangs from its end.
    pub(crate) children: Vec<Vec<usize>>,
    /// What hangs from the root.
    pub(crate) roots: Vec<usize>,
    pub(crate) lines: Vec<Line>,
    /// By limb: the length of it and of all that hangs from it, in mm.
    pub(crate) total_mm: Vec<f64>,
    /// By limb: the same without itself.
    pub(crate) below_mm: Vec<f64>,
    /// By limb: its mean radius, in mm.
    pub(crate) radius_mm: Vec<f64>,
}

impl Limbs {
    /// Every branch of a tree.
    pub(crate) fn of(tree: &Tree, branches: &Branches) -> Self {
        let lines: Vec<Line> =
            branches.list().iter().map(|branch| Line::along(tree, std::iter::once(branch))).collect();
        let parents = branches.list().iter().map(|branch| branch.parent).collect();
        Self::new((0..lines.len()).collect(), parents, lines)
    }

    fn new(branch: Vec<usize>, parent: Vec<Option<usize>>, lines: Vec<Line>) -> Self {
        let n_limbs = branch.len();
        let (mut children, mut roots) = (vec![Vec::new(); n_limbs], Vec::new());
        for (limb, parent) in parent.iter().enumerate() {
            parent.map_or(&mut roots, |parent| &mut children[parent]).push(limb);
        }
        let mut below_mm = vec![0.0; n_limbs];
        let mut total_mm = vec![0.0; n_limbs];
        for limb in (0..n_limbs).rev() {
            total_mm[limb] = below_mm[limb] + lines[limb].length_mm();
            if let Some(parent) = parent[limb] {
                below_mm[parent] += total_mm[limb];
            }
        }
        let radius_mm = lines.iter().map(|line| line.mean_radius_mm([0.0, line.length_mm()])).collect();
        Self { branch, parent, children, roots, lines, total_mm, below_mm, radius_mm }
    }

    /// The number of limbs.
    pub(crate) fn len(&self) -> usize {
        self.branch.len()
    }

    /// The length of all limbs, in mm.
    pub(crate) fn length_mm(&self) -> f64 {
        self.roots.iter().map(|&root| self.total_mm[root]).sum()
    }

    /// The total that all but the `n` largest limbs do not exceed.
    pub(crate) fn threshold_mm(&self, n: usize) -> f64 {
        let mut totals = self.total_mm.clone();
        totals.sort_by(|a, b| b.total_cmp(a));
        totals.get(n).copied().unwrap_or(0.0)
    }

    /// The limbs with more than so much behind them: a tree of its own, since no limb has more than its parent.
    pub(crate) fn larger_than(&self, threshold_mm: f64) -> Self {
        let order: Vec<usize> = (0..self.len()).filter(|&limb| self.total_mm[limb] > threshold_mm).collect();
        let mut place = vec![None; self.len()];
        for (new, &old) in order.iter().enumerate() {
            place[old] = Some(new);
        }
        let of_parent = |&limb: &usize| self.parent[limb].and_then(|parent| place[parent]);
        Self::new(
            order.iter().map(|&limb| self.branch[limb]).collect(),
            order.iter().map(of_parent).collect(),
            order.iter().map(|&limb| self.lines[limb].clone()).collect(),
        )
    }
}
