//! The last rigid motion, and rounding.
//!
//! **Input** a layout in any pose, the rule for its rotation. **Output** rounded positions, root at the origin;
//! pose; quantum.
//! **Notation** h headings of the layout, H those in the global view, w = conf · l their weights, φ the rotation.
//! **Steps** 1. How well the layout can agree with the view: A = Σ w e^{i(H − h)}; the least
//! Σ w (1 − cos(h + φ − H)) over all φ is Σ w − |A|. The same for its mirror image, whose headings are π − h.
//! 2. Take the mirror image if it costs less by more than 1e-9 Σ w. 3. Turn the whole: `view` by φ = arg A;
//! `root-on-top` so that the centroid of its length lies straight below the root, as if it hung there, and where
//! root and centroid are one, as `view`. 4. Round to a power of ten at 12 significant digits of the extent, by
//! formatting and parsing, so that memory equals file.
//! **Guarantees** whatever the rotation, the picture has the handedness of the global view as nearly as its layout
//! can: patient's right on the viewer's left where that view looks from the front. A layout that meets targets
//! whose mirrors the closed loop of the views has chosen is hardly ever reflected: that loop tried it already.
//! Targets stay as they are; `Posed::unreflected` has the turns that compare with them, exactly.
//! **Differs from the source** [Hu2022] says nothing about the pose.
//! **Cost** O(N).

use std::f64::consts::{FRAC_PI_2, PI};

use espalier_geom::angle::heading;
use espalier_geom::math;
use espalier_model::Pose;
use glam::DVec2;

use crate::choices::PoseMode;
use crate::place;
use crate::problem::Problem;

/// Significant digits of the largest coordinate.
const DIGITS: i32 = 12;
/// A share of Σ w, or of the tree's length: what is smaller comes from rounding.
const NOTHING: f64 = 1e-9;

/// A layout in its final pose.
pub(crate) struct Posed {
    pub(crate) positions: Vec<DVec2>,
    pub(crate) pose: Pose,
    pub(crate) quantum_mm: f64,
}

impl Posed {
    /// The positions as written, in the handedness of the targets: mirrored back if they were mirrored.
    pub(crate) fn unreflected(&self) -> Vec<DVec2> {
        let back = |p: &DVec2| if self.pose.is_reflected { reflected(*p) } else { *p };
        self.positions.iter().map(back).collect()
    }
}

/// Reflects, turns, moves and rounds a layout.
pub(crate) fn pose(problem: &Problem, positions: &[DVec2], mode: PoseMode) -> Posed {
    let mut posed: Vec<DVec2> = positions.iter().map(|&p| p - positions[0]).collect();
    let heading_rad = place::headings(problem, &posed);
    let mirrored_rad: Vec<f64> = heading_rad.iter().map(|h| PI - h).collect();
    let (agreement, weight) = agreement(problem, &heading_rad);
    let (mirrored, _) = self::agreement(problem, &mirrored_rad);
    let is_reflected = is_reflected(agreement, mirrored, weight);
    if is_reflected {
        posed.iter_mut().for_each(|p| *p = reflected(*p));
    }

    let as_seen_rad = heading(if is_reflected { mirrored } else { agreement });
    let rotation_rad = match mode {
        PoseMode::Auto | PoseMode::View => as_seen_rad,
        PoseMode::RootOnTop => hanging_rad(problem, &posed).unwrap_or(as_seen_rad),
    };
    let pose = Pose { rotation_rad, is_reflected };
    turned_and_rounded(posed, pose)
}

/// Moves a layout as another was moved, so that what both have in common lies in the same place.
pub(crate) fn posed_like(positions: &[DVec2], pose: Pose) -> Posed {
    let moved = |&p: &DVec2| {
        let p = p - positions[0];
        if pose.is_reflected { reflected(p) } else { p }
    };
    turned_and_rounded(positions.iter().map(moved).collect(), pose)
}

fn turned_and_rounded(mut posed: Vec<DVec2>, pose: Pose) -> Posed {
    let turn = math::unit_vector(pose.rotation_rad);
    posed.iter_mut().for_each(|p| *p = turn.rotate(*p));

    let extent = posed.iter().fold(0.0_f64, |extent, p| extent.max(p.x.abs()).max(p.y.abs()));
    let decimals = decimals(extent);
    for p in &mut posed {
        *p = DVec2::new(round(p.x, decimals), round(p.y, decimals));
    }
    let quantum_mm = format!("1e-{decimals}").parse().unwrap_or(1.0);
    Posed { positions: posed, pose, quantum_mm }
}

/// Whether the mirror image agrees better with the view, by more than rounding can.
pub(crate) fn is_reflected(agreement: DVec2, mirrored: DVec2, weight: f64) -> bool {
    mirrored.length() > agreement.length() + NOTHING * weight
}

/// A = Σ w e^{i(H − h)} and Σ w.
pub(crate) fn agreement(problem: &Problem, heading_rad: &[f64]) -> (DVec2, f64) {
    let (mut sum, mut total) = (DVec2::ZERO, 0.0);
    for (node, &heading_rad) in heading_rad.iter().enumerate().skip(1) {
        let weight = problem.targets.confidence[node] * problem.targets.length_mm[node];
        sum += weight * math::unit_vector(problem.targets.heading_rad[node] - heading_rad);
        total += weight;
    }
    (sum, total)
}

/// The rotation that brings the centroid of the layout's length straight below its root, which is the origin;
/// `None` if the centroid is the root.
fn hanging_rad(problem: &Problem, positions: &[DVec2]) -> Option<f64> {
    let (mut moment, mut total) = (DVec2::ZERO, 0.0);
    for (node, parent) in problem.tree.edges() {
        let length = positions[node].distance(positions[parent]);
        moment += 0.5 * length * (positions[node] + positions[parent]);
        total += length;
    }
    let has_direction = moment.length() > NOTHING * total * total;
    has_direction.then(|| -FRAC_PI_2 - heading(moment))
}

/// The mirror image of a point, left and right changed; the mirror image of that is the point itself, bit for bit.
fn reflected(p: DVec2) -> DVec2 {
    // 0 − x and not −x: there shall be no −0.
    DVec2::new(0.0 - p.x, p.y)
}

/// Decimals that give the extent its digits; never a negative number of them.
fn decimals(extent: f64) -> usize {
    if extent == 0.0 {
        return 0;
    }
    let n_before_point = math::floor(math::log10(extent)) as i32 + 1;
    usize::try_from(DIGITS - n_before_point).unwrap_or(0)
}

/// The number that a reader of the file will have.
fn round(value: f64, decimals: usize) -> f64 {
    let rounded: f64 = format!("{value:.decimals$}").parse().unwrap_or(value);
    // −0 and 0 are one coordinate and shall have one byte pattern.
    rounded + 0.0
}

#[cfg(test)]
mod tests {
    use espalier_geom::angle::wrap;
    use espalier_model::Tree;
    use glam::DVec3;

    use super::*;
    use crate::common::{random_tree, tree_of, views_along};
    use crate::layout::cone;
    use crate::params::Params;
    use crate::{energy, losses, targets};

    fn problem(tree: &Tree) -> Problem<'_> {
        let (params, branches) = (Params::default(), tree.branches());
        let views = views_along(tree, DVec3::Z);
        let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
        Problem::new(tree, branches, targets, &params)
    }

    /// Σ w (1 − cos(h − H)) by its definition.
    fn cost(problem: &Problem, positions: &[DVec2]) -> f64 {
        let heading_rad = place::headings(problem, positions);
        let off = |node: usize| heading_rad[node] - problem.targets.heading_rad[node];
        let weight = |node: usize| problem.targets.confidence[node] * problem.targets.length_mm[node];
        (1..positions.len()).map(|node| weight(node) * (1.0 - math::cos(off(node)))).sum()
    }

    #[test]
    fn the_pose_costs_least_of_all_rotations_and_mirror_images() {
        let mut n_reflected = 0;
        for key in 0..100 {
            let tree = random_tree(key as usize % 8, 30, 1.0, false, key);
            let problem = problem(&tree);
            let mut positions = place::from_headings(&problem, &cone::headings(&problem));
            if key % 2 == 1 {
                positions.iter_mut().for_each(|p| *p = reflected(*p));
            }
            let posed = pose(&problem, &positions, PoseMode::View);
            n_reflected += usize::from(posed.pose.is_reflected);
            let (least, scale) = (cost(&problem, &posed.positions), tree.length_mm());
            for step in 0..100 {
                let turn = math::unit_vector(f64::from(step) * 0.063);
                for mirror in [1.0, -1.0] {
                    let other: Vec<DVec2> =
                        positions.iter().map(|p| turn.rotate(DVec2::new(mirror * p.x, p.y))).collect();
                    assert!(least <= cost(&problem, &other) + 2e-9 * scale, "tree {key}");
                }
            }
        }
        assert!((30..70).contains(&n_reflected), "{n_reflected}");
    }

    #[test]
    fn a_reflected_picture_is_scored_as_its_layout() {
        let mut n_reflected = 0;
        for key in 0..40 {
            let tree = random_tree(key as usize % 8, 40, 1.0, false, key);
            let problem = problem(&tree);
            let layout = place::from_headings(&problem, &cone::headings(&problem));
            // A layout that agrees better with a mirror image of the view: its own headings, mirrored.
            let mut opposite = problem;
            opposite.targets.heading_rad =
                place::headings(&opposite, &layout).iter().map(|h| wrap(PI - h)).collect();
            opposite.targets.confidence = vec![1.0; layout.len()];
            let posed = pose(&opposite, &layout, PoseMode::View);
            n_reflected += usize::from(posed.pose.is_reflected);
            let found = energy::score(&opposite, &posed.unreflected(), posed.quantum_mm, 0).energy;
            let expected = energy::score(&opposite, &layout, posed.quantum_mm, 0).energy;
            assert!((found.angle - expected.angle).abs() < 1e-6 * expected.angle.max(1.0), "tree {key}");
            let (found, expected) =
                (losses::losses(&opposite, &posed.unreflected()), losses::losses(&opposite, &layout));
            assert!((found.angle_loss_mean - expected.angle_loss_mean).abs() < 1e-6, "tree {key}");
        }
        assert!(n_reflected > 30, "{n_reflected}");
    }

    #[test]
    fn a_tree_hangs_from_its_root() {
        for key in 0..40 {
            let tree = random_tree(key as usize % 8, 30, 1.0, false, key);
            let problem = problem(&tree);
            let layout = place::from_headings(&problem, &cone::headings(&problem));
            let hanging = pose(&problem, &layout, PoseMode::RootOnTop);
            let centroid = tree.edges().fold(DVec2::ZERO, |sum, (node, parent)| {
                sum + tree.edge_length_mm(node) * (hanging.positions[node] + hanging.positions[parent])
            });
            assert!(centroid.y < 0.0 && centroid.x.abs() < 1e-6 * -centroid.y, "tree {key}: {centroid}");
            // The rotation is the only difference.
            assert_eq!(hanging.pose.is_reflected, pose(&problem, &layout, PoseMode::View).pose.is_reflected);
        }
    }

    #[test]
    fn a_tree_balanced_on_its_root_keeps_the_view() {
        let tree = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (1.0, 2.0, 0.0, Some(0)),
            (-1.0, -2.0, 0.0, Some(0)),
            (2.0, -1.0, 0.0, Some(0)),
            (-2.0, 1.0, 0.0, Some(0)),
        ]);
        let problem = problem(&tree);
        let layout: Vec<DVec2> = tree.nodes().iter().map(|node| node.position_mm.truncate().perp()).collect();
        let posed = pose(&problem, &layout, PoseMode::RootOnTop);
        for (flat, node) in posed.positions.iter().zip(tree.nodes()) {
            assert!(flat.distance(node.position_mm.truncate()) < 1e-9, "{flat}");
        }
    }
}
