//! The layout during the search: exact lengths, exact bends, and a side for each turn.
//!
//! **Input** a `Step`: parts of the tree, each with an isometry. **Output** what it would change; the state after it.
//! **Notation** a part is a range of the preorder; part 0 is all that is in no other part, and does not move.
//! **Steps** 1. The cheap terms: headings from block sums, siblings, zigzags. 2. The conflicts between parts, which
//! go. 3. New conflicts, part against part, the smaller side asking; it ends as soon as the step is too dear.
//! 4. When a step is taken, the largest part stays and the others are carried into its frame: the layout is held up
//! to an isometry of the whole, with a flag if that is a mirror.
//! **Guarantees** conflicts and terms equal those of a layout built from the turns, up to rounding, which `rebuild`
//! takes away.
//! **Cost** see `hierarchy`.

use std::ops::Range;
use std::slice::from_ref;

use espalier_geom::math;
use espalier_geom::plane::Segment;
use glam::DVec2;

use super::conflicts::{Conflict, Conflicts, Fault};
use super::hierarchy::{HeadingSums, Hierarchy, Walk};
use super::isometry::Isometry;
use super::setting::{N_RAYS, Setting};

/// How far behind the root's edge a ray of the keep-out stands, in rad.
const RAY_RAD: f64 = 2.0 * std::f64::consts::PI / 3.0;
/// The length of those rays as a multiple of the tree's radius.
const RAY_LENGTH: f64 = 1.5;
/// A layout is built anew from its turns after this many steps, so that rounding does not add up.
const STEPS_UNTIL_REBUILT: u32 = 4096;

/// How many pairs that were in the way are kept for each node.
const N_RECENT: usize = 4;
/// No pair.
const NO_PAIR: [u32; 2] = [0; 2];

/// A part of the tree and where it goes.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) range: Range<usize>,
    pub(super) isometry: Isometry,
}

/// The new turn of a node whose parent is in another part.
#[derive(Clone, Debug)]
pub(super) struct NewTurn {
    pub(super) node: usize,
    pub(super) turn_rad: f64,
    pub(super) side: f64,
}

/// A change of sides.
#[derive(Clone, Debug, Default)]
pub(super) struct Step {
    pub(super) parts: Vec<Part>,
    pub(super) turns: Vec<NewTurn>,
    /// By how much the sibling error grows.
    pub(super) siblings_rad: f64,
    /// By how much the zigzags grow.
    pub(super) zigzags_rad: f64,
}

impl Step {
    pub(super) fn clear(&mut self) {
        self.parts.clear();
        self.turns.clear();
        (self.siblings_rad, self.zigzags_rad) = (0.0, 0.0);
    }

    /// The part of an edge.
    pub(super) fn part_of(&self, edge: usize) -> usize {
        self.parts.iter().position(|part| part.range.contains(&edge)).map_or(0, |idx| idx + 1)
    }

    /// The ranges of a part.
    fn ranges_of(&self, part: usize, n_edges: usize, ranges: &mut Vec<Range<usize>>) {
        ranges.clear();
        if part > 0 {
            ranges.push(self.parts[part - 1].range.clone());
            return;
        }
        let mut start = 0;
        for Part { range, .. } in &self.parts {
            ranges.push(start..range.start);
            start = range.end;
        }
        ranges.push(start..n_edges);
    }
}

/// What a layout costs beside its crossings, part by part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Terms {
    pub(crate) crossings: usize,
    pub(crate) near: usize,
    pub(crate) kept_out: usize,
    /// 1 − |Σ p e^{i(h − H)}|, in [0, 1].
    pub(crate) placement: f64,
    pub(crate) siblings_rad: f64,
    pub(crate) zigzags_rad: f64,
}

/// The price of each term; a crossing costs 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prices {
    pub(super) near: f64,
    pub(super) kept_out: f64,
    pub(super) placement: f64,
    pub(super) siblings: f64,
    pub(super) zigzags: f64,
}

impl Prices {
    fn of(&self, fault: Fault) -> f64 {
        match fault {
            Fault::Crossing => 1.0,
            Fault::Near => self.near,
            Fault::KeepOut => self.kept_out,
        }
    }

    pub(super) fn cost(&self, terms: &Terms) -> f64 {
        terms.crossings as f64
            + self.near * terms.near as f64
            + self.kept_out * terms.kept_out as f64
            + self.placement * terms.placement
            + self.siblings * terms.siblings_rad
            + self.zigzags * terms.zigzags_rad
    }
}

/// Sides to come back to.
#[derive(Clone)]
pub(super) struct Saved {
    turn_rad: Vec<f64>,
    side: Vec<f64>,
    is_mirrored: bool,
}

/// A layout with its conflicts.
#[derive(Clone)]
pub(super) struct State<'s> {
    pub(super) setting: &'s Setting<'s>,
    /// The turn of each node's edge against its parent's; that of a child of the root against direction 0.
    pub(super) turn_rad: Vec<f64>,
    /// The side of each turn; a turn has another sign only where siblings were moved apart.
    pub(super) side: Vec<f64>,
    /// The direction of each edge.
    pub(super) direction: Vec<DVec2>,
    pub(super) hierarchy: Hierarchy,
    pub(super) conflicts: Conflicts,
    /// Whether all of the above is the mirror image of the layout that is meant.
    is_mirrored: bool,
    siblings_rad: f64,
    zigzags_rad: f64,
    n_steps: u32,
    pub(super) walk: Walk,
    /// Of the last evaluation: conflicts that go, by index, and conflicts that come.
    going: Vec<usize>,
    coming: Vec<Conflict>,
    /// For the first node of a step, pairs of edges that made such steps too dear lately.
    recent: Vec<[[u32; 2]; N_RECENT]>,
    /// Memory for the ranges of two parts.
    ranges: [Vec<Range<usize>>; 2],
}

impl<'s> State<'s> {
    /// The layout of the given targets.
    pub(super) fn new(setting: &'s Setting<'s>) -> Self {
        let targets = &setting.problem.targets;
        let turn = |node: usize| if node == 0 { 0.0 } else { targets.angle_rad[node] - std::f64::consts::PI };
        let mut state = Self {
            setting,
            turn_rad: (0..setting.n_nodes()).map(turn).collect(),
            side: setting.first_side.clone(),
            direction: vec![DVec2::X; setting.n_nodes()],
            hierarchy: Hierarchy::new(setting.n_edges()),
            conflicts: Conflicts::new(setting.n_edges()),
            is_mirrored: false,
            siblings_rad: 0.0,
            zigzags_rad: 0.0,
            n_steps: 0,
            walk: Walk::default(),
            going: Vec::new(),
            coming: Vec::new(),
            recent: vec![[NO_PAIR; N_RECENT]; setting.n_nodes()],
            ranges: [Vec::new(), Vec::new()],
        };
        state.rebuild();
        state
    }

    pub(super) fn save(&self) -> Saved {
        Saved { turn_rad: self.turn_rad.clone(), side: self.side.clone(), is_mirrored: self.is_mirrored }
    }

    pub(super) fn restore(&mut self, saved: &Saved) {
        self.turn_rad.clone_from(&saved.turn_rad);
        self.side.clone_from(&saved.side);
        self.is_mirrored = saved.is_mirrored;
        self.rebuild();
    }

    /// The turns of the layout that is meant.
    pub(super) fn turns(&self) -> Vec<f64> {
        let sign = if self.is_mirrored { -1.0 } else { 1.0 };
        self.turn_rad.iter().map(|turn| sign * turn).collect()
    }

    pub(super) fn terms(&self) -> Terms {
        Terms {
            crossings: self.conflicts.count(Fault::Crossing),
            near: self.conflicts.count(Fault::Near),
            kept_out: self.conflicts.count(Fault::KeepOut),
            placement: self.misplacement(&self.hierarchy.total()),
            siblings_rad: self.siblings_rad,
            zigzags_rad: self.zigzags_rad,
        }
    }

    fn misplacement(&self, sums: &HeadingSums) -> f64 {
        1.0 - if self.is_mirrored { sums.mirrored.length() } else { sums.direct.length() }
    }

    /// Where an edge starts, and the direction of the edge above it.
    pub(super) fn frame_above(&self, node: usize) -> (DVec2, DVec2) {
        let direction = match self.setting.parent(node) {
            0 => DVec2::X,
            parent => self.direction[parent],
        };
        (self.hierarchy.ends[node].0, direction)
    }

    /// Where a node lies.
    pub(super) fn position(&self, node: usize) -> DVec2 {
        self.hierarchy.ends[node].1
    }

    /// Where an edge ends, and its direction.
    pub(super) fn frame_at(&self, node: usize) -> (DVec2, DVec2) {
        (self.hierarchy.ends[node].1, self.direction[node])
    }

    /// Whether the turn has another side, compared with the turn before, than the targets had.
    pub(super) fn is_zigzag(&self, node: usize) -> bool {
        let first = &self.setting.first_side;
        self.side[node] * self.side[node - 1] != first[node] * first[node - 1]
    }

    /// The changes of sides inside segments that the given targets did not have.
    pub(super) fn n_zigzags(&self) -> usize {
        self.zigzags().count()
    }

    fn zigzags(&self) -> impl Iterator<Item = usize> {
        (1..self.setting.n_nodes()).filter(|&node| self.setting.continues_arc(node) && self.is_zigzag(node))
    }

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

    /// Builds everything from the turns.
    pub(super) fn rebuild(&mut self) {
        let setting = self.setting;
        self.hierarchy.ends[0] = (DVec2::ZERO, DVec2::ZERO);
        for node in 1..setting.n_nodes() {
            let parent = setting.parent(node);
            let start = self.hierarchy.ends[parent].1;
            let above = if parent == 0 { DVec2::X } else { self.direction[parent] };
            let direction = math::unit_vector(self.turn_rad[node]).rotate(above);
            self.direction[node] = direction;
            let end = start + direction * setting.problem.targets.length_mm[node];
            self.hierarchy.place(
                node,
                ((start, end), direction),
                HeadingSums::of_edge(direction, setting.aim[node]),
            );
        }
        if setting.keeps_out {
            let first_side = if self.is_mirrored { 1.0 } else { -1.0 };
            for (ray, side) in (setting.n_nodes()..setting.n_nodes() + N_RAYS).zip([first_side, -first_side])
            {
                let direction = math::unit_vector(side * RAY_RAD).rotate(self.direction[1]);
                let end = direction * (RAY_LENGTH * setting.radius_mm);
                self.hierarchy.place(ray, ((DVec2::ZERO, end), direction), HeadingSums::default());
            }
        }
        self.hierarchy.finish();
        self.count_terms();
        self.find_conflicts();
    }

    fn count_terms(&mut self) {
        let (setting, tree) = (self.setting, self.setting.problem.tree);
        let sibling_error =
            |node: usize| setting.sibling_error_rad(node, |child| self.turn_rad[tree.children(node)[child]]);
        let siblings_rad = (0..setting.n_nodes()).map(sibling_error).sum();
        self.zigzags_rad = self.zigzags().map(|node| setting.zigzag_rad(node)).sum();
        self.siblings_rad = siblings_rad;
    }

    /// All conflicts, each edge asking those after it.
    fn find_conflicts(&mut self) {
        let (setting, hierarchy) = (self.setting, &self.hierarchy);
        self.conflicts.clear();
        for edge in 1..setting.n_edges() {
            let (alone, after) = (edge..edge + 1, edge + 1..setting.n_edges());
            let (conflicts, reach_mm) = (&mut self.conflicts, setting.reach_mm());
            let question = (from_ref(&alone), &Isometry::IDENTITY);
            hierarchy.each_near(
                question,
                from_ref(&after),
                reach_mm,
                &mut self.walk,
                |(edge, (a, b)), other| {
                    let (start, end) = hierarchy.ends[other];
                    if let Some(fault) =
                        setting.fault((edge, Segment { a, b }), (other, Segment { a: start, b: end }))
                    {
                        conflicts.insert(Conflict { edges: [edge as u32, other as u32], fault });
                    }
                    true
                },
            );
        }
    }
}
