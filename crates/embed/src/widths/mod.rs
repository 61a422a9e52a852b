//! Layouts at the widths of their tubes.
//!
//! | file | what |
//! |---|---|
//! | `overlap` | which tubes overlap, and which only merge where they part |
//! | `area` | the proof that tubes are too thick for any layout with exact lengths |
//! | `stretch` | the least scale of lengths without overlaps |
//! | `avoid` | lengths and angles that give way to widths |
//!
//! **Input** a layout. **Output** what overlaps, the largest radius scale at which nothing does, areas; another
//! layout, if one is asked for. **Definition** whether two edges are a pair that must not overlap is decided at full
//! width, so the largest radius scale is the least distance of such a pair over the sum of its radii.
//! **Source** ours. **Cost** O(N log N + boxes that meet).

mod area;
mod avoid;
mod overlap;
mod stretch;

use espalier_model::Widths;
use glam::DVec2;

use crate::choices::WidthsMode;
use crate::params::Params;
use crate::place;
use crate::problem::Problem;
use crate::ratio;
use crate::solver::Shape;

/// What overlaps in a layout, at full width and below.
pub(crate) fn measure(problem: &Problem, positions: &[DVec2]) -> Widths {
    let mut widths = Widths { radius_scale: 1.0, length_scale: 1.0, ..Widths::default() };
    widths.is_complete = overlap::each_meeting(problem, positions, |meeting| {
        if meeting.is_overlap() {
            widths.overlaps += 1;
            widths.radius_scale = widths.radius_scale.min(meeting.distance_mm / meeting.reach_mm);
        }
    });
    (widths.area_needed_mm2, widths.area_available_mm2) = area::needed_and_available(problem);
    widths
}

/// Another layout at its widths.
pub(crate) struct Changed {
    /// Plane mm.
    pub(crate) positions: Vec<DVec2>,
    /// By what all lengths were scaled.
    pub(crate) length_scale: f64,
}

/// What the params ask for where tubes overlap; nothing if none do, or if nothing better was found.
pub(crate) fn change(problem: &Problem, positions: &[DVec2], params: &Params) -> Option<Changed> {
    let mode = params.widths.mode;
    if mode == WidthsMode::Report {
        return None;
    }
    let found = measure(problem, positions);
    if found.overlaps == 0 || !found.is_complete {
        return None;
    }
    let shape = avoid::avoid(problem, &params.solver, &nearest_shape(problem, positions));
    let avoided = shape.map(|shape| shape.positions(problem));
    // The shape is only near the layout where that was not made by ratios.
    let avoided = avoided.filter(|avoided| measure(problem, avoided).overlaps < found.overlaps);
    let is_same = avoided.is_none();
    let positions = avoided.unwrap_or_else(|| positions.to_vec());
    let length_scale = stretch(problem, params, &positions);
    if is_same && length_scale == 1.0 {
        return None;
    }
    Some(Changed {
        positions: positions.into_iter().map(|place| place * length_scale).collect(),
        length_scale,
    })
}

/// The shape with fewer overlaps, if there are any, the params ask for it, and one is found; what may not change in the
/// problem stays.
pub(crate) fn avoided(problem: &Problem, params: &Params, shape: &Shape) -> Option<Shape> {
    let asks = params.widths.mode != WidthsMode::Report;
    let found = asks.then(|| measure(problem, &shape.positions(problem)))?;
    let has_some = found.overlaps > 0 && found.is_complete;
    has_some.then(|| avoid::avoid(problem, &params.solver, shape)).flatten()
}

/// The least scale of the lengths at which nothing overlaps, where the params ask for it.
pub(crate) fn stretch(problem: &Problem, params: &Params, positions: &[DVec2]) -> f64 {
    let asks = params.widths.mode == WidthsMode::Stretch;
    asks.then(|| stretch::least_scale(problem, positions)).flatten().unwrap_or(1.0)
}

/// The ratios of a layout: its own, if it was made by ratios.
fn nearest_shape(problem: &Problem, positions: &[DVec2]) -> Shape {
    let mut shape = Shape::from_headings(problem, &place::headings(problem, positions));
    let (low, high) = ratio::LENGTH_RANGE;
    for (segment, branch) in problem.branches.list().iter().enumerate() {
        let edges = branch.nodes.clone();
        let drawn_mm = |node: usize| positions[node].distance(positions[problem.parent[node] as usize]);
        let target_mm: f64 = edges.clone().map(|node| problem.targets.length_mm[node]).sum();
        shape.length_ratio[segment] = (edges.map(drawn_mm).sum::<f64>() / target_mm - 1.0).clamp(low, high);
    }
    shape
}

#[cfg(test)]
mod tests {
    use espalier_geom::plane::segment_distance;
    use espalier_model::Tree;

    use super::*;
    use crate::common::{random_tree, views_along};
    use crate::layout::cone;
    use crate::separation::segment;
    use crate::targets;

    fn thick_tree(key: u32) -> Tree {
        let tree = random_tree(key as usize % 8, 50, 1.0, false, key);
        let mut nodes = tree.nodes().to_vec();
        nodes.iter_mut().enumerate().for_each(|(node, data)| data.radius_mm = 0.1 + 0.01 * node as f64);
        Tree::new(&nodes).expect("a tree")
    }

    #[test]
    fn overlaps_grow_with_the_radius_scale_from_where_it_says() {
        let mut n_overlapping = 0;
        for key in 0..60 {
            let tree = thick_tree(key);
            let views = views_along(&tree, glam::DVec3::Z);
            let branches = tree.branches();
            let params = Params::default();
            let targets = targets::targets(&tree, &branches, &views, params.targets).expect("targets");
            let problem = Problem::new(&tree, branches, targets, &params);
            let positions = place::from_headings(&problem, &cone::headings(&problem));
            let widths = measure(&problem, &positions);
            // Every pair, by the definition.
            let tubes = overlap::Tubes::new(&problem, &positions);
            let at = |share: f64| {
                let is_overlap = |a: usize, b: usize| {
                    let [s, t] = [a, b].map(|edge| segment(&problem, &positions, edge));
                    let has_common =
                        problem.parent[b] as usize == a || problem.parent[a] == problem.parent[b];
                    let reach_mm = share * (tubes.radius_mm(a) + tubes.radius_mm(b));
                    !has_common && tubes.must_part(a, b) && segment_distance(&s, &t) < reach_mm
                };
                (1..50).map(|b| (1..b).filter(|&a| is_overlap(a, b)).count()).sum::<usize>()
            };
            let counts: Vec<usize> = (0..=20).map(|step| at(0.05 * f64::from(step))).collect();
            assert!(counts.windows(2).all(|pair| pair[0] <= pair[1]), "tree {key}: {counts:?}");
            assert_eq!(at(1.0), widths.overlaps, "tree {key}");
            assert_eq!(at(widths.radius_scale * (1.0 - 1e-9)), 0, "tree {key}");
            if widths.overlaps > 0 {
                n_overlapping += 1;
                assert!(at(widths.radius_scale * (1.0 + 1e-9)) > 0, "tree {key}");
            }
        }
        assert!(n_overlapping > 20, "{n_overlapping}");
    }

    #[test]
    fn the_least_scale_is_the_first_without_overlaps() {
        let mut n_scaled = 0;
        for key in 0..40 {
            let tree = thick_tree(key);
            let views = views_along(&tree, glam::DVec3::Z);
            let branches = tree.branches();
            let params = Params::default();
            let targets = targets::targets(&tree, &branches, &views, params.targets).expect("targets");
            let problem = Problem::new(&tree, branches, targets, &params);
            let positions = place::from_headings(&problem, &cone::headings(&problem));
            let overlaps_at = |scale: f64| {
                let scaled: Vec<DVec2> = positions.iter().map(|&place| place * scale).collect();
                measure(&problem, &scaled).overlaps
            };
            let scale = stretch::least_scale(&problem, &positions).expect("few pairs");
            assert_eq!(overlaps_at(scale), 0, "tree {key}: {scale}");
            n_scaled += usize::from(scale > 1.0);
            for step in 0..50 {
                let below = 1.0 + (scale - 1.0) * f64::from(step) / 50.0;
                assert!(scale == 1.0 || overlaps_at(below) > 0, "tree {key}: {below} of {scale}");
            }
        }
        assert!(n_scaled > 20, "{n_scaled}");
    }
}
