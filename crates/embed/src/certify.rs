//! The certificate: an exact check of the coordinates as they are written.
//!
//! **Input** parents and rounded positions. **Output** `Certificate`: how many pairs of edges have a point in
//! common that they should not have, and the first of them.
//! **Steps** 1. Take the axis along which the layout is longer. 2. Sort edges by their lower end on it. 3. Sweep:
//! compare each edge with those that start before it ends, by exact orientation predicates.
//! **Guarantees** exact for any finite coordinates: touching and collinear overlap count; edges with a common
//! node may share that node only; an edge without length always counts against its neighbours. Independent of
//! every optimiser's own check.
//! **Source** predicates: `espalier_geom::plane`.
//! **Cost** O(N log N + pairs whose extents on the axis meet).

use espalier_geom::plane::{Segment, intersect, overlap_beyond_hub};
use espalier_model::Certificate;
use glam::DVec2;

/// The box of an edge, by its lower node, along and across the axis of the sweep.
struct Span {
    start: f64,
    end: f64,
    bottom: f64,
    top: f64,
    node: usize,
}

/// Checks a layout of a tree whose root is node 0 and is its own parent.
pub(crate) fn certify(parent: &[u32], positions: &[DVec2]) -> Certificate {
    let low = positions.iter().fold(DVec2::INFINITY, |low, &p| low.min(p));
    let high = positions.iter().fold(DVec2::NEG_INFINITY, |high, &p| high.max(p));
    let extent = high - low;
    let along = |p: DVec2| if extent.x >= extent.y { p.x } else { p.y };
    let across = |p: DVec2| if extent.x >= extent.y { p.y } else { p.x };

    let span = |node: usize| {
        let (a, b) = (positions[node], positions[parent[node] as usize]);
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
            if !is_apart && meet(parent, positions, pair) {
                certificate.crossings += 1;
                certificate.pairs.push(pair);
            }
            if certificate.pairs.len() >= 4 * Certificate::MAX_PAIRS {
                keep_first(&mut certificate.pairs);
            }
        }
    }
    keep_first(&mut certificate.pairs);
    certificate
}

/// Whether two edges, by their lower nodes and `a` before `b`, meet where they should not.
fn meet(parent: &[u32], positions: &[DVec2], (a, b): (usize, usize)) -> bool {
    let (parent_a, parent_b) = (parent[a] as usize, parent[b] as usize);
    if parent_b == a {
        overlap_beyond_hub(positions[a], positions[parent_a], positions[b])
    } else if parent_a == parent_b {
        overlap_beyond_hub(positions[parent_a], positions[a], positions[b])
    } else {
        let segment_a = Segment { a: positions[parent_a], b: positions[a] };
        intersect(&segment_a, &Segment { a: positions[parent_b], b: positions[b] })
    }
}

/// Keeps the lowest pairs, so that what is kept does not depend on the order of the sweep.
fn keep_first(pairs: &mut Vec<(usize, usize)>) {
    pairs.sort_unstable();
    pairs.truncate(Certificate::MAX_PAIRS);
}
