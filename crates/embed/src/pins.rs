//! Pinned turns and lengths: what a manual edit has fixed, and what is still free around it.
//!
//! **Input** the problem, a layout as turns and lengths, what of it is pinned. **Output** a problem of which the
//! pinned part is a target that costs nothing and may not be left, and the shape that is the layout.
//! **Notation** τ turn against the parent's edge, ℓ drawn length; r_a, r_l ratios against the new targets.
//! **Steps** 1. A pinned turn or length becomes the target, its cost 0. 2. A free turn on the other side of its
//! target moves the target to that side: ratios cannot change the side of a turn. 3. Lengths of a segment that the
//! layout has stretched unevenly keep their proportions. 4. The ratios that draw the layout.
//! **Guarantees** the shape draws the layout, but for turns folded beyond the range of r_a, which are opened to it.
//! Where every free turn keeps its side, energies of the new problem and of the old one differ by a constant, what
//! the pinned part costs.
//! **Source** [Hu2022] section 3.3: "considers the ratios of the user-adjusted segment to be fixed".
//! **Cost** O(N).

use std::f64::consts::{PI, TAU};

use espalier_geom::angle::wrap;
use glam::DVec2;

use crate::place;
use crate::problem::Problem;
use crate::ratio;
use crate::solver::Shape;

/// Ratios nearer to each other than this differ by the rounding of coordinates only.
const NOTHING: f64 = 1e-9;

/// A layout as turns and lengths: what stays when the whole is moved.
#[derive(Clone, Debug)]
pub(crate) struct Drawn {
    /// The turn of each edge against its parent's, in radians; of the root's children against heading 0.
    pub(crate) turn_rad: Vec<f64>,
    /// The length of each edge, in mm.
    pub(crate) length_mm: Vec<f64>,
}

/// What may not change.
#[derive(Clone, Debug)]
pub(crate) struct Pins {
    /// By node: its turn.
    pub(crate) angle: Vec<bool>,
    /// By segment: its lengths.
    pub(crate) length: Vec<bool>,
}

impl Drawn {
    /// The turns and lengths of positions.
    pub(crate) fn of(problem: &Problem, positions: &[DVec2]) -> Self {
        let heading_rad = place::headings(problem, positions);
        let parent = |node: usize| problem.parent[node] as usize;
        let turn = |node: usize| wrap(heading_rad[node] - heading_rad[parent(node)]);
        Self {
            turn_rad: (0..positions.len()).map(turn).collect(),
            length_mm: (0..positions.len())
                .map(|node| positions[node].distance(positions[parent(node)]))
                .collect(),
        }
    }
}

impl Drawn {
    /// What a shape draws; pinned turns keep their bits.
    pub(crate) fn by(problem: &Problem, shape: &Shape) -> Self {
        let mut drawn =
            Self { turn_rad: vec![0.0; problem.n_nodes()], length_mm: vec![0.0; problem.n_nodes()] };
        for node in 1..problem.n_nodes() {
            drawn.turn_rad[node] = shape.turn_rad(problem, node);
            drawn.length_mm[node] = shape.length_mm(problem, node);
        }
        drawn
    }
}

impl Pins {
    /// Nothing is pinned.
    pub(crate) fn none(problem: &Problem) -> Self {
        Self { angle: vec![false; problem.n_nodes()], length: vec![false; problem.branches.list().len()] }
    }
}

/// The problem with a part of a layout pinned, and the shape that is the layout.
pub(crate) fn around<'a>(problem: &Problem<'a>, drawn: &Drawn, pins: &Pins) -> (Problem<'a>, Shape) {
    let mut pinned = problem.clone();
    let mut shape = Shape::targets(problem);
    for node in 1..problem.n_nodes() {
        set_angle(&mut pinned, node, drawn.turn_rad[node], pins.angle[node]);
        if !pins.angle[node] {
            let (low, high) = ratio::ANGLE_RANGE;
            let ratio = ratio::angle_ratio(pinned.targets.angle_rad[node], drawn.turn_rad[node]);
            shape.angle_ratio[node] = if ratio.abs() < NOTHING { 0.0 } else { ratio.clamp(low, high) };
        }
    }
    for segment in 0..pins.length.len() {
        shape.length_ratio[segment] =
            set_lengths(&mut pinned, segment, &drawn.length_mm, pins.length[segment]);
    }
    (pinned, shape)
}

/// The problem whose targets are what a shape draws: to leave that costs what the same ratios cost elsewhere.
pub(crate) fn held<'a>(problem: &Problem<'a>, shape: &Shape) -> Problem<'a> {
    let mut held = problem.clone();
    for node in 1..problem.n_nodes() {
        let turn_rad = shape.turn_rad(problem, node);
        held.targets.angle_rad[node] = PI + turn_rad;
        held.bend[node] = turn_rad.abs();
        if turn_rad != 0.0 {
            held.side[node] = turn_rad.signum();
        }
        held.targets.length_mm[node] = shape.length_mm(problem, node);
    }
    held
}

fn set_angle(problem: &mut Problem, node: usize, turn_rad: f64, is_pinned: bool) {
    if is_pinned {
        problem.targets.angle_rad[node] = PI + turn_rad;
        problem.bend[node] = turn_rad.abs();
        problem.side[node] = if turn_rad < 0.0 { -1.0 } else { 1.0 };
        problem.angle_cost[node] = 0.0;
        problem.free_angle[node] = false;
    } else if problem.side[node] * turn_rad < -NOTHING {
        // What is straight up to rounding is on neither side.
        problem.targets.angle_rad[node] = TAU - problem.targets.angle_rad[node];
        problem.side[node] = -problem.side[node];
    }
}

/// Gives a segment its target lengths; returns the ratio that draws it.
fn set_lengths(problem: &mut Problem, segment: usize, length_mm: &[f64], is_pinned: bool) -> f64 {
    let nodes = problem.branches.list()[segment].nodes.clone();
    let target_mm: f64 = problem.targets.length_mm[nodes.clone()].iter().sum();
    let drawn_mm: f64 = length_mm[nodes.clone()].iter().sum();
    let (low, high) = ratio::LENGTH_RANGE;
    let mut ratio = (drawn_mm / target_mm - 1.0).clamp(low, high);
    if is_pinned || ratio.abs() < NOTHING {
        ratio = 0.0;
    }
    for node in nodes {
        let as_drawn_mm = length_mm[node] / (1.0 + ratio);
        if is_pinned || (as_drawn_mm / problem.targets.length_mm[node] - 1.0).abs() > NOTHING {
            problem.targets.length_mm[node] = as_drawn_mm;
        }
        if is_pinned {
            problem.length_cost[node] = 0.0;
        }
    }
    problem.free_length[segment] &= !is_pinned;
    ratio
}

#[cfg(test)]
mod tests {
    use espalier_model::Tree;
    use glam::DVec3;

    use super::*;
    use crate::common::{random_tree, stream, views_along};
    use crate::layout::{cone, radial};
    use crate::params::Params;
    use crate::{energy, targets};

    fn problem(tree: &Tree) -> Problem<'_> {
        let (params, branches) = (Params { w_placement: 0.0, ..Params::default() }, tree.branches());
        let views = views_along(tree, DVec3::Z);
        let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
        Problem::new(tree, branches, targets, &params)
    }

    fn random_pins(problem: &Problem, key: u32) -> Pins {
        let mut stream = stream(key);
        let mut pins = Pins::none(problem);
        pins.angle[1..].iter_mut().for_each(|pin| *pin = stream.unit() < 0.3);
        pins.length.iter_mut().for_each(|pin| *pin = stream.unit() < 0.3);
        pins
    }

    /// A layout with its own length for each edge, the cone's sides or the radial layout's.
    fn layout(problem: &Problem, key: u32) -> Vec<DVec2> {
        let mut stream = stream(1000 + key);
        let headings =
            if key.is_multiple_of(2) { cone::headings(problem) } else { radial::headings(problem) };
        let mut stretched = problem.clone();
        for node in 1..problem.n_nodes() {
            stretched.targets.length_mm[node] *= stream.uniform(0.8, 1.2);
        }
        place::from_headings(if key.is_multiple_of(3) { &stretched } else { problem }, &headings)
    }

    #[test]
    fn the_shape_draws_the_layout() {
        for key in 0..80 {
            let tree = random_tree(key as usize % 8, 2 + key as usize, 2.0, false, key);
            let problem = problem(&tree);
            let positions = layout(&problem, key);
            let (pinned, shape) =
                around(&problem, &Drawn::of(&problem, &positions), &random_pins(&problem, key));
            let extent = tree.length_mm();
            for (found, expected) in shape.positions(&pinned).iter().zip(&positions) {
                assert!(found.distance(*expected) < 1e-9 * extent, "tree {key}");
            }
        }
    }

    #[test]
    fn what_is_pinned_costs_nothing_and_the_rest_what_it_did() {
        for key in (0..80).step_by(2) {
            let tree = random_tree(key as usize % 8, 2 + key as usize, 1.0, false, key);
            let problem = problem(&tree);
            let headings = cone::headings(&problem);
            let drawn = Drawn::of(&problem, &place::from_headings(&problem, &headings));
            let pins = random_pins(&problem, key);
            let (pinned, mut shape) = around(&problem, &drawn, &pins);
            let full =
                |shape: &Shape| energy::score(&problem, &shape.positions(&pinned), 0.0, 0).energy.total();
            let fixed = full(&shape) - shape.loss(&pinned);
            let mut stream = stream(2000 + key);
            for node in 1..tree.n_nodes() {
                assert_eq!(pinned.free_angle[node], !pins.angle[node]);
                if pinned.free_angle[node] {
                    shape.angle_ratio[node] = stream.uniform(-0.9, 0.9);
                }
            }
            for segment in (0..pins.length.len()).filter(|&segment| pinned.free_length[segment]) {
                shape.length_ratio[segment] = stream.uniform(-0.9, 0.9);
            }
            let expected = shape.loss(&pinned) + fixed;
            assert!(
                (full(&shape) - expected).abs() < 1e-6 * expected.max(1.0),
                "tree {key}: {} {expected} {fixed}",
                full(&shape)
            );
        }
    }
}
