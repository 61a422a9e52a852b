//! What a layout loses: the paper's two metrics, degrees, and what they do not see.
//!
//! | file | what |
//! |---|---|
//! | `mod` | Metric 1, Metric 2, the errors of angles in degrees |
//! | `form` | angles between siblings, chords of branches, what points backward, the box |
//! | `clearance` | how near edges come that are far apart along the tree |
//!
//! **Input** rounded positions. **Output** `Losses`, those of distances aside (see `distances`).
//! **Notation** θ, l targets; θ_e, l_e embedded; φ the interior angle in space (π = straight), φ_e in the plane.
//! **Steps** Metric 1: |l − l_e| / l over edges, |θ − θ_e| / θ over nodes with a grandparent. Metric 2:
//! |φ − φ_e| / max(φ, 5°) over the same nodes, and |φ − φ_e| in degrees: mean, 95th percentile by nearest rank,
//! maximum, and mean weighted by the length of the edge that turns.
//! **Source** [Hu2022] section 5.1.1.
//! **Differs from the source** it calls the angle of Metric 2 acute, but only the interior angle has the size of
//! its figures; the guard keeps fold-backs from ruling the mean.
//! **Cost** O(N log N), and the pairs that `clearance` looks at.

mod clearance;
mod form;

use std::f64::consts::PI;

use espalier_geom::angle::wrap_positive;
use espalier_model::Losses;
use glam::DVec2;

use crate::place;
use crate::problem::Problem;
use crate::targets::interior_angle;

/// The least denominator of Metric 2: 5°.
const GUARD_RAD: f64 = 5.0 * PI / 180.0;

/// Mean and maximum under construction.
#[derive(Default)]
struct Summary {
    sum: f64,
    max: f64,
    count: usize,
}

impl Summary {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.max = self.max.max(value);
        self.count += 1;
    }

    fn mean(&self) -> f64 {
        if self.count == 0 { 0.0 } else { self.sum / self.count as f64 }
    }
}

/// All losses of a layout but those of distances.
pub(crate) fn losses(problem: &Problem, positions: &[DVec2]) -> Losses {
    let heading_rad = place::headings(problem, positions);
    let turn_rad = place::turns(problem, &heading_rad);
    let length = length_losses(problem, positions);
    let angle = angle_losses(problem, &turn_rad);
    let (angle3d, errors_deg) = angle3d_losses(problem, &turn_rad);
    let degrees = Degrees::of(problem, &errors_deg);
    let siblings = form::sibling_errors_deg(problem, positions);
    let chords = form::chord_errors(problem, positions);
    let clearance_mm = clearance::clearance_mm(problem, positions);
    let (box_area_mm2, box_aspect) = form::bounding_box(positions);
    Losses {
        length_loss_mean: length.mean(),
        length_loss_max: length.max,
        angle_loss_mean: angle.mean(),
        angle_loss_max: angle.max,
        angle3d_loss_mean: angle3d.mean(),
        angle3d_loss_max: angle3d.max,
        angle3d_error_mean_deg: degrees.mean,
        angle3d_error_max_deg: degrees.max,
        angle3d_error_p95_deg: degrees.p95,
        angle3d_error_weighted_deg: degrees.weighted,
        sibling_error_mean_deg: siblings.mean(),
        sibling_error_max_deg: siblings.max,
        chord_error_mean: chords.mean(),
        chord_error_max: chords.max,
        clearance_min_mm: clearance_mm,
        clearance_min_edges: if problem.scale_mm > 0.0 { clearance_mm / problem.scale_mm } else { 0.0 },
        backward_length_share: form::backward_share(problem, &heading_rad),
        box_area_mm2,
        box_aspect,
        ..Losses::default()
    }
}

/// Metric 1 of lengths.
fn length_losses(problem: &Problem, positions: &[DVec2]) -> Summary {
    let mut length = Summary::default();
    for (node, parent) in problem.tree.edges() {
        let target_mm = problem.targets.length_mm[node];
        length.add((positions[node].distance(positions[parent]) - target_mm).abs() / target_mm);
    }
    length
}

/// Metric 1 of angles.
fn angle_losses(problem: &Problem, turn_rad: &[f64]) -> Summary {
    let mut angle = Summary::default();
    for (node, _) in problem.tree.edges().filter(|&(_, parent)| parent != 0) {
        let target_rad = problem.targets.angle_rad[node];
        angle.add((target_rad - wrap_positive(turn_rad[node] + PI)).abs() / target_rad);
    }
    angle
}

/// Metric 2, and |φ − φ_e| in degrees by node; `NaN` where there is no angle.
fn angle3d_losses(problem: &Problem, turn_rad: &[f64]) -> (Summary, Vec<f64>) {
    let mut angle3d = Summary::default();
    let mut errors_deg = vec![f64::NAN; turn_rad.len()];
    for (node, parent) in problem.tree.edges().filter(|&(_, parent)| parent != 0) {
        let interior = interior_angle(problem.tree, node, parent);
        let error = (interior - (PI - turn_rad[node].abs())).abs();
        angle3d.add(error / interior.max(GUARD_RAD));
        errors_deg[node] = error.to_degrees();
    }
    (angle3d, errors_deg)
}

/// What is said of the errors of angles in degrees.
#[derive(Default)]
struct Degrees {
    mean: f64,
    p95: f64,
    max: f64,
    weighted: f64,
}

impl Degrees {
    fn of(problem: &Problem, errors_deg: &[f64]) -> Self {
        let (mut summary, mut moment, mut weight) = (Summary::default(), 0.0, 0.0);
        let mut sorted = Vec::with_capacity(errors_deg.len());
        for (node, &error) in errors_deg.iter().enumerate().filter(|(_, error)| !error.is_nan()) {
            summary.add(error);
            moment += problem.targets.length_mm[node] * error;
            weight += problem.targets.length_mm[node];
            sorted.push(error);
        }
        if sorted.is_empty() {
            return Self::default();
        }
        sorted.sort_by(f64::total_cmp);
        // Nearest rank: the ⌈0.95 n⌉-th, counted in whole numbers.
        let rank = (95 * sorted.len()).div_ceil(100);
        Self { mean: summary.mean(), p95: sorted[rank - 1], max: summary.max, weighted: moment / weight }
    }
}

#[cfg(test)]
mod tests {
    use espalier_model::Tree;
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::common::{random_tree, tree_of, views_along};
    use crate::params::Params;
    use crate::targets::targets;

    /// The losses of a layout; views look along z.
    fn losses_of(tree: &Tree, positions: &[(f64, f64)]) -> Losses {
        let (params, branches) = (Params::default(), tree.branches());
        let views = views_along(tree, DVec3::Z);
        let targets = targets(tree, &branches, &views, params.targets).expect("targets");
        let positions: Vec<DVec2> = positions.iter().map(|&(x, y)| DVec2::new(x, y)).collect();
        losses(&Problem::new(tree, branches, targets, &params), &positions)
    }

    fn near(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 1e-9
    }

    /// A stem of 1, a fork of two arms of 2 at right angles to it and to each other in space.
    fn corner() -> Tree {
        tree_of(&[
            (0.0, 0.0, 0.0, None),
            (0.0, 1.0, 0.0, Some(0)),
            (2.0, 1.0, 0.0, Some(1)),
            (0.0, 1.0, 2.0, Some(1)),
        ])
    }

    #[test]
    fn a_corner_laid_flat() {
        // Both arms keep their right angle to the stem, one to each side: the angle between them becomes 180°.
        let found = losses_of(&corner(), &[(0.0, 0.0), (0.0, 1.0), (2.0, 1.0), (-2.0, 1.0)]);
        assert!(near(found.angle3d_error_max_deg, 0.0), "{found:?}");
        assert!(near(found.sibling_error_mean_deg, 90.0) && near(found.sibling_error_max_deg, 90.0));
        assert!(near(found.chord_error_max, 0.0), "{found:?}");
        assert!(near(found.box_area_mm2, 4.0) && near(found.box_aspect, 0.25), "{found:?}");
        // The arm along the line of sight has no heading, so nothing points backward; no pair is far along the tree.
        assert!(near(found.backward_length_share, 0.0) && near(found.clearance_min_edges, 1.0), "{found:?}");
        // With the seen arm on the other side it points backward; the rotation of the whole may make up for that.
        let found = losses_of(&corner(), &[(0.0, 0.0), (0.0, 1.0), (1.0, 2.0), (-1.0, 0.0)]);
        assert!(near(found.angle3d_error_mean_deg, 45.0) && near(found.angle3d_error_weighted_deg, 45.0));
        assert!(near(found.length_loss_max, 1.0 - 0.5_f64.sqrt()), "{found:?}");
    }

    #[test]
    fn a_chain_folded_over() {
        // Four edges in a line in space; in the plane a narrow hook whose last edge runs back beside the second.
        let tree = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (10.0, 0.0, 0.0, Some(0)),
            (20.0, 0.0, 0.0, Some(1)),
            (21.0, 0.0, 0.0, Some(2)),
            (31.0, 0.0, 0.0, Some(3)),
        ]);
        let hook = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (20.0, 1.0), (10.0, 1.0)];
        let found = losses_of(&tree, &hook);
        // Angles 0°, 90°, 90° off for edges of 10, 1 and 10 mm.
        assert!(near(found.angle3d_error_mean_deg, 60.0) && near(found.angle3d_error_p95_deg, 90.0));
        assert!(near(found.angle3d_error_weighted_deg, 90.0 * 11.0 / 21.0), "{found:?}");
        assert!(near(found.chord_error_mean, 1.0 - 101.0_f64.sqrt() / 31.0), "{found:?}");
        // The last edge lies 1 mm from the second, whose near ends are 1 mm apart along the tree: not counted. It lies
        // 1 mm from the first, 11 mm along the tree: counted.
        assert!(near(found.clearance_min_mm, 1.0) && near(found.clearance_min_edges, 0.1), "{found:?}");
        // 10 of 31 mm point backward.
        assert!(near(found.backward_length_share, 10.0 / 31.0), "{found:?}");
        // The mirror image, turned, is as good.
        let turned: Vec<(f64, f64)> = hook.iter().map(|&(x, y)| (y, x)).collect();
        assert!(near(losses_of(&tree, &turned).backward_length_share, 10.0 / 31.0));
        // A crossing leaves no clearance.
        let crossed = losses_of(&tree, &[(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (5.0, 5.0), (5.0, -5.0)]);
        assert!(near(crossed.clearance_min_mm, 0.0), "{crossed:?}");
    }

    #[test]
    fn the_95th_percentile_is_the_nearest_rank() {
        let tree = tree_of(&std::array::from_fn::<_, 23, _>(|i| (i as f64, 0.0, 0.0, i.checked_sub(1))));
        let (params, branches) = (Params::default(), tree.branches());
        let targets =
            targets(&tree, &branches, &views_along(&tree, DVec3::Z), params.targets).expect("targets");
        let problem = Problem::new(&tree, branches, targets, &params);
        // 21 angles with the errors 1 … 21 in some order: the 20th of 21 is the ⌈19.95⌉-th.
        let errors: Vec<f64> =
            (0..23).map(|i| if i < 2 { f64::NAN } else { f64::from((i * 8) % 21 + 1) }).collect();
        let degrees = Degrees::of(&problem, &errors);
        assert_eq!((degrees.p95, degrees.max, degrees.mean), (20.0, 21.0, 11.0));
    }

    #[test]
    fn the_least_trees_have_finite_losses() {
        for (tree, positions) in [
            (tree_of(&[(1.0, 2.0, 3.0, None)]), vec![(0.0, 0.0)]),
            (tree_of(&[(0.0, 0.0, 0.0, None), (0.0, 0.0, 1.0, Some(0))]), vec![(0.0, 0.0), (1.0, 0.0)]),
        ] {
            let found = losses_of(&tree, &positions);
            for column in Losses::COLUMNS {
                assert!((column.of)(&found).is_finite(), "{}", column.column.name);
            }
        }
        // A closed loop of a branch has no chord to divide by.
        let ring = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (1.0, 0.0, 0.0, Some(0)),
            (1.0, 1.0, 0.0, Some(1)),
            (0.0, 0.0, 0.0, Some(2)),
        ]);
        let found = losses_of(&ring, &[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.4, 0.0)]);
        assert!(found.chord_error_max.is_finite() && found.chord_error_max > 10.0, "{found:?}");
    }

    #[test]
    fn losses_do_not_depend_on_the_pose() {
        for key in 0..24 {
            let tree = random_tree(key as usize % 8, 60, 1.0, false, key);
            let (params, branches) = (Params::default(), tree.branches());
            let views = views_along(&tree, DVec3::new(0.6, 0.0, 0.8));
            let targets = targets(&tree, &branches, &views, params.targets).expect("targets");
            let problem = Problem::new(&tree, branches, targets, &params);
            let layout: Vec<DVec2> = tree.nodes().iter().map(|node| node.position_mm.truncate()).collect();
            let turn = DVec2::new(0.8, -0.6);
            let turned: Vec<DVec2> = layout.iter().map(|p| turn.rotate(*p) + DVec2::new(3.0, -4.0)).collect();
            let (a, b) = (losses(&problem, &layout), losses(&problem, &turned));
            for column in Losses::COLUMNS.iter().filter(|column| !column.column.name.starts_with("box")) {
                let (a, b) = ((column.of)(&a), (column.of)(&b));
                assert!((a - b).abs() <= 1e-6 * a.abs().max(1.0), "{key} {}: {a} {b}", column.column.name);
            }
        }
    }
}
