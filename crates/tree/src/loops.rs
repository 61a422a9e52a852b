//! Loops are opened at their thinnest place.
//!
//! **Input** a connected [`Graph`]. **Output** the same graph without cycles; a ledger entry for each cut.
//! **Steps** 1. The bottleneck of a piece is its smallest radius. 2. Take the pieces by falling bottleneck into a
//! spanning tree; a piece that would close a cycle is the thinnest of that cycle. 3. Cut it between the two
//! neighbouring places with the smallest mean radius; both stubs stay.
//! **Guarantees** a maximum-radius spanning tree: no other choice of cuts leaves a thicker thinnest place on the way
//! between any two hubs.
//! **Why both stubs?** In a true anastomosis both halves are vessel, and the picture should show them; about a hole
//! in a wall the stubs are short and pruning takes them. Cutting a whole branch away would lose the first to
//! be rid of the second.
//! **Cost** O(P log P + N) in pieces and samples.

use espalier_geom::union_find::UnionFind;
use espalier_model::table::fixed;
use espalier_model::{Ledger, LedgerEntry, LedgerKind};

use crate::Error;
use crate::graph::{Graph, Hub, Piece, Sample, polyline_length_mm};
use crate::params::{Loops, Params};

/// Opens every loop; also returns how many there were.
///
/// # Errors
/// [`Error::Loops`] if there are loops and the policy is to refuse them.
pub(crate) fn open(graph: &mut Graph, params: &Params, ledger: &mut Ledger) -> Result<usize, Error> {
    let closing = closing_pieces(graph);
    if let (Loops::Refuse, Some(&first)) = (params.loops, closing.first()) {
        let polyline = graph.polyline(first);
        let place = middle_of_edge(&polyline, thinnest_edge(&polyline));
        return Err(Error::Loops {
            n_loops: closing.len(),
            position_mm: place.position_mm,
            radius_mm: place.radius_mm,
        });
    }

    let mut is_closing = vec![false; graph.pieces.len()];
    for &piece in &closing {
        is_closing[piece] = true;
        let polyline = graph.polyline(piece);
        let edge = thinnest_edge(&polyline);
        let place = middle_of_edge(&polyline, edge);
        // A stub of one sample is 0 mm long, not −0.
        let stubs = [&polyline[..=edge], &polyline[edge + 1..]];
        let [before, after] = stubs.map(|stub| fixed(polyline_length_mm(stub), 3));
        ledger.0.push(LedgerEntry {
            kind: LedgerKind::LoopCut,
            position_mm: place.position_mm,
            radius_mm: place.radius_mm,
            length_mm: polyline[edge].position_mm.distance(polyline[edge + 1].position_mm),
            reason: format!(
                "thinnest place on its loop, radius {:.3} mm; stubs of {before} and {after} mm remain",
                place.radius_mm
            ),
        });
        let ends = graph.pieces[piece].ends;
        add_stub(graph, ends[0], &polyline[1..=edge]);
        let far_side: Vec<Sample> = polyline[edge + 1..polyline.len() - 1].iter().rev().copied().collect();
        add_stub(graph, ends[1], &far_side);
    }
    let mut piece_idx = 0;
    graph.pieces.retain(|_| {
        piece_idx += 1;
        !is_closing.get(piece_idx - 1).copied().unwrap_or(false)
    });
    Ok(closing.len())
}

/// The pieces outside a maximum-radius spanning tree, thickest first.
fn closing_pieces(graph: &Graph) -> Vec<usize> {
    let bottleneck: Vec<f64> = (0..graph.pieces.len())
        .map(|piece| graph.polyline(piece).iter().map(|s| s.radius_mm).fold(f64::INFINITY, f64::min))
        .collect();
    let mut by_bottleneck: Vec<usize> = (0..graph.pieces.len()).collect();
    by_bottleneck.sort_by(|&a, &b| bottleneck[b].total_cmp(&bottleneck[a]).then(a.cmp(&b)));
    let mut sets = UnionFind::new(graph.hubs.len());
    by_bottleneck.retain(|&piece| {
        let [first, last] = graph.pieces[piece].ends;
        !sets.join(first, last)
    });
    by_bottleneck
}

/// The edge (from this index to the next) with the smallest mean radius; of equals, the one nearest the middle.
fn thinnest_edge(polyline: &[Sample]) -> usize {
    let n_edges = polyline.len() - 1;
    let off_middle = |edge: usize| (2 * edge + 1).abs_diff(n_edges);
    let radius = |edge: usize| polyline[edge].radius_mm + polyline[edge + 1].radius_mm;
    (0..n_edges)
        .min_by(|&a, &b| radius(a).total_cmp(&radius(b)).then(off_middle(a).cmp(&off_middle(b))))
        .unwrap_or(0)
}

fn middle_of_edge(polyline: &[Sample], edge: usize) -> Sample {
    let (a, b) = (polyline[edge], polyline[edge + 1]);
    Sample {
        position_mm: a.position_mm.midpoint(b.position_mm),
        radius_mm: 0.5 * (a.radius_mm + b.radius_mm),
    }
}

/// Hangs a stub on a hub: the samples from the hub outwards, the last of which becomes its tip.
fn add_stub(graph: &mut Graph, hub: usize, outwards: &[Sample]) {
    if let Some((&tip, samples)) = outwards.split_last() {
        graph.hubs.push(Hub { sample: tip, is_stub: true, is_at_border: false });
        let last = graph.hubs.len() - 1;
        graph.pieces.push(Piece { ends: [hub, last], samples: samples.to_vec() });
    }
}
