//! Islands joined to the tree over short gaps.
//!
//! Segmentations lose thin or poorly filled stretches of a vessel, and what lies beyond becomes an island.
//!
//! **Input** the graph, the component of each hub, the islands that may be joined with the widest gap that each may
//! have. **Output** the bridges.
//! **Notation** the *gap* between two places is the distance of their spheres' surfaces, 0 if they meet.
//! **Steps** As in Prim's spanning tree: of all islands take the one with the least gap to what the tree is by now, from
//! any of its tips and junctions to any place of the tree; join it if the gap is allowed; look from its own
//! places at the islands that are left. Ties go to the lower hub and the earlier place.
//! **Why from tips and junctions only?** A vessel goes on where it ends. An island alongside a vessel has its ends there,
//! too.
//! **Guarantees** joining makes no loop: every island gets one bridge.
//! **Cost** O(samples · log² samples + islands · their hubs · log samples), for at most [`MAX_ISLANDS`] islands.

use espalier_model::{Ledger, LedgerEntry, LedgerKind};

use crate::graph::{Graph, Hub, Piece, Sample};
use crate::nearest::NearestSphere;

/// The most islands that are looked at, the longest first: real forests have hundreds, noise has any number.
pub(crate) const MAX_ISLANDS: usize = 1000;

/// A place on the graph.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Hub(usize),
    /// A sample of a piece by its index among those between the ends.
    Between(usize, usize),
}

/// A bridge from a place on the tree to a hub of an island.
#[derive(Clone, Copy, Debug)]
struct Bridge {
    place: Place,
    hub: usize,
}

/// An island that may be joined.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Island {
    /// Its component.
    pub(crate) component: usize,
    /// Its length in mm.
    pub(crate) length_mm: f64,
    /// The widest gap that may be bridged to it, in mm.
    pub(crate) max_gap_mm: f64,
}

/// The nearest place of the tree to a hub of an island.
#[derive(Clone, Copy)]
struct Nearest {
    gap_mm: f64,
    place: Place,
    sample: Sample,
}

/// Joins the islands that can be to the component `tree`; returns those that were, each with its gap in mm.
pub(crate) fn join(
    graph: &mut Graph,
    component_of: &[usize],
    tree: usize,
    islands: &[Island],
    ledger: &mut Ledger,
) -> Vec<(usize, f64)> {
    let places = places_by_component(graph, component_of);
    let mut nearest: Vec<Option<Nearest>> = vec![None; graph.hubs.len()];
    let mut left: Vec<(Island, Vec<usize>)> =
        islands.iter().map(|island| (*island, hubs_of(&places[island.component]))).collect();
    let (mut bridges, mut joined, mut newest) = (Vec::new(), Vec::new(), tree);
    loop {
        let newcomers = NearestSphere::of(places[newest].iter().map(|&(_, sample)| sample));
        for &hub in left.iter().flat_map(|(_, hubs)| hubs) {
            let least_mm = nearest[hub].map_or(f64::INFINITY, |nearest| nearest.gap_mm);
            if let Some((index, gap_mm)) = newcomers.look(graph.hubs[hub].sample, least_mm) {
                let (place, sample) = places[newest][index];
                nearest[hub] = Some(Nearest { gap_mm, place, sample });
            }
        }
        // The island with the least gap, and the hub that has it.
        let mut best: Option<(f64, usize, usize)> = None;
        for (i, (island, hubs)) in left.iter().enumerate() {
            for &hub in hubs {
                let gap_mm = nearest[hub].map_or(f64::INFINITY, |nearest| nearest.gap_mm);
                let is_better = best.is_none_or(|(least, _, first)| (gap_mm, hub) < (least, first));
                if gap_mm <= island.max_gap_mm && is_better {
                    best = Some((gap_mm, i, hub));
                }
            }
        }
        let Some((gap_mm, i, hub)) = best else { break };
        let (island, _) = left.swap_remove(i);
        if let Some(nearest) = nearest[hub] {
            ledger.0.push(entry(&island, graph.hubs[hub].sample, &nearest));
            bridges.push(Bridge { place: nearest.place, hub });
        }
        newest = island.component;
        joined.push((newest, gap_mm));
    }
    build(graph, &bridges);
    joined
}

/// All places of each component, hubs first.
fn places_by_component(graph: &Graph, component_of: &[usize]) -> Vec<Vec<(Place, Sample)>> {
    let mut places = vec![Vec::new(); graph.hubs.len()];
    for (hub_idx, hub) in graph.hubs.iter().enumerate() {
        places[component_of[hub_idx]].push((Place::Hub(hub_idx), hub.sample));
    }
    for (piece_idx, piece) in graph.pieces.iter().enumerate() {
        let component = component_of[piece.ends[0]];
        let samples = piece.samples.iter().enumerate();
        places[component].extend(samples.map(|(i, &sample)| (Place::Between(piece_idx, i), sample)));
    }
    places
}

/// The hubs among the places of a component.
fn hubs_of(places: &[(Place, Sample)]) -> Vec<usize> {
    let hub = |&(place, _): &(Place, Sample)| match place {
        Place::Hub(hub) => Some(hub),
        Place::Between(..) => None,
    };
    places.iter().map_while(hub).collect()
}

fn entry(island: &Island, from: Sample, nearest: &Nearest) -> LedgerEntry {
    let to = nearest.sample;
    let allowed = match island.max_gap_mm {
        f64::INFINITY => "any was allowed".to_owned(),
        max_gap_mm => format!("up to {max_gap_mm:.3} mm were allowed"),
    };
    LedgerEntry {
        kind: LedgerKind::GapBridged,
        position_mm: from.position_mm.midpoint(to.position_mm),
        radius_mm: 0.5 * (from.radius_mm + to.radius_mm),
        length_mm: from.position_mm.distance(to.position_mm),
        reason: format!(
            "island of {:.3} mm joined over a gap of {:.3} mm between surfaces; {allowed}",
            island.length_mm, nearest.gap_mm
        ),
    }
}

/// Adds the bridges as pieces, splitting those on which they stand.
fn build(graph: &mut Graph, bridges: &[Bridge]) {
    // The hub of each place that gets a bridge, by piece and sample.
    let mut splits: Vec<(usize, usize)> = bridges
        .iter()
        .filter_map(|bridge| match bridge.place {
            Place::Between(piece, sample) => Some((piece, sample)),
            Place::Hub(_) => None,
        })
        .collect();
    splits.sort_unstable();
    splits.dedup();
    let first_hub = graph.hubs.len();
    for &(piece, sample) in &splits {
        let sample = graph.pieces[piece].samples[sample];
        graph.hubs.push(Hub { sample, is_stub: false, is_at_border: false });
    }
    for bridge in bridges {
        let start = match bridge.place {
            Place::Hub(hub) => hub,
            Place::Between(piece, sample) => {
                first_hub + splits.binary_search(&(piece, sample)).unwrap_or_default()
            }
        };
        graph.pieces.push(Piece { ends: [start, bridge.hub], samples: Vec::new() });
    }
    // From the last split of a piece to its first: what lies beyond becomes a piece of its own.
    for (i, &(piece, sample)) in splits.iter().enumerate().rev() {
        let hub = first_hub + i;
        let whole = &mut graph.pieces[piece];
        let beyond = whole.samples.split_off(sample + 1);
        whole.samples.pop();
        let end = std::mem::replace(&mut whole.ends[1], hub);
        graph.pieces.push(Piece { ends: [hub, end], samples: beyond });
    }
}
