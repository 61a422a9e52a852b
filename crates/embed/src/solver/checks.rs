//! Untangling, descent and the linkage under them, on the random families.

use espalier_geom::plane::Segment;
use espalier_model::Tree;
use glam::DVec3;

use super::descent::descend;
use super::joint::Change;
use super::linkage::Linkage;
use super::placement::Placement;
use super::shape::Shape;
use super::untangling::untangle;
use super::work::Work;
use crate::certify::certify;
use crate::common::{FAMILIES, random_tree, stream, tree_of, views_along};
use crate::layout::cone;
use crate::params::Params;
use crate::problem::Problem;
use crate::separation::Separation;
use crate::{energy, targets};

fn problem<'a>(tree: &'a Tree, params: &Params) -> Problem<'a> {
    let (views, branches) = (views_along(tree, DVec3::Z), tree.branches());
    let targets = targets::targets(tree, &branches, &views, params.targets).expect("targets");
    Problem::new(tree, branches, targets, params)
}

fn cone_shape(problem: &Problem) -> Shape {
    Shape::from_headings(problem, &cone::headings(problem))
}

/// By the one energy of all methods.
fn energy(problem: &Problem, shape: &Shape) -> f64 {
    energy::score(problem, &shape.positions(problem), 0.0, 0).energy.total()
}

fn assert_is_layout(problem: &Problem, shape: &Shape, name: &str) {
    let certificate = certify(problem.tree, &shape.positions(problem));
    assert!(certificate.holds(), "{name}: {:?}", certificate.pairs);
    for (node, ratio) in shape.angle_ratio.iter().enumerate().skip(1) {
        let low = if problem.parent[node] == 0 { -1.0 } else { -0.97 };
        assert!((low..=1.0).contains(ratio), "{name}: r_a of {node} is {ratio}");
    }
    assert!(shape.length_ratio.iter().all(|ratio| (-0.97..=1.0).contains(ratio)), "{name}");
}

#[test]
fn the_placement_term_falls_as_it_says() {
    let params = Params { w_placement: 0.3, ..Params::default() };
    for key in 0..40 {
        let tree = random_tree(key as usize % 8, 8 + key as usize, 1.0, false, key);
        let problem = problem(&tree, &params);
        let separation = Separation::new(&problem, 0.05);
        let mut linkage = Linkage::new(&problem, &separation, cone_shape(&problem)).with_placement();
        let before = linkage.placement.as_ref().map_or(0.0, |placement| placement.total);
        let expected = energy::score(&problem, &linkage.shape.positions(&problem), 0.0, 0).energy.placement;
        assert!((before - expected).abs() < 1e-9 * (1.0 + before), "tree {key}: {before} {expected}");
        // Σ p off² by hand, with the rotation and the whole turns of the start.
        let start = linkage.shape.headings(&problem);
        let total_of = |shape: &Shape, placement: &Placement| {
            let turned = shape.headings(&problem);
            let turn = |node: usize| turned[node] - start[node];
            (1..start.len()).map(|node| placement.gain(&(node..node + 1), turn(node))).sum::<f64>()
        };
        let fresh = Placement::of(&problem, &start);
        for round in 0..20 {
            linkage.change = random_change(&problem, &linkage.shape, 9000 + 100 * key + round);
            linkage.cut();
            linkage.make();
            let total = linkage.placement.as_ref().map_or(0.0, |placement| placement.total);
            let expected = before - total_of(&linkage.shape, &fresh);
            assert!((total - expected).abs() < 1e-9 * (1.0 + total), "tree {key}: {total} {expected}");
        }
    }
}

/// Some ratios anew, by chance.
fn random_change(problem: &Problem, shape: &Shape, key: u32) -> Change {
    let mut stream = stream(key);
    let mut change = Change::default();
    let size = if key.is_multiple_of(2) { 0.5 } else { 0.02 };
    for _ in 0..1 + stream.below(4) {
        let node = 1 + stream.below(problem.n_nodes() as u32 - 1) as usize;
        if change.angles.iter().all(|&(other, _)| other != node) {
            let ratio = (shape.angle_ratio[node] + size * stream.normal()).clamp(-0.97, 1.0);
            change.angles.push((node, ratio));
        }
    }
    for _ in 0..stream.below(3) {
        let segment = stream.below(shape.length_ratio.len() as u32) as usize;
        if change.lengths.iter().all(|&(other, _)| other != segment) {
            let ratio = (shape.length_ratio[segment] + size * stream.normal()).clamp(-0.97, 1.0);
            change.lengths.push((segment, ratio));
        }
    }
    change
}

/// The pairs in the way by trying all, and whether one of them is a matter of rounding.
fn brute_force(problem: &Problem, separation: &Separation, shapes: [&Shape; 2]) -> (usize, bool) {
    let positions = shapes.map(|shape| shape.positions(problem));
    let place = |when: usize, edge: usize| Segment {
        a: positions[when][problem.parent[edge] as usize],
        b: positions[when][edge],
    };
    let (mut n_in_the_way, mut is_close_call) = (0, false);
    for a in 1..problem.n_nodes() {
        for b in a + 1..problem.n_nodes() {
            let (before, after) = ([place(0, a), place(0, b)], [place(1, a), place(1, b)]);
            let distance = |s: &[Segment; 2]| espalier_geom::plane::segment_distance(&s[0], &s[1]);
            let is_same = (distance(&before) - distance(&after)).abs() < 1e-9 * problem.scale_mm;
            let may_move = separation.may_move(problem, (a, b), &before, &after);
            n_in_the_way += usize::from(!may_move);
            is_close_call |= !may_move && is_same;
        }
    }
    (n_in_the_way, is_close_call)
}

#[test]
fn a_change_is_clear_if_all_pairs_allow_it() {
    let params = Params::default();
    let (mut n_clear, mut n_blocked) = (0, 0);
    for key in 0..48 {
        let tree = random_tree(key as usize % 8, 12 + 2 * key as usize, 1.0, false, key);
        let problem = problem(&tree, &params);
        let separation = Separation::new(&problem, 0.05);
        let mut linkage = Linkage::new(&problem, &separation, cone_shape(&problem));
        for round in 0..40 {
            let change = random_change(&problem, &linkage.shape, 5000 + 100 * key + round);
            let mut after = linkage.shape.clone();
            change.angles.iter().for_each(|&(node, ratio)| after.angle_ratio[node] = ratio);
            change.lengths.iter().for_each(|&(segment, ratio)| after.length_ratio[segment] = ratio);
            let (n_in_the_way, is_close_call) = brute_force(&problem, &separation, [&linkage.shape, &after]);
            if is_close_call {
                continue;
            }
            linkage.change = change;
            linkage.cut();
            let found = linkage.is_clear(&(1..problem.n_nodes()), &mut Work::up_to(u64::MAX));
            assert_eq!(found.is_ok(), n_in_the_way == 0, "tree {key}, round {round}: {found:?}");
            match found {
                Ok(()) => {
                    n_clear += 1;
                    let gain = linkage.gain();
                    let expected = linkage.shape.loss(&problem) - after.loss(&problem);
                    assert!((gain - expected).abs() < 1e-9, "tree {key}, round {round}");
                    linkage.make();
                    let positions = after.positions(&problem);
                    for (node, &position) in positions.iter().enumerate().skip(1) {
                        let off = linkage.edge(node).b.distance(position);
                        assert!(off < 1e-9 * tree.length_mm(), "tree {key}, node {node}: {off}");
                    }
                }
                Err(pair) => {
                    n_blocked += 1;
                    assert!(!linkage.allows(pair), "tree {key}, round {round}");
                }
            }
        }
    }
    assert!(n_clear > 300 && n_blocked > 200, "{n_clear} {n_blocked}");
}

#[test]
fn random_trees_come_out_without_crossings_and_no_worse() {
    let params = Params::default();
    let mut n_better = 0;
    for key in 0..64 {
        let (family, n_nodes) = (key as usize % 8, 10 + (key as usize * 37) % 390);
        let tree = random_tree(family, n_nodes, f64::from(key % 3), false, key);
        let problem = problem(&tree, &params);
        let separation = Separation::new(&problem, 0.05);
        let cone = cone_shape(&problem);
        let name = format!("{} {key}", FAMILIES[family]);
        let budget = || Work::up_to(300_000);
        let untangled = untangle(&problem, &separation, &cone, &mut budget());
        assert_is_layout(&problem, &untangled, &name);
        assert_eq!(untangled, untangle(&problem, &separation, &cone, &mut budget()), "{name}");
        for start in [cone, untangled] {
            let mut shape = start.clone();
            descend(&problem, &separation, &mut shape, &mut budget());
            assert_is_layout(&problem, &shape, &name);
            let (before, after) = (energy(&problem, &start), energy(&problem, &shape));
            assert!(after <= before * (1.0 + 1e-9), "{name}: {before} {after}");
            n_better += usize::from(after < 0.5 * before);
            let mut again = start;
            descend(&problem, &separation, &mut again, &mut budget());
            assert_eq!(shape, again, "{name}");
        }
    }
    assert!(n_better > 40, "{n_better}");
}

#[test]
fn a_layout_that_meets_its_targets_stays() {
    let params = Params::default();
    let mut n_planar = 0;
    for key in 0..100 {
        let tree = random_tree(key as usize % 8, 4 + key as usize % 12, 1.0, true, key);
        let problem = problem(&tree, &params);
        let targets = Shape::targets(&problem);
        if certify(&tree, &targets.positions(&problem)).holds() {
            n_planar += 1;
            let separation = Separation::new(&problem, 0.05);
            let mut shape =
                untangle(&problem, &separation, &cone_shape(&problem), &mut Work::up_to(u64::MAX));
            descend(&problem, &separation, &mut shape, &mut Work::up_to(u64::MAX));
            assert_eq!(shape, targets, "tree {key}");
        }
    }
    assert!(n_planar > 30, "{n_planar}");
}

#[test]
fn odd_trees_and_budgets_are_no_trouble() {
    let chain: Vec<_> = (0..3000_usize)
        .map(|i| (i as f64, f64::from(i as u32 % 2), f64::from(i as u32 % 3), i.checked_sub(1)))
        .collect();
    let folded =
        [(0.0, 0.0, 0.0, None), (1.0, 0.0, 0.0, Some(0)), (0.0, 0.0, 0.0, Some(1)), (1.0, 0.0, 0.0, Some(2))];
    let trees = [
        ("one node", tree_of(&chain[..1])),
        ("one edge", tree_of(&chain[..2])),
        ("chain", tree_of(&chain)),
        ("folded", tree_of(&folded)),
        ("star", random_tree(3, 1000, 2.0, false, 1)),
        ("comb", random_tree(2, 3001, 1.0, false, 1)),
        ("decades", random_tree(0, 300, 8.0, false, 1)),
    ];
    let no_angle = Params { w_angle: 0.0, ..Params::default() };
    let nothing = Params { w_length: 0.0, w_angle: 0.0, ..Params::default() };
    for (name, tree) in &trees {
        for params in [&Params::default(), &no_angle, &nothing] {
            let problem = problem(tree, params);
            let separation = Separation::new(&problem, 0.05);
            let cone = cone_shape(&problem);
            for budget in [0, 200_000] {
                let mut shape = untangle(&problem, &separation, &cone, &mut Work::up_to(budget));
                assert_is_layout(&problem, &shape, name);
                descend(&problem, &separation, &mut shape, &mut Work::up_to(budget));
                assert_is_layout(&problem, &shape, name);
            }
        }
    }
}

#[test]
fn pinned_ratios_stay() {
    let tree = random_tree(0, 120, 1.0, false, 3);
    let mut problem = problem(&tree, &Params::default());
    let separation = Separation::new(&problem, 0.05);
    let start = cone_shape(&problem);
    for node in (1..problem.n_nodes()).step_by(3) {
        problem.free_angle[node] = false;
    }
    let mut shape = start.clone();
    descend(&problem, &separation, &mut shape, &mut Work::up_to(3_000_000));
    assert!(shape.loss(&problem) < start.loss(&problem));
    for node in (1..problem.n_nodes()).step_by(3) {
        assert_eq!(shape.angle_ratio[node], start.angle_ratio[node]);
    }
}
