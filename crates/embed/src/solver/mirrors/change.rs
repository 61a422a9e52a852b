//! What a step would change, and taking it.
//!
//! **Input** a `Step`: parts of the tree, each with an isometry. **Output** the change in cost; the state after it.
//! **Steps** 1. The cheap terms: headings from block sums, siblings, zigzags. 2. The conflicts between parts, which
//! go. 3. New conflicts, part against part, the smaller side asking; it ends as soon as the step is too dear.
//! 4. When a step is taken, the largest part stays and the others are carried into its frame: the layout is held up
//! to an isometry of the whole, with a flag if that is a mirror.
//! **Guarantees** conflicts and terms equal those of a layout built from the turns, up to rounding, which `rebuild`
//! takes away.
//! **Cost** see `hierarchy`.

use std::ops::Range;

use espalier_geom::plane::Segment;
use glam::DVec2;

use super::conflicts::Conflict;
use super::isometry::Isometry;
use super::state::{NO_PAIR, State};
use super::step::{NewTurn, Part, Prices, Step};

/// A layout is built anew from its turns after this many steps, so that rounding does not add up.
const STEPS_UNTIL_REBUILT: u32 = 4096;

impl State<'_> {
    /// What a step changes in cost at these prices; `None` if that is more than `limit`.
    pub(super) fn evaluate(&mut self, step: &Step, prices: &Prices, limit: f64) -> Option<f64> {
        let mut change = prices.siblings * step.siblings_rad + prices.zigzags * step.zigzags_rad;
        if prices.placement > 0.0 {
            let before = self.hierarchy.total();
            let mut after = before;
            for part in &step.parts {
                let sums = self.hierarchy.sums(&part.range);
                after = after.minus(&sums).plus(&sums.moved(&part.isometry));
            }
            change += prices.placement * (self.misplacement(&after) - self.misplacement(&before));
        }
        self.find_going(step);
        let list = self.conflicts.list();
        change -= self.going.iter().map(|&pair_idx| prices.of(list[pair_idx].fault)).sum::<f64>();
        if change > limit || self.is_barred(step, prices, (change, limit)) {
            return None;
        }
        let found = self.find_coming(step, prices, (change, limit));
        if found.is_none() {
            self.remember(step);
        }
        found
    }

    /// Whether pairs that were in the way of such steps lately make this one too dear already.
    fn is_barred(&mut self, step: &Step, prices: &Prices, (mut change, limit): (f64, f64)) -> bool {
        let recent = self.recent[step.parts[0].range.start];
        for pair in recent.into_iter().take_while(|pair| *pair != NO_PAIR) {
            let [a, b] = pair.map(|edge| edge as usize);
            let (part_a, part_b) = (step.part_of(a), step.part_of(b));
            if part_a == part_b {
                continue;
            }
            self.walk.n_visits += 1;
            let fault =
                self.setting.fault((a, self.moved(step, (a, part_a))), (b, self.moved(step, (b, part_b))));
            change += fault.map_or(0.0, |fault| prices.of(fault));
            if change > limit {
                return true;
            }
        }
        false
    }

    /// An edge after a step.
    fn moved(&self, step: &Step, (edge, part): (usize, usize)) -> Segment {
        let (a, b) = self.hierarchy.ends[edge];
        match part {
            0 => Segment { a, b },
            part => {
                let isometry = &step.parts[part - 1].isometry;
                Segment { a: isometry.point(a), b: isometry.point(b) }
            }
        }
    }

    /// Keeps the pair that made a step too dear, in place of the oldest.
    fn remember(&mut self, step: &Step) {
        let Some(Conflict { edges, .. }) = self.coming.last() else { return };
        let recent = &mut self.recent[step.parts[0].range.start];
        if !recent.contains(edges) {
            recent.rotate_right(1);
            recent[0] = *edges;
        }
    }

    /// Conflicts between different parts.
    fn find_going(&mut self, step: &Step) {
        self.going.clear();
        let list = self.conflicts.list();
        let n_moving: usize = step.parts.iter().map(|part| part.range.len()).sum();
        // An edge that has no conflict is passed over about eight times as fast as a pair is looked at.
        if list.len() <= n_moving / 8 {
            let is_torn =
                |edges: &[u32; 2]| step.part_of(edges[0] as usize) != step.part_of(edges[1] as usize);
            self.going.extend((0..list.len()).filter(|&pair_idx| is_torn(&list[pair_idx].edges)));
            return;
        }
        for (part, Part { range, .. }) in (1..).zip(&step.parts) {
            for edge in range.clone() {
                self.conflicts.each_of(edge, |pair_idx, other, _| {
                    let of_other = step.part_of(other);
                    // A pair between two moving parts is seen from both.
                    if of_other == 0 || of_other > part {
                        self.going.push(pair_idx);
                    }
                });
            }
        }
        self.going.sort_unstable();
    }

    fn find_coming(&mut self, step: &Step, prices: &Prices, (mut change, limit): (f64, f64)) -> Option<f64> {
        self.coming.clear();
        let n_parts = step.parts.len();
        let n_moving: usize = step.parts.iter().map(|part| part.range.len()).sum();
        let n_edges = self.setting.n_edges();
        let place = |part: usize| match part {
            0 => (n_edges - n_moving, Isometry::IDENTITY),
            part => (step.parts[part - 1].range.len(), step.parts[part - 1].isometry),
        };
        for a in 0..=n_parts {
            for b in a + 1..=n_parts {
                let (moving, fixed) = if place(a).0 < place(b).0 { (a, b) } else { (b, a) };
                let isometry = place(fixed).1.inverse().after(&place(moving).1);
                let (setting, hierarchy, coming) = (self.setting, &self.hierarchy, &mut self.coming);
                let mut visit = |(edge, (start, end)): (usize, (DVec2, DVec2)), other: usize| {
                    let (other_start, other_end) = hierarchy.ends[other];
                    let fault = setting.fault(
                        (edge, Segment { a: start, b: end }),
                        (other, Segment { a: other_start, b: other_end }),
                    );
                    if let Some(fault) = fault {
                        coming.push(Conflict { edges: [edge as u32, other as u32], fault });
                        change += prices.of(fault);
                    }
                    change <= limit
                };
                step.ranges_of(moving, n_edges, &mut self.ranges[0]);
                step.ranges_of(fixed, n_edges, &mut self.ranges[1]);
                let (question, walk) = ((&self.ranges[0][..], &isometry), &mut self.walk);
                if !hierarchy.each_near(question, &self.ranges[1], setting.reach_mm(), walk, &mut visit) {
                    return None;
                }
            }
        }
        Some(change)
    }

    /// Takes the step that was evaluated last.
    pub(super) fn take(&mut self, step: &Step) {
        self.conflicts.remove_all(&self.going);
        self.coming.drain(..).for_each(|conflict| self.conflicts.insert(conflict));
        self.siblings_rad += step.siblings_rad;
        self.zigzags_rad += step.zigzags_rad;

        let n_edges = self.setting.n_edges();
        let n_moving: usize = step.parts.iter().map(|part| part.range.len()).sum();
        let (mut staying, mut most) = (0, n_edges - n_moving);
        for (part, Part { range, .. }) in (1..).zip(&step.parts) {
            if range.len() > most {
                (staying, most) = (part, range.len());
            }
        }
        let place = |part: usize| if part == 0 { Isometry::IDENTITY } else { step.parts[part - 1].isometry };
        let into_frame = place(staying).inverse();
        let edge_turns = self.turns_across(step, into_frame.is_mirror);
        // Moving an edge takes a third of the time of a pair of blocks.
        self.walk.n_visits += (n_edges - most) as u64 / 3;
        let mut ranges = std::mem::take(&mut self.ranges[0]);
        for part in (0..=step.parts.len()).filter(|&part| part != staying) {
            let isometry = into_frame.after(&place(part));
            step.ranges_of(part, n_edges, &mut ranges);
            ranges.iter().for_each(|range| self.carry(range, &isometry));
        }
        step.parts.iter().for_each(|part| self.hierarchy.mend(&part.range));
        self.ranges[0] = ranges;
        for NewTurn { node, turn_rad, side } in edge_turns {
            (self.turn_rad[node], self.side[node]) = (turn_rad, side);
        }
        self.is_mirrored ^= into_frame.is_mirror;
        self.n_steps += 1;
        if self.n_steps.is_multiple_of(STEPS_UNTIL_REBUILT) {
            self.rebuild();
        }
    }

    /// The turns of nodes whose parents are in other parts, after the step, in the new frame.
    fn turns_across(&self, step: &Step, is_mirror: bool) -> Vec<NewTurn> {
        let sign = if is_mirror { -1.0 } else { 1.0 };
        let mut turns = Vec::new();
        for Part { range, .. } in &step.parts {
            let mut node = range.start;
            while node < range.end {
                let (turn_rad, side) = (sign * self.turn_rad[node], sign * self.side[node]);
                turns.push(NewTurn { node, turn_rad, side });
                node = self.setting.subtree(node).end;
            }
        }
        for &NewTurn { node, turn_rad, side } in &step.turns {
            turns.push(NewTurn { node, turn_rad: sign * turn_rad, side: sign * side });
        }
        turns
    }

    fn carry(&mut self, range: &Range<usize>, isometry: &Isometry) {
        self.hierarchy.carry(range, isometry);
        let nodes = range.start..range.end.min(self.setting.n_nodes());
        for direction in &mut self.direction[nodes.clone()] {
            *direction = isometry.direction(*direction);
        }
        if isometry.is_mirror {
            self.turn_rad[nodes.clone()].iter_mut().for_each(|turn| *turn = -*turn);
            self.side[nodes].iter_mut().for_each(|side| *side = -*side);
        }
    }
}
