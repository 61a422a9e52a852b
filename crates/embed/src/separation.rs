//! How far apart edges must stay, and whether they do.
//!
//! **Input** two edges by their lower nodes, positions. **Output** whether they meet, or come too near.
//! **Notation** gap = the path along the tree between the near ends of two edges.
//! **Definition** edges that are not neighbours *meet* nearer than 1e-6 of the median edge length; they are *too
//! near* nearer than the clearance, or than a fifth of their gap if that is less. Neighbours meet within 1e-6 rad.
//! **Guarantees** what does not meet here has no crossing after rounding, in the exact check.
//! **Cost** O(1) for a pair.

use espalier_geom::plane::{Segment, segment_distance};
use glam::DVec2;

use crate::paths::Paths;
use crate::problem::Problem;

/// The tolerance as a share of the median edge length, and the least angle between neighbours in rad.
const TOLERANCE: f64 = 1e-6;
/// The clearance is at most this share of the path between two edges: near a fork edges have to be near.
pub(crate) const GAP_SHARE: f64 = 0.2;

/// Whether two segments are farther apart than a margin for sure: one lies on one side of the line through the other,
/// farther off than that.
pub(crate) fn are_apart(s: &Segment, t: &Segment, margin_mm: f64) -> bool {
    let is_beside = |s: &Segment, t: &Segment| {
        let along = s.b - s.a;
        let (from, to) = (along.perp_dot(t.a - s.a), along.perp_dot(t.b - s.a));
        // |x| + |y| is no less than the length, and needs no root.
        let margin = margin_mm * (along.x.abs() + along.y.abs());
        from.min(to) > margin || from.max(to) < -margin
    };
    is_beside(s, t) || is_beside(t, s)
}

/// The rule of separation of a problem.
pub(crate) struct Separation {
    pub(crate) paths: Paths,
    /// Edges that are not neighbours keep at least this far apart, where their gap allows, in mm.
    pub(crate) clearance_mm: f64,
    tolerance_mm: f64,
}

impl Separation {
    /// With a clearance given as a share of the median edge length.
    pub(crate) fn new(problem: &Problem, clearance: f64) -> Self {
        Self {
            paths: Paths::new(&problem.parent, &problem.targets.length_mm),
            clearance_mm: clearance * problem.scale_mm,
            tolerance_mm: TOLERANCE * problem.scale_mm,
        }
    }

    /// The distance below which two edges meet, in mm, if they are not neighbours.
    pub(crate) fn tolerance_mm(&self) -> f64 {
        self.tolerance_mm
    }

    /// The distance that two edges have to keep, in mm; 0 for neighbours.
    pub(crate) fn required_mm(&self, a: usize, b: usize) -> f64 {
        let gap_mm = self.paths.gap_mm(a, b);
        if gap_mm == 0.0 { 0.0 } else { self.clearance_mm.min(GAP_SHARE * gap_mm).max(self.tolerance_mm) }
    }

    /// Whether two different edges meet: what tests count.
    #[cfg(test)]
    pub(crate) fn meet(&self, problem: &Problem, positions: &[DVec2], a: usize, b: usize) -> bool {
        self.meet_at(problem, (a, b), &[segment(problem, positions, a), segment(problem, positions, b)])
    }

    /// Whether two different edges meet or are too near.
    pub(crate) fn too_near(&self, problem: &Problem, positions: &[DVec2], a: usize, b: usize) -> bool {
        let places = [segment(problem, positions, a), segment(problem, positions, b)];
        neighbours_fold(problem, (a, b), &places)
            .unwrap_or_else(|| segment_distance(&places[0], &places[1]) < self.required_mm(a, b))
    }

    /// Whether two different edges meet where they are put, each from its parent to its node.
    pub(crate) fn meet_at(&self, problem: &Problem, (a, b): (usize, usize), places: &[Segment; 2]) -> bool {
        neighbours_fold(problem, (a, b), places)
            .unwrap_or_else(|| segment_distance(&places[0], &places[1]) < self.tolerance_mm)
    }

    /// Whether two different edges may go from where they are to other places: they are far enough apart there, or
    /// they did not meet before and come no nearer.
    pub(crate) fn may_move(
        &self,
        problem: &Problem,
        (a, b): (usize, usize),
        before: &[Segment; 2],
        after: &[Segment; 2],
    ) -> bool {
        if let Some(is_folded) = neighbours_fold(problem, (a, b), after) {
            return !is_folded;
        }
        let distance_mm = segment_distance(&after[0], &after[1]);
        if distance_mm < self.tolerance_mm {
            return false;
        }
        let is_far = distance_mm >= self.clearance_mm || distance_mm >= self.required_mm(a, b);
        // Rounding is no approach.
        let near_mm = self.tolerance_mm..=distance_mm * (1.0 + 1e-9);
        is_far || near_mm.contains(&segment_distance(&before[0], &before[1]))
    }
}

/// An edge by its lower node.
pub(crate) fn segment(problem: &Problem, positions: &[DVec2], edge: usize) -> Segment {
    Segment { a: positions[problem.parent[edge] as usize], b: positions[edge] }
}

/// For edges with a common node: whether they lie on each other.
fn neighbours_fold(problem: &Problem, (a, b): (usize, usize), places: &[Segment; 2]) -> Option<bool> {
    let [place_a, place_b] = places;
    let ((first, place_first), (last, place_last)) =
        if a < b { ((a, place_a), (b, place_b)) } else { ((b, place_b), (a, place_a)) };
    let parent_last = problem.parent[last] as usize;
    let to_first = if parent_last == first {
        place_first.a - place_first.b
    } else if parent_last == problem.parent[first] as usize {
        place_first.b - place_first.a
    } else {
        return None;
    };
    let to_last = place_last.b - place_last.a;
    let is_ahead = to_first.dot(to_last) > 0.0;
    // sin of the angle between them; the lengths are positive unless the edges have none.
    let across = to_first.perp_dot(to_last).abs();
    Some(is_ahead && across <= TOLERANCE * to_first.length() * to_last.length() || to_last == DVec2::ZERO)
}
