//! The radial layout bent back towards one view: the baseline of Marino and Kaufman, reconstructed.
//!
//! **Input** the problem, one view of the whole tree. **Output** positions with exact lengths.
//! **Notation** turn of a node = heading of its edge less that of its parent's; Δ = what a turn is off its target.
//! **Steps** 1. Project every edge along the view: the turn that the picture shows is the target. 2. `order`: the
//! children of each fork in the order in which the view shows their subtrees. 3. The radial layout in that order,
//! turned as a whole so that the root's edges agree best with the view. 4. `recovery`: turns go back towards their
//! targets, a tenth at a time, as long as nothing crosses.
//! **Guarantees** no crossing, as in `radial`: a turn that would make one is not taken. Lengths are exact.
//! **Source** [Marino2015].
//! **Differs from the source** its text leaves open what a program needs, and there is no public code; so this is a
//! reconstruction. What we assume, beside the constants of `recovery`:
//! - The projection is orthographic, and the view is one for the whole tree: by default the best global view.
//! - The target is the angle between *projected* edges, the length that in space, which is never changed.
//! - Children stand in the order of the centres of their subtrees, as far as the shortest of them reaches, counter-
//!   clockwise from the direction back to the parent.
//! - The root's edges, which have no parent, aim at their headings in the view.
//! - An edge that the view shows end-on goes on straight, and so do those after it.
//!
//! **Cost** as `recovery`: seconds for a neuron of 10,000 nodes.

mod circles;
mod order;
mod recovery;

use espalier_geom::angle::{heading, wrap};
use espalier_geom::math;
use espalier_model::{View, ViewHierarchy};
use glam::{DVec2, DVec3};

use crate::choices::MarinoView;
use crate::layout::{Layout, radial};
use crate::params::MarinoParams;
use crate::place;
use crate::problem::Problem;

/// A projection shorter than this share of its edge has no direction.
const VANISHING: f64 = 1e-9;

/// Lays the tree out towards the view that the params choose.
pub(crate) fn layout(problem: &Problem, views: &ViewHierarchy, params: &MarinoParams) -> Layout {
    let seen = Seen::new(problem, &view(views, params));
    let order = order::Order::new(problem, &seen);
    let mut heading_rad = radial::headings_in_order(problem, |fork| order.children(fork));
    seen.turn_whole(problem, &mut heading_rad);

    let off_rad = seen.residuals(problem, &heading_rad);
    let recovered = recovery::recover(problem, &heading_rad, off_rad);
    let positions = place::from_headings(problem, &recovered.heading_rad);
    Layout {
        evaluations: recovered.n_tried,
        ..Layout::constructed(&name(params.view, &recovered), positions)
    }
}

fn name(view: MarinoView, recovered: &recovery::Recovered) -> String {
    let view = match view {
        MarinoView::Auto => String::new(),
        view => format!(" {}", view.name()),
    };
    let n_sweeps = recovered.residual_rad.len() - 1;
    let cut = if recovered.is_cut { format!(" cut at {n_sweeps} sweeps") } else { String::new() };
    format!("marino{view}{cut}")
}

/// The view: the axes are those of RAS+, and the patient's right or front is on the viewer's left.
fn view(views: &ViewHierarchy, params: &MarinoParams) -> View {
    let (towards_camera, up) = match params.view {
        MarinoView::Auto => return views.global,
        MarinoView::Coronal => (DVec3::Y, DVec3::Z),
        MarinoView::Sagittal => (DVec3::NEG_X, DVec3::Z),
        MarinoView::Axial => (DVec3::NEG_Z, DVec3::Y),
        MarinoView::Towards | MarinoView::File => params.axes(),
    };
    View { towards_camera, up, ..views.global }
}

/// The tree as the view shows it.
pub(super) struct Seen {
    /// The picture of each node, mm.
    pub(super) positions: Vec<DVec2>,
    /// The heading of each edge; where the view shows it end-on, none.
    heading_rad: Vec<Option<f64>>,
    /// The same, or the heading of the last edge above that can be seen; 0 if there is none.
    pub(super) ahead_rad: Vec<f64>,
}

impl Seen {
    pub(super) fn new(problem: &Problem, view: &View) -> Self {
        let root = problem.tree.position_mm(0);
        let nodes = problem.tree.nodes();
        let positions: Vec<DVec2> = nodes.iter().map(|node| view.project(node.position_mm - root)).collect();
        let edge_heading = |node: usize| {
            let flat = positions[node] - positions[problem.parent[node] as usize];
            (flat.length() > VANISHING * problem.targets.length_mm[node]).then(|| heading(flat))
        };
        let heading_rad: Vec<Option<f64>> = (0..nodes.len()).map(edge_heading).collect();
        let mut ahead_rad = vec![0.0; nodes.len()];
        for node in 1..nodes.len() {
            ahead_rad[node] = heading_rad[node].unwrap_or(ahead_rad[problem.parent[node] as usize]);
        }
        Self { positions, heading_rad, ahead_rad }
    }

    /// Turns a layout as a whole, so that the root's edges agree with the view as well as they can.
    fn turn_whole(&self, problem: &Problem, heading_rad: &mut [f64]) {
        let agreement = |&child: &usize| {
            let seen_rad = self.heading_rad[child]?;
            Some(math::unit_vector(seen_rad - heading_rad[child]))
        };
        let sum: DVec2 = problem.tree.children(0).iter().filter_map(agreement).sum();
        let turn_rad = heading(sum);
        heading_rad.iter_mut().skip(1).for_each(|heading_rad| *heading_rad += turn_rad);
    }

    /// Δ of every node; 0 for the root.
    fn residuals(&self, problem: &Problem, heading_rad: &[f64]) -> Vec<f64> {
        let off = |node: usize| {
            let parent = problem.parent[node] as usize;
            let turn_rad = heading_rad[node] - heading_rad[parent];
            match (self.heading_rad[node], self.heading_rad[parent]) {
                (Some(seen_rad), _) if parent == 0 => wrap(seen_rad - heading_rad[node]),
                (None, _) if parent == 0 => 0.0,
                (Some(seen_rad), Some(before_rad)) => wrap(seen_rad - before_rad - turn_rad),
                _ => wrap(-turn_rad),
            }
        };
        std::iter::once(0.0).chain((1..heading_rad.len()).map(off)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certify;
    use crate::common::{FAMILIES, random_tree, tree_of, views_along};
    use crate::params::Params;
    use crate::targets;
    use espalier_model::Tree;

    fn problem<'a>(tree: &'a Tree, views: &ViewHierarchy) -> Problem<'a> {
        let params = Params::default();
        let branches = tree.branches();
        let targets = targets::targets(tree, &branches, views, params.targets).expect("targets");
        Problem::new(tree, branches, targets, &params)
    }

    fn laid_out(tree: &Tree, params: &MarinoParams) -> Layout {
        let views = views_along(tree, DVec3::Z);
        layout(&problem(tree, &views), &views, params)
    }

    #[test]
    fn it_never_crosses_and_residuals_never_rise() {
        for key in 0..120 {
            let family = key as usize % 8;
            let tree = random_tree(family, 2 + (key as usize * 7) % 90, f64::from(key % 5), false, key);
            let views = views_along(&tree, DVec3::Z);
            let problem = problem(&tree, &views);
            let seen = Seen::new(&problem, &views.global);
            let order = order::Order::new(&problem, &seen);
            let mut heading_rad = radial::headings_in_order(&problem, |fork| order.children(fork));
            seen.turn_whole(&problem, &mut heading_rad);
            let off_rad = seen.residuals(&problem, &heading_rad);
            let recovered = recovery::recover(&problem, &heading_rad, off_rad);
            let residual = &recovered.residual_rad;
            assert!(residual.windows(2).all(|pair| pair[1] <= pair[0]), "{} {key}", FAMILIES[family]);

            let layout = laid_out(&tree, &MarinoParams::default());
            let certificate = certify::certify(&tree, &layout.positions);
            assert!(certificate.holds(), "{} {key}: {:?}", FAMILIES[family], certificate.pairs);
            for (node, parent) in tree.edges() {
                let length_mm = layout.positions[node].distance(layout.positions[parent]);
                let exact_mm = tree.edge_length_mm(node);
                assert!((length_mm - exact_mm).abs() < 1e-9 * tree.length_mm(), "tree {key}, node {node}");
            }
            // What the layout is off the view is what the recovery says it is.
            let off_rad = seen.residuals(&problem, &place::headings(&problem, &layout.positions));
            let sum: f64 = off_rad.iter().map(|off| off.abs()).sum();
            assert!((sum - residual[residual.len() - 1]).abs() < 1e-6, "tree {key}");
        }
    }

    #[test]
    fn a_planar_tree_comes_back_as_the_view_shows_it() {
        // A stem, a fork, and an arm that bends: nothing is in the way, so every projected angle is reached.
        let flat = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (0.0, -2.0, 0.0, Some(0)),
            (2.0, -3.0, 0.0, Some(1)),
            (4.0, -2.5, 0.0, Some(2)),
            (-1.0, -4.0, 0.0, Some(1)),
        ]);
        let layout = laid_out(&flat, &MarinoParams::default());
        assert_eq!(layout.name, "marino");
        for (node, position) in layout.positions.iter().enumerate() {
            assert!(position.distance(flat.position_mm(node).truncate()) < 1e-9, "{node}: {position}");
        }
    }

    #[test]
    fn lengths_are_those_in_space_and_turns_those_of_the_view() {
        // Seen along z: ahead, then 90° to the left; in space each edge climbs as far as it goes.
        let tree = tree_of(&[(0.0, 0.0, 0.0, None), (1.0, 0.0, 1.0, Some(0)), (1.0, 1.0, 2.0, Some(1))]);
        let layout = laid_out(&tree, &MarinoParams::default());
        let root_2 = std::f64::consts::SQRT_2;
        assert!(layout.positions[1].distance(DVec2::new(root_2, 0.0)) < 1e-12);
        assert!(layout.positions[2].distance(DVec2::new(root_2, root_2)) < 1e-12);
        // Seen from the front, it goes to the viewer's left and up, then straight up: 45°.
        let coronal = MarinoParams { view: MarinoView::Coronal, ..MarinoParams::default() };
        let layout = laid_out(&tree, &coronal);
        assert_eq!(layout.name, "marino coronal");
        assert!(layout.positions[1].distance(DVec2::new(-1.0, 1.0)) < 1e-12);
        assert!(layout.positions[2].distance(DVec2::new(-1.0, 1.0 + root_2)) < 1e-12);
    }

    #[test]
    fn what_is_in_the_way_is_not_passed() {
        // The second arm curls back over the first in the view: the last edge would cross it.
        let tree = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (4.0, 0.0, 0.0, Some(0)),
            (0.0, 1.0, 0.0, Some(0)),
            (2.0, 1.0, 0.0, Some(2)),
            (2.0, -1.0, 0.0, Some(3)),
        ]);
        let layout = laid_out(&tree, &MarinoParams::default());
        assert!(certify::certify(&tree, &layout.positions).holds());
        let seen: Vec<DVec2> = tree.nodes().iter().map(|node| node.position_mm.truncate()).collect();
        assert_eq!(certify::certify(&tree, &seen).crossings, 1);
        let p = &layout.positions;
        let turn_rad = |p: &[DVec2], node: usize| (p[2] - p[0]).angle_to(p[node] - p[node - 1]);
        // It turns to the right as in the view, but not as far.
        assert!(turn_rad(p, 3) < -0.5 && turn_rad(p, 4) > turn_rad(&seen, 4) + 0.1);
    }

    #[test]
    fn each_view_gives_its_own_layout() {
        let tree = random_tree(0, 60, 1.0, false, 3);
        let of = |view: MarinoView| laid_out(&tree, &MarinoParams { view, ..MarinoParams::default() });
        let (auto, coronal) = (of(MarinoView::Auto), of(MarinoView::Coronal));
        let (sagittal, axial) = (of(MarinoView::Sagittal), of(MarinoView::Axial));
        let towards = of(MarinoView::Towards);
        // `towards` defaults to the front, and `auto` looks along z from above here, `axial` from below.
        assert_eq!(towards.positions, coronal.positions);
        for (a, b) in [(&auto, &coronal), (&auto, &sagittal), (&coronal, &sagittal), (&auto, &axial)] {
            assert_ne!(a.positions, b.positions);
        }
        for (view, towards_camera, up) in [
            (&sagittal, [-2.0, 0.0, 0.0], [-1.0, 0.0, 5.0]),
            (&axial, [0.0, 0.0, -1.0], [0.0, 3.0, 0.0]),
            (&auto, [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
        ] {
            let same = MarinoParams { view: MarinoView::Towards, towards_camera, up, view_file: None };
            // The vectors are brought to unit length, so the last bits may differ.
            let positions = laid_out(&tree, &same).positions;
            assert!(positions.iter().zip(&view.positions).all(|(a, b)| a.distance(*b) < 1e-9));
        }
    }

    #[test]
    fn children_stand_in_the_order_of_their_subtrees() {
        // Both arms leave to the right, the second a little higher, but it soon turns down below the first.
        let tree = tree_of(&[
            (0.0, 0.0, 0.0, None),
            (1.0, 0.0, 0.0, Some(0)),
            (2.0, 0.1, 0.0, Some(1)),
            (3.0, 0.2, 0.0, Some(2)),
            (5.0, 0.3, 0.0, Some(3)),
            (1.2, 0.1, 0.0, Some(1)),
            (2.0, -2.0, 0.0, Some(5)),
            (2.5, -4.0, 0.0, Some(6)),
        ]);
        let views = views_along(&tree, DVec3::Z);
        let problem = problem(&tree, &views);
        let seen = Seen::new(&problem, &views.global);
        assert_eq!(order::Order::new(&problem, &seen).children(1), [5, 2]);
    }
}
