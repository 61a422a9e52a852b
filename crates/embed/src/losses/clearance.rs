//! The clearance that a layout keeps.
//!
//! **Input** positions. **Output** a length in mm.
//! **Definition** the largest c, at most the median edge length, with which no pair of edges is too near by the rule of
//! `separation`: edges without a common node keep at least c, or a fifth of the path along the tree between their near
//! ends if that is less. So it is the least distance d of a pair with d < path / 5, or the median edge if no such pair
//! is that near. 0 where edges cross.
//! **Steps** sweep along the longer side of the box; a pair is measured only if its boxes are nearer than the least
//! distance so far, which soon is small.
//! **Guarantees** the minimum over all pairs, whatever the order.
//! **Cost** O(N log N + pairs whose extents along the axis are that near).

use espalier_geom::plane::segment_distance;
use glam::DVec2;

use crate::paths::Paths;
use crate::problem::Problem;
use crate::separation::{GAP_SHARE, segment};

/// The box of an edge, along and across the axis of the sweep.
struct Span {
    start: f64,
    end: f64,
    bottom: f64,
    top: f64,
    node: usize,
    parent: usize,
}

/// The clearance of a layout, in mm.
pub(super) fn clearance_mm(problem: &Problem, positions: &[DVec2]) -> f64 {
    let paths = Paths::new(&problem.parent, &problem.targets.length_mm);
    let spans = spans(problem, positions);
    let mut least_mm = problem.scale_mm;
    for (idx, a) in spans.iter().enumerate() {
        for b in &spans[idx + 1..] {
            if b.start > a.end + least_mm {
                break;
            }
            let is_apart = b.bottom > a.top + least_mm || a.bottom > b.top + least_mm;
            let is_neighbour = a.parent == b.parent || a.parent == b.node || b.parent == a.node;
            if is_apart || is_neighbour {
                continue;
            }
            let distance_mm =
                segment_distance(&segment(problem, positions, a.node), &segment(problem, positions, b.node));
            if distance_mm < least_mm && distance_mm < GAP_SHARE * paths.gap_mm(a.node, b.node) {
                least_mm = distance_mm;
            }
        }
    }
    least_mm
}

/// The edges in the order in which they start along the longer side of the box.
fn spans(problem: &Problem, positions: &[DVec2]) -> Vec<Span> {
    let low = positions.iter().fold(DVec2::INFINITY, |low, &p| low.min(p));
    let extent = positions.iter().fold(DVec2::NEG_INFINITY, |high, &p| high.max(p)) - low;
    let turned = |p: DVec2| if extent.x >= extent.y { p } else { p.perp() };
    let span = |node: usize| {
        let parent = problem.parent[node] as usize;
        let (a, b) = (turned(positions[node]), turned(positions[parent]));
        let (low, high) = (a.min(b), a.max(b));
        Span { start: low.x, end: high.x, bottom: low.y, top: high.y, node, parent }
    };
    let mut spans: Vec<Span> = (1..positions.len()).map(span).collect();
    spans.sort_unstable_by(|a, b| a.start.total_cmp(&b.start).then(a.node.cmp(&b.node)));
    spans
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::common::{random_tree, views_along};
    use crate::layout::{cone, radial};
    use crate::params::Params;
    use crate::{place, separation, targets};

    #[test]
    fn it_is_the_largest_clearance_that_no_pair_breaks() {
        for key in 0..40 {
            let tree = random_tree(key as usize % 8, 50, 1.0, false, key);
            let (params, branches) = (Params::default(), tree.branches());
            let views = views_along(&tree, DVec3::Z);
            let targets = targets::targets(&tree, &branches, &views, params.targets).expect("targets");
            let problem = Problem::new(&tree, branches, targets, &params);
            let headings = if key % 2 == 0 { cone::headings(&problem) } else { radial::headings(&problem) };
            let positions = place::from_headings(&problem, &headings);
            let found_mm = clearance_mm(&problem, &positions);
            let breaks = |share: f64| {
                let rule = separation::Separation::new(&problem, share * found_mm / problem.scale_mm);
                (1..positions.len()).any(|a| {
                    (1..a).any(|b| {
                        rule.too_near(&problem, &positions, a, b) && !rule.meet(&problem, &positions, a, b)
                    })
                })
            };
            assert!(found_mm > 0.0 && !breaks(1.0 - 1e-9), "tree {key}");
            assert!(found_mm == problem.scale_mm || breaks(1.0 + 1e-9), "tree {key}");
        }
    }
}
