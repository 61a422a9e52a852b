//! A tree as lines with widths: few enough for a page, whatever the size of the tree.
//!
//! **Input** a tree, where its nodes lie in a [`Frame`], colours by node. **Output** [`Piece`]s: parts of branches with
//! one width and one colour in every colouring.
//! **Steps** 1. A branch is cut where a colour changes or its width does by a step. 2. If that makes too many pieces,
//! each branch is one piece in its middle colours. 3. Points that a line can do without are left out ([Douglas1973]),
//! with a tolerance that doubles until all fit the budget.
//! 4. What still does not fit, since there are so many branches, goes by its length, the shortest first.
//! **Guarantees** at most [`Budget::pieces`] pieces or one a branch, at most [`Budget::points`] points.
//! **Cost** O(nodes · log nodes).

use std::collections::BTreeMap;
use std::fmt::Write as _;

use espalier_geom::math;
use espalier_model::{Branch, Branches, Tree};
use glam::DVec2;

use crate::layout::Frame;

/// A step of width within a branch: a seventh cannot be seen at a joint.
const WIDTH_STEP: f64 = 1.15;
/// The least width of a line in units: thinner ones vanish in print.
pub(crate) const LEAST_WIDTH: f64 = 16.0;
/// What lines may be off at first, in units: a third of a pixel.
const TOLERANCE: f64 = 4.0;

/// What a drawing may cost.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    pub(crate) pieces: usize,
    pub(crate) points: usize,
}

/// A part of a branch with one width and one colour in every colouring.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Piece {
    pub(crate) branch: usize,
    /// Where it runs, in units.
    pub(crate) points: Vec<[i64; 2]>,
    pub(crate) width: i64,
    /// By colouring: the index of its colour.
    pub(crate) bins: Vec<u8>,
}

/// What is drawn.
#[derive(Clone, Copy)]
pub(crate) struct Subject<'a> {
    pub(crate) tree: &'a Tree,
    pub(crate) branches: &'a Branches,
    /// Where each node lies.
    pub(crate) positions_mm: &'a [DVec2],
    pub(crate) frame: &'a Frame,
    /// By colouring, by node.
    pub(crate) bins: &'a [&'a [u8]],
    /// Whether lines are as wide as the tubes.
    pub(crate) has_widths: bool,
}

/// The pieces of a tree, those of a branch one after the other.
pub(crate) fn pieces(subject: &Subject<'_>, budget: Budget) -> Vec<Piece> {
    let list = subject.branches.list();
    let mut runs: Vec<Run> =
        list.iter().enumerate().flat_map(|(index, branch)| subject.runs(index, branch)).collect();
    if runs.len() > budget.pieces {
        runs = list.iter().enumerate().map(|(index, branch)| subject.whole(index, branch)).collect();
    }
    let mut tolerance = TOLERANCE;
    loop {
        let pieces: Vec<Piece> = runs.iter().map(|run| subject.piece(run, tolerance)).collect();
        let n_points: usize = pieces.iter().map(|piece| piece.points.len()).sum();
        if n_points <= budget.points.max(2 * pieces.len()) || tolerance > crate::layout::LONG_SIDE {
            return longest(pieces, budget.points);
        }
        tolerance *= 2.0;
    }
}

/// The pieces without the shortest, as many as there is room for.
fn longest(pieces: Vec<Piece>, max_points: usize) -> Vec<Piece> {
    let n_points: usize = pieces.iter().map(|piece| piece.points.len()).sum();
    if n_points <= max_points {
        return pieces;
    }
    let reach = |piece: &Piece| {
        let [[x, y], [end_x, end_y]] = [piece.points[0], piece.points[piece.points.len() - 1]];
        (end_x - x).abs().max((end_y - y).abs())
    };
    let mut order: Vec<usize> = (0..pieces.len()).collect();
    order.sort_by_key(|&index| (-reach(&pieces[index]), index));
    let mut is_kept = vec![false; pieces.len()];
    let mut n_taken = 0;
    for index in order {
        n_taken += pieces[index].points.len();
        is_kept[index] = n_taken <= max_points;
    }
    pieces.into_iter().zip(is_kept).filter(|(_, kept)| *kept).map(|(piece, _)| piece).collect()
}

/// The pieces as few paths: those of one colour in the first colouring and one width together, thin ones first.
pub(crate) fn merged(pieces: &[Piece]) -> BTreeMap<(i64, u8), String> {
    let mut paths: BTreeMap<(i64, u8), String> = BTreeMap::new();
    for piece in pieces {
        let bin = piece.bins.first().copied().unwrap_or(0);
        write_path(paths.entry((piece.width, bin)).or_default(), &piece.points);
    }
    paths
}

/// The attribute `d` of a line.
pub(crate) fn path(points: &[[i64; 2]]) -> String {
    let mut out = String::new();
    write_path(&mut out, points);
    out
}

/// Writes a line with relative steps, without a blank where a sign parts two numbers.
fn write_path(out: &mut String, points: &[[i64; 2]]) {
    let Some(&[mut x, mut y]) = points.first() else { return };
    // Writing to a String cannot fail.
    let _ = write!(out, "M{x} {y}");
    if points.iter().all(|point| *point == [x, y]) {
        out.push_str("h0");
        return;
    }
    out.push('l');
    for (i, &[next_x, next_y]) in points.iter().enumerate().skip(1) {
        let (dx, dy) = (next_x - x, next_y - y);
        let gap = if i > 1 && dx >= 0 { " " } else { "" };
        let _ = write!(out, "{gap}{dx}{}{dy}", if dy >= 0 { " " } else { "" });
        [x, y] = [next_x, next_y];
    }
}

/// A part of a branch before it has points.
struct Run {
    branch: usize,
    /// Its nodes, the upper end first.
    nodes: Vec<usize>,
    width: i64,
    bins: Vec<u8>,
}

impl Subject<'_> {
    fn runs(&self, index: usize, branch: &Branch) -> Vec<Run> {
        let mut runs: Vec<Run> = Vec::new();
        let mut above = branch.hub;
        for node in branch.nodes.clone() {
            let (width, bins) = (self.width_of([above, node]), self.bins_of(node));
            match runs.last_mut() {
                Some(run) if run.width == width && run.bins == bins => run.nodes.push(node),
                _ => runs.push(Run { branch: index, nodes: vec![above, node], width, bins }),
            }
            above = node;
        }
        runs
    }

    /// A branch as one run, in its middle node's colours and at its mean width.
    fn whole(&self, index: usize, branch: &Branch) -> Run {
        let middle = (branch.nodes.start + branch.end()) / 2;
        Run {
            branch: index,
            nodes: branch.polyline().collect(),
            width: self.width_of([branch.nodes.start, branch.end()]),
            bins: self.bins_of(middle),
        }
    }

    fn bins_of(&self, node: usize) -> Vec<u8> {
        self.bins.iter().map(|bins| bins[node]).collect()
    }

    /// The width of a line between two nodes, on a ladder of steps.
    fn width_of(&self, ends: [usize; 2]) -> i64 {
        if !self.has_widths {
            return LEAST_WIDTH as i64;
        }
        let diameter_mm: f64 = ends.iter().map(|&node| self.tree.nodes()[node].radius_mm).sum();
        let width = self.frame.units(diameter_mm).clamp(LEAST_WIDTH, crate::layout::LONG_SIDE);
        let step = math::floor(math::ln(width / LEAST_WIDTH) / math::ln(WIDTH_STEP) + 0.5);
        (LEAST_WIDTH * math::pow(WIDTH_STEP, step) + 0.5) as i64
    }

    fn piece(&self, run: &Run, tolerance: f64) -> Piece {
        let points: Vec<[i64; 2]> =
            run.nodes.iter().map(|&node| self.frame.place(self.positions_mm[node])).collect();
        Piece {
            branch: run.branch,
            points: simplified(&points, tolerance),
            width: run.width,
            bins: run.bins.clone(),
        }
    }
}

/// The points without which a line would be off by more than the tolerance.
fn simplified(points: &[[i64; 2]], tolerance: f64) -> Vec<[i64; 2]> {
    let n_points = points.len();
    if n_points <= 2 {
        return points.to_vec();
    }
    let at = |i: usize| DVec2::new(points[i][0] as f64, points[i][1] as f64);
    let mut is_kept = vec![false; n_points];
    (is_kept[0], is_kept[n_points - 1]) = (true, true);
    let mut open = vec![(0, n_points - 1)];
    while let Some((first, last)) = open.pop() {
        let segment = espalier_geom::plane::Segment { a: at(first), b: at(last) };
        let off = |i: usize| espalier_geom::plane::distance_to_segment(at(i), &segment);
        let farthest = (first + 1..last).map(|i| (off(i), i)).max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, middle)) = farthest.filter(|(distance, _)| *distance > tolerance) {
            is_kept[middle] = true;
            open.extend([(first, middle), (middle, last)]);
        }
    }
    points.iter().zip(is_kept).filter(|(_, kept)| *kept).map(|(point, _)| *point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_short() {
        assert_eq!(path(&[[1, 2], [4, 1], [4, 5]]), "M1 2l3-1 0 4");
        assert_eq!(path(&[[1, 2], [1, 2]]), "M1 2h0");
        assert_eq!(path(&[]), "");
    }

    #[test]
    fn straight_points_go() {
        let line: Vec<[i64; 2]> = (0..50).map(|i| [10 * i, i % 2]).collect();
        assert_eq!(simplified(&line, 4.0), [[0, 0], [490, 1]]);
        let bend = [[0, 0], [100, 0], [100, 100]];
        assert_eq!(simplified(&bend, 4.0), bend);
    }
}
