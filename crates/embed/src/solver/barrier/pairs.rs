//! The pairs of edges that may be near each other, kept while nothing moves far.
//!
//! **Input** positions, and a rule of what each pair has to keep. **Output** flat lists of pairs; the pairs that meet.
//! **Notation** skin: how far a node may move before the list is made anew.
//! **Steps** 1. Edges in order of their parents, eight to a run; a box around each edge, as thick as the rule says and
//! grown by half the rule's reach and the skin; boxes around runs, and around those two by two. 2. Pairs of boxes that
//! meet, from the large to the small; then edges against eight edges at a time, then edge against edge. Pairs that are
//! listed are pushed apart at once, since their nearest points are known. 3. Siblings stand next to each other, and two
//! runs of the same siblings pass each other at once: a star of 10,000 is no worse than a chain. 4. Where edges meet no
//! list is made: a search as wide as the floors finds which.
//! **Guarantees** every pair within the rule's reach is listed until a node has moved by more than the skin; the
//! order of the list depends on positions only.
//! Why not a grid? One with cells as wide as the reach took a third of the time of a whole embedding of an airway of 4099
//! nodes, most of it for finding pairs several times; boxes take half of that.
//! **Cost** O(N log N + pairs of runs that are near) to make; no allocation after the arrays have grown.

use glam::DVec2;
use rayon::prelude::*;

use super::super::work::Work;
use super::contact::{Contact, Ends, Push, are_apart};
use crate::problem::Problem;
use crate::runs::{Lanes, MIXED, RUN, UprightBox, is_same_fan};

/// The skin as a share of the reach. A wider one lists more pairs and is left as soon where whole subtrees turn: on an
/// airway of 4099 nodes the first relaxing takes 575 million units of work at .35, 445 at .15, 389 at .05.
const SKIN_SHARE: f64 = 0.05;
/// More pairs than this for each edge are not listed: the reach is halved instead, so that memory is bounded.
const MOST_PAIRS_PER_EDGE: usize = 60;
/// Runs whose neighbours are looked up together, at most: a power of two.
const RUNS_PER_CHUNK: usize = 256;
/// Pairs that one thread pushes at once.
const PAIRS_PER_CHUNK: usize = 4096;

/// What two edges have to keep: the barrier is infinite at `floor_mm` and ends at `floor_mm + width_mm`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    pub(crate) floor_mm: f64,
    pub(crate) width_mm: f64,
}

/// A rule of what pairs of edges have to keep.
pub(crate) trait Spacing: Sync {
    /// Half the width of an edge, in mm; 0 if only its centreline matters.
    fn thickness_mm(&self, edge: usize) -> f64;
    /// The most that any pair's bounds end beyond the two thicknesses, in mm.
    fn reach_mm(&self) -> f64;
    /// The most that any pair's floor is beyond the two thicknesses, in mm.
    fn floor_reach_mm(&self) -> f64;
    /// Halves the reach; false if it is as short as the rule allows.
    fn halve_reach(&mut self) -> bool;
    /// What edges a < b have to keep, if anything; nothing if they have a common node.
    fn bounds(&self, a: usize, b: usize) -> Option<Bounds>;
}

/// A pair of edges, the first above the second in preorder, with what it has to keep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    pub(super) first: u32,
    pub(super) second: u32,
    pub(super) bounds: Bounds,
}

/// The list.
#[derive(Default)]
pub(super) struct PairList {
    pub(super) pairs: Vec<Pair>,
    /// What the barrier does to each pair, at the places for which that was asked last.
    pub(super) pushes: Vec<Push>,
    /// Where the nodes were when the list was made.
    anchors: Vec<DVec2>,
    skin_mm: f64,
    /// Edges in order of their parents; eight at a time are a run.
    order: Vec<u32>,
    /// For each run the node from which all its edges come, or `MIXED`.
    hubs: Vec<u32>,
    lanes: Vec<Lanes>,
    /// Boxes over runs, two by two: box b holds the boxes 2b and 2b + 1, the last ones are those of runs.
    boxes: Vec<UprightBox>,
    chunks: Vec<Chunk>,
}

/// What the runs of one chunk found.
#[derive(Default)]
struct Chunk {
    pairs: Vec<Pair>,
    pushes: Vec<Push>,
    stack: Vec<(u32, u32)>,
    n_looked: usize,
}

impl PairList {
    pub(super) fn new(problem: &Problem) -> Self {
        let mut order: Vec<u32> = (1..problem.n_nodes() as u32).collect();
        order.sort_by_key(|&node| (problem.parent[node as usize], node));
        let hub = |run: &[u32]| {
            let hub = problem.parent[run[0] as usize];
            if run.iter().all(|&edge| problem.parent[edge as usize] == hub) { hub } else { MIXED }
        };
        let hubs: Vec<u32> = order.chunks(RUN).map(hub).collect();
        let lanes = vec![Lanes::EMPTY; hubs.len()];
        let boxes = vec![UprightBox::EMPTY; 2 * hubs.len().next_power_of_two()];
        Self { order, hubs, lanes, boxes, ..Self::default() }
    }

    #[cfg(test)]
    pub(super) fn skin_mm(&self) -> f64 {
        self.skin_mm
    }

    /// Whether a node has left its place by more than the skin.
    pub(super) fn is_stale(&self, positions: &[DVec2]) -> bool {
        let most = self.skin_mm * self.skin_mm;
        self.anchors.len() != positions.len()
            || self.anchors.iter().zip(positions).any(|(a, p)| a.distance_squared(*p) > most)
    }

    /// Pushes the listed pairs apart where they are now.
    pub(super) fn push(&mut self, ends: impl Fn(&Pair) -> Ends + Sync) {
        self.pushes.resize(self.pairs.len(), Push::NONE);
        let pushes = self.pushes.par_iter_mut().with_min_len(PAIRS_PER_CHUNK);
        pushes.zip(&self.pairs).for_each(|(push, pair)| *push = Push::between(ends(pair), &pair.bounds));
    }

    /// Makes the list for the places of now, and pushes its pairs apart there.
    pub(super) fn rebuild(
        &mut self,
        problem: &Problem,
        spacing: &mut impl Spacing,
        positions: &[DVec2],
        work: &mut Work,
    ) {
        self.anchors.clear();
        self.anchors.extend_from_slice(positions);
        let mut most_pairs = MOST_PAIRS_PER_EDGE * problem.n_nodes();
        loop {
            self.skin_mm = SKIN_SHARE * spacing.reach_mm();
            let slack_mm = 2.0 * self.skin_mm;
            let reach_mm = spacing.reach_mm() + slack_mm;
            let search = Search {
                problem,
                spacing: &*spacing,
                positions,
                reach_mm,
                wanted: Wanted::Near { slack_mm },
            };
            self.fit_boxes(&search);
            if self.look(&search, most_pairs, work) {
                self.collect();
                return;
            }
            if !spacing.halve_reach() {
                most_pairs = usize::MAX;
            }
        }
    }

    /// Pairs of edges that are not above their floors, all of them unless they are very many; the list stays.
    pub(super) fn find_met(
        &mut self,
        (problem, spacing, positions): (&Problem, &impl Spacing, &[DVec2]),
        met: &mut Vec<(u32, u32)>,
        work: &mut Work,
    ) {
        let reach_mm = spacing.floor_reach_mm() * (1.0 + 1e-9);
        let search = Search { problem, spacing, positions, reach_mm, wanted: Wanted::Met };
        self.fit_boxes(&search);
        self.look(&search, MOST_PAIRS_PER_EDGE * problem.n_nodes(), work);
        met.extend(self.chunks.iter().flat_map(|chunk| &chunk.pairs).map(|pair| (pair.first, pair.second)));
    }

    /// Boxes of edges, runs and all above them.
    fn fit_boxes<S: Spacing>(&mut self, search: &Search<S>) {
        let first_leaf = self.boxes.len() / 2;
        for (run, edges) in self.order.chunks(RUN).enumerate() {
            let mut all = UprightBox::EMPTY;
            for (lane, &edge) in edges.iter().enumerate() {
                let bounds = search.bounds_of(edge as usize);
                self.lanes[run].set(lane, bounds);
                all = all.joined(&bounds);
            }
            self.boxes[first_leaf + run] = all;
        }
        for idx in (1..first_leaf).rev() {
            self.boxes[idx] = self.boxes[2 * idx].joined(&self.boxes[2 * idx + 1]);
        }
    }

    /// Finds the pairs, chunk by chunk; false if there are more than `most_pairs`.
    fn look<S: Spacing>(&mut self, search: &Search<S>, most_pairs: usize, work: &mut Work) -> bool {
        let Self { chunks, order, hubs, lanes, boxes, .. } = self;
        let runs = Runs { order, hubs, lanes, boxes };
        // A chunk is what one box at some height holds.
        let (n_leaves, n_chunks) = (boxes.len() / 2, (boxes.len() / 2).div_ceil(RUNS_PER_CHUNK));
        chunks.resize_with(n_chunks.min(hubs.len().div_ceil(n_leaves / n_chunks)), Chunk::default);
        chunks.par_iter_mut().enumerate().for_each(|(idx, chunk)| {
            chunk.collect(search, &runs, (n_chunks + idx, 2 * n_chunks, most_pairs));
        });
        work.spend(search.positions.len() + chunks.iter().map(|chunk| chunk.n_looked).sum::<usize>());
        chunks.iter().map(|chunk| chunk.pairs.len()).sum::<usize>() <= most_pairs
    }

    /// Makes the list of what was found.
    fn collect(&mut self) {
        self.pairs.clear();
        self.pushes.clear();
        for chunk in &self.chunks {
            self.pairs.extend_from_slice(&chunk.pairs);
            self.pushes.extend_from_slice(&chunk.pushes);
        }
    }
}

/// The boxes as they are read.
struct Runs<'a> {
    order: &'a [u32],
    hubs: &'a [u32],
    lanes: &'a [Lanes],
    boxes: &'a [UprightBox],
}

impl Chunk {
    /// The pairs of what is in one box, with itself and with the boxes after it at the same height.
    fn collect<S: Spacing>(
        &mut self,
        search: &Search<S>,
        runs: &Runs,
        (own, end, most_pairs): (usize, usize, usize),
    ) {
        self.pairs.clear();
        self.pushes.clear();
        self.n_looked = 0;
        for later in own..end {
            self.stack.push((own as u32, later as u32));
            while let Some((a, b)) = self.stack.pop() {
                self.n_looked += 1;
                if self.pairs.len() <= most_pairs {
                    self.open(search, runs, (a as usize, b as usize));
                }
            }
        }
    }

    /// Looks into two boxes of one height, or into one, if they meet.
    fn open<S: Spacing>(&mut self, search: &Search<S>, runs: &Runs, (a, b): (usize, usize)) {
        let first_leaf = runs.boxes.len() / 2;
        if !runs.boxes[a].meets(&runs.boxes[b]) {
            return;
        }
        if a >= first_leaf {
            self.pair_runs(search, runs, (a - first_leaf, b - first_leaf));
            return;
        }
        let (low, high, other_low, other_high) =
            (2 * a as u32, 2 * a as u32 + 1, 2 * b as u32, 2 * b as u32 + 1);
        self.stack.extend([(high, other_high), (low, other_high), (low, other_low)]);
        if a != b {
            self.stack.push((high, other_low));
        }
    }

    fn pair_runs<S: Spacing>(&mut self, search: &Search<S>, runs: &Runs, (run, later): (usize, usize)) {
        if is_same_fan(runs.hubs[run], runs.hubs[later]) {
            return;
        }
        let (lanes, later_lanes) = (&runs.lanes[run], &runs.lanes[later]);
        let mut reaching = lanes.meeting(runs.boxes[runs.boxes.len() / 2 + later]);
        while reaching != 0 {
            let lane = reaching.trailing_zeros() as usize;
            reaching &= reaching - 1;
            // Within a run only lanes after this one.
            let after = if run == later { !1 << lane } else { u32::MAX };
            let mut met = later_lanes.meeting(lanes.get(lane)) & after;
            self.n_looked += 1;
            while met != 0 {
                let other = later * RUN + met.trailing_zeros() as usize;
                met &= met - 1;
                self.n_looked += 1;
                if let Some((pair, contact)) = search.pair(runs.order[run * RUN + lane], runs.order[other]) {
                    self.pairs.push(pair);
                    self.pushes.push(Push::of(&contact, &pair.bounds));
                }
            }
        }
    }
}

/// What one search looks at.
struct Search<'a, S> {
    problem: &'a Problem<'a>,
    spacing: &'a S,
    positions: &'a [DVec2],
    /// Pairs farther apart than this beyond their thicknesses are of no interest.
    reach_mm: f64,
    wanted: Wanted,
}

/// Which pairs a search is for.
#[derive(Clone, Copy)]
enum Wanted {
    /// Those that come within their bounds if they come nearer by this.
    Near { slack_mm: f64 },
    /// Those that are not above their floors.
    Met,
}

impl<S: Spacing> Search<'_, S> {
    fn ends(&self, edge: usize) -> (DVec2, DVec2) {
        (self.positions[self.problem.parent[edge] as usize], self.positions[edge])
    }

    /// A box such that boxes of edges meet that are within reach.
    fn bounds_of(&self, edge: usize) -> UprightBox {
        let per_mm = 1.0 / self.problem.scale_mm;
        let margin_mm = self.spacing.thickness_mm(edge) + 0.5 * self.reach_mm;
        let (a, b) = self.ends(edge);
        let (a, b) = (a * per_mm, b * per_mm);
        UprightBox::around((a.x, a.y), (b.x, b.y), margin_mm * per_mm)
    }

    /// The pair of two edges, if it is wanted.
    fn pair(&self, edge: u32, other: u32) -> Option<(Pair, Contact)> {
        let (first, second) = (edge.min(other), edge.max(other));
        let (a, b) = (first as usize, second as usize);
        let parent = self.problem.parent[b];
        if parent == first || parent == self.problem.parent[a] {
            return None;
        }
        let (p, q) = (self.ends(a), self.ends(b));
        let thick_mm = self.spacing.thickness_mm(a) + self.spacing.thickness_mm(b);
        if are_apart(p, q, thick_mm + self.reach_mm) {
            return None;
        }
        let contact = Contact::between(p, q);
        if contact.distance >= thick_mm + self.reach_mm {
            return None;
        }
        let bounds = self.spacing.bounds(a, b)?;
        let is_wanted = match self.wanted {
            Wanted::Near { slack_mm } => contact.distance < bounds.floor_mm + bounds.width_mm + slack_mm,
            Wanted::Met => contact.distance <= bounds.floor_mm,
        };
        is_wanted.then_some((Pair { first, second, bounds }, contact))
    }
}
