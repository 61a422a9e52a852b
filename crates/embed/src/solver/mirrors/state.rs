//! The layout during the search: exact lengths, exact bends, and a side for each turn.
//!
//! **Output** turns, sides, ends and conflicts, and what they cost; `change` alters them step by step.
//! **Guarantees** built from the turns alone; a layout to come back to costs three copies and one building.
//! **Cost** building is linear but for the conflicts, which the hierarchy finds.

use std::ops::Range;
use std::slice::from_ref;

use espalier_geom::math;
use espalier_geom::plane::Segment;
use glam::DVec2;

use super::conflicts::{Conflict, Conflicts, Fault};
use super::hierarchy::{HeadingSums, Hierarchy, Walk};
use super::isometry::Isometry;
use super::setting::{N_RAYS, Setting};
use super::step::Terms;

/// How far behind the root's edge a ray of the keep-out stands, in rad.
const RAY_RAD: f64 = 2.0 * std::f64::consts::PI / 3.0;
/// The length of those rays as a multiple of the tree's radius.
const RAY_LENGTH: f64 = 1.5;

/// How many pairs that were in the way are kept for each node.
const N_RECENT: usize = 4;
/// No pair.
pub(super) const NO_PAIR: [u32; 2] = [0; 2];

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
    pub(super) is_mirrored: bool,
    pub(super) siblings_rad: f64,
    pub(super) zigzags_rad: f64,
    pub(super) n_steps: u32,
    pub(super) walk: Walk,
    /// Of the last evaluation: conflicts that go, by index, and conflicts that come.
    pub(super) going: Vec<usize>,
    pub(super) coming: Vec<Conflict>,
    /// For the first node of a step, pairs of edges that made such steps too dear lately.
    pub(super) recent: Vec<[[u32; 2]; N_RECENT]>,
    /// Memory for the ranges of two parts.
    pub(super) ranges: [Vec<Range<usize>>; 2],
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

    pub(super) fn misplacement(&self, sums: &HeadingSums) -> f64 {
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
