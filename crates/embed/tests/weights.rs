//! The user's weights: what they change, and what they must not.

#![allow(clippy::expect_used, reason = "a test that cannot go on says why")]

mod common;

use common::{random_tree, tree_of, views_along};
use espalier_embed::{Method, Params, PsoParams, SolverParams, WeightRule, embed};
use espalier_model::diagnose::{Class, Diagnose};
use espalier_model::{Embedding, Termination, Tree};
use glam::DVec3;

/// The swarm alone, small.
fn small() -> Params {
    let pso = PsoParams { particles: 24, iterations: 20, ..PsoParams::default() };
    Params { method: Method::Pso, methods: vec![Method::Projection, Method::Pso], pso, ..Params::default() }
}

fn rule() -> WeightRule {
    WeightRule::default()
}

fn with(rules: &[WeightRule]) -> Params {
    Params { weights: rules.to_vec(), ..small() }
}

fn laid_flat(tree: &Tree, params: &Params) -> Embedding {
    embed(tree, &views_along(tree, DVec3::Z), params, 7, &|_| {}).expect("a certified layout").embedding
}

#[test]
fn rules_that_say_what_the_whole_says_change_no_bit() {
    for key in 0..8 {
        let tree = random_tree(key as usize, 50, 1.0, false, key);
        let plain = Params { w_length: 3.0, w_angle: 0.7, ..small() };
        let everywhere = WeightRule { generations: Some([0, u32::MAX]), w_length: Some(3.0), ..rule() };
        let ruled = Params {
            weights: vec![
                everywhere,
                WeightRule { depth_mm: Some([0.0, 2.0]), w_angle: Some(0.7), ..rule() },
            ],
            ..plain.clone()
        };
        assert_eq!(laid_flat(&tree, &plain).to_json(), laid_flat(&tree, &ruled).to_json(), "tree {key}");
    }
}

#[test]
fn the_energy_has_the_weights_of_each_node() {
    for key in 0..16 {
        let tree = random_tree(key as usize % 8, 60, 1.0, false, key);
        let branches = tree.branches();
        let last = branches.list().len() as u32 - 1;
        let rules = [
            WeightRule { generations: Some([1, 2]), w_length: Some(5.0), ..rule() },
            WeightRule { branches: Some(vec![last]), w_length: Some(0.0), w_angle: Some(11.0), ..rule() },
        ];
        let embedding = laid_flat(&tree, &with(&rules));
        let (mut length, mut angle) = (0.0, 0.0);
        for (idx, branch) in branches.list().iter().enumerate() {
            let is_last = idx as u32 == last;
            let in_rule = (1..=2).contains(&branch.generation);
            let w_length = if is_last {
                0.0
            } else if in_rule {
                5.0
            } else {
                2.0
            };
            let w_angle = if is_last { 11.0 } else { 2.0 };
            let mean = |ratios: &[f64], nodes: Vec<usize>| {
                let sum: f64 = nodes.iter().map(|&node| ratios[node] * ratios[node]).sum();
                sum / (nodes.len() as f64).max(1.0)
            };
            length += w_length * mean(&embedding.length_ratio, branch.nodes.clone().collect());
            let turning = branch.nodes.clone().filter(|&node| tree.parent(node) != Some(0)).collect();
            angle += w_angle * mean(&embedding.angle_ratio, turning);
        }
        assert!((embedding.energy.length - length).abs() < 1e-9 * length.max(1.0), "tree {key}");
        assert!((embedding.energy.angle - angle).abs() < 1e-9 * angle.max(1.0), "tree {key}");
    }
}

/// Σ r² over the nodes of the first generations, and over the others.
fn shallow_and_deep(tree: &Tree, ratios: &[f64]) -> (f64, f64) {
    let branches = tree.branches();
    (1..tree.n_nodes()).fold((0.0, 0.0), |(shallow, deep), node| {
        let square = ratios[node] * ratios[node];
        let branch = branches.of_node(node).expect("a branch");
        if branches.list()[branch].generation <= 2 {
            (shallow + square, deep)
        } else {
            (shallow, deep + square)
        }
    })
}

#[test]
fn weights_near_the_root_keep_what_is_near_the_root() {
    let solver = SolverParams { mirrors: false, effort: 0.2, ..SolverParams::default() };
    let plain = Params { method: Method::Solver, methods: Vec::new(), solver, ..Params::default() };
    let near_root = WeightRule { generations: Some([0, 2]), ..rule() };
    let lengths = WeightRule { w_length: Some(400.0), ..near_root.clone() };
    let angles = WeightRule { w_angle: Some(400.0), ..near_root };
    let mut sums = [(0.0, 0.0); 4];
    for key in 0..6 {
        // Bushy trees in space, which no layout can draw without losses.
        let tree = random_tree(1, 63, 0.5, false, 100 + key);
        let [plain, stiff, true_angles] = [vec![], vec![lengths.clone()], vec![angles.clone()]]
            .map(|weights| laid_flat(&tree, &Params { weights, ..plain.clone() }));
        let ratios = [&plain.length_ratio, &stiff.length_ratio, &plain.angle_ratio, &true_angles.angle_ratio];
        for (sum, ratios) in sums.iter_mut().zip(ratios) {
            let (shallow, deep) = shallow_and_deep(&tree, ratios);
            *sum = (sum.0 + shallow, sum.1 + deep);
        }
    }
    let [stretched, stiff, bent, true_angles] = sums;
    assert!(stiff.0 < 0.1 * stretched.0, "lengths near the root: {stretched:?} {stiff:?}");
    assert!(stiff.1 > stretched.1, "at the cost of others: {stretched:?} {stiff:?}");
    assert!(true_angles.0 < 0.75 * bent.0, "angles near the root: {bent:?} {true_angles:?}");
    assert!(true_angles.1 > bent.1, "at the cost of others: {bent:?} {true_angles:?}");
}

#[test]
fn a_crossing_costs_more_than_the_heaviest_rule() {
    for key in 0..16 {
        let tree = random_tree(key as usize % 8, 40, 1.0, false, key);
        let heavy =
            WeightRule { generations: Some([0, 99]), w_length: Some(1e6), w_angle: Some(1e6), ..rule() };
        let params = Params { w_side: 3.0, ..with(&[heavy]) };
        let embedding = laid_flat(&tree, &params);
        for row in embedding.methods.iter().filter(|row| row.crossings > 0) {
            let bound = 1.5 * tree.branches().list().len() as f64 * 5e6;
            assert!(row.energy.crossing >= bound, "tree {key}: {:?}", row.energy);
        }
        assert!(embedding.certificate.holds());
    }
}

#[test]
fn the_other_side_costs_what_w_side_says() {
    // Two edges at a right angle; the only turn with a loss is that of node 2.
    let bent = tree_of(&[(0.0, 0.0, 0.0, None), (1.0, 0.0, 0.0, Some(0)), (1.0, 1.0, 0.0, Some(1))]);
    // Seen from behind the turn goes to the other side: the projection of one view against targets of another.
    let mut views = views_along(&bent, DVec3::Z);
    views.global = views_along(&bent, DVec3::NEG_Z).global;
    let params = |w_side: f64| Params { w_side, w_placement: 0.0, ..small() };
    let energy = |w_side: f64| {
        let embedding = embed(&bent, &views, &params(w_side), 0, &|_| {}).expect("a layout").embedding;
        let row = embedding.methods.iter().find(|row| row.method == "projection").expect("a row");
        row.energy
    };
    let (free, priced) = (energy(0.0), energy(3.0));
    assert_eq!(free.side, 0.0);
    assert!(
        (priced.side - 3.0).abs() < 1e-9,
        "a right angle is as far from either side as can be: {priced:?}"
    );
    assert_eq!(priced.angle, free.angle);
    assert!((priced.total() - free.total() - 3.0).abs() < 1e-9);
}

#[test]
fn a_rule_for_a_part_that_is_not_there() {
    let tree = random_tree(0, 30, 1.0, false, 3);
    let refused = |rule: WeightRule| {
        let params = with(&[WeightRule { w_angle: Some(1.0), ..rule }]);
        embed(&tree, &views_along(&tree, DVec3::Z), &params, 0, &|_| {}).expect_err("refused")
    };
    let error = refused(WeightRule { nodes: Some(vec![30]), ..rule() });
    assert_eq!(error.to_string(), "weights[0].nodes: there is no 30: they are 1 to 29");
    assert_eq!(error.class(), Class::Usage);
    assert!(
        refused(WeightRule { branches: Some(vec![999]), ..rule() })
            .to_string()
            .contains("weights[0].branches")
    );

    let empty = with(&[WeightRule { depth_mm: Some([1e3, 1e4]), w_angle: Some(1.0), ..rule() }]);
    let report = embed(&tree, &views_along(&tree, DVec3::Z), &empty, 0, &|_| {}).expect("a layout").report;
    assert_eq!(report.warnings[0].code, "W-EMBED-NO-SUCH-PART");
}

#[test]
fn headings_that_are_asked_for_take_something_of_exact_angles() {
    let mut n_traded = 0;
    for key in 0..16 {
        let tree = random_tree(key as usize % 8, 60, 1.0, false, key);
        let with_placement = |w_placement| {
            let methods = vec![Method::Solver, Method::Marino];
            // Without untangling the exact layout is a start all the same.
            let solver = SolverParams { untangling: key % 2 == 0, ..SolverParams::default() };
            laid_flat(&tree, &Params { w_placement, methods, solver, ..Params::default() })
        };
        let (exact, asked) = (with_placement(0.01), with_placement(1.0));
        let lossless = |embedding: &Embedding| embedding.energy.length + embedding.energy.angle == 0.0;
        if !lossless(&exact) || exact.energy.placement == 0.0 {
            continue;
        }
        assert_eq!(exact.termination, Termination::Optimal, "tree {key}");
        // The exact layout is one of those that may be had at the new weights too.
        assert!(asked.energy.total() <= 100.0 * exact.energy.placement * (1.0 + 1e-9), "tree {key}");
        let solver = asked.methods.iter().find(|row| row.method == "solver").expect("its row");
        let marino = asked.methods.iter().find(|row| row.method == "marino").expect("its row");
        assert!(solver.energy.total() <= marino.energy.total(), "tree {key}: {solver:?} {marino:?}");
        if !lossless(&asked) {
            assert!(asked.energy.placement < 100.0 * exact.energy.placement, "tree {key}");
            assert_ne!(asked.termination, Termination::Optimal, "tree {key}");
            n_traded += 1;
        }
    }
    assert!(n_traded > 3, "{n_traded}");
}

#[test]
fn only_what_loses_nothing_is_called_optimal() {
    let mut n_bent = 0;
    for key in 0..16 {
        let tree = random_tree(key as usize % 8, 60, 1.0, false, key);
        let embedding = laid_flat(&tree, &Params { w_length: 0.0, w_angle: 0.0, ..small() });
        let is_exact = embedding.length_ratio.iter().chain(&embedding.angle_ratio).all(|&ratio| ratio == 0.0);
        assert_eq!(embedding.termination == Termination::Optimal, is_exact, "tree {key}");
        n_bent += usize::from(!is_exact);
    }
    assert!(n_bent > 0);
}
