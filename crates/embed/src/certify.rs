//! The certificate: an exact check of the coordinates as they are written.
//!
//! **Input** a tree and rounded positions. **Output** `Certificate`: how many pairs of edges have a point in
//! common that they should not have, and the first of them.
//! **Steps** 1. Take the axis along which the layout is longer. 2. Sort edges by their lower end on it. 3. Sweep:
//! compare each edge with those that start before it ends, by exact orientation predicates.
//! **Guarantees** exact for any finite coordinates: touching and collinear overlap count; edges with a common
//! node may share that node only; an edge without length always counts against its neighbours. Independent of
//! every optimiser's own check.
//! **Source** predicates: `espalier_geom::plane`.
//! **Cost** O(N log N + pairs whose extents on the axis meet).

use espalier_geom::plane::{Segment, intersect, overlap_beyond_hub};
use espalier_model::{Certificate, Tree};
use glam::DVec2;

/// The box of an edge, by its lower node, along and across the axis of the sweep.
struct Span {
    start: f64,
    end: f64,
    bottom: f64,
    top: f64,
    node: usize,
}

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
    let low = positions.iter().fold(DVec2::INFINITY, |low, &p| low.min(p));
    let high = positions.iter().fold(DVec2::NEG_INFINITY, |high, &p| high.max(p));
    let extent = high - low;
    let along = |p: DVec2| if extent.x >= extent.y { p.x } else { p.y };
    let across = |p: DVec2| if extent.x >= extent.y { p.y } else { p.x };

    let span = |node: usize| {
        let (a, b) = (positions[node], positions[parent_of(tree, node)]);
        let (start, end) = (along(a).min(along(b)), along(a).max(along(b)));
        Span { start, end, bottom: across(a).min(across(b)), top: across(a).max(across(b)), node }
    };
    let mut edges: Vec<Span> = (1..positions.len()).map(span).collect();
    edges.sort_unstable_by(|a, b| a.start.total_cmp(&b.start).then(a.node.cmp(&b.node)));

    let mut certificate = Certificate::default();
    for (idx, edge) in edges.iter().enumerate() {
        for other in edges[idx + 1..].iter().take_while(|other| other.start <= edge.end) {
            let is_apart = other.bottom > edge.top || edge.bottom > other.top;
            let pair = (edge.node.min(other.node), edge.node.max(other.node));
            if !is_apart && meet(tree, positions, pair) {
                certificate.crossings += 1;
                certificate.pairs.push(pair);
            }
            if certificate.pairs.len() >= 4 * most.max(1) {
                keep_first(&mut certificate.pairs, most);
            }
        }
    }
    keep_first(&mut certificate.pairs, most);
    certificate
}

/// Whether two edges, by their lower nodes and `a` before `b`, meet where they should not.
fn meet(tree: &Tree, positions: &[DVec2], (a, b): (usize, usize)) -> bool {
    let (parent_a, parent_b) = (parent_of(tree, a), parent_of(tree, b));
    if parent_b == a {
        overlap_beyond_hub(positions[a], positions[parent_a], positions[b])
    } else if parent_a == parent_b {
        overlap_beyond_hub(positions[parent_a], positions[a], positions[b])
    } else {
        let segment_a = Segment { a: positions[parent_a], b: positions[a] };
        intersect(&segment_a, &Segment { a: positions[parent_b], b: positions[b] })
    }
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
