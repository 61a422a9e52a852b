//! Polylines → a traced structure.
//!
//! **Input** [`Polylines`], such as VMTK's centrelines, each from the common inlet to an outlet, or the branches of a
//! tree. **Output** [`Traced`], one tree for each group of lines that touch.
//! **Notation** N points.
//! **Steps** 1. pieces of one centreline are put together; 2. points at the same place are one; 3. line by line, those
//! that touch the tree before others: a line follows the tree as long as it runs within
//! [`FOLLOW_RADII`] of it, and the rest of it becomes a branch; 4. a line that meets the tree again is cut there.
//! **Guarantees** a tree written as polylines comes back with the same nodes and edges; the order of lines that do not
//! share a trunk does not matter to the shape.
//! **Cost** O(N log N), and for lines that share a trunk O(N · children at a node).

use std::collections::{BTreeMap, BTreeSet};

use espalier_model::Report;
use espalier_model::polydata::{Polyline, Polylines};
use espalier_model::swc::{Traced, TracedNode};
use glam::DVec3;

/// Centrelines of one vessel leave each other where they are farther apart than this share of its radius. VMTK's lines
/// are the same points along a trunk; resampled and smoothed they differ by up to 0.7 % of it, and at a fork they part
/// by 15 % within two steps.
const FOLLOW_RADII: f64 = 0.05;
const NONE: usize = usize::MAX;

/// Joins lines that touch.
#[must_use]
pub fn join_lines(polylines: &Polylines) -> (Traced, Report) {
    let lines = whole_lines(polylines);
    let place_of = places(&polylines.points_mm);
    let mut lines_at: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, line) in lines.iter().enumerate() {
        for end in [line.points[0], line.points[line.points.len() - 1]] {
            lines_at.entry(place_of[end]).or_default().push(index);
        }
    }
    let node_at = vec![NONE; polylines.points_mm.len()];
    let (nodes, children, ready) = (Vec::new(), Vec::new(), BTreeSet::new());
    let mut joined = Joined { polylines, place_of, node_at, nodes, children, lines_at, ready, n_cut: 0 };
    let mut is_added = vec![false; lines.len()];
    for (first, line) in lines.iter().enumerate() {
        if is_added[first] {
            continue;
        }
        // Nothing touches what is there: a tree of its own.
        joined.push(line.points[0], None, line.number);
        while let Some(index) = joined.ready.pop_first() {
            if !std::mem::replace(&mut is_added[index], true) {
                joined.add(&lines[index]);
            }
        }
    }
    let mut report = Report::default();
    if joined.n_cut > 0 {
        let n_cut = joined.n_cut;
        report.warn("W-POLYDATA-LOOPS", format!("lines meet again behind a fork {n_cut} times: cut there"));
    }
    (Traced { nodes: joined.nodes }, report)
}

/// The lines of a file, pieces of one centreline put together in their order; each with its number, from 1.
fn whole_lines(polylines: &Polylines) -> Vec<Line> {
    let mut pieces: Vec<(usize, &Polyline)> = polylines.lines.iter().enumerate().collect();
    pieces.sort_by_key(|&(index, line)| (line.tract.is_none(), line.tract, index));
    let mut lines: Vec<Line> = Vec::new();
    let mut last = None;
    for (index, piece) in pieces {
        let centreline = piece.tract.map(|(centreline, _)| centreline);
        match lines.last_mut() {
            Some(line) if centreline.is_some() && centreline == last => line.points.extend(&piece.points),
            _ => lines.push(Line { number: index + 1, points: piece.points.clone() }),
        }
        last = centreline;
    }
    lines
}

/// A line, by the indices of its points.
struct Line {
    number: usize,
    points: Vec<usize>,
}

/// For each point the first one at the same place.
fn places(points_mm: &[DVec3]) -> Vec<usize> {
    let by_place = |&a: &usize, &b: &usize| {
        let (a_mm, b_mm) = (points_mm[a], points_mm[b]);
        a_mm.x
            .total_cmp(&b_mm.x)
            .then(a_mm.y.total_cmp(&b_mm.y))
            .then(a_mm.z.total_cmp(&b_mm.z))
            .then(a.cmp(&b))
    };
    let mut order: Vec<usize> = (0..points_mm.len()).collect();
    order.sort_unstable_by(by_place);
    let mut place_of = vec![0; points_mm.len()];
    for (i, &point) in order.iter().enumerate() {
        let is_same = i > 0 && points_mm[order[i - 1]] == points_mm[point];
        place_of[point] = if is_same { place_of[order[i - 1]] } else { point };
    }
    place_of
}

struct Joined<'a> {
    polylines: &'a Polylines,
    place_of: Vec<usize>,
    /// The node at a place.
    node_at: Vec<usize>,
    nodes: Vec<TracedNode>,
    children: Vec<Vec<usize>>,
    /// The lines that end at a place where there is no node yet.
    lines_at: BTreeMap<usize, Vec<usize>>,
    /// The lines that touch the tree.
    ready: BTreeSet<usize>,
    /// How often a line met the tree again.
    n_cut: usize,
}

impl Joined<'_> {
    fn node_of(&self, point: usize) -> usize {
        self.node_at[self.place_of[point]]
    }

    /// Adds a line that begins or ends at the tree.
    fn add(&mut self, line: &Line) {
        if self.node_of(line.points[0]) == NONE {
            let points: Vec<usize> = line.points.iter().rev().copied().collect();
            self.add_forward(&points, line.number);
        } else {
            self.add_forward(&line.points, line.number);
        }
    }

    /// Adds a line whose first point is known.
    fn add_forward(&mut self, points: &[usize], number: usize) {
        let first = points[0];
        let mut at = self.node_of(first);
        // A line with points of its own may run along the tree; one that shares the tree's point leaves it there.
        let mut follows = self.place_of[first] != first;
        let mut is_behind_fork = false;
        for &point in &points[1..] {
            let known = self.node_of(point);
            if known != NONE {
                self.n_cut += usize::from(is_behind_fork && known != at);
                is_behind_fork &= known == at;
                at = known;
                continue;
            }
            if follows && let Some(near) = self.follow(at, self.polylines.points_mm[point]) {
                at = near;
                continue;
            }
            follows = false;
            is_behind_fork = true;
            at = self.push(point, Some(at), number);
        }
    }

    /// The node that a line has come to at `point_mm`, going on from the node `from`; none if it has left the tree.
    fn follow(&self, from: usize, point_mm: DVec3) -> Option<usize> {
        let mut at = from;
        loop {
            let step =
                |child: usize| along(self.nodes[at].position_mm, self.nodes[child].position_mm, point_mm);
            let steps = self.children[at].iter().map(|&child| (step(child), child));
            let ((distance_mm, share), child) = steps.min_by(|a, b| a.0.0.total_cmp(&b.0.0))?;
            if share >= 1.0 && !self.children[child].is_empty() {
                at = child;
                continue;
            }
            let radius_mm = self.nodes[at].radius_mm.max(self.nodes[child].radius_mm);
            return (distance_mm <= FOLLOW_RADII * radius_mm).then_some(if share > 0.5 { child } else { at });
        }
    }

    fn push(&mut self, point: usize, parent: Option<usize>, line: usize) -> usize {
        let node = self.nodes.len();
        self.nodes.push(TracedNode {
            id: node as i64 + 1,
            kind: 0,
            position_mm: self.polylines.points_mm[point],
            radius_mm: self.polylines.radii_mm[point],
            parent,
            line,
        });
        self.children.push(Vec::new());
        if let Some(parent) = parent {
            self.children[parent].push(node);
        }
        self.node_at[self.place_of[point]] = node;
        self.ready.extend(self.lines_at.remove(&self.place_of[point]).unwrap_or_default());
        node
    }
}

/// How far a point is from a segment, and at which share of it, from 0 to 1.
fn along(start: DVec3, end: DVec3, point: DVec3) -> (f64, f64) {
    let step = end - start;
    let share = ((point - start).dot(step) / step.length_squared()).clamp(0.0, 1.0);
    let share = if share.is_nan() { 0.0 } else { share };
    (point.distance(start + step * share), share)
}
