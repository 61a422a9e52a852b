//! The certificate: an exact check of the coordinates as they are written.
//!
//! **Input** a tree and rounded positions. **Output** `Certificate`: how many pairs of edges have a point in
//! common that they should not have, and the first of them.
//! **Steps** 1. Pairs whose boxes meet, by exact orientation predicates. 2. Edges from one node, in the order of their
//! directions, which the same predicates tell: of equal ones each pair.
//! **Guarantees** exact for any finite coordinates: touching and collinear overlap count; edges with a common
//! node may share that node only; an edge without length always counts against its neighbours. Independent of
//! every optimiser's own check.
//! **Source** predicates: `espalier_geom::plane`.
//! **Cost** O(N log N + boxes that meet), see `boxes`.

use std::cmp::Ordering;

use espalier_geom::plane::{Segment, Side, intersect, overlap_beyond_hub, side};
use espalier_model::{Certificate, Tree};
use glam::DVec2;

use crate::boxes::{self, EdgeBox};

/// Checks a layout of a tree, exactly: no pair of edges may have a point in common that is no common node.
///
/// `positions_mm` are finite plane coordinates, one per node, taken as the numbers they are: what was read from a
/// file can be certified without trust in who wrote it. Touching and collinear overlap count, and an edge without
/// length counts against its neighbours.
///
/// # Panics
/// If there is not one position per node.
///
/// ```
/// use espalier_embed::certify;
/// use espalier_model::{Node, Tree};
/// use glam::{DVec2, DVec3};
///
/// let node = |z: f64, parent| Node { position_mm: DVec3::new(0.0, 0.0, z), radius_mm: 1.0, parent, kind: 0 };
/// let tree = Tree::new(&[node(0.0, None), node(1.0, Some(0)), node(2.0, Some(1)), node(3.0, Some(2))])?;
/// let mut flat = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0)].map(|(x, y)| DVec2::new(x, y));
/// assert!(certify(&tree, &flat).holds());
///
/// flat[3] = DVec2::new(1.0, 0.0); // the tip touches the first edge
/// assert_eq!(certify(&tree, &flat).pairs, [(1, 3)]);
/// # Ok::<(), espalier_model::TreeError>(())
/// ```
#[must_use]
pub fn certify(tree: &Tree, positions_mm: &[DVec2]) -> Certificate {
    sweep(tree, positions_mm, Certificate::MAX_PAIRS)
}

/// The pairs of edges that [`certify`] counts, in ascending order, each by its lower node: the first `most` of them.
///
/// # Panics
/// As [`certify`].
#[must_use]
pub fn crossing_pairs(tree: &Tree, positions_mm: &[DVec2], most: usize) -> Vec<(usize, usize)> {
    sweep(tree, positions_mm, most).pairs
}

/// Counts the pairs that meet, and keeps the first `most`.
fn sweep(tree: &Tree, positions: &[DVec2], most: usize) -> Certificate {
    assert_eq!(positions.len(), tree.n_nodes(), "one position per node");
    let mut certificate = Certificate::default();
    let mut count = |a: usize, b: usize| {
        certificate.crossings += 1;
        certificate.pairs.push((a.min(b), a.max(b)));
        if certificate.pairs.len() >= 4 * most.max(1) {
            keep_first(&mut certificate.pairs, most);
        }
    };
    let edge_box = |node: usize| {
        let parent = parent_of(tree, node);
        EdgeBox::around((positions[node], positions[parent]), 0.0, (node, parent))
    };
    boxes::each_meeting((1..positions.len()).map(edge_box).collect(), |a, b| {
        if meet(tree, positions, (a, b)) {
            count(a, b);
        }
        true
    });
    for hub in 0..positions.len() {
        each_overlap_at(tree, positions, hub, &mut count);
    }
    keep_first(&mut certificate.pairs, most);
    certificate
}

/// Whether two edges from different nodes, by their lower nodes and `a` before `b`, meet where they should not.
fn meet(tree: &Tree, positions: &[DVec2], (a, b): (usize, usize)) -> bool {
    let (parent_a, parent_b) = (parent_of(tree, a), parent_of(tree, b));
    if parent_b == a {
        return overlap_beyond_hub(positions[a], positions[parent_a], positions[b]);
    }
    let segment_a = Segment { a: positions[parent_a], b: positions[a] };
    intersect(&segment_a, &Segment { a: positions[parent_b], b: positions[b] })
}

/// Visits the pairs of edges from a node that have more than it in common: those of one direction, and an edge without
/// length with every other.
fn each_overlap_at(tree: &Tree, positions: &[DVec2], hub: usize, visit: &mut impl FnMut(usize, usize)) {
    let (at, children) = (positions[hub], tree.children(hub));
    if children.len() < 2 {
        return;
    }
    let (points, mut others): (Vec<usize>, Vec<usize>) =
        children.iter().partition(|&&child| positions[child] == at);
    for (idx, &point) in points.iter().enumerate() {
        points[idx + 1..].iter().chain(&others).for_each(|&other| visit(point, other));
    }
    others.sort_unstable_by(|&a, &b| by_direction(at, positions[a], positions[b]).then(a.cmp(&b)));
    for same in others.chunk_by(|&a, &b| by_direction(at, positions[a], positions[b]).is_eq()) {
        for (idx, &a) in same.iter().enumerate() {
            same[idx + 1..].iter().for_each(|&b| visit(a, b));
        }
    }
}

/// The order of two points by their directions from a third, counter-clockwise from that of +x; exact.
fn by_direction(hub: DVec2, a: DVec2, b: DVec2) -> Ordering {
    // Signs of coordinate differences are those of comparisons, which are exact.
    let is_lower_half = |p: DVec2| p.y < hub.y || (p.y == hub.y && p.x < hub.x);
    is_lower_half(a).cmp(&is_lower_half(b)).then_with(|| match side(hub, a, b) {
        Side::Left => Ordering::Less,
        Side::On => Ordering::Equal,
        Side::Right => Ordering::Greater,
    })
}

/// The node at the upper end of the edge of a node; edges have one, since the root is no edge's lower node.
fn parent_of(tree: &Tree, node: usize) -> usize {
    tree.parent(node).unwrap_or(0)
}

/// Keeps the lowest pairs, so that what is kept does not depend on the order of the sweep.
fn keep_first(pairs: &mut Vec<(usize, usize)>, most: usize) {
    pairs.sort_unstable();
    pairs.truncate(most);
}
