//! The clearance that a layout keeps.
//!
//! **Input** positions. **Output** a length in mm.
//! **Definition** the largest c, at most the median edge length, with which no pair of edges is too near by the rule of
//! `separation`: edges without a common node keep at least c, or a fifth of the path along the tree between their near
//! ends if that is less. So it is the least distance d of a pair with d < path / 5, or the median edge if no such pair
//! is that near. 0 where edges cross.
//! **Steps** pairs whose boxes, grown by half a margin, meet. The margin is small at first: where a pair is nearer than
//! that, it is found among few; where none is, it grows.
//! **Guarantees** the minimum over all pairs, whatever the order.
//! **Cost** O(N log N + boxes that are that near), see `boxes`.

use espalier_geom::plane::segment_distance;
use glam::DVec2;

use crate::boxes::{self, EdgeBox};
use crate::paths::Paths;
use crate::problem::Problem;
use crate::separation::{GAP_SHARE, are_apart, segment};

/// The margins, as shares of the median edge length.
const MARGINS: [f64; 3] = [0.01, 0.1, 1.0];

/// The clearance of a layout, in mm.
pub(super) fn clearance_mm(problem: &Problem, positions: &[DVec2]) -> f64 {
    let paths = Paths::new(&problem.parent, &problem.targets.length_mm);
    let mut least_mm = problem.scale_mm;
    for margin_mm in MARGINS.map(|share| share * problem.scale_mm) {
        each_near(problem, positions, margin_mm, |a, b| {
            let (s, t) = (segment(problem, positions, a), segment(problem, positions, b));
            if are_apart(&s, &t, least_mm) {
                return;
            }
            let distance_mm = segment_distance(&s, &t);
            if distance_mm < least_mm && distance_mm < GAP_SHARE * paths.gap_mm(a, b) {
                least_mm = distance_mm;
            }
        });
        if least_mm <= margin_mm {
            break;
        }
    }
    least_mm
}

/// Visits the pairs of edges without a common node whose boxes are nearer than a margin.
fn each_near(problem: &Problem, positions: &[DVec2], margin_mm: f64, mut visit: impl FnMut(usize, usize)) {
    let edge_box = |node: usize| {
        let parent = problem.parent[node] as usize;
        EdgeBox::around((positions[node], positions[parent]), 0.5 * margin_mm, (node, parent))
    };
    boxes::each_meeting((1..positions.len()).map(edge_box).collect(), |a, b| {
        if problem.parent[b] as usize != a {
            visit(a, b);
        }
        true
    });
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
