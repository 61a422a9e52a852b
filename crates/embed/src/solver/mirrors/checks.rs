//! Tests that hold the state after many steps against one built anew, and the search against its promises.

use std::f64::consts::PI;

use espalier_geom::math::unit_vector;
use espalier_geom::random::Stream;
use espalier_model::Tree;
use espalier_phantom::{Kind, grow_tree};
use espalier_views::find_views;
use glam::DVec3;

use super::conflicts::Conflict;
use super::moves::Mover;
use super::setting::Setting;
use super::state::State;
use super::step::{Prices, Step};
use super::{Mirrored, search};
use crate::choices::KeepOut;
use crate::common::{FAMILIES, random_tree, stream, tree_of, views_along};
use crate::params::{Params, SolverParams};
use crate::problem::Problem;
use crate::solver::Shape;
use crate::{certify, targets};

const PRICES: Prices = Prices { near: 0.3, kept_out: 0.7, placement: 2.0, siblings: 1.0, zigzags: 0.5 };

fn problem(tree: &Tree) -> Problem<'_> {
    let params = Params::default();
    let branches = tree.branches();
    let views = views_along(tree, DVec3::Z);
    let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
    Problem::new(tree, branches, targets, &params)
}

fn phantom_problem(tree: &Tree) -> Problem<'_> {
    let params = Params::default();
    let branches = tree.branches();
    let views = find_views(tree, &espalier_views::Params::default(), 0).expect("views").hierarchy;
    let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
    Problem::new(tree, branches, targets, &params)
}

fn sorted(conflicts: &[Conflict]) -> Vec<Conflict> {
    let mut sorted: Vec<Conflict> = conflicts
        .iter()
        .map(|c| Conflict { edges: [c.edges[0].min(c.edges[1]), c.edges[0].max(c.edges[1])], ..*c })
        .collect();
    sorted.sort_unstable();
    sorted
}

/// Takes random steps and compares with a state built from the turns.
fn check_steps(problem: &Problem, keeps_out: bool, stream: &mut Stream) {
    let setting = Setting::new(problem, 0.5, keeps_out);
    let (mut state, mut mover, mut step) = (State::new(&setting), Mover::default(), Step::default());
    for round in 0..60 {
        if !mover.propose(&state, stream, &mut step) {
            continue;
        }
        let before = PRICES.cost(&state.terms());
        // Half of the steps are taken as the walk would, the others whatever they cost.
        let limit = if round % 2 == 0 { f64::INFINITY } else { 0.5 };
        let Some(change) = state.evaluate(&step, &PRICES, limit) else { continue };
        state.take(&step);
        let after = PRICES.cost(&state.terms());
        assert!((after - before - change).abs() < 1e-7, "round {round}: {change} but {}", after - before);
        if round % 5 != 4 {
            continue;
        }
        let mut anew = state.clone();
        anew.rebuild();
        assert_eq!(sorted(state.conflicts.list()), sorted(anew.conflicts.list()), "round {round}");
        let (terms, expected) = (PRICES.cost(&state.terms()), PRICES.cost(&anew.terms()));
        assert!((terms - expected).abs() < 1e-7, "round {round}: {terms} but {expected}");
        for node in 1..problem.n_nodes() {
            let distance = |state: &State| {
                let ends = &state.hierarchy.ends;
                ends[node].1.distance(ends[problem.n_nodes() / 2].1)
            };
            let scale = setting.radius_mm.max(problem.scale_mm);
            assert!((distance(&state) - distance(&anew)).abs() < 1e-9 * scale, "round {round}: node {node}");
            let at_start = problem.bend[node];
            let n_siblings = problem.tree.children(problem.parent[node] as usize).len();
            if n_siblings == 1 && problem.parent[node] != 0 {
                assert!((state.turn_rad[node].abs() - at_start).abs() < 1e-12, "round {round}: node {node}");
            }
        }
    }
}

#[test]
fn steps_equal_a_state_built_anew() {
    for key in 0..160 {
        let (family, n) = (key as usize % FAMILIES.len(), 3 + key as usize % 70);
        let tree = random_tree(family, n, 0.7, false, key);
        let problem = problem(&tree);
        check_steps(&problem, key % 2 == 0, &mut stream(6000 + key));
    }
}

#[test]
fn conflicts_equal_every_pair() {
    for key in 0..40 {
        let tree = random_tree(key as usize % FAMILIES.len(), 40, 0.7, false, 300 + key);
        let problem = problem(&tree);
        let setting = Setting::new(&problem, 0.05, false);
        let state = State::new(&setting);
        let positions = Shape::targets(&problem).positions(&problem);
        let mut expected = (0, 0);
        for a in 1..problem.n_nodes() {
            for b in a + 1..problem.n_nodes() {
                let meets = setting.separation.meet(&problem, &positions, a, b);
                expected.0 += usize::from(meets);
                expected.1 += usize::from(!meets && setting.separation.too_near(&problem, &positions, a, b));
            }
        }
        assert_eq!((state.terms().crossings, state.terms().near), expected, "tree {key}");
    }
}

fn searched<'t>(problem: &Problem<'t>, seed: u64) -> (Mirrored, Problem<'t>) {
    let params = SolverParams { effort: 0.2, ..SolverParams::default() };
    let found = search(problem, &params, seed);
    let rebuilt =
        Problem::new(problem.tree, problem.tree.branches(), found.targets.clone(), &Params::default());
    (found, rebuilt)
}

#[test]
fn a_phantom_with_crossings_ends_at_zero_certified() {
    let tree = grow_tree(Kind::Neuron, &espalier_phantom::Params::default(), 2).expect("a phantom");
    let problem = phantom_problem(&tree);
    let (found, mirrored) = searched(&problem, 0);
    assert!(found.terms_at_start.crossings > 0 && found.terms.crossings == 0);
    let positions = Shape::targets(&mirrored).positions(&mirrored);
    assert!(certify::certify(&tree, &positions).holds());
    for node in 1..problem.n_nodes() {
        let hub = problem.parent[node] as usize;
        if hub != 0 && tree.children(hub).len() == 1 {
            let interior = targets::interior_angle(&tree, node, hub);
            let bend = (mirrored.targets.angle_rad[node] - PI).abs();
            // Targets stay a little away from lying on their parents.
            assert!((bend - (PI - interior)).abs() < 0.021, "node {node}");
        }
    }
    let again = searched(&problem, 0).0;
    assert!(again.targets.angle_rad[1..] == found.targets.angle_rad[1..]);
    assert_eq!(again.evaluations, found.evaluations);
}

#[test]
fn a_side_weight_leaves_fewer_zigzags() {
    let tree = grow_tree(Kind::Neuron, &espalier_phantom::Params::default(), 2).expect("a phantom");
    let mut problem = phantom_problem(&tree);
    let free = searched(&problem, 0).0;
    problem.w_side = 20.0;
    let priced = searched(&problem, 0).0;
    assert!(priced.terms.crossings <= priced.terms_at_start.crossings);
    assert!(
        priced.terms.zigzags_rad < 0.5 * free.terms.zigzags_rad,
        "{} {}",
        priced.terms.zigzags_rad,
        free.terms.zigzags_rad
    );
}

#[test]
fn never_more_crossings_and_nothing_changes_without() {
    let mut n_better = 0;
    for key in 0..48 {
        let tree = random_tree(key as usize % FAMILIES.len(), 4 + key as usize, 0.5, false, 700 + key);
        let problem = problem(&tree);
        let (found, mirrored) = searched(&problem, 3);
        assert!(found.terms.crossings <= found.terms_at_start.crossings);
        n_better += usize::from(found.terms.crossings < found.terms_at_start.crossings);
        let positions = Shape::targets(&mirrored).positions(&mirrored);
        assert_eq!(certify::certify(&tree, &positions).crossings, found.terms.crossings, "tree {key}");
        if found.terms_at_start.crossings == 0 {
            assert!(found.targets.angle_rad[1..] == problem.targets.angle_rad[1..]);
            assert_eq!(found.targets.kind, problem.targets.kind);
        }
    }
    assert!(n_better > 10, "{n_better}");
}

#[test]
fn a_branch_that_curls_past_its_trunk_is_turned_away() {
    // An arc of a circle that begins at the root and ends behind it, crossing nothing.
    let mut nodes = vec![(0.0, 0.0, 0.0, None)];
    for step in 0..16 {
        let direction = unit_vector(f64::from(step) * 0.31);
        let (x, y, z, _) = nodes[nodes.len() - 1];
        nodes.push((x + direction.x, y + direction.y, z, Some(nodes.len() - 1)));
    }
    let tree = tree_of(&nodes);
    let problem = problem(&tree);
    let with =
        |root_keep_out| search(&problem, &SolverParams { root_keep_out, ..SolverParams::default() }, 0);
    let found = with(KeepOut::On);
    assert!(found.terms_at_start.kept_out > 0 && found.terms.kept_out + found.terms.crossings == 0);
    assert!(found.n_zigzags > 0);
    // Nothing crosses, so the other choices leave the tree as its view shows it.
    for choice in [KeepOut::Off, KeepOut::Auto] {
        let found = with(choice);
        assert!(found.targets.angle_rad[1..] == problem.targets.angle_rad[1..]);
    }
}

#[test]
fn odd_shapes_are_searched_too() {
    let point = tree_of(&[(0.0, 0.0, 0.0, None)]);
    let edge = tree_of(&[(0.0, 0.0, 0.0, None), (1.0, 0.0, 0.0, Some(0))]);
    let folded =
        [(0.0, 0.0, 0.0, None), (4.0, 0.0, 0.0, Some(0)), (1.0, 0.0, 0.0, Some(1)), (5.0, 0.0, 0.0, Some(2))];
    for tree in [point, edge, tree_of(&folded)] {
        searched(&problem(&tree), 0);
    }
    for (family, n) in [(2, 2000), (3, 1000), (5, 600), (6, 500)] {
        let tree = random_tree(family, n, 3.0, false, 9);
        let problem = problem(&tree);
        let params = SolverParams { effort: 0.01, ..SolverParams::default() };
        let found = search(&problem, &params, 0);
        assert!(found.terms.crossings <= found.terms_at_start.crossings, "family {family}");
    }
}
