//! One component of the graph is the tree; the others are joined to it or go.
//!
//! **Input** [`Graph`]. **Output** the graph of its longest component and of those joined to it; a ledger entry for each
//! bridge, and for each component dropped, at its thickest hub.
//! **Policies** `join`: over gaps of at most `bridge_mm` and of the island's own length, since a bridge longer than what it
//! leads to explains nothing; over any gap if the island has [`TREE_SHARE`] of the longest's length, since no gap is as bad
//! as half of a forest lost; `all`: over any gap; `largest`: none; `refuse`: an error if there are several. An
//! island that is no longer than a spur at its own radius is never joined: it is noise, and would be pruned.
//! **Why length**, not voxels or volume? Voxel counts depend on the direction of thick slices, and a volume would
//! prefer one blob to a whole vessel tree. Ties: the component with the lower hub index.
//! **Cost** O(N α(N)), and what [`bridges`] takes.

use espalier_geom::union_find::UnionFind;
use espalier_model::{Ledger, LedgerEntry, LedgerKind, Report};

use crate::Error;
use crate::bridges::{self, Island};
use crate::graph::{Graph, Hub, Piece};
use crate::params::{Components, Params};

/// An island of at least this share of the longest component's length is a tree of its own.
pub(crate) const TREE_SHARE: f64 = 0.1;

struct Component {
    length_mm: f64,
    n_hubs: usize,
    thickest: Hub,
}

/// Keeps what the policy names.
///
/// # Errors
/// [`Error::Components`] if there are several and the policy is to refuse them.
pub(crate) fn select(
    mut graph: Graph,
    params: &Params,
    ledger: &mut Ledger,
    report: &mut Report,
) -> Result<Graph, Error> {
    let mut sets = UnionFind::new(graph.hubs.len());
    for piece in &graph.pieces {
        sets.join(piece.ends[0], piece.ends[1]);
    }
    let mut component_of: Vec<usize> = (0..graph.hubs.len()).map(|hub| sets.find(hub)).collect();
    let components = measure(&graph, &component_of);

    let mut by_length: Vec<usize> = (0..graph.hubs.len()).filter(|&hub| components[hub].is_some()).collect();
    let length = |hub: &usize| components[*hub].as_ref().map_or(0.0, |c| c.length_mm);
    by_length.sort_by(|a, b| length(b).total_cmp(&length(a)).then(a.cmp(b)));
    let kept = by_length[0];
    let Some(second) = by_length.get(1) else { return Ok(graph) };
    if let (Components::Refuse, Some(component)) = (params.components, &components[*second]) {
        return Err(Error::Components {
            n_components: by_length.len(),
            second_mm: component.length_mm,
            position_mm: component.thickest.sample.position_mm,
        });
    }

    let islands: Vec<Island> = by_length[1..]
        .iter()
        .filter_map(|&hub| joinable(hub, components[hub].as_ref()?, length(&kept), params))
        .take(bridges::MAX_ISLANDS)
        .collect();
    let joined = bridges::join(&mut graph, &component_of, kept, &islands, ledger);
    let mut is_kept = vec![false; component_of.len()];
    for component in joined.iter().map(|&(component, _)| component).chain([kept]) {
        is_kept[component] = true;
    }
    if params.components == Components::Join {
        warn_of_long_bridges(&joined, params, report);
    }
    for (hub, component) in by_length.iter().filter_map(|&hub| Some((hub, components[hub].as_ref()?))) {
        if !is_kept[hub] {
            ledger.0.push(dropped(component, length(&kept)));
        }
    }
    // Hubs that bridges added belong to what is kept.
    component_of.resize(graph.hubs.len(), kept);
    Ok(restrict(graph, |hub| is_kept[component_of[hub]]))
}

/// The island that a component is, if the policy may join it.
fn joinable(component: usize, measured: &Component, longest_mm: f64, params: &Params) -> Option<Island> {
    let length_mm = measured.length_mm;
    let max_gap_mm = match params.components {
        Components::Join if length_mm >= TREE_SHARE * longest_mm => f64::INFINITY,
        Components::Join => params.bridge_mm.min(length_mm),
        Components::All => f64::INFINITY,
        Components::Largest | Components::Refuse => return None,
    };
    let spur_mm = (params.prune_factor * measured.thickest.sample.radius_mm).max(params.prune_min_mm);
    (length_mm > spur_mm).then_some(Island { component, length_mm, max_gap_mm })
}

/// An edge over a wide gap is in the picture for the sake of what lies beyond it.
fn warn_of_long_bridges(joined: &[(usize, f64)], params: &Params, report: &mut Report) {
    let long_mm = || joined.iter().map(|&(_, gap_mm)| gap_mm).filter(|&gap_mm| gap_mm > params.bridge_mm);
    if long_mm().next().is_some() {
        let (n_long, longest_mm) = (long_mm().count(), long_mm().fold(0.0, f64::max));
        report.warn(
            "W-TREE-FOREST",
            format!(
                "the mask is a forest: {n_long} more trees are joined to the longest over gaps of up to {longest_mm:.1} mm, where \
                 there is no vessel: topology.tsv has the places; set tree.components = \"largest\" for one tree alone"
            ),
        );
    }
}

fn dropped(component: &Component, kept_mm: f64) -> LedgerEntry {
    LedgerEntry {
        kind: LedgerKind::ComponentDropped,
        position_mm: component.thickest.sample.position_mm,
        radius_mm: component.thickest.sample.radius_mm,
        length_mm: component.length_mm,
        reason: format!(
            "island of {} tips and junctions, {:.3} mm long; the largest component is {kept_mm:.3} mm long",
            component.n_hubs, component.length_mm
        ),
    }
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

/// The part of the graph whose hubs are kept.
fn restrict(graph: Graph, is_kept: impl Fn(usize) -> bool) -> Graph {
    let mut new_index = vec![usize::MAX; graph.hubs.len()];
    let mut hubs = Vec::new();
    for (hub_idx, hub) in graph.hubs.into_iter().enumerate() {
        if is_kept(hub_idx) {
            new_index[hub_idx] = hubs.len();
            hubs.push(hub);
        }
    }
    let pieces = graph
        .pieces
        .into_iter()
        .filter(|piece| is_kept(piece.ends[0]))
        .map(|piece| Piece { ends: piece.ends.map(|end| new_index[end]), ..piece })
        .collect();
    Graph { hubs, pieces }
}
