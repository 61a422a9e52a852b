//! The global view, the subtree views and the planes, each the best view of its part.
//!
//! **Input** a tree, the parameters, a seed. **Output** a [`ViewHierarchy`] whose planes all face the global view's
//! camera, and the work done.
//! **Notation** h the branching depth: the number of forks above a node, the root counted where it is one.
//! **Steps** 1. The global view: the best view of the whole tree, on its anterior side. 2. For h = 1, 2, … up to
//! `max_levels`: the best view of each subtree that hangs from a fork at depth h − 1, with the edge that it hangs
//! from, if it branches again. 3. The best view of each chain set and of each branching set.
//! **Guarantees** centre = length-weighted centroid, radius = expansion radius, of the real edges; results stand in
//! a fixed order whatever the threads.
//! **Source** [Hu2022] sections 3.1.2 and 3.2.1.
//! **Differs from the source** subtrees that do not branch again have their chain's plane and no view beside it;
//! levels end at `max_levels`.
//! **Cost** a search costs some 500 × the edges of its part, and the parts of one level are disjoint, so
//! O(N · min(depth, `max_levels`)); in parallel over parts. Where that is much, as in trees of more than about
//! 10,000 nodes, searches gather edges by direction: a binary tree of depth 16 then takes 1.5 s of processor time
//! instead of 6.9 s, and of its 511 views the worst loses 0.0006 more than before (0.05 on average, 0.00003 more).

use espalier_model::{Branches, LocalPlane, SubtreeView, Tree, View, ViewHierarchy};
use glam::DVec3;
use rayon::prelude::*;

use crate::enhanced::Part;
use crate::frame::Frame;
use crate::metric::Edges;
use crate::objective::Objective;
use crate::params::Params;
use crate::search::best_direction;

/// Edges of all levels together up to which searches see every edge: some two seconds of work.
const MANY_EDGES: usize = 200_000;
/// Parts of fewer edges are never gathered; those of more than the second always.
const GATHERED: [usize; 2] = [512, 32_768];
/// Edges per cell: the search among cells then costs about three times what all edges cost to judge its answer.
const EDGES_PER_CELL: usize = 16;
/// Cells per side of a cube's face: 11° and 3° wide.
const CELLS: [usize; 2] = [8, 32];

/// A best view and what it took to find it.
struct Sought<T> {
    found: T,
    n_evaluations: u64,
}

/// What all searches of a tree have in common.
#[derive(Clone, Copy)]
struct Task<'a> {
    params: &'a Params,
    seed: u64,
    /// About how many edges the parts of all levels have together.
    n_edges: usize,
}

/// All views of a tree, mirrors not chosen yet, and the number of evaluations of the view metric.
pub(crate) fn views_of_parts(
    tree: &Tree,
    branches: &Branches,
    params: &Params,
    seed: u64,
) -> (ViewHierarchy, u64) {
    let m = params.max_siblings;
    let roots = subtree_roots(tree, branches, params.max_levels);
    let part = Part::subtree(tree, 0, m);
    let n_below: usize = roots.iter().map(|&(_, root)| tree.subtree(root).len()).sum();
    let edges_per_node = (part.real.len() + part.imaginary.len()).div_ceil(tree.n_nodes());
    let task = Task { params, seed, n_edges: edges_per_node * (tree.n_nodes() + n_below) };
    let whole = global_view(tree, &part, task);
    let global = whole.found;
    let reference = Frame::of(&global);
    let view = |part: Part| best_view(tree, &part, reference, task);
    let plane = |part: Part| {
        let Sought { found, n_evaluations } = view(part);
        Sought { found: LocalPlane { view: found, is_mirrored: false }, n_evaluations }
    };

    let subtrees: Vec<Sought<SubtreeView>> = roots
        .into_par_iter()
        .map(|(level, root)| {
            let Sought { found, n_evaluations } = view(Part::subtree(tree, root, m));
            Sought { found: SubtreeView { level, root, view: found }, n_evaluations }
        })
        .collect();
    let chains: Vec<Sought<LocalPlane>> =
        branches.list().par_iter().map(|branch| plane(Part::chain(tree, branch))).collect();
    let forks: Vec<Option<Sought<LocalPlane>>> = (0..tree.n_nodes())
        .into_par_iter()
        .map(|node| (tree.children(node).len() > 1).then(|| plane(Part::fork(tree, node, m))))
        .collect();

    let n_evaluations = whole.n_evaluations
        + subtrees.iter().map(|sought| sought.n_evaluations).sum::<u64>()
        + chains.iter().chain(forks.iter().flatten()).map(|sought| sought.n_evaluations).sum::<u64>();
    let first = SubtreeView { level: 0, root: 0, view: global };
    let hierarchy = ViewHierarchy {
        tree: tree.digest(),
        global,
        subtrees: std::iter::once(first).chain(subtrees.into_iter().map(|sought| sought.found)).collect(),
        chains: chains.into_iter().map(|sought| sought.found).collect(),
        forks: forks.into_iter().map(|fork| fork.map(|sought| sought.found)).collect(),
    };
    (hierarchy, n_evaluations)
}

/// The best view of the whole tree, or the view that the user wants.
fn global_view(tree: &Tree, part: &Part, task: Task<'_>) -> Sought<View> {
    let params = task.params;
    let Some(fixed) = params.fixed_view.map(DVec3::from_array) else {
        return best_view(tree, part, Frame::ANTERIOR, task);
    };
    // Scaled first, for the square of a large coordinate overflows.
    let towards_camera = (fixed / fixed.abs().max_element()).normalize();
    let loss = Edges::of(tree, part).seen_from(towards_camera, params.metric).loss;
    let frame = Frame::ANTERIOR.seen_from(towards_camera);
    Sought { found: view_of(tree, part, frame, loss), n_evaluations: 1 }
}

/// The best view of a part, on the side that faces the reference.
fn best_view(
    tree: &Tree,
    part: &Part,
    reference: Frame,
    Task { params, seed, n_edges }: Task<'_>,
) -> Sought<View> {
    let edges = Edges::of(tree, part);
    let objective =
        Objective { edges: &edges, cells: cells(edges.len(), n_edges), metric: params.metric, reference };
    let best = best_direction(&objective, params, seed);
    let loss = edges.seen_from(best.direction, params.metric).loss;
    let frame = reference.seen_from(reference.facing(best.direction));
    Sought { found: view_of(tree, part, frame, loss), n_evaluations: best.n_evaluations }
}

/// Cells per side by which a part's edges are gathered for its search; `None` where it sees them all.
fn cells(n_edges: usize, n_edges_of_all: usize) -> Option<usize> {
    let [some, many] = GATHERED;
    let is_gathered = n_edges > many || (n_edges_of_all > MANY_EDGES && n_edges > some);
    let cells_per_side = || (n_edges / (3 * EDGES_PER_CELL)).isqrt().clamp(CELLS[0], CELLS[1]);
    is_gathered.then(cells_per_side)
}

fn view_of(tree: &Tree, part: &Part, frame: Frame, loss: f64) -> View {
    let (center_mm, radius_mm) = part.center_and_radius_mm(tree);
    View { towards_camera: frame.towards_camera, up: frame.up, center_mm, radius_mm, loss }
}

/// (level, root) of the subtrees with a view of their own, level by level, in preorder within a level.
fn subtree_roots(tree: &Tree, branches: &Branches, max_levels: u32) -> Vec<(u32, usize)> {
    let is_root_fork = tree.children(0).len() > 1;
    let level_and_root = branches.list().iter().filter_map(|branch| {
        let level = branch.generation + u32::from(is_root_fork);
        let branches_again = tree.children(branch.end()).len() > 1;
        ((1..=max_levels).contains(&level) && branches_again).then_some((level, branch.nodes.start))
    });
    let mut roots: Vec<_> = level_and_root.collect();
    roots.sort_unstable();
    roots
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;

    use super::*;

    /// 0 → 1 → {2 → {3 → {4, 5}, 6}, 7 → {8, 9}}, or without node 0's edge: the root is the fork.
    fn roots(parents: &[usize], max_levels: u32) -> Vec<(u32, usize)> {
        let node = |i: usize, parent| Node {
            position_mm: DVec3::new(i as f64, (i * i % 5) as f64, 0.0),
            radius_mm: 1.0,
            parent,
            kind: 0,
        };
        let rest = parents.iter().enumerate().map(|(i, &parent)| node(i + 1, Some(parent)));
        let tree =
            Tree::new(&std::iter::once(node(0, None)).chain(rest).collect::<Vec<_>>()).expect("a tree");
        subtree_roots(&tree, &tree.branches(), max_levels)
    }

    #[test]
    fn levels_count_forks() {
        let trunk = [0, 1, 2, 3, 3, 2, 1, 7, 7];
        assert_eq!(roots(&trunk, 9), [(1, 2), (1, 7), (2, 3)]);
        assert_eq!(roots(&trunk, 1), [(1, 2), (1, 7)]);
        assert_eq!(roots(&trunk, 0), []);
        let fork_at_root = [0, 1, 2, 2, 1, 0, 6, 6];
        assert_eq!(roots(&fork_at_root, 9), [(1, 1), (1, 6), (2, 2)]);
    }
}
