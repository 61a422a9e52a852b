//! Nodes at one place become one.
//!
//! **Input** nodes of a rooted tree in any order. **Output** the same without edges shorter than a tolerance; the
//! parent stays, takes over the children and the larger radius; a ledger entry for each merge.
//! **Cost** O(N).

use espalier_geom::space::extent;
use espalier_model::{Ledger, LedgerEntry, LedgerKind, Node};

/// Edges shorter than this share of the tree's extent have no direction worth keeping.
const SHARE_OF_EXTENT: f64 = 1e-6;

/// The length in mm up to which an edge has no direction.
pub(crate) fn tolerance_mm(nodes: &[Node]) -> f64 {
    SHARE_OF_EXTENT * extent(nodes.iter().map(|node| node.position_mm))
}

/// Collapses all edges not longer than [`tolerance_mm`]. Nodes that no root leads to are dropped; there are none in
/// what the callers give.
pub(crate) fn merge_near(nodes: &[Node], ledger: &mut Ledger) -> Vec<Node> {
    let tolerance_mm = tolerance_mm(nodes);
    let mut merged: Vec<Node> = Vec::with_capacity(nodes.len());
    let mut new_index = vec![usize::MAX; nodes.len()];
    for node_idx in parents_first(nodes) {
        let node = nodes[node_idx];
        let parent = node.parent.map(|parent| new_index[parent]);
        let edge_mm = parent.map(|parent| node.position_mm.distance(merged[parent].position_mm));
        match (parent, edge_mm) {
            (Some(parent), Some(length_mm)) if length_mm <= tolerance_mm => {
                let radius_mm = merged[parent].radius_mm.max(node.radius_mm);
                merged[parent].radius_mm = radius_mm;
                new_index[node_idx] = parent;
                ledger.0.push(LedgerEntry {
                    kind: LedgerKind::NodesMerged,
                    position_mm: node.position_mm,
                    radius_mm,
                    length_mm,
                    reason: format!("edge of {length_mm:.3e} mm, not longer than {tolerance_mm:.3e} mm"),
                });
            }
            _ => {
                new_index[node_idx] = merged.len();
                merged.push(Node { parent, ..node });
            }
        }
    }
    merged
}

/// The node indices with every parent before its children, otherwise in index order by depth.
pub(crate) fn parents_first(nodes: &[Node]) -> Vec<usize> {
    let mut children = vec![Vec::new(); nodes.len()];
    let mut order = Vec::with_capacity(nodes.len());
    for (node_idx, node) in nodes.iter().enumerate() {
        match node.parent {
            Some(parent) => children[parent].push(node_idx),
            None => order.push(node_idx),
        }
    }
    let mut n_done = 0;
    while n_done < order.len() {
        order.extend_from_slice(&children[order[n_done]]);
        n_done += 1;
    }
    order
}
