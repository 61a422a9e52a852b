//! What a search for exact angles may hope for: how often the targets cross themselves.
//!
//! **Input** a problem. **Output** whether its layout at ratio 0 crosses not at all, often, or everywhere.
//! **Steps** 1. The crossings are counted. 2. Where a large tree has some, a short walk over the sides of turns tries
//! how many of them go: of a tree that has room near its targets most, of one whose tips double with each fork while
//! its area does not next to none.
//! **Guarantees** the same for any number of threads. **Cost** that of `crossing`, which ends where it is crowded; a
//! hundredth of the search for sides.

use crate::choices::Method;
use crate::crossing;
use crate::params::Params;
use crate::problem::Problem;
use crate::solver::{Shape, mirrors};

/// More crossings than this for each edge are too many to be searched. Neurons, airways and vessels of 135 to 10,000
/// nodes have 0.01 to 0.3; complete binary trees of equal edges have 1.6 at depth 8, 6 at depth 10 and hundreds at depth
/// 16, where searches found next to nothing in minutes.
const MOST_CROSSINGS_PER_EDGE: usize = 8;
/// The same for trees that are large (see below), whose searches take minutes.
const MOST_CROSSINGS_PER_EDGE_OF_LARGE: usize = 2;
/// From this size on a walk is sent ahead: smaller trees take seconds, whatever they are.
const LARGE: usize = 3000;
/// A tree of which that walk leaves a larger share of the crossings is crowded. Hemibrain neurons, a neuron of 50,000
/// nodes and one of 9500 keep 0.04 to 0.21 of them, airways of 4100 to 9100 nodes 0.07 to 0.37. Complete binary trees
/// keep 0.69 at depth 12 where edges shrink by 0.6 from fork to fork (searched, 73 of 497 crossings stay, and angles are
/// 1.1° off on average), 0.87 where they shrink by 0.7 or 0.8; at depth 16 0.94 to 0.99.
const MOST_LEFT: f64 = 0.9;

/// What there is to hope for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Prospect {
    /// The targets cross nowhere.
    Free,
    /// A search may find a layout near the targets.
    Open,
    /// The targets cross so often that no search is worth its work.
    Crowded,
}

impl Prospect {
    /// Of the targets of a problem.
    pub(crate) fn of(problem: &Problem) -> Self {
        if problem.is_crowded {
            return Self::Crowded;
        }
        let is_large = problem.n_nodes() >= LARGE;
        let per_edge = if is_large { MOST_CROSSINGS_PER_EDGE_OF_LARGE } else { MOST_CROSSINGS_PER_EDGE };
        let most = per_edge * problem.n_nodes();
        match crossing::count_at(problem, &Shape::targets(problem).positions(problem), most) {
            0 => Self::Free,
            n_crossings if n_crossings > most => Self::Crowded,
            _ => Self::Open,
        }
    }
}

/// Whether a large tree is one that searches do not bring near its targets.
pub(crate) fn is_crowded(problem: &Problem, params: &Params, seed: u64) -> bool {
    let is_searched = params.method == Method::Solver || params.methods.contains(&Method::Solver);
    if !is_searched || problem.is_thread() || problem.n_nodes() < LARGE {
        return false;
    }
    match Prospect::of(problem) {
        Prospect::Free => false,
        Prospect::Open => mirrors::share_left(problem, &params.solver, seed) > MOST_LEFT,
        Prospect::Crowded => true,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::common::{tree_of, views_along};
    use crate::params::Params;
    use crate::targets;

    /// A complete binary tree of equal bends, each edge `shrink` times as long as the one above.
    fn with_problem<T>((depth, shrink): (u32, f64), look: impl FnOnce(&Problem, &Params) -> T) -> T {
        let mut nodes = vec![(0.0, 0.0, 0.0, None)];
        let mut headings = vec![0.0_f64];
        let mut lengths = vec![1.0_f64];
        for node in 1..(1_usize << depth) - 1 {
            let parent = (node - 1) / 2;
            let heading = headings[parent] + if node % 2 == 0 { 0.6 } else { -0.6 };
            let (sin, cos) = espalier_geom::math::sin_cos(heading);
            headings.push(heading);
            let length = shrink * lengths[parent];
            lengths.push(length);
            nodes.push((nodes[parent].0 + length * cos, nodes[parent].1 + length * sin, 0.0, Some(parent)));
        }
        let tree = tree_of(&nodes);
        let (params, branches, views) = (Params::default(), tree.branches(), views_along(&tree, DVec3::Z));
        let targets = targets::targets(&tree, &branches, &views, params.targets).expect("targets");
        look(&Problem::new(&tree, branches, targets, &params), &params)
    }

    #[test]
    fn binary_trees_fill_up() {
        let prospect = |depth| with_problem((depth, 1.0), |problem, _| Prospect::of(problem));
        assert_eq!(prospect(3), Prospect::Free);
        assert_eq!(prospect(8), Prospect::Open);
        assert_eq!(prospect(14), Prospect::Crowded);
    }

    #[test]
    fn a_walk_tells_whether_there_is_room() {
        let is_crowded = |depth, shrink| {
            with_problem((depth, shrink), |problem, params| super::is_crowded(problem, params, 0))
        };
        assert!(!is_crowded(8, 0.8), "a small one is searched");
        assert!(is_crowded(13, 0.85), "a large one that crosses itself more than twice for each edge");
        assert!(!is_crowded(13, 0.7), "a walk finds a little room");
        let left = |depth| {
            with_problem((depth, 0.7), |problem, params| mirrors::share_left(problem, &params.solver, 0))
        };
        assert!((0.5..0.9).contains(&left(12)) && left(12) < left(13), "each fork takes room");
        assert!(!is_crowded(12, 0.45), "there is room for edges that halve");
    }
}
