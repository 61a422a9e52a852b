//! One component of the graph is the tree; the others go.
//!
//! **Input** [`Graph`]. **Output** the graph of its longest component; a ledger entry for each other one, at its
//! thickest hub.
//! **Why length**, not voxels or volume? Voxel counts depend on the direction of thick slices, and a volume would
//! prefer one blob to a whole vessel tree. Ties: the component with the lower hub index.
//! **Cost** O(N α(N)).

use espalier_geom::union_find::UnionFind;
use espalier_model::{Ledger, LedgerEntry, LedgerKind};

use crate::Error;
use crate::graph::{Graph, Hub, Piece};
use crate::params::{Components, Params};

struct Component {
    length_mm: f64,
    n_hubs: usize,
    thickest: Hub,
}

/// Keeps the component that the policy names; also returns how many were dropped.
///
/// # Errors
/// [`Error::Components`] if there are several and the policy is to refuse them.
pub(crate) fn select(graph: Graph, params: &Params, ledger: &mut Ledger) -> Result<(Graph, usize), Error> {
    let mut sets = UnionFind::new(graph.hubs.len());
    for piece in &graph.pieces {
        sets.join(piece.ends[0], piece.ends[1]);
    }
    let component_of: Vec<usize> = (0..graph.hubs.len()).map(|hub| sets.find(hub)).collect();
    let components = measure(&graph, &component_of);

    let mut by_length: Vec<usize> = (0..graph.hubs.len()).filter(|&hub| components[hub].is_some()).collect();
    let length = |hub: &usize| components[*hub].as_ref().map_or(0.0, |c| c.length_mm);
    by_length.sort_by(|a, b| length(b).total_cmp(&length(a)).then(a.cmp(b)));
    let kept = by_length[0];
    let Some(second) = by_length.get(1) else { return Ok((graph, 0)) };
    if let (Components::Refuse, Some(component)) = (params.components, &components[*second]) {
        return Err(Error::Components {
            n_components: by_length.len(),
            second_mm: component.length_mm,
            position_mm: component.thickest.sample.position_mm,
        });
    }

    for component in by_length[1..].iter().filter_map(|&hub| components[hub].as_ref()) {
        ledger.0.push(LedgerEntry {
            kind: LedgerKind::ComponentDropped,
            position_mm: component.thickest.sample.position_mm,
            radius_mm: component.thickest.sample.radius_mm,
            length_mm: component.length_mm,
            reason: format!(
                "island of {} tips and junctions, {:.3} mm long; the component kept is {:.3} mm long",
                component.n_hubs,
                component.length_mm,
                length(&kept)
            ),
        });
    }
    Ok((restrict(graph, &component_of, kept), by_length.len() - 1))
}

/// Each component under the index of the hub that stands for it.
fn measure(graph: &Graph, component_of: &[usize]) -> Vec<Option<Component>> {
    let mut components: Vec<Option<Component>> = (0..graph.hubs.len()).map(|_| None).collect();
    for (&hub, &component) in graph.hubs.iter().zip(component_of) {
        let entry =
            components[component].get_or_insert(Component { length_mm: 0.0, n_hubs: 0, thickest: hub });
        entry.n_hubs += 1;
        if hub.sample.radius_mm > entry.thickest.sample.radius_mm {
            entry.thickest = hub;
        }
    }
    for (piece_idx, piece) in graph.pieces.iter().enumerate() {
        if let Some(entry) = &mut components[component_of[piece.ends[0]]] {
            entry.length_mm += graph.length_mm(piece_idx);
        }
    }
    components
}

/// The part of the graph whose hubs belong to `kept`.
fn restrict(graph: Graph, component_of: &[usize], kept: usize) -> Graph {
    let mut new_index = vec![usize::MAX; graph.hubs.len()];
    let mut hubs = Vec::new();
    for (hub_idx, hub) in graph.hubs.into_iter().enumerate() {
        if component_of[hub_idx] == kept {
            new_index[hub_idx] = hubs.len();
            hubs.push(hub);
        }
    }
    let pieces = graph
        .pieces
        .into_iter()
        .filter(|piece| component_of[piece.ends[0]] == kept)
        .map(|piece| Piece { ends: piece.ends.map(|end| new_index[end]), ..piece })
        .collect();
    Graph { hubs, pieces }
}
