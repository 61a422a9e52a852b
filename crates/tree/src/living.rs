//! A tree of pieces while branches are taken from it.
//!
//! A *run* is what a branch is at the moment: the pieces between two hubs that are tips or forks now. When a fork
//! loses all but two of its pieces, it dissolves and its two runs become one; that is a union of sets, so even a comb
//! of very many teeth is pruned in nearly linear time.

use espalier_geom::union_find::UnionFind;

use crate::graph::{Graph, Sample};

/// The pieces between two hubs that are tips or forks now.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    /// The hubs at its ends.
    pub(crate) ends: [usize; 2],
    /// Its length in mm.
    pub(crate) length_mm: f64,
}

/// A graph without cycles of which pieces can be removed.
pub(crate) struct Living<'g> {
    /// The graph.
    pub(crate) graph: &'g Graph,
    incident: Vec<Vec<usize>>,
    is_live: Vec<bool>,
    degree: Vec<usize>,
    sets: UnionFind,
    runs: Vec<Run>,
}

impl<'g> Living<'g> {
    /// All of a graph without cycles.
    pub(crate) fn new(graph: &'g Graph) -> Self {
        let incident = graph.incidence();
        let runs = graph
            .pieces
            .iter()
            .enumerate()
            .map(|(piece_idx, piece)| Run { ends: piece.ends, length_mm: graph.length_mm(piece_idx) })
            .collect();
        let mut living = Self {
            graph,
            is_live: vec![true; graph.pieces.len()],
            degree: incident.iter().map(Vec::len).collect(),
            incident,
            sets: UnionFind::new(graph.pieces.len()),
            runs,
        };
        for hub in 0..graph.hubs.len() {
            living.dissolve_if_passed_through(hub);
        }
        living
    }

    /// How many pieces meet at a hub now.
    pub(crate) fn degree(&self, hub: usize) -> usize {
        self.degree[hub]
    }

    /// The hubs that are tips now, ascending. A tree without pieces has one tip, its only hub.
    pub(crate) fn tips(&self) -> Vec<usize> {
        let is_tip = |hub: &usize| self.degree[*hub] == 1 || self.graph.hubs.len() == 1;
        (0..self.graph.hubs.len()).filter(is_tip).collect()
    }

    /// The pieces at a hub now, ascending.
    pub(crate) fn pieces_at(&self, hub: usize) -> impl Iterator<Item = usize> + '_ {
        self.incident[hub].iter().copied().filter(|&piece| self.is_live[piece])
    }

    /// The run of the first piece at a hub: the only run at a tip, or at a dissolved fork.
    pub(crate) fn run_through(&mut self, hub: usize) -> Option<Run> {
        let piece = self.pieces_at(hub).next()?;
        Some(self.runs[self.sets.find(piece)])
    }

    /// The run at a tip, and the hub at its other end.
    pub(crate) fn run_at_tip(&mut self, tip: usize) -> Option<(Run, usize)> {
        let run = self.run_through(tip)?;
        let [first, last] = run.ends;
        Some((run, if first == tip { last } else { first }))
    }

    /// A name for the run that a piece is part of, the same for all of its pieces now; `None` if the piece was removed.
    pub(crate) fn run_of(&mut self, piece: usize) -> Option<usize> {
        if self.is_live[piece] { Some(self.sets.find(piece)) } else { None }
    }

    /// The samples of a piece as met when coming from `hub`, both ends included, and the hub at the other end.
    pub(crate) fn polyline_from(&self, hub: usize, piece: usize) -> (Vec<Sample>, usize) {
        let mut polyline = self.graph.polyline(piece);
        let [first, last] = self.graph.pieces[piece].ends;
        if first == hub {
            return (polyline, last);
        }
        polyline.reverse();
        (polyline, first)
    }

    /// The samples from `hub` over `piece` to the next hub that is a tip or a fork now; that hub, and the
    /// last piece before it.
    pub(crate) fn branch_from(&self, hub: usize, piece: usize) -> (Vec<Sample>, usize, usize) {
        let (mut polyline, mut end) = self.polyline_from(hub, piece);
        let mut last_piece = piece;
        while self.degree[end] == 2 {
            let Some(onwards) = self.pieces_at(end).find(|&p| p != last_piece) else { break };
            let (further, next) = self.polyline_from(end, onwards);
            polyline.extend_from_slice(&further[1..]);
            (last_piece, end) = (onwards, next);
        }
        (polyline, end, last_piece)
    }

    /// Takes away the run that ends at `tip`; the hub at its other end stays, and dissolves if only two pieces are
    /// left there. Returns that hub.
    pub(crate) fn remove_at_tip(&mut self, tip: usize) -> Option<usize> {
        let (_, fork) = self.run_at_tip(tip)?;
        let mut hub = tip;
        while hub != fork {
            let piece = self.pieces_at(hub).next()?;
            let [first, last] = self.graph.pieces[piece].ends;
            self.is_live[piece] = false;
            self.degree[first] -= 1;
            self.degree[last] -= 1;
            hub = if first == hub { last } else { first };
        }
        self.dissolve_if_passed_through(fork);
        Some(fork)
    }

    fn dissolve_if_passed_through(&mut self, hub: usize) {
        if self.degree[hub] != 2 {
            return;
        }
        let pieces: Vec<usize> = self.pieces_at(hub).collect();
        let &[p, q] = pieces.as_slice() else { return };
        let (p, q) = (self.sets.find(p), self.sets.find(q));
        let far_end = |run: Run| if run.ends[0] == hub { run.ends[1] } else { run.ends[0] };
        let joined = Run {
            ends: [far_end(self.runs[p]), far_end(self.runs[q])],
            length_mm: self.runs[p].length_mm + self.runs[q].length_mm,
        };
        self.sets.join(p, q);
        let whole = self.sets.find(p);
        self.runs[whole] = joined;
    }
}
