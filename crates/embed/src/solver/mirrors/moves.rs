//! The moves of the search: which turns change sides together.
//!
//! **Input** the state, a stream of random numbers. **Output** a `Step`.
//! **Notation** a segment has the nodes first..=last; its first turn belongs to the fork above it.
//! **Steps** 1. Where: on the tree path between the edges of a random conflict, or anywhere. 2. What:
//! - `Fork`: children of a fork change sides, their subtrees are reflected or not (the fork's local plane is
//!   mirrored, or single children swing over);
//! - `Run`: a run of turns inside a segment changes sides, the rest follows (a chain's local plane is mirrored, or a
//!   suffix of it, or one bend);
//! - `From`: all turns from a node on change sides;
//! - `Root`: a child of the root turns to another direction, which costs nothing there.
//!
//! **Guarantees** lengths and sizes of bends stay, siblings keep their distance.
//! **Cost** O(segments on the path).

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use espalier_geom::angle::wrap;
use espalier_geom::math;
use espalier_geom::random::Stream;
use glam::DVec2;

use super::conflicts::Conflict;
use super::isometry::Isometry;
use super::setting::MOST_SIBLINGS_FLIPPED;
use super::state::State;
use super::step::{NewTurn, Part, Step};
use crate::siblings;

/// Of 100 moves, how many are on the path of a conflict: 70 in the measured prototype.
const ON_PATHS: u32 = 70;

/// What a move may be.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// Bit i of `swung`: child i changes sides; of `reflected`: its subtree does.
    Fork { hub: usize, swung: u32, reflected: u32 },
    /// Turns first..=last inside one segment.
    Run { first: usize, last: usize },
    /// All turns in the subtree of a node, its own too.
    From { node: usize },
    /// All turns in the subtree of a node, its own not.
    Below { node: usize },
    /// A new turn of a child of the root.
    Root { child: usize, turn_rad: f64 },
}

/// Makes moves; holds memory for them.
#[derive(Clone, Default)]
pub(super) struct Mover {
    runs: Vec<Range<usize>>,
    sides: Vec<f64>,
    turns_rad: Vec<f64>,
}

impl Mover {
    /// A random move into `step`; whether there is one.
    pub(super) fn propose(&mut self, state: &State, stream: &mut Stream, step: &mut Step) -> bool {
        step.clear();
        let run = self.choose_run(state, stream);
        turn_move(state, stream, &run).is_some_and(|kind| self.make(state, kind, step))
    }

    /// A run of nodes of one segment whose turns have a say in a random conflict; or any segment.
    fn choose_run(&mut self, state: &State, stream: &mut Stream) -> Range<usize> {
        let setting = state.setting;
        let conflicts = state.conflicts.list();
        if !conflicts.is_empty() && stream.below(100) < ON_PATHS {
            let Conflict { edges, .. } = conflicts[stream.below(conflicts.len() as u32) as usize];
            self.find_path(state, edges);
            if !self.runs.is_empty() {
                return self.runs[stream.below(self.runs.len() as u32) as usize].clone();
            }
        }
        let n_segments = setting.problem.branches.list().len();
        setting.segment(stream.below(n_segments as u32) as usize)
    }

    /// The nodes whose turns change how two edges lie to each other, by segment.
    fn find_path(&mut self, state: &State, edges: [u32; 2]) {
        let setting = state.setting;
        self.runs.clear();
        // A ray hangs from the root.
        let lower = |edge: u32| if edge as usize >= setting.n_nodes() { 0 } else { edge as usize };
        let (mut a, mut b) = (lower(edges[0]), lower(edges[1]));
        while a != b {
            let (upper, lower) = (a.min(b), a.max(b));
            let segment = setting.segment_of(lower);
            if segment.contains(&upper) {
                self.runs.push(upper + 1..lower + 1);
                return;
            }
            self.runs.push(segment.start..lower + 1);
            (a, b) = (upper, setting.parent(segment.start));
        }
    }

    /// Turns a kind of move into parts with isometries; whether it changes anything.
    fn make(&mut self, state: &State, kind: Kind, step: &mut Step) -> bool {
        match kind {
            Kind::Fork { hub, swung, reflected } => self.fork(state, (hub, swung, reflected), step),
            Kind::Run { first, last } => run(state, first..last + 1, step),
            Kind::From { node } => from(state, node, step),
            Kind::Below { node } => below(state, node, step),
            Kind::Root { child, turn_rad } => root(state, child, turn_rad, step),
        }
        !step.parts.is_empty()
    }

    fn fork(&mut self, state: &State, (hub, swung, reflected): (usize, u32, u32), step: &mut Step) {
        let setting = state.setting;
        let children = setting.problem.tree.children(hub);
        let bit = |bits: u32, idx: usize| bits >> idx & 1 == 1;
        self.sides.clear();
        let side = |(idx, &child): (usize, &usize)| {
            if bit(swung, idx) { -state.side[child] } else { state.side[child] }
        };
        self.sides.extend(children.iter().enumerate().map(side));
        if swung != 0 {
            setting.separate(children, &self.sides, &mut self.turns_rad);
        } else {
            self.turns_rad.clear();
            self.turns_rad.extend(children.iter().map(|&child| state.turn_rad[child]));
        }
        let (_, above) = state.frame_at(hub);
        for (idx, &child) in children.iter().enumerate() {
            let (turn_rad, is_reflected) = (self.turns_rad[idx], bit(reflected, idx));
            if turn_rad == state.turn_rad[child] && !is_reflected {
                continue;
            }
            let (at, ahead) = (state.frame_above(child).0, state.direction[child]);
            let new_ahead = math::unit_vector(turn_rad).rotate(above);
            let isometry = Isometry::carrying((at, ahead), (at, new_ahead), is_reflected);
            step.parts.push(Part { range: setting.subtree(child), isometry });
            step.turns.push(NewTurn { node: child, turn_rad, side: self.sides[idx] });
        }
        if swung != 0 {
            let error = |turn: &dyn Fn(usize) -> f64| setting.sibling_error_rad(hub, turn);
            step.siblings_rad =
                error(&|child| self.turns_rad[child]) - error(&|child| state.turn_rad[children[child]]);
        }
    }
}

/// The change of the zigzags when the turn at a node changes sides and the one before does not, or the other way
/// round.
fn torn(state: &State, node: usize) -> f64 {
    if !state.setting.continues_arc(node) {
        return 0.0;
    }
    let zigzag_rad = state.setting.zigzag_rad(node);
    if state.is_zigzag(node) { -zigzag_rad } else { zigzag_rad }
}

fn other_side(state: &State, node: usize) -> NewTurn {
    NewTurn { node, turn_rad: -state.turn_rad[node], side: -state.side[node] }
}

fn run(state: &State, nodes: Range<usize>, step: &mut Step) {
    let setting = state.setting;
    let (first, last) = (nodes.start, nodes.end - 1);
    let above = state.frame_above(first);
    let reflection = Isometry::carrying(above, above, true);
    let subtree = setting.subtree(first);
    let end = state.frame_at(last);
    let after_end = (reflection.point(end.0), reflection.direction(end.1));
    let follows = Isometry::carrying(end, after_end, false);
    if first == last {
        step.parts.push(Part { range: subtree, isometry: follows });
    } else {
        step.parts.push(Part { range: nodes.clone(), isometry: reflection });
        if nodes.end < subtree.end {
            step.parts.push(Part { range: nodes.end..subtree.end, isometry: follows });
        }
    }
    step.turns.push(other_side(state, first));
    step.zigzags_rad = torn(state, first);
    if setting.segment_of(last).contains(&(last + 1)) {
        step.zigzags_rad += torn(state, last + 1);
    }
}

fn from(state: &State, node: usize, step: &mut Step) {
    let above = state.frame_above(node);
    let isometry = Isometry::carrying(above, above, true);
    step.parts.push(Part { range: state.setting.subtree(node), isometry });
    step.turns.push(other_side(state, node));
    step.zigzags_rad = torn(state, node);
}

fn below(state: &State, node: usize, step: &mut Step) {
    let range = node + 1..state.setting.subtree(node).end;
    if range.is_empty() {
        return;
    }
    let here = state.frame_at(node);
    step.parts.push(Part { range, isometry: Isometry::carrying(here, here, true) });
    let children = state.setting.problem.tree.children(node);
    step.turns.extend(children.iter().map(|&child| other_side(state, child)));
    if children.len() == 1 {
        step.zigzags_rad = torn(state, node + 1);
    }
}

fn root(state: &State, child: usize, turn_rad: f64, step: &mut Step) {
    let setting = state.setting;
    let children = setting.problem.tree.children(0);
    let at = state.frame_above(child).0;
    let rotation = math::unit_vector(turn_rad - state.turn_rad[child]);
    let isometry = Isometry::carrying((at, DVec2::X), (at, rotation), false);
    step.parts.push(Part { range: setting.subtree(child), isometry });
    step.turns.push(NewTurn { node: child, turn_rad, side: state.side[child] });
    let before = |idx: usize| state.turn_rad[children[idx]];
    let after = |idx: usize| if children[idx] == child { turn_rad } else { before(idx) };
    step.siblings_rad = setting.sibling_error_rad(0, after) - setting.sibling_error_rad(0, before);
}

/// A run of turns changes sides, or single children of a fork.
fn turn_move(state: &State, stream: &mut Stream, run: &Range<usize>) -> Option<Kind> {
    let setting = state.setting;
    let segment = setting.segment_of(run.start);
    let (first, last) = (segment.start, segment.end - 1);
    // A turn inside of the segment that has a say.
    let inner = run.start.max(first + 1)..run.end;
    let choice = stream.below(16);
    if choice < 7 && inner.is_empty() {
        return fork_move(state, stream, first, Swing::Some);
    }
    let node = inner.start + stream.below(inner.len() as u32) as usize;
    match choice {
        0 | 1 => Some(Kind::Run { first: node, last }),
        2 | 3 => Some(Kind::Run { first: node, last: node }),
        4 => {
            let other = inner.start + stream.below(inner.len() as u32) as usize;
            Some(Kind::Run { first: node.min(other), last: node.max(other) })
        }
        5 | 6 => Some(Kind::From { node }),
        7 if last > first => Some(Kind::Run { first: first + 1, last }),
        8 => fork_move(state, stream, first, Swing::All),
        9 => Some(Kind::Below { node: last }),
        10 => Some(Kind::Below { node: first }),
        11 | 12 => fork_move(state, stream, first, Swing::One),
        _ => fork_move(state, stream, first, Swing::Some),
    }
}

/// Which children of a fork change sides.
#[derive(Clone, Copy)]
enum Swing {
    All,
    /// The one from which the segment starts.
    One,
    /// That one or others, and some subtrees are reflected.
    Some,
}

/// A move of the fork above a segment.
fn fork_move(state: &State, stream: &mut Stream, first: usize, swing: Swing) -> Option<Kind> {
    let setting = state.setting;
    let hub = setting.parent(first);
    if hub == 0 {
        return root_move(state, stream, first);
    }
    let children = setting.problem.tree.children(hub);
    if children.len() > MOST_SIBLINGS_FLIPPED {
        return Some(Kind::Below { node: first });
    }
    let own = 1 << children.iter().position(|&child| child == first)?;
    let all = (1 << children.len()) - 1;
    let (swung, reflected) = match swing {
        Swing::All => (all, 0),
        Swing::One => (own, 0),
        Swing::Some => match stream.below(3) {
            0 => (own, own),
            1 => (stream.next_u32() & all, 0),
            _ => (stream.next_u32() & all, stream.next_u32() & all),
        },
    };
    Some(Kind::Fork { hub, swung, reflected })
}

/// A new direction for a child of the root, apart from its siblings.
fn root_move(state: &State, stream: &mut Stream, child: usize) -> Option<Kind> {
    let children = state.setting.problem.tree.children(0);
    if children.len() < 2 {
        return Some(Kind::Below { node: child });
    }
    let (low, high) = (siblings::MARGIN_RAD - PI, PI - siblings::MARGIN_RAD);
    let turn_rad = stream.uniform(low, high);
    let gap_rad = siblings::GAP_RAD.min(TAU / (4.0 * children.len() as f64));
    let is_free = |&other: &usize| other == child || wrap(turn_rad - state.turn_rad[other]).abs() >= gap_rad;
    children.iter().all(is_free).then_some(Kind::Root { child, turn_rad })
}
