//! What a search for exact angles may hope for: how often the targets cross themselves.
//!
//! **Input** a problem. **Output** whether its layout at ratio 0 crosses not at all, often, or everywhere.
//! **Guarantees** the same for any number of threads. **Cost** that of `crossing`, which ends where it is crowded.

use crate::crossing;
use crate::problem::Problem;
use crate::solver::Shape;

/// More crossings than this for each edge are too many to be searched. Neurons, airways and vessels of 135 to 10,000
/// nodes have 0.01 to 0.3; complete binary trees of equal edges have 1.6 at depth 8, 6 at depth 10 and hundreds at depth
/// 16, where searches found next to nothing in minutes.
const MOST_CROSSINGS_PER_EDGE: usize = 8;

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
        let most = MOST_CROSSINGS_PER_EDGE * problem.n_nodes();
        match crossing::count_at(problem, &Shape::targets(problem).positions(problem), most) {
            0 => Self::Free,
            n_crossings if n_crossings > most => Self::Crowded,
            _ => Self::Open,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::common::{tree_of, views_along};
    use crate::params::Params;
    use crate::targets;

    /// A complete binary tree of equal edges and equal bends.
    fn prospect(depth: u32) -> Prospect {
        let mut nodes = vec![(0.0, 0.0, 0.0, None)];
        let mut headings = vec![0.0_f64];
        for node in 1..(1_usize << depth) - 1 {
            let parent = (node - 1) / 2;
            let heading = headings[parent] + if node % 2 == 0 { 0.6 } else { -0.6 };
            let (sin, cos) = espalier_geom::math::sin_cos(heading);
            headings.push(heading);
            nodes.push((nodes[parent].0 + cos, nodes[parent].1 + sin, 0.0, Some(parent)));
        }
        let tree = tree_of(&nodes);
        let (params, branches, views) = (Params::default(), tree.branches(), views_along(&tree, DVec3::Z));
        let targets = targets::targets(&tree, &branches, &views, params.targets).expect("targets");
        Prospect::of(&Problem::new(&tree, branches, targets, &params))
    }

    #[test]
    fn binary_trees_fill_up() {
        assert_eq!(prospect(3), Prospect::Free);
        assert_eq!(prospect(8), Prospect::Open);
        assert_eq!(prospect(14), Prospect::Crowded);
    }
}
